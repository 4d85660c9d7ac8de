use super::{
    DecouplerWindow,
    files::{Answer, ToWrite, Written},
    modal::Modal,
    save_form::{Saving, Tried},
};
use crate::window::{
    job::JobError,
    preview::PreviewEvent,
    shared::{Matter, Notice, Phase, Preview, RunView, RunsRequest, ViewKind},
    training_worker::{Event, Start},
};

impl DecouplerWindow {
    /// Handles the events of threads and dialogs.
    pub fn take_events(&mut self) {
        match self.pictures.next_event() {
            Some(Ok((picture, notice))) => {
                self.ctx.copy_image(picture);
                self.notices.add(Matter::Clipboard, Notice::Done(notice));
            }
            Some(Err(reason)) => {
                let text = format!("Nothing was copied: {reason}");
                self.notices.fail(Matter::Clipboard, text);
            }
            None => {}
        }
        while let Some(event) = self.worker.next_event() {
            self.take_event(event);
        }
        while let Some(event) = self.previews.next_event() {
            self.take_preview(event);
        }
        let was_listed = self.shared.runs.path.is_some();
        if let Some(notice) = self.shared.runs.take_events(&self.runs) {
            self.notices.add(Matter::RunList, notice);
        }
        let last = self.shared.runs.newest().map(|run| run.id);
        if let (false, true, Some(last)) = (was_listed, self.shared.runs.path.is_some(), last) {
            self.open_run(last, false);
        }
        match self.opening.next_event() {
            Some((is_chosen, Ok(run))) => self.take_opened(is_chosen, *run),
            Some((true, Err(reason))) => self.notices.fail(Matter::RunList, reason),
            // The files of the last run may be gone, which the recording says.
            Some((false, Err(_))) | None => {}
        }
        while let Some(written) = self.files.next_written() {
            self.report_written(written);
        }
        while let Some((task, answer)) = self.dialogs.next_answer() {
            match answer {
                Answer::Chosen(path) => self.answer(task, path, false),
                Answer::NoDialog => self.type_path(task),
                Answer::Cancelled => {}
            }
        }
        let mut effects = Vec::new();
        for kind in ViewKind::ALL {
            self.views.get(kind).take_events(&self.shared, &mut effects);
        }
        self.apply_all(effects);
        self.take_close_request();
    }

    /// Handles a training that could not begin: the previous one stays. Previews that arrived meanwhile were discarded.
    fn refuse(&mut self, matter: Matter, reason: String) {
        self.shared.phase = self.shared.phase_at_rest();
        self.notices.fail(matter, reason);
        self.request_preview();
    }

    fn report_written(&mut self, (ToWrite { task, path, asks }, written): (ToWrite, Written)) {
        let tried = match written {
            Written::Done(message) => {
                return self.notices.add(Matter::File, Notice::Saved(message, path));
            }
            Written::Exists => Tried::Exists,
            Written::InUse(reason) if asks => Tried::Refused(reason),
            Written::InUse(reason) | Written::Failed(reason) => {
                // The user must see this.
                self.modal.take_if(|modal| matches!(modal, Modal::Closing(_)));
                return self.notices.fail(Matter::File, reason);
            }
        };
        self.modal = Some(Modal::Path(Saving::new(task, path.display().to_string(), Some(tried))));
    }

    fn take_preview(&mut self, event: PreviewEvent) {
        match event {
            PreviewEvent::Drawn(settings, Ok(test)) => {
                self.shared.preview = Some(Preview {
                    settings: *settings,
                    test,
                    baselines: None,
                });
            }
            PreviewEvent::Compared(Ok(baselines)) => {
                if let Some(preview) = &mut self.shared.preview {
                    preview.baselines = baselines;
                }
            }
            PreviewEvent::Drawn(_, Err(error)) => self.notices.fail(Matter::Preview, error),
            PreviewEvent::Compared(Err(error)) => self.notices.fail(Matter::Preview, error),
        }
    }

    /// Shows another training, on the left its setup too if `takes_setup`.
    pub(super) fn show_run(&mut self, run: RunView, phase: Phase, takes_setup: bool) {
        let setup = run.setup.clone();
        self.shared.preview = None;
        self.previews.abandon();
        self.shared.run = Some(run);
        if takes_setup {
            self.take_setup(&setup);
        }
        // The same plan is shared, not compared in every frame.
        let asked = self.shared.asked();
        if let (Some(run), Ok(asked)) = (&mut self.shared.run, asked)
            && run.asked == asked
        {
            run.asked = asked;
        }
        self.shared.phase = phase;
    }

    fn take_event(&mut self, event: Event) {
        let shared = &mut self.shared;
        shared.preparing = None;
        match event {
            Event::Began(_, start, Ok(began)) => {
                // If one from a checkpoint has ended, its next event says so.
                let phase = match start {
                    Start::Paused => Phase::Paused,
                    Start::New | Start::Resumed => Phase::Training,
                };
                // The checkpoint of one that was cut short is removed when the window closes.
                let is_saved = start == Start::Paused;
                self.show_run(RunView { is_saved, ..*began }, phase, start != Start::New);
            }
            Event::Began(_, start, Err(reason)) => {
                let matter = if start == Start::New {
                    Matter::Settings
                } else {
                    Matter::Training
                };
                self.refuse(matter, reason);
            }
            Event::Left(question) => {
                self.notices.settle(Matter::CutShort);
                if let Some(question) = question {
                    self.notices.fail(Matter::CutShort, question);
                }
            }
            Event::Unkept(reason) => {
                let text = format!("A running training will be lost if the program ends: {reason}");
                self.notices.fail(Matter::Memory, text);
            }
            Event::Continued(Ok(settings)) => {
                // Settings that were chosen were not asked for.
                let asked = shared.chosen_run().is_none().then(|| shared.settings().training);
                if let Some(run) = &mut shared.run {
                    if let Some(training) = asked {
                        run.asked.settings.training = training;
                    }
                    run.setup = run.setup.with_settings(*settings);
                    run.is_saved = false;
                    run.stop_reason = None;
                }
                shared.phase = Phase::Training;
            }
            Event::Continued(Err(error)) => {
                shared.phase = match shared.phase_at_rest() {
                    Phase::Idle => Phase::Paused,
                    ended => ended,
                };
                self.notices.fail(Matter::Training, error);
            }
            Event::Preparing(progress) => shared.preparing = Some(progress),
            Event::Progressed(progress) => {
                if let Some(reason) = progress.stop_reason {
                    shared.phase = Phase::Ended(reason);
                } else if progress.is_calibrating {
                    shared.phase = Phase::Calibrating;
                }
                if let Some(run) = &mut shared.run {
                    run.progress(*progress);
                }
            }
            Event::Finished(Ok(file)) => self.runs.ask(RunsRequest::Keep(file)),
            Event::Finished(Err(reason)) => self.notices.fail(Matter::Training, reason),
            Event::Died(reason) => {
                shared.phase = shared.phase_at_rest();
                if matches!(reason, Some(JobError::Panicked { .. })) {
                    self.restart_worker();
                }
                let reason = reason.map(|error| format!(": {error}")).unwrap_or_default();
                let text = format!("The training ended unexpectedly{reason}. The results shown remain available.");
                self.notices.fail(Matter::Training, text);
            }
        }
        if self.worker.is_preparing() {
            // The event belongs to the previous training.
            self.shared.phase = Phase::Preparing;
        }
    }
}
