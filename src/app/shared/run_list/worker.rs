//! The thread that reads and writes the workspace file. Requests go in, events
//! come out, and each event wakes the window. When the window closes it waits for what is still to be written.

use std::{
    collections::VecDeque,
    fmt,
    fs::{self, File},
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, Sender, channel},
    thread::{self, JoinHandle},
};

use crate::{
    app::threads::{Report, Wake, WorkerDied, next_event, yield_to_window},
    export::{FoundWorkspace, Workspace, WorkspaceError, WriteError},
};

/// What the window asks of the thread.
pub(super) enum RunsRequest {
    /// Take up the workspace in this file.
    Load(PathBuf),
    /// Write the workspace. Only the newest one counts.
    Save(Workspace),
}

/// What the thread tells the window.
pub(super) enum RunsEvent {
    /// The workspace, or why runs are not kept.
    Loaded(PathBuf, Result<FoundWorkspace, String>),
    /// The workspace could not be written.
    NotSaved(String),
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
            let mut labour = Labour::default();
            while let Some(request) = labour.next(&incoming) {
                if let Some(event) = labour.answer(request) {
                    report.send(event);
                }
            }
        };
        let thread = thread::Builder::new().name("workspace".to_owned()).spawn(work)?;
        Ok(Self {
            requests: Some(requests),
            events,
            thread: Some(thread),
        })
    }

    /// Takes up the workspace in `path`, and keeps runs there from now on.
    pub fn load(&self, path: PathBuf) {
        self.ask(RunsRequest::Load(path));
    }

    /// Asks for something.
    pub(super) fn ask(&self, request: RunsRequest) {
        if let Some(requests) = &self.requests {
            // The other end is gone only if the thread died, which the next look at the events shows.
            let _ = requests.send(request);
        }
    }

    /// The next event, if one has come.
    ///
    /// # Errors
    /// The thread has ended.
    pub(super) fn next_event(&self) -> Result<Option<RunsEvent>, WorkerDied> {
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

/// The thread's own state.
#[derive(Default)]
struct Labour {
    queue: VecDeque<RunsRequest>,
    /// Where the workspace is written, and the lock that keeps other windows from it.
    place: Option<(PathBuf, File)>,
}

impl Labour {
    /// The next request; waits for one. `None` once the window is closed and everything is done.
    fn next(&mut self, incoming: &Receiver<RunsRequest>) -> Option<RunsRequest> {
        if self.queue.is_empty() {
            self.enqueue(incoming.recv().ok()?);
        }
        while let Ok(request) = incoming.try_recv() {
            self.enqueue(request);
        }
        self.queue.pop_front()
    }

    fn enqueue(&mut self, request: RunsRequest) {
        if let RunsRequest::Save(_) = request {
            self.queue.retain(|older| !matches!(older, RunsRequest::Save(_)));
        }
        self.queue.push_back(request);
    }

    fn answer(&mut self, request: RunsRequest) -> Option<RunsEvent> {
        match request {
            RunsRequest::Load(path) => {
                let found = self.load(&path);
                Some(RunsEvent::Loaded(path, found))
            }
            RunsRequest::Save(workspace) => {
                let (path, _) = self.place.as_ref()?;
                let saved = workspace.save(path);
                saved.err().map(|error| RunsEvent::NotSaved(error.to_string()))
            }
        }
    }

    fn load(&mut self, path: &Path) -> Result<FoundWorkspace, String> {
        let lock = lock(path)?;
        let found = Workspace::load(path).map_err(|error: WorkspaceError| error.to_string())?;
        self.place = Some((path.to_owned(), lock));
        Ok(found)
    }
}

/// Keeps other windows from writing the same workspace, until the file returned is closed.
fn lock(path: &Path) -> Result<File, String> {
    let refused = |error: WriteError| format!("{error}; runs of this session are not kept");
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|source| refused(WriteError::io(folder, source)))?;
    }
    let place = path.with_extension("lock");
    let file = File::options().create(true).append(true).open(&place);
    let file = file.map_err(|source| refused(WriteError::io(&place, source)))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(fs::TryLockError::WouldBlock) => Err(format!(
            "Another window keeps the run list '{}': runs of this one are not kept.",
            path.display()
        )),
        // Some network folders know no locks; one window at a time is then the user's care.
        Err(fs::TryLockError::Error(_)) => Ok(file),
    }
}
