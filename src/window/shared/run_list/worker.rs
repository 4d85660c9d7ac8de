//! The thread that keeps the run list in its folder. Requests go in, the list as it then is comes out, which wakes the
//! window. When the window closes it waits for what is still to be written.

use std::{
    cell::Cell,
    fmt,
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Sender, channel},
    },
    time::Duration,
};

use crate::window::job::{Job, JobError, Wake};
use decoupler_files::export::{KeptRuns, NetworkFile, RunFolder};

/// Longest time that closing waits for the files.
const LONGEST_WRITE: Duration = Duration::from_secs(5);

/// Requests to the thread.
pub(super) enum RunsRequest {
    /// Keep the runs in this folder.
    Open(PathBuf),
    /// See what other windows have changed.
    Look,
    /// Add a finished training.
    Keep(Arc<NetworkFile>),
    /// Give a run another name.
    Rename(u64, String),
    /// Show this run in one of the two places, or nothing.
    Pin(usize, Option<u64>),
    /// Remove a run for good.
    Remove(u64),
}

/// The run list after a request.
pub(super) struct Listed {
    pub(super) runs: KeptRuns,
    /// Folder in which they are kept, if they are.
    pub(super) path: Option<PathBuf>,
    /// Files that cannot be read or written.
    pub(super) problems: Vec<String>,
}

/// News from the thread.
pub(super) enum RunsEvent {
    /// The run list after a request.
    Listed(Listed),
    /// The thread has ended, and why, unless it was to end.
    Died(Option<JobError>),
}

/// The window's end of the thread.
#[derive(Debug)]
pub struct RunsWorker {
    requests: Option<Sender<RunsRequest>>,
    job: Job<RunsEvent>,
    /// Requests that were not answered yet.
    unanswered: Cell<usize>,
}

impl RunsWorker {
    /// Starts the thread. `wake` is called after each event.
    pub fn start(wake: Wake) -> Self {
        let (requests, incoming) = channel();
        let mut job = Job::new("run list", wake);
        job.start(
            move |report| {
                let mut folder = RunFolder::default();
                for request in incoming {
                    report.send(RunsEvent::Listed(answer(request, &mut folder)));
                }
            },
            |ended| RunsEvent::Died(ended.err()),
        );
        Self {
            requests: Some(requests),
            job,
            unanswered: Cell::default(),
        }
    }

    /// Shows the runs in the folder `path`, and keeps runs there from now on.
    pub fn open(&self, path: PathBuf) {
        self.ask(RunsRequest::Open(path));
    }

    /// Shows what other windows have changed.
    pub fn look(&self) {
        self.ask(RunsRequest::Look);
    }

    /// Adds a finished training.
    pub fn keep(&self, file: NetworkFile) {
        self.ask(RunsRequest::Keep(Arc::new(file)));
    }

    pub(super) fn ask(&self, request: RunsRequest) {
        if let Some(requests) = &self.requests {
            // The other end is gone only if the thread died, which is the last event.
            if requests.send(request).is_ok() {
                self.unanswered.set(self.unanswered.get() + 1);
            }
        }
    }

    /// The next event, if one has come.
    pub(super) fn next_event(&self) -> Option<RunsEvent> {
        let event = self.job.next_event()?;
        if let RunsEvent::Listed(_) = event {
            self.unanswered.set(self.unanswered.get().saturating_sub(1));
        }
        Some(event)
    }

    /// Returns true if the last list taken knows of everything that was asked for.
    pub(super) fn is_up_to_date(&self) -> bool {
        self.unanswered.get() == 0
    }
}

impl Drop for RunsWorker {
    fn drop(&mut self) {
        // The thread ends when everything asked for is done.
        self.requests = None;
        self.job.wait(LONGEST_WRITE);
    }
}

fn answer(request: RunsRequest, folder: &mut RunFolder) -> Listed {
    // Changes are made to what is there now.
    let mut problems = folder.look();
    match request {
        RunsRequest::Open(path) => match RunFolder::open(&path) {
            Ok((opened, found)) => {
                *folder = opened;
                problems.extend(found);
            }
            Err(error) => problems.push(format!("{error}; runs of this session are not kept")),
        },
        RunsRequest::Look => {}
        RunsRequest::Keep(file) => problems.extend(failure(folder.keep(file))),
        RunsRequest::Rename(id, name) => problems.extend(failure(folder.rename(id, &name))),
        RunsRequest::Pin(place, id) => {
            let mut pinned = folder.runs().pinned;
            pinned[place] = id;
            problems.extend(failure(folder.pin(pinned)));
        }
        RunsRequest::Remove(id) => problems.extend(failure(folder.remove(id))),
    }
    Listed {
        runs: folder.runs().clone(),
        path: folder.path().map(PathBuf::from),
        problems,
    }
}

fn failure<E: fmt::Display>(written: Result<(), E>) -> Option<String> {
    written.err().map(|error| format!("{error}; the change is not kept"))
}
