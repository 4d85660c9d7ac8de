use std::sync::Arc;

use super::{
    Action, DecouplerWindow,
    applying::{have_same_sets, have_same_test_set},
};
use crate::{
    app::{
        dialogs::Answer,
        preview::PreviewEvent,
        shared::{Notice, Phase, Preview, RunView, run_list},
        training_worker::Event,
        views::{experiments, identifiability, trade_off},
    },
    evaluation::SimulatedSettings,
};

impl DecouplerWindow {
    /// Takes what the worker and the dialogs have to tell.
    pub fn take_news(&mut self) {
        while let Some(event) = self.worker.next_event() {
            self.take_event(event);
        }
        while let Some(event) = self.previews.next_event() {
            self.take_preview(event);
        }
        while let Some(written) = self.files.next_written() {
            self.state.notice = Some(match written {
                Ok(path) => {
                    self.state.typed = None;
                    Notice::Done(format!("Saved {}", path.display()))
                }
                Err(reason) => {
                    // The user has to see this.
                    self.closing = None;
                    Notice::Failed(reason)
                }
            });
        }
        experiments::take_news(&mut self.state, &self.experiments);
        run_list::take_news(&mut self.state, &self.runs);
        identifiability::take_news(&mut self.state, &mut self.identifiability);
        trade_off::take_news(&mut self.state, &self.trade);
        self.measuring.take_news(&mut self.state.decoders);
        while let Some((task, answer)) = self.dialogs.next_answer() {
            match answer {
                Answer::Chosen(path) => self.apply(task.at(path)),
                Answer::NoDialog => self.apply(Action::TypePath(task)),
                Answer::Cancelled => {}
            }
        }
        self.take_close_request();
    }

    fn take_preview(&mut self, event: PreviewEvent) {
        let state = &mut self.state;
        match event {
            // Settings that have moved on meanwhile have asked for another test set, or need none.
            PreviewEvent::Drawn(settings, _) if !have_same_test_set(&settings, &state.draft) => {}
            PreviewEvent::Drawn(settings, Ok(test)) => {
                if !state.phase.is_busy() {
                    state.preview = Some(Preview {
                        settings: *settings,
                        test,
                        baselines: None,
                    });
                    state.refresh_frames();
                    self.ask_for_what_is_missing();
                }
            }
            PreviewEvent::Drawn(_, Err(error)) => state.notice = Some(Notice::Failed(error.to_string())),
            PreviewEvent::Compared(settings, baselines) => {
                if let Some(preview) = &mut state.preview
                    && have_same_sets(&settings, &state.draft)
                {
                    preview.baselines = baselines;
                }
            }
            PreviewEvent::Failed(error) => state.notice = Some(Notice::Failed(error.to_string())),
        }
    }

    fn take_event(&mut self, event: Event) {
        let state = &mut self.state;
        match event {
            Event::Began(Ok(began)) => {
                self.measuring.forget(&mut state.decoders);
                state.preview = None;
                state.run = Some(RunView::new(*began));
                state.phase = Phase::Training;
                state.refresh_frames();
            }
            Event::Began(Err(error)) => {
                state.phase = state.phase_at_rest();
                state.notice = Some(Notice::Failed(error.to_string()));
            }
            Event::Opened(Ok(began)) => {
                self.measuring.forget(&mut state.decoders);
                state.draft = began.settings;
                state.preview = None;
                state.run = Some(RunView {
                    is_saved: true,
                    ..RunView::new(*began)
                });
                state.typed = None;
                // If it has ended, the news of it say so.
                state.phase = Phase::Paused;
                state.refresh_frames();
            }
            Event::Opened(Err(error)) => {
                state.phase = state.phase_at_rest();
                state.notice = Some(Notice::Failed(error));
            }
            Event::Continued(Ok(settings)) => {
                self.measuring.forget(&mut state.decoders);
                if let Some(run) = &mut state.run {
                    run.asked = SimulatedSettings {
                        training: state.draft.training,
                        ..run.asked
                    };
                    run.settings = *settings;
                    run.is_saved = false;
                    run.stop_reason = None;
                }
                state.phase = Phase::Training;
            }
            Event::Continued(Err(error)) => {
                state.phase = match state.phase_at_rest() {
                    Phase::Idle => Phase::Paused,
                    ended => ended,
                };
                state.notice = Some(Notice::Failed(error));
            }
            Event::Progressed(progress) => {
                if let Some(reason) = progress.stop_reason {
                    state.phase = Phase::Ended(reason);
                }
                if let Some(run) = &mut state.run {
                    run.progress(*progress);
                }
                state.refresh_frames();
                self.measure_decoders();
            }
            Event::Networks(number, networks) if self.measuring.awaits(number) => match (networks, &state.run) {
                (Ok(networks), Some(run)) => {
                    let test = Arc::clone(&run.test.set);
                    self.measuring.begin(run.settings, *networks, test);
                }
                (Err(reason), _) => state.decoders.end(&reason),
                (Ok(_), None) => {}
            },
            // The network is another one by now.
            Event::Networks(..) => {}
            Event::Finished(Ok(file)) => run_list::keep(state, *file, &self.runs),
            Event::Finished(Err(reason)) => state.notice = Some(Notice::Failed(reason)),
            Event::Died(reason) => {
                state.phase = Phase::Died;
                let reason = reason.map(|error| format!(" ({error})")).unwrap_or_default();
                let text = format!("The training ended unexpectedly{reason}. What is shown can still be looked at.");
                state.notice = Some(Notice::Failed(text));
            }
            // The worker keeps these to itself.
            Event::Abandoned => {}
        }
        if self.worker.is_preparing() {
            // This was news of the training before.
            self.state.phase = Phase::Preparing;
        }
    }
}
