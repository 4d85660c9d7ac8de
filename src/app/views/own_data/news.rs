//! News of the view's threads and of the dialogs, and what becomes of it.

use std::path::PathBuf;

use super::{
    keeping::KeepingEvent,
    opening::Opened,
    state::{OwnDataView, Tab},
    training::{Task, TrainingEvent},
};
use crate::app::shared::{Effect, Matter, Notice, Phase, Shared};

impl OwnDataView {
    /// Opens the files that the user has chosen.
    pub(super) fn take_chosen(&mut self) {
        let paths: Vec<PathBuf> = self.chosen.try_iter().collect();
        if !paths.is_empty() {
            self.open(paths);
        }
        let paths: Vec<PathBuf> = self.chosen_for_test.try_iter().collect();
        if let (Some(draft), false) = (&mut self.draft, self.phase.is_busy()) {
            paths.into_iter().for_each(|path| draft.add_test_file(path));
        }
        let path = self.chosen_positions.try_iter().last();
        if let (Some(draft), Some(path), false) = (&mut self.draft, path, self.phase.is_busy()) {
            draft.plan.import.positions = Some(path);
        }
    }

    /// Keeps networks beside the runs of the other views, if those are kept.
    pub(super) fn follow_keeping(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let beside = shared.runs.path.as_ref().and_then(|runs| runs.parent());
        if let (None, Some(beside)) = (&self.keeping.folder, beside) {
            self.keeping.open(beside.join("own-data"));
        }
        while let Some(event) = self.keeping.next_event() {
            match event {
                KeepingEvent::Found(path, file) => self.runs.note_found(path, file),
                KeepingEvent::Kept(path, file) => self.runs.note_kept(path, &file),
                KeepingEvent::Failed(reason) => effects.push(failed(&reason)),
                KeepingEvent::Ended => {}
            }
        }
    }

    /// Takes what the threads have to tell.
    pub(super) fn follow(&mut self, effects: &mut Vec<Effect>) {
        if let Some(opened) = self.opening.next_opened() {
            match opened {
                Ok(opened) => {
                    effects.push(Effect::Settle(Matter::OwnData));
                    self.take(opened);
                }
                Err(reason) => effects.push(failed(&reason)),
            }
        }
        if let Some(reason) = self.measuring.follow() {
            effects.push(failed(&reason));
        }
        while let Some(event) = self.trainer.next_event() {
            self.take_training(event, effects);
        }
        let draft = self.draft.as_ref().filter(|draft| draft.obstacle().is_none());
        let plan = draft.and_then(|draft| draft.plan().ok());
        // The machine is for the training then.
        if !self.phase.is_busy() {
            self.checking.follow(plan, self.settings.seed);
        }
    }

    fn take(&mut self, opened: Opened) {
        match opened {
            Opened::Recordings(draft) => {
                let draft = match &self.draft {
                    Some(older) => draft.keeping(older),
                    None => *draft,
                };
                self.tab = Tab::Columns;
                self.draft = Some(draft);
                self.set_held_out();
            }
            Opened::Positions(path) => {
                if let Some(draft) = &mut self.draft {
                    draft.plan.import.positions = Some(path);
                }
            }
            Opened::Import(draft) => {
                self.draft = Some(*draft);
            }
            Opened::Network(trained, draft) => {
                self.draft = draft.map(|draft| *draft).or(self.draft.take());
                self.settings = trained.file.settings.into();
                let mut trained = *trained;
                trained.name = self.runs.name_of(&trained);
                self.runs.add(&trained);
                self.show(trained);
                self.tab = Tab::Results;
            }
            Opened::Checkpoint(path, file, draft) => {
                self.draft = draft.map(|draft| *draft).or(self.draft.take());
                self.settings = file.settings.into();
                self.tab = Tab::Results;
                self.begin(Task::Resume(path, file), Some(self.settings));
            }
        }
    }

    /// Holds out for validation what the method needs.
    pub(super) fn set_held_out(&mut self) {
        let fraction = self.settings.validation_fraction();
        if let Some(draft) = &mut self.draft {
            draft.plan.division.validation_fraction = fraction;
        }
    }

    fn take_training(&mut self, event: TrainingEvent, effects: &mut Vec<Effect>) {
        match event {
            TrainingEvent::Reading(progress) => self.reading = Some(progress),
            TrainingEvent::Progressed(mut trained) => {
                let begun = self.beginning.take();
                trained.name = self.runs.name_of(&trained);
                self.phase = trained.phase;
                if begun.is_some() {
                    self.asked = begun;
                    // One that was opened is held where it was saved.
                    self.saved_epochs = (trained.phase == Phase::Paused).then_some(trained.epochs_run);
                    effects.push(Effect::Settle(Matter::OwnData));
                    self.tab = Tab::Results;
                    self.chart.fit(&trained);
                }
                if matches!(trained.phase, Phase::Ended(_)) && self.runs.add(&trained) {
                    self.keeping.keep(&trained.file);
                }
                self.shown = Some(*trained);
            }
            TrainingEvent::Validated(validated) => {
                self.validated = Some(*validated);
                self.tab = Tab::Results;
            }
            TrainingEvent::Refused(reason) => effects.push(failed(&reason)),
            TrainingEvent::Ended(ended) => {
                effects.extend(ended.err().map(|reason| failed(&reason)));
                self.trainer.forget();
                (self.is_validating, self.beginning) = (false, None);
                if self.phase.is_busy() {
                    self.phase = self.phase_at_rest();
                }
            }
        }
    }
}

fn failed(reason: &str) -> Effect {
    Effect::Tell(Matter::OwnData, Notice::Failed(reason.to_owned()))
}
