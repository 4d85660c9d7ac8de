//! The one place that changes the run list: at once what is shown, and the folder as soon as the thread can.

use super::{
    RunList, RunsWorker,
    worker::{Listed, RunsRequest},
};
use crate::app::shared::Notice;

impl RunList {
    /// Takes the list from the thread; returns what the user is to be told.
    pub fn take_news(&mut self, worker: &RunsWorker) -> Option<Notice> {
        let mut notice = None;
        loop {
            match worker.next_event() {
                Ok(Some(Listed { runs, path, problems })) => {
                    (self.workspace, self.path) = (runs, path);
                    if !problems.is_empty() {
                        notice = Some(Notice::Failed(problems.join(". ")));
                    }
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

    /// Gives the run with this number another name, unless that is empty.
    pub fn rename(&mut self, id: u64, name: &str, worker: &RunsWorker) {
        let (name, run) = (name.trim(), self.workspace.runs.iter_mut().find(|run| run.id == id));
        if let Some(run) = run.filter(|_| !name.is_empty()) {
            name.clone_into(&mut run.name);
            worker.ask(RunsRequest::Rename(id, name.to_owned()));
        }
    }

    /// Shows a run in one of the two places, or nothing.
    pub fn pin(&mut self, place: usize, id: Option<u64>, worker: &RunsWorker) {
        self.workspace.pinned[place] = id;
        worker.ask(RunsRequest::Pin(place, id));
    }

    /// Removes the run with this number for good.
    pub fn remove(&mut self, id: u64, worker: &RunsWorker) {
        self.workspace.runs.retain(|run| run.id != id);
        worker.ask(RunsRequest::Remove(id));
    }
}
