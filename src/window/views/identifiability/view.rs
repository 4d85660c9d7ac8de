use eframe::egui::Ui;

use super::{
    IdentifiabilityView,
    array_view::{analysis_exports, identifiability_ui, status_ui},
    form, recording,
};
use crate::window::shared::{Effect, Export, Offers, Shared, SourceKind, Unfinished, View};

impl View for IdentifiabilityView {
    fn name(&self) -> &'static str {
        "Identifiability"
    }

    /// Shows the sensor and scene of the Train view, with what was last tried on them.
    fn enter(&mut self, shared: &Shared) {
        if self.follow(&shared.draft) || self.problem.is_some() {
            self.ask();
        }
    }

    fn take_events(&mut self, _shared: &Shared, effects: &mut Vec<Effect>) {
        self.study.take_events(effects);
        while let Some(answer) = self.worker.next_answer() {
            if answer.is_newest {
                self.is_pending = false;
            }
            match answer.analysis {
                Ok(analysis) => {
                    self.problem = None;
                    self.analysis = Some(analysis);
                }
                Err(reason) => self.problem = Some(reason),
            }
        }
    }

    fn is_working(&self) -> bool {
        self.study.is_under_way()
    }

    fn unfinished(&self, _shared: &Shared) -> Vec<Unfinished> {
        self.study.unfinished().into_iter().collect()
    }

    fn offer_actions(&mut self, offers: &mut Offers<'_>, shared: &Shared, _effects: &mut Vec<Effect>) {
        if shared.source == SourceKind::Recording {
            recording::offer_actions(&mut self.study, offers, shared);
        }
    }

    fn exports<'a>(&'a self, shared: &'a Shared) -> Vec<Export<'a>> {
        match shared.source {
            SourceKind::Array => analysis_exports(self, shared),
            SourceKind::Recording => recording::study_exports(&self.study),
        }
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        match shared.source {
            SourceKind::Array => form::form_ui(ui, self, shared, effects),
            SourceKind::Recording => recording::form_ui(ui, &mut self.study, shared),
        }
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        match shared.source {
            SourceKind::Array => identifiability_ui(ui, self, shared, effects),
            SourceKind::Recording => recording::body_ui(ui, &mut self.study, shared),
        }
    }

    fn status_ui(&self, ui: &mut Ui, shared: &Shared) {
        match shared.source {
            SourceKind::Array => status_ui(ui, self),
            SourceKind::Recording => recording::status_ui(ui, &self.study, shared),
        }
    }
}
