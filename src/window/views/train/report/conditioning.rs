//! Note of the report on ill-conditioned scenes.

use eframe::egui::Ui;

use crate::window::{test_view::TestView, theme::space, widgets::note_ui};
use decoupler_core::{evaluation::Outlook, sensor::Identifiability};

fn is_badly_conditioned(outlook: &Outlook) -> bool {
    outlook.worst_row.condition() >= Identifiability::LARGEST_CONDITION
}

/// Says that the scene is ill-conditioned, lest its errors be taken for the network's fault.
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
        "This scene is ill-conditioned (condition number {condition}): whatever the decoder, some deformations cannot \
         be told apart. The note under Scene says what to change."
    );
    note_ui(ui, &text);
}
