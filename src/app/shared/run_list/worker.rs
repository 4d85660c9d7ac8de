//! The thread that keeps the run list and prepares what is compared. Requests go in, events come out, and each event
//! wakes the window. When the window closes it waits for what is still to be written.

use std::{
    fmt,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
    thread::{self, JoinHandle},
};

use super::Compared;
use crate::{
    app::{
        test_view::{Frame, TestView},
        threads::{Report, Wake, WorkerDied, next_event, yield_to_window},
        views::train::shown_figure::Undrawn,
    },
    export::{
        NetworkFile, RunFolder, RunList,
        figures::{PictureError, PictureFormat},
    },
};

/// What the window asks of the thread.
pub enum RunsRequest {
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
    /// Prepare this run to be drawn in one of the two places.
    Prepare(usize, u64, Arc<NetworkFile>),
    /// Draw and write a picture.
    Write(Box<Undrawn>, PathBuf),
}

/// What the thread tells the window.
pub enum RunsEvent {
    /// The run list as it is now, where it is kept, and what cannot be read or written.
    Listed(RunList, Option<PathBuf>, Vec<String>),
    /// A run can be drawn, or why not.
    Prepared(usize, Result<Box<Compared>, String>),
    /// A picture was written, or why not.
    Written(Result<PathBuf, String>),
}

/// The window's end of the thread.
pub struct RunsWorker {
    requests: Option<Sender<RunsRequest>>,
    events: Receiver<RunsEvent>,
    thread: Option<JoinHandle<()>>,
}

impl RunsWorker {
    /// Starts the thread. `wake` is called after each event.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(wake: Wake) -> std::io::Result<Self> {
        let (requests, incoming) = channel();
        let (outgoing, events) = channel();
        let report = Report::new(outgoing, wake);
        let work = move || {
            yield_to_window();
            let mut folder = RunFolder::default();
            for request in incoming {
                report.send(answer(request, &mut folder));
            }
        };
        let thread = thread::Builder::new().name("runs".to_owned()).spawn(work)?;
        Ok(Self {
            requests: Some(requests),
            events,
            thread: Some(thread),
        })
    }

    /// Asks for something.
    pub fn ask(&self, request: RunsRequest) {
        if let Some(requests) = &self.requests {
            // The other end is gone only if the thread died, which the next look at the events shows.
            let _ = requests.send(request);
        }
    }

    /// The next event, if one has come.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn next_event(&self) -> Result<Option<RunsEvent>, WorkerDied> {
        next_event(&self.events)
    }
}

impl Drop for RunsWorker {
    fn drop(&mut self) {
        // The thread ends when everything asked for is done.
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl fmt::Debug for RunsWorker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RunsWorker").finish_non_exhaustive()
    }
}

fn answer(request: RunsRequest, folder: &mut RunFolder) -> RunsEvent {
    // Changes are made to what is there now.
    let mut problems = folder.look();
    let failed: Option<String> = match request {
        RunsRequest::Prepare(place, id, file) => {
            return RunsEvent::Prepared(place, prepare(id, &file).map(Box::new));
        }
        RunsRequest::Write(picture, path) => {
            let written = write(&picture, &path).map(|()| path);
            return RunsEvent::Written(written.map_err(|error| error.to_string()));
        }
        RunsRequest::Open(path) => match RunFolder::open(&path) {
            Ok((opened, found)) => {
                *folder = opened;
                problems.extend(found);
                None
            }
            Err(error) => Some(format!("{error}; runs of this session are not kept")),
        },
        RunsRequest::Look => None,
        RunsRequest::Keep(file) => failure(folder.keep(file)),
        RunsRequest::Rename(id, name) => failure(folder.rename(id, &name)),
        RunsRequest::Pin(place, id) => {
            let mut pinned = folder.list().pinned;
            pinned[place] = id;
            failure(folder.pin(pinned))
        }
        RunsRequest::Remove(id) => failure(folder.remove(id)),
    };
    problems.extend(failed);
    let path = folder.path().map(PathBuf::from);
    RunsEvent::Listed(folder.list().clone(), path, problems)
}

fn failure<E: fmt::Display>(written: Result<(), E>) -> Option<String> {
    written.err().map(|error| format!("{error}; the change is not kept"))
}

fn prepare(id: u64, file: &NetworkFile) -> Result<Compared, String> {
    let test = TestView::draw(&file.settings).map_err(|error| error.to_string())?;
    let decoupled_mm = file.network.decouple(&test.set);
    let mut compared = Compared {
        id,
        test,
        decoupled_mm: Arc::new(decoupled_mm),
        frames: [Frame::default(), Frame::default(), Frame::default()],
    };
    compared.show(0);
    Ok(compared)
}

fn write(picture: &Undrawn, path: &Path) -> Result<(), PictureError> {
    let format = PictureFormat::of_path(path)?;
    picture.draw().save(format, path)
}
