//! The one place that changes the state of the Identifiability view.

use super::{IdentifiabilityAction, IdentifiabilityWorker};
use crate::app::shared::State;

/// Takes what the thread has to tell.
pub fn take_news(state: &mut State, worker: &mut IdentifiabilityWorker) {
    let shown = &mut state.identifiability;
    while let Some(answer) = worker.next_answer() {
        if answer.is_newest {
            shown.is_pending = false;
        }
        match answer.analysis {
            Ok(analysis) => {
                shown.problem = None;
                shown.analysis = Some(analysis);
            }
            Err(reason) => shown.problem = Some(reason),
        }
    }
}

/// Does what the user meant.
pub fn apply(action: IdentifiabilityAction, state: &mut State, worker: &mut IdentifiabilityWorker) {
    let shown = &mut state.identifiability;
    match action {
        IdentifiabilityAction::Ask(question) => shown.question = *question,
        IdentifiabilityAction::TakeDraft => shown.take(&state.draft),
        IdentifiabilityAction::ShowAxis(axis) => {
            shown.axis = axis;
            return;
        }
        // The window does it, for it concerns the next training.
        IdentifiabilityAction::UseSensor => return,
    }
    ask(state, worker);
}

/// The view is opened: it shows the sensor and scene of the Train view, with what was last tried on them.
pub fn enter(state: &mut State, worker: &mut IdentifiabilityWorker) {
    if state.identifiability.follow(&state.draft) || state.identifiability.problem.is_some() {
        ask(state, worker);
    }
}

fn ask(state: &mut State, worker: &mut IdentifiabilityWorker) {
    let shown = &mut state.identifiability;
    shown.is_pending = true;
    worker.ask(shown.question);
}
