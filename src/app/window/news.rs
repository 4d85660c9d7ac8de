use std::sync::Arc;

use super::{
    Action, DecouplerWindow,
    applying::{have_same_sets, have_same_test_set},
    decoupler_window::wake,
};
use crate::{
    app::{
        dialogs::Answer,
        shared::{Notice, Phase, Preview, RunView, run_list},
        training_worker::Event,
        views::{experiments, identifiability, trade_off},
    },
    evaluation::SimulatedSettings,
};

impl DecouplerWindow {
    /// Takes what the worker and the dialogs have to tell.
    pub fn take_news(&mut self) {
        loop {
            match self.worker.next_event() {
                Ok(Some(event)) => self.take_event(event),
                Ok(None) => break,
                Err(_) => {
                    if self.state.phase != Phase::Died {
                        self.state.phase = Phase::Died;
                        let text = "The training thread ended unexpectedly. What is shown can still be looked at.";
                        self.state.notice = Some(Notice::Failed(text.to_owned()));
                    }
                    break;
                }
            }
        }
        experiments::take_news(&mut self.state, &self.experiments);
        run_list::take_news(&mut self.state, &self.runs);
        identifiability::take_news(&mut self.state, &mut self.identifiability);
        trade_off::take_news(&mut self.state, &self.trade);
        self.measuring.take_news(&mut self.state.decoders);
        while let Some(answer) = self.dialogs.next_answer() {
            match answer {
                Answer::Chosen(task, path) => self.apply(task.at(path)),
                Answer::NoDialog(task) => self.apply(Action::TypePath(task)),
                Answer::Cancelled => {}
            }
        }
    }

    fn take_event(&mut self, event: Event) {
        let state = &mut self.state;
        match event {
            // Settings that have moved on meanwhile have asked for another test set, or need none.
            Event::Previewed(settings, _) if !have_same_test_set(&settings, &state.draft) => {}
            Event::Previewed(settings, Ok(test)) => {
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
            Event::Previewed(_, Err(error)) => state.notice = Some(Notice::Failed(error.to_string())),
            Event::Compared(settings, baselines) => {
                if let Some(preview) = &mut state.preview
                    && have_same_sets(&settings, &state.draft)
                {
                    preview.baselines = baselines;
                }
            }
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
                state.run = Some(RunView::new(*began));
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
                    let measured = self.measuring.begin(run.settings, *networks, test, wake(&self.ctx));
                    if let Err(error) = measured {
                        state.decoders.end(&format!("no thread could be started: {error}"));
                    }
                }
                (Err(reason), _) => state.decoders.end(&reason),
                (Ok(_), None) => {}
            },
            // The network is another one by now.
            Event::Networks(..) => {}
            Event::Finished(Ok(file)) => run_list::keep(state, *file, &self.runs),
            Event::Finished(Err(reason)) => state.notice = Some(Notice::Failed(reason)),
            Event::Exported(Ok(path)) => {
                state.typed = None;
                state.notice = Some(Notice::Done(format!("Saved {}", path.display())));
            }
            Event::Exported(Err(error)) => state.notice = Some(Notice::Failed(error)),
        }
    }
}
