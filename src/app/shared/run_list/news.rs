//! The one place that changes the run list: at once what is shown, and the folder as soon as the thread can.

use super::{
    RunList, RunsWorker,
    worker::{Listed, RunsEvent, RunsRequest},
};
use crate::app::shared::Notice;

impl RunList {
    /// Takes the list from the thread; returns what the user is to be told.
    pub fn take_news(&mut self, worker: &RunsWorker) -> Option<Notice> {
        let mut notice = None;
        while let Some(event) = worker.next_event() {
            match event {
                RunsEvent::Listed(Listed { runs, path, problems }) => {
                    (self.workspace, self.path) = (runs, path);
                    if !problems.is_empty() {
                        notice = Some(Notice::Failed(problems.join(". ")));
                    }
                }
                RunsEvent::Died(reason) => {
                    self.path = None;
                    let reason = reason.map(|error| format!(" ({error})")).unwrap_or_default();
                    let text = format!("Runs are not kept from now on{reason}. Start the program again.");
                    notice = Some(Notice::Failed(text));
                }
            }
        }
        notice
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
