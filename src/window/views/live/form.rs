use eframe::egui::Ui;

use super::{LiveView, engine::Command, source_form::SourceKind};
use crate::window::{
    shared::{Effect, Shared},
    theme::space,
    widgets::{note_ui, scrolled_ui, section_heading_ui},
};

/// Network, source and fault.
pub fn form_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "live form", |ui| {
        section_heading_ui(ui, "Network");
        let is_another = view.network.form_ui(ui, &shared.runs, effects);
        if is_another && view.running.is_some() {
            view.start_again(shared);
        }
        section_heading_ui(ui, "Source");
        let network = view.network.network(&shared.runs).map(|(_, file)| file.clone());
        let settings = network.as_ref().and_then(|file| file.settings.simulated());
        let motion = view.source.motion;
        let has_sensor = view.has_sensor(shared);
        view.source
            .form_ui(ui, (settings.as_ref(), has_sensor), view.running.is_some(), effects);
        if view.source.motion != motion {
            view.command(Command::Move(view.source.motion));
        }
        if let (SourceKind::Simulated, Some(settings)) = (view.source.kind, settings) {
            let scale = settings.source.sensor.scale;
            let read = settings.source.scene.rows.read(scale.rows()).unwrap_or_default();
            let fault = |view: &LiveView| {
                let is_possible = view.fault.problem(scale, &read).is_none();
                view.fault.fault(scale).filter(|_| is_possible)
            };
            let before = fault(view);
            view.fault.form_ui(ui, scale, &read);
            let after = fault(view);
            if after != before {
                view.command(Command::Break(after));
            }
        }
        if let (Some(obstacle), true) = (view.obstacle(shared), network.is_some()) {
            ui.add_space(space(1));
            note_ui(ui, &obstacle);
        }
        ui.add_space(space(4));
    });
}
