use eframe::egui::{RichText, Ui};

use super::{LiveView, engine::SourcePlan, source_form::SourceKind};
use crate::window::{
    shared::{Effect, Shared},
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, primary_button},
};

/// The text of an empty view, and the one click that fills it.
pub fn invitation_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let palette = Theme::of(ui).palette;
    ui.vertical_centered(|ui| {
        ui.add_space((0.5 * ui.available_height() - space(20)).max(0.0));
        ui.set_max_width(ui.available_width().min(space(105)));
        let (heading, text) = words(view, shared);
        ui.label(RichText::new(heading).font(semibold(type_size().title)));
        ui.add_space(space(1));
        ui.label(RichText::new(text).color(palette.dim));
        ui.add_space(space(4));
        if view.running.is_some() {
            return;
        }
        if view.network.network(&shared.runs).is_none() {
            let is_free = !shared.phase.is_busy();
            if is_free && ui.add(primary_button("Train a network now")).clicked() {
                effects.extend([Effect::ShowTraining, Effect::Train]);
            }
        } else if view.source.kind == SourceKind::Simulated && view.has_sensor(shared) {
            if ui.add(primary_button("Start the simulated source")).clicked() {
                view.start(shared, effects);
            }
        } else if view.obstacle(shared).is_none() && ui.add(primary_button("Start this source")).clicked() {
            view.start(shared, effects);
        }
        ui.add_space(space(2));
        let hint = "Four seconds of a ball that wanders over a simulated array, with a network that decodes them.";
        let sample = ui.add(ghost_button("Play the sample recording"));
        if sample.on_hover_text(hint).clicked() {
            view.ask_for_sample(shared);
        }
    });
}

fn words(view: &LiveView, shared: &Shared) -> (String, String) {
    let (counts, network) = (&view.shown.counts, view.network.network(&shared.runs));
    if let Some(running) = &view.running {
        let source = match &running.source {
            SourcePlan::Simulated { .. } => "the simulated source".to_owned(),
            SourcePlan::Replay { path, .. } => format!("'{}'", path.display()),
            SourcePlan::Stream(source) => source.to_string(),
        };
        let text = match &counts.last_bad {
            Some(reason) => format!("Lines that are no frame: {}. The last: {reason}.", counts.bad),
            None => "It appears here as soon as it comes.".to_owned(),
        };
        return (format!("Waiting for the first frame from {source}"), text);
    }
    let Some((name, _)) = network else {
        let text = if shared.phase.is_busy() {
            "Live decoding needs a trained network. One is being trained in the Train view: it can be used here as soon \
             as it is finished."
        } else {
            "Live decoding needs a trained network. Train one with the settings of the Train view, which takes from \
             seconds to minutes, or open a network file."
        };
        return ("No network yet".to_owned(), text.to_owned());
    };
    let text = match view.source.kind {
        SourceKind::Simulated if view.has_sensor(shared) => format!(
            "An indenter wanders over a simulated array and the network '{name}' decodes its readings, without any \
             hardware. To decode your own, choose a replay, a serial port or a TCP address on the left."
        ),
        _ => match view.obstacle(shared) {
            Some(obstacle) => obstacle,
            None if view.has_sensor(shared) => format!("The network '{name}' decodes its frames as they come."),
            None => format!("The network '{name}' decodes its samples as they come, by the names of their columns."),
        },
    };
    ("Decode live readings".to_owned(), text)
}
