//! The one place that changes the state of the run list.

use std::sync::Arc;

use super::{RunsRequest, RunsWorker, worker::RunsEvent};
use crate::{
    app::{
        shared::{Notice, State},
        views::compare::RunsAction,
    },
    export::{FoundWorkspace, NetworkFile, Workspace},
};

/// Takes what the thread has to tell.
pub fn take_news(state: &mut State, worker: &RunsWorker) {
    while let Some(event) = worker.next_event() {
        match event {
            RunsEvent::Loaded(path, Ok(FoundWorkspace { workspace, warning })) => {
                state.runs.path = Some(path);
                // What was damaged is replaced at once, lest it be found again.
                take_up(state, workspace, warning.is_some(), worker);
                if let Some(warning) = warning {
                    state.notice = Some(Notice::Failed(warning));
                }
            }
            RunsEvent::Loaded(_, Err(reason)) | RunsEvent::NotSaved(reason) => {
                state.notice = Some(Notice::Failed(reason));
            }
            RunsEvent::Prepared(place, Ok(mut compared)) => {
                // The user may have moved on meanwhile.
                if state.runs.workspace.pinned[place] == Some(compared.id) {
                    if state.runs.snapshot > 0 {
                        compared.show(state.runs.snapshot);
                    }
                    state.runs.compared[place] = Some(*compared);
                }
            }
            RunsEvent::Prepared(place, Err(reason)) => {
                if state.runs.compared[place].is_none() {
                    state.runs.workspace.pinned[place] = None;
                }
                state.notice = Some(Notice::Failed(reason));
            }
            RunsEvent::Died(reason) => {
                state.runs.path = None;
                let reason = reason.map(|error| format!(" ({error})")).unwrap_or_default();
                let text = format!("Runs are not kept from now on{reason}. Start the program again.");
                state.notice = Some(Notice::Failed(text));
            }
        }
    }
}

/// Puts the runs of the file before those that were finished while it was read.
fn take_up(state: &mut State, mut workspace: Workspace, is_repaired: bool, worker: &RunsWorker) {
    let runs = &mut state.runs;
    std::mem::swap(&mut runs.workspace, &mut workspace);
    let newer = workspace.runs;
    let has_newer = !newer.is_empty();
    for run in newer {
        let run = runs.new_run(run.file);
        runs.workspace.runs.push(run);
    }
    if has_newer || is_repaired {
        worker.ask(RunsRequest::Save(runs.workspace.clone()));
    }
    for place in 0..2 {
        prepare(state, place, worker);
    }
}

/// Keeps a finished training in the list.
pub fn keep(state: &mut State, file: NetworkFile, worker: &RunsWorker) {
    let run = state.runs.new_run(Arc::new(file));
    state.runs.workspace.runs.push(run);
    worker.ask(RunsRequest::Save(state.runs.workspace.clone()));
}

/// Does what the user meant.
pub fn apply(action: RunsAction, state: &mut State, worker: &RunsWorker) {
    let runs = &mut state.runs;
    match action {
        RunsAction::Rename(id, name) => {
            let name = name.trim().to_owned();
            match runs.workspace.runs.iter_mut().find(|run| run.id == id) {
                Some(run) if !name.is_empty() => run.name = name,
                _ => return,
            }
        }
        RunsAction::Pin(place, id) => {
            runs.workspace.pinned[place] = id;
            prepare(state, place, worker);
        }
        RunsAction::Remove(id) => {
            runs.workspace.runs.retain(|run| run.id != id);
            runs.removing = None;
            for place in 0..2 {
                if runs.workspace.pinned[place] == Some(id) {
                    runs.workspace.pinned[place] = None;
                    runs.compared[place] = None;
                }
            }
        }
        RunsAction::AskToRemove(id) => {
            runs.removing = id;
            return;
        }
        RunsAction::ShowSnapshot(snapshot) => {
            runs.snapshot = snapshot;
            for compared in runs.compared.iter_mut().flatten() {
                compared.show(snapshot);
            }
            return;
        }
        RunsAction::ShowCard(card) => {
            runs.card = card;
            return;
        }
        // The window does it, for it concerns the next training.
        RunsAction::TakeSettings(_) => return,
    }
    worker.ask(RunsRequest::Save(state.runs.workspace.clone()));
}

/// Asks for what is to be drawn in one of the two places.
fn prepare(state: &mut State, place: usize, worker: &RunsWorker) {
    state.runs.compared[place] = None;
    if let Some(run) = state.runs.pinned(place) {
        worker.ask(RunsRequest::Prepare(place, run.id, Arc::clone(&run.file)));
    }
}
