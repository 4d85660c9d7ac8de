use std::time::Instant;

use eframe::egui::{Key, Modifiers, Sense, Ui};

use super::{
    ExperimentLook, ExperimentsView, Outcome, Topic,
    exports::experiment_exports,
    heat_map::sweep_ui,
    panel,
    results_card::{results_card_height, results_card_ui},
    status,
    sweep_folder::folder_card_ui,
    verdict_list::verdicts_ui,
    worker::ExperimentEvent,
};
use crate::window::{
    plotting::{Pointer, legend_ui, plots_ui},
    shared::{Effect, Export, Matter, Notice, Offers, Shared, Unfinished, View},
    theme::space,
    widgets::{card_ui, invitation_ui, placeholder_ui, scrolled_ui, section_heading_ui},
};
use decoupler_core::text::counted;
use decoupler_files::figure::Figure;

impl View for ExperimentsView {
    fn name(&self) -> &'static str {
        "Experiments"
    }

    fn take_events(&mut self, _shared: &Shared, effects: &mut Vec<Effect>) {
        let mut finished = Vec::new();
        while let Some(event) = self.job.next_event() {
            match event {
                ExperimentEvent::Read(problem) => self.describe(problem),
                ExperimentEvent::Finished(trial) => finished.push(*trial),
                ExperimentEvent::Ended(result) => {
                    self.record(std::mem::take(&mut finished));
                    self.end(Instant::now());
                    effects.extend(
                        result
                            .err()
                            .map(|reason| Effect::Tell(Matter::Experiments, Notice::Failed(reason))),
                    );
                }
            }
        }
        if !finished.is_empty() {
            self.record(finished);
        }
        self.folder.take_events();
    }

    fn is_working(&self) -> bool {
        self.running.is_some()
    }

    fn unfinished(&self, _shared: &Shared) -> Vec<Unfinished> {
        let running = self.running.iter();
        let unfinished = running.map(|running| {
            let (name, done) = (running.topic.name(), running.done);
            let progress = format!("{name}, {done} of {} finished", counted(running.trials, "trial"));
            Unfinished::discarded("Experiment", progress)
        });
        unfinished.collect()
    }

    fn offer_actions(&mut self, offers: &mut Offers<'_>, _shared: &Shared, effects: &mut Vec<Effect>) {
        if offers.offer_keys("Run experiment", Modifiers::COMMAND, Key::Enter, self.can_run()) {
            self.run(effects);
        }
        if offers.offer_keys(
            "Cancel experiment",
            Modifiers::COMMAND,
            Key::Period,
            self.running.is_some(),
        ) {
            self.cancel();
        }
    }

    fn exports<'a>(&'a self, shared: &'a Shared) -> Vec<Export<'a>> {
        experiment_exports(self, shared.look.colours)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        panel::form_ui(ui, self, shared, effects);
    }

    /// The table above, picture and verdicts below.
    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let whole = ui.available_rect_before_wrap();
        if self.shown_folder().is_some() {
            card_ui(ui, whole, |ui| folder_card_ui(ui, &mut self.folder));
            ui.allocate_rect(whole, Sense::hover());
            return;
        }
        let mut look = self.look;
        let Some(outcome) = self.shown() else {
            card_ui(ui, whole, |ui| {
                placeholder_ui(ui, "The values on the left cannot be run yet: the note there says why.");
            });
            return;
        };
        let gap = space(2);
        let height = results_card_height(ui, outcome, whole.width()).min((0.53 * whole.height()).round());
        let (upper, lower) = whole.split_top_bottom_at_y(whole.top() + height);
        card_ui(ui, upper, |ui| {
            results_card_ui(ui, (self.topic, outcome), &mut look, shared, effects);
        });
        let lower = lower.with_min_y(lower.min.y + gap);
        let (left, right) = lower.split_left_right_at_x(lower.left() + (0.6 * lower.width()).round());
        card_ui(ui, left, |ui| {
            picture_ui(ui, (self.topic, outcome), &mut look, shared, effects);
        });
        let mut is_wanted = false;
        card_ui(ui, right.with_min_x(right.min.x + gap), |ui| {
            if outcome.trials().0 == 0 {
                match hint(self) {
                    Some(hint) => placeholder_ui(ui, hint),
                    None => is_wanted = invitation_ui(ui, INVITATION, "Run now", self.can_run()),
                }
                return;
            }
            section_heading_ui(ui, "Verdicts");
            scrolled_ui(ui, "verdicts", |ui| verdicts_ui(ui, outcome));
        });
        ui.allocate_rect(whole, Sense::hover());
        self.look = look;
        if is_wanted {
            self.run(effects);
        }
    }

    fn status_ui(&self, ui: &mut Ui, _shared: &Shared) {
        status::status_ui(ui, self);
    }
}

/// The promise of an experiment that was not run yet.
const INVITATION: &str = "Our figures appear next to the published ones as the trials finish.";

/// Returns the hint shown while there is no figure yet, unless that is an invitation to run.
fn hint(experiments: &ExperimentsView) -> Option<&'static str> {
    match (&experiments.running, experiments.outcome()) {
        (Some(running), _) if running.topic == experiments.topic => Some("The figures appear as the trials finish."),
        (_, Some(_)) => Some("The experiment ended before its first trial finished."),
        _ => None,
    }
}

fn picture_ui(
    ui: &mut Ui,
    (topic, outcome): (Topic, &Outcome),
    look: &mut ExperimentLook,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    match &outcome.figure {
        Figure::HeatMap(map) => {
            let map = (**map).clone().coloured(shared.look.colours);
            sweep_ui(ui, (outcome, &map), look, shared, effects);
        }
        Figure::Plots(plots) => {
            legend_ui(ui, &plots.keys);
            plots_ui(ui, topic.name(), plots, Pointer::Moves);
        }
        // No experiment has any.
        Figure::Surfaces(_) => {}
    }
}
