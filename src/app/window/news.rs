use std::path::PathBuf;

use super::{
    DecouplerWindow,
    applying::{have_same_sets, have_same_test_set},
    dialogs::Answer,
};
use crate::{
    app::{
        shared::{Notice, Phase, Preview, RunView},
        training_worker::Event,
    },
    evaluation::SimulatedSettings,
};

impl DecouplerWindow {
    /// Takes what the threads and the dialogs have to tell.
    pub fn take_news(&mut self) {
        loop {
            match self.worker.next_event() {
                Ok(Some(event)) => self.take_event(event),
                Ok(None) => break,
                Err(_) => {
                    if self.shared.phase != Phase::Died {
                        self.shared.phase = Phase::Died;
                        let text = "The training thread ended unexpectedly. What is shown can still be looked at.";
                        self.notice = Some(Notice::Failed(text.to_owned()));
                    }
                    break;
                }
            }
        }
        if let Some(notice) = self.shared.runs.take_news(&self.runs) {
            self.notice = Some(notice);
        }
        while let Some(written) = self.files.next_written() {
            self.tell_written(written);
        }
        while let Some(answer) = self.dialogs.next_answer() {
            match answer {
                Answer::Chosen(task, path) => self.answer(task, path),
                Answer::NoDialog(task) => self.type_path(task),
                Answer::Cancelled => {}
            }
        }
        let mut effects = Vec::new();
        let mut working = Vec::new();
        for view in self.views.all() {
            view.take_news(&self.shared, &mut effects);
            working.extend(view.is_working().then(|| view.name()));
        }
        self.shared.working = working;
        self.apply_all(effects);
    }

    fn tell_written(&mut self, written: Result<PathBuf, String>) {
        self.notice = Some(match written {
            Ok(path) => {
                self.typed = None;
                Notice::Done(format!("Saved {}", path.display()))
            }
            Err(reason) => Notice::Failed(reason),
        });
    }

    fn take_event(&mut self, event: Event) {
        let shared = &mut self.shared;
        match event {
            // Settings that have moved on meanwhile have asked for another test set, or need none.
            Event::Previewed(settings, _) if !have_same_test_set(&settings, &shared.draft) => {}
            Event::Previewed(settings, Ok(test)) => {
                if !shared.phase.is_busy() {
                    shared.preview = Some(Preview {
                        settings: *settings,
                        test,
                        baselines: None,
                    });
                    self.ask_for_what_is_missing();
                }
            }
            Event::Previewed(_, Err(error)) => self.notice = Some(Notice::Failed(error.to_string())),
            Event::Compared(settings, baselines) => {
                if let Some(preview) = &mut shared.preview
                    && have_same_sets(&settings, &shared.draft)
                {
                    preview.baselines = baselines;
                }
            }
            Event::Began(Ok(began)) => {
                shared.preview = None;
                shared.run = Some(RunView::new(*began));
                shared.phase = Phase::Training;
            }
            Event::Began(Err(error)) => {
                shared.phase = shared.phase_at_rest();
                self.notice = Some(Notice::Failed(error.to_string()));
            }
            Event::Opened(Ok(began)) => {
                shared.draft = began.settings;
                shared.preview = None;
                shared.run = Some(RunView::new(*began));
                self.typed = None;
                // If it has ended, the news of it say so.
                shared.phase = Phase::Paused;
            }
            Event::Opened(Err(error)) => {
                shared.phase = shared.phase_at_rest();
                self.notice = Some(Notice::Failed(error));
            }
            Event::Continued(Ok(settings)) => {
                if let Some(run) = &mut shared.run {
                    run.asked = SimulatedSettings {
                        training: shared.draft.training,
                        ..run.asked
                    };
                    run.settings = *settings;
                    run.stop_reason = None;
                }
                shared.phase = Phase::Training;
            }
            Event::Continued(Err(error)) => {
                shared.phase = match shared.phase_at_rest() {
                    Phase::Idle => Phase::Paused,
                    ended => ended,
                };
                self.notice = Some(Notice::Failed(error));
            }
            Event::Progressed(progress) => {
                if let Some(reason) = progress.stop_reason {
                    shared.phase = Phase::Ended(reason);
                }
                if let Some(run) = &mut shared.run {
                    run.progress(*progress);
                }
            }
            Event::Finished(Ok(file)) => shared.runs.keep(*file, &self.runs),
            Event::Finished(Err(reason)) => self.notice = Some(Notice::Failed(reason)),
            Event::Exported(written) => self.tell_written(written),
        }
    }
}
