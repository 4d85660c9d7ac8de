//! News of the view's threads and of the dialogs, and what becomes of it.

use std::{path::PathBuf, sync::Arc};

use super::{
    keeping::KeepingEvent,
    opening::Opened,
    state::{OwnDataView, Tab},
    training::{Task, TrainingEvent},
};
use crate::{
    app::shared::{Effect, Matter, Notice, Phase, Shared},
    export::MeasuredNetworkFile,
    training::Method,
};

impl OwnDataView {
    /// Opens the files that the user has chosen.
    pub(super) fn take_chosen(&mut self, effects: &mut Vec<Effect>) {
        let paths: Vec<PathBuf> = self.chosen.try_iter().collect();
        if !paths.is_empty() {
            self.open(paths);
        }
        let paths: Vec<PathBuf> = self.chosen_for_test.try_iter().collect();
        if let (Some(draft), false) = (&mut self.draft, self.phase.is_busy()) {
            let refused = paths.into_iter().filter_map(|path| draft.add_test_file(path).err());
            effects.extend(refused.map(|reason| failed(&reason)));
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
        let planned = draft.and_then(|draft| draft.planned().ok());
        // The machine is for the training then.
        if !self.phase.is_busy() {
            self.checking.follow(planned, self.settings.seed);
        }
    }

    fn take(&mut self, opened: Opened) {
        match opened {
            Opened::Recordings(draft) => {
                self.tab = Tab::Columns;
                match &self.draft {
                    Some(older) => self.draft = Some(draft.keeping(older)),
                    None => {
                        self.draft = Some(*draft);
                        self.set_held_out();
                    }
                }
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
                self.take_settings(trained.file.settings.into());
                let mut trained = *trained;
                trained.file = self.listed(trained.file);
                trained.name = self.runs.name_of(&trained);
                self.runs.add(&trained);
                self.show(trained);
                self.tab = Tab::Results;
            }
            Opened::Checkpoint(path, file, draft) => {
                self.draft = draft.map(|draft| *draft).or(self.draft.take());
                self.take_settings(file.settings.into());
                self.checkpoint = Some(path.clone());
                self.tab = Tab::Results;
                self.begin(Task::Resume(path, file), Some(self.settings));
            }
        }
    }

    /// Holds out for validation what the method needs, if the method before needed something else; a share of the user stays.
    pub(super) fn follow_method(&mut self, before: Method) {
        let mut settings = self.settings;
        settings.training.method = before;
        if settings.validation_fraction() != self.settings.validation_fraction() {
            self.set_held_out();
        }
    }

    /// Holds out for validation what the method needs.
    pub(super) fn set_held_out(&mut self) {
        let fraction = self.settings.validation_fraction();
        if let Some(draft) = &mut self.draft {
            draft.plan.division.validation_fraction = fraction;
        }
    }

    /// The same network file as it is in the list, if it is there: lists and cards, which ask in every frame, know a network
    /// by its place in memory.
    fn listed(&self, file: Arc<MeasuredNetworkFile>) -> Arc<MeasuredNetworkFile> {
        let same = self.runs.runs.iter().find(|run| *run.trained.file == *file);
        same.map_or(file, |run| Arc::clone(&run.trained.file))
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
                if matches!(trained.phase, Phase::Ended(_)) {
                    trained.file = self.listed(trained.file);
                    if self.runs.add(&trained) {
                        self.keeping.keep(&trained.file);
                    }
                }
                self.put_on_show(*trained);
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
