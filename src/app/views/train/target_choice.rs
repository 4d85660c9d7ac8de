use eframe::egui::{ComboBox, Ui};

use crate::evaluation::Channel;

/// The choice of one of the targets of a recording, behind `name`; returns the one chosen.
pub fn target_choice_ui(ui: &mut Ui, name: &str, targets: &[Channel], chosen: usize) -> usize {
    let mut target = chosen.min(targets.len().saturating_sub(1));
    ui.horizontal(|ui| {
        let label = ui.label(name);
        let selected = targets.get(target).map_or_else(String::new, Channel::title);
        let combo = ComboBox::from_id_salt(name).selected_text(selected);
        let picked = combo.show_ui(ui, |ui| {
            for (index, of) in targets.iter().enumerate() {
                ui.selectable_value(&mut target, index, of.title());
            }
        });
        picked.response.labelled_by(label.id);
    });
    target
}
