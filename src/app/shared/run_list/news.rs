//! The one place that changes the state of the run list.

use std::sync::Arc;

use super::{RunsRequest, RunsWorker, worker::RunsEvent};
use crate::{
    app::{
        shared::{Notice, State},
        views::compare::RunsAction,
    },
    export::NetworkFile,
};

/// Takes what the thread has to tell.
pub fn take_news(state: &mut State, worker: &RunsWorker) {
    loop {
        let event = match worker.next_event() {
            Ok(Some(event)) => event,
            Ok(None) => return,
            Err(_) => {
                if !std::mem::replace(&mut state.runs.has_worker_died, true) {
                    state.runs.path = None;
                    let text = "The thread that keeps the run list ended unexpectedly: runs are not kept from now on. \
                                Start the program again.";
                    state.notice = Some(Notice::Failed(text.to_owned()));
                }
                return;
            }
        };
        match event {
            RunsEvent::Listed(list, path, problems) => {
                (state.runs.list, state.runs.path) = (list, path);
                show_pinned(state, worker);
                if !problems.is_empty() {
                    state.notice = Some(Notice::Failed(problems.join(". ")));
                }
            }
            RunsEvent::Prepared(place, Ok(mut compared)) => {
                // The user may have moved on meanwhile.
                if state.runs.list.pinned[place] == Some(compared.id) {
                    if state.runs.snapshot > 0 {
                        compared.show(state.runs.snapshot);
                    }
                    state.runs.compared[place] = Some(*compared);
                }
            }
            RunsEvent::Prepared(place, Err(reason)) => {
                apply(RunsAction::Pin(place, None), state, worker);
                state.notice = Some(Notice::Failed(reason));
            }
            RunsEvent::Written(Ok(path)) => {
                state.typed = None;
                state.notice = Some(Notice::Done(format!("Saved {}", path.display())));
            }
            RunsEvent::Written(Err(reason)) => state.notice = Some(Notice::Failed(reason)),
        }
    }
}

/// Keeps a finished training in the list.
pub fn keep(file: NetworkFile, worker: &RunsWorker) {
    worker.ask(RunsRequest::Keep(Arc::new(file)));
}

/// Does what the user meant: at once in what is shown, and in the folder as soon as the thread can.
pub fn apply(action: RunsAction, state: &mut State, worker: &RunsWorker) {
    let runs = &mut state.runs;
    match action {
        RunsAction::Rename(id, name) => {
            let name = name.trim();
            if let Some(run) = runs.list.runs.iter_mut().find(|run| run.id == id)
                && !name.is_empty()
            {
                name.clone_into(&mut run.name);
                worker.ask(RunsRequest::Rename(id, name.to_owned()));
            }
        }
        RunsAction::Pin(place, id) => {
            worker.ask(RunsRequest::Pin(place, id));
            runs.list.pinned[place] = id;
            show_pinned(state, worker);
        }
        RunsAction::Remove(id) => {
            worker.ask(RunsRequest::Remove(id));
            runs.list.runs.retain(|run| run.id != id);
            runs.removing = None;
            show_pinned(state, worker);
        }
        RunsAction::AskToRemove(id) => runs.removing = id,
        RunsAction::ShowSnapshot(snapshot) => {
            runs.snapshot = snapshot;
            for compared in runs.compared.iter_mut().flatten() {
                compared.show(snapshot);
            }
        }
        RunsAction::ShowCard(card) => runs.card = card,
        // The window does it, for it concerns the next training.
        RunsAction::TakeSettings(_) => {}
    }
}

/// Asks for what is to be drawn in the two places, where another run is pinned than before.
fn show_pinned(state: &mut State, worker: &RunsWorker) {
    let runs = &mut state.runs;
    for place in 0..2 {
        let pinned = runs.pinned(place).map(|run| (run.id, Arc::clone(&run.file)));
        let id = pinned.as_ref().map(|(id, _)| *id);
        if std::mem::replace(&mut runs.asked[place], id) != id {
            runs.compared[place] = None;
            if let Some((id, file)) = pinned {
                worker.ask(RunsRequest::Prepare(place, id, file));
            }
        }
    }
}
