//! The one place that changes the run list.

use std::sync::Arc;

use super::{
    RunList, RunsWorker,
    worker::{RunsEvent, RunsRequest},
};
use crate::{
    app::shared::Notice,
    export::{FoundWorkspace, NetworkFile, Workspace},
};

impl RunList {
    /// Takes what the thread has to tell; returns what the user is to be told.
    pub fn take_news(&mut self, worker: &RunsWorker) -> Option<Notice> {
        let mut notice = None;
        loop {
            match worker.next_event() {
                Ok(Some(RunsEvent::Loaded(path, Ok(FoundWorkspace { workspace, warning })))) => {
                    self.path = Some(path);
                    // What was damaged is replaced at once, lest it be found again.
                    self.take_up(workspace, warning.is_some(), worker);
                    notice = warning.map(Notice::Failed).or(notice);
                }
                Ok(Some(RunsEvent::Loaded(_, Err(reason)) | RunsEvent::NotSaved(reason))) => {
                    notice = Some(Notice::Failed(reason));
                }
                Ok(None) => return notice,
                Err(_) if self.has_worker_died => return notice,
                Err(_) => {
                    (self.has_worker_died, self.path) = (true, None);
                    let text = "The thread that keeps the run list ended unexpectedly: runs are not kept from now on. \
                                Start the program again.";
                    return Some(Notice::Failed(text.to_owned()));
                }
            }
        }
    }

    /// Puts the runs of the file before those that were finished while it was read.
    fn take_up(&mut self, mut workspace: Workspace, is_repaired: bool, worker: &RunsWorker) {
        std::mem::swap(&mut self.workspace, &mut workspace);
        let newer = workspace.runs;
        let has_newer = !newer.is_empty();
        for run in newer {
            let run = self.new_run(run.file);
            self.workspace.runs.push(run);
        }
        if has_newer || is_repaired {
            self.save(worker);
        }
    }

    fn save(&self, worker: &RunsWorker) {
        worker.ask(RunsRequest::Save(self.workspace.clone()));
    }

    /// Keeps a finished training in the list.
    pub fn keep(&mut self, file: NetworkFile, worker: &RunsWorker) {
        let run = self.new_run(Arc::new(file));
        self.workspace.runs.push(run);
        self.save(worker);
    }

    /// Calls the run with this number so, if that is a name.
    pub fn rename(&mut self, id: u64, name: &str, worker: &RunsWorker) {
        let run = self.workspace.runs.iter_mut().find(|run| run.id == id);
        if let Some(run) = run.filter(|_| !name.trim().is_empty()) {
            name.trim().clone_into(&mut run.name);
            self.save(worker);
        }
    }

    /// Shows a run in one of the two places, or nothing.
    pub fn pin(&mut self, place: usize, id: Option<u64>, worker: &RunsWorker) {
        self.workspace.pinned[place] = id;
        self.save(worker);
    }

    /// Keeps the run with this number no longer.
    pub fn remove(&mut self, id: u64, worker: &RunsWorker) {
        self.workspace.runs.retain(|run| run.id != id);
        for pinned in self.workspace.pinned.iter_mut().filter(|pinned| **pinned == Some(id)) {
            *pinned = None;
        }
        self.save(worker);
    }
}
