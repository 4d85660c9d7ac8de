//! What the report says of scenes that are badly conditioned.

use eframe::egui::Ui;

use crate::{
    app::{
        test_view::TestView,
        theme::{note_ui, space},
    },
    evaluation::{Baselines, Outlook},
    sensor::Identifiability,
};

/// The baselines without a reference where nothing is known of it: without noise it is 0 by definition, but in a scene
/// so badly conditioned rounding decides.
pub fn soundly(baselines: &Baselines, test: &TestView) -> Baselines {
    let is_blurred = test.outlook.as_ref().is_some_and(is_badly_conditioned);
    Baselines {
        reference: baselines.reference.filter(|limit| limit.z_mm > 0.0 || !is_blurred),
        ..*baselines
    }
}

fn is_badly_conditioned(outlook: &Outlook) -> bool {
    outlook.worst_row.condition() >= Identifiability::LARGEST_CONDITION
}

/// Says that the scene is badly conditioned, lest its errors be taken for the network's fault.
pub fn conditioning_ui(ui: &mut Ui, test: &TestView) {
    let Some(outlook) = test.outlook.as_ref().filter(|outlook| is_badly_conditioned(outlook)) else {
        return;
    };
    ui.add_space(space(2));
    let condition = match outlook.worst_row.condition() {
        condition if condition.is_finite() => format!("{condition:.0e}"),
        _ => "infinite".to_owned(),
    };
    let text = format!(
        "This scene is badly conditioned (condition number {condition}): whatever the decoder, some deformations cannot be \
         told apart. The note under Scene says what to change."
    );
    note_ui(ui, &text);
}
