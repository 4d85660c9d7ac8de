use eframe::egui::Ui;

use super::{Ending, ExperimentsView};
use crate::window::{theme::Theme, widgets::state_ui};
use decoupler_core::text::counted;
use decoupler_files::export::format_duration;

/// Shows the state of the experiment in the line at the bottom.
pub fn status_ui(ui: &mut Ui, experiments: &ExperimentsView) {
    let palette = Theme::of(ui).palette;
    let folder = experiments.shown_folder().filter(|_| experiments.running.is_none());
    let of_folder = folder.and_then(|folder| Some((folder.name(), folder.trials()?)));
    if let Some((name, (finished, trials))) = of_folder {
        let colour = if finished == trials {
            palette.good
        } else {
            palette.accent
        };
        let text = format!(
            "Sweep folder {name}: {finished} of {} finished",
            counted(trials, "trial")
        );
        ui.horizontal_centered(|ui| state_ui(ui, colour, &text));
        return;
    }
    let (colour, text) = match (&experiments.running, experiments.outcome()) {
        (Some(running), _) => (palette.accent, format!("Running {}", running.topic.name())),
        (None, Some(outcome)) => {
            let (done, all) = outcome.trials();
            let took = outcome
                .took
                .map_or_else(String::new, |took| format!(" in {}", format_duration(took)));
            let name = experiments.topic.name();
            match outcome.ending {
                Some(Ending::Complete) => (palette.good, format!("{name} finished: {all} trials{took}")),
                _ => (
                    palette.warning,
                    format!("{name} ended early: {done} of {all} trials{took}"),
                ),
            }
        }
        (None, None) => (palette.dim, "Ready: press Run".to_owned()),
    };
    ui.horizontal_centered(|ui| state_ui(ui, colour, &text));
}
