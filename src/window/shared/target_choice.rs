use eframe::egui::{ComboBox, Ui};

use decoupler_core::evaluation::Channel;

/// The list of targets behind `name`, where there are several.
pub fn target_choice_ui(ui: &mut Ui, name: &str, id: &str, targets: &[Channel], target: &mut usize) {
    *target = (*target).min(targets.len().saturating_sub(1));
    if targets.len() < 2 {
        return;
    }
    ui.horizontal(|ui| {
        let label = ui.label(name);
        let combo = ComboBox::from_id_salt(id).selected_text(targets[*target].title());
        let picked = combo.show_ui(ui, |ui| {
            for (index, of) in targets.iter().enumerate() {
                ui.selectable_value(target, index, of.title());
            }
        });
        picked.response.labelled_by(label.id);
    });
}
