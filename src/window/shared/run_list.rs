//! The run list: every finished training is kept and survives a restart.
//!
//! A separate thread keeps the runs in a folder. It answers each request with the updated list, which wakes the window.
//! When the window closes, it waits for pending writes.
//!
//! The run list is changed only here: the displayed list at once, and the folder as soon as the thread gets to it.

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

use decoupler_files::export::{KeptRun, KeptRuns, NetworkFile, RunFolder};

use crate::window::{
    job::{Background, JobError, Wake, caught},
    shared::Notice,
};

/// Longest time that closing waits for the files.
const LONGEST_WRITE: Duration = Duration::from_secs(5);

/// Name of the thread.
const THREAD: &str = "run list";

/// Requests to the thread.
pub(super) enum RunsRequest {
    /// Keep the runs in this folder.
    Open(PathBuf),
    /// Take over the changes of other windows.
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
    /// Folder in which they are kept, if any.
    pub(super) path: Option<PathBuf>,
    /// Number of runs that could not be written.
    pub(super) unwritten: usize,
    /// Files that cannot be read or written.
    pub(super) problems: Vec<String>,
}

/// Event from the thread.
pub(super) enum RunsEvent {
    /// The run list after a request.
    Listed(Listed),
    /// The thread has ended, with the reason if it was not supposed to.
    Died(Option<JobError>),
}

/// The window's end of the thread.
#[derive(Debug)]
pub struct RunsWorker {
    requests: Option<Sender<RunsRequest>>,
    job: Background<RunsEvent>,
    /// Requests that were not answered yet.
    unanswered: Cell<usize>,
}

impl RunsWorker {
    /// Starts the thread. `wake` is called after each event.
    pub fn start(wake: Wake) -> Self {
        let (requests, incoming) = channel();
        let mut job = Background::new(THREAD, wake);
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

    /// Takes over the changes of other windows.
    pub fn look(&self) {
        self.ask(RunsRequest::Look);
    }

    /// Adds a finished training.
    pub fn keep(&self, file: NetworkFile) {
        self.ask(RunsRequest::Keep(Arc::new(file)));
    }

    pub(super) fn ask(&self, request: RunsRequest) {
        if let Some(requests) = &self.requests {
            // The receiver is gone only if the thread died, which is reported as its last event.
            if requests.send(request).is_ok() {
                self.unanswered.set(self.unanswered.get() + 1);
            }
        }
    }

    /// Returns the next event, if one has come.
    pub(super) fn next_event(&self) -> Option<RunsEvent> {
        let event = self.job.next_event()?;
        if let RunsEvent::Listed(_) = event {
            self.unanswered.set(self.unanswered.get().saturating_sub(1));
        }
        Some(event)
    }

    /// Returns true if the last list taken includes the effect of every request.
    pub(super) fn is_up_to_date(&self) -> bool {
        self.unanswered.get() == 0
    }
}

impl Drop for RunsWorker {
    fn drop(&mut self) {
        // The thread ends when all requests are done.
        self.requests = None;
        self.job.wait(LONGEST_WRITE);
    }
}

fn answer(request: RunsRequest, folder: &mut RunFolder) -> Listed {
    // The thread keeps the runs that could not be written, so it must survive.
    let answered = caught(THREAD, || {
        let mut problems = carry_out(request, folder);
        problems.extend(folder.load_used());
        problems
    });
    let problems = answered.unwrap_or_else(|error| vec![format!("{error}; the change is not kept")]);
    Listed {
        runs: folder.runs().clone(),
        path: folder.path().map(PathBuf::from),
        unwritten: folder.unwritten(),
        problems,
    }
}

/// Carries out a request; returns the problems.
fn carry_out(request: RunsRequest, folder: &mut RunFolder) -> Vec<String> {
    // Changes apply to the current contents of the folder.
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
    problems
}

fn failure<E: fmt::Display>(written: Result<(), E>) -> Option<String> {
    written.err().map(|error| format!("{error}; the change is not kept"))
}

/// The names of the two places.
pub const PLACES: [&str; 2] = ["A", "B"];

/// The finished trainings.
#[derive(Debug, Default)]
pub struct RunList {
    /// The runs, and which two are compared.
    pub workspace: KeptRuns,
    /// Folder in which runs are kept; `None` while they are not.
    pub path: Option<PathBuf>,
    /// Number of runs that exist only in memory, since they could not be written to the folder.
    pub unwritten: usize,
}

/// A run whose file is in memory.
#[derive(Clone, Copy, Debug)]
pub struct LoadedRun<'a> {
    /// [`KeptRun::id`].
    pub id: u64,
    /// Name given by the user.
    pub name: &'a str,
    /// Its file.
    pub file: &'a Arc<NetworkFile>,
}

impl<'a> LoadedRun<'a> {
    /// Returns the run, if its file is in memory.
    fn of(run: &'a KeptRun) -> Option<Self> {
        let KeptRun { id, name, file, .. } = run;
        file.as_ref().map(|file| Self { id: *id, name, file })
    }
}

impl RunList {
    /// Returns the run with this number.
    pub fn run(&self, id: u64) -> Option<&KeptRun> {
        self.workspace.runs.iter().find(|run| run.id == id)
    }

    /// Returns the run in one of the two places, once it is loaded.
    pub fn pinned(&self, place: usize) -> Option<LoadedRun<'_>> {
        self.run(self.workspace.pinned[place]?).and_then(LoadedRun::of)
    }

    /// Returns the newest run, once it is loaded.
    pub fn newest(&self) -> Option<LoadedRun<'_>> {
        self.workspace.runs.last().and_then(LoadedRun::of)
    }
}

impl RunList {
    /// Takes the list from the thread; returns a notice for the user, if any.
    pub fn take_events(&mut self, worker: &RunsWorker) -> Option<Notice> {
        let mut notice = None;
        while let Some(event) = worker.next_event() {
            match event {
                RunsEvent::Listed(Listed {
                    runs,
                    path,
                    unwritten,
                    problems,
                }) => {
                    (self.path, self.unwritten) = (path, unwritten);
                    // A list from before the last change would undo it: a run removed meanwhile would be back.
                    if worker.is_up_to_date() {
                        self.workspace = runs;
                    }
                    if !problems.is_empty() {
                        notice = Some(Notice::Failed(problems.join(". ")));
                    }
                }
                RunsEvent::Died(reason) => {
                    self.path = None;
                    let reason = reason.map(|error| format!(" ({error})")).unwrap_or_default();
                    let text = format!("New runs are no longer kept{reason}. Restart the program.");
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

#[cfg(test)]
mod tests {
    use std::{
        sync::{
            Arc,
            mpsc::{Receiver, channel},
        },
        time::Duration,
    };

    use decoupler_core::evaluation::{Run, RunSettings};
    use decoupler_files::export::NetworkFile;

    use super::*;

    fn small_run() -> NetworkFile {
        let mut settings = RunSettings {
            hidden: 2,
            ..RunSettings::default()
        };
        settings.simulation_mut().unwrap().sensor.scale = "4x4_2x12".parse().unwrap();
        (
            settings.simulation_mut().unwrap().samples,
            settings.simulation_mut().unwrap().test_samples,
        ) = (40, 8);
        settings.training.stopping.epochs = 2;
        let mut run = Run::prepare(settings).unwrap();
        while run.step().is_none() {}
        NetworkFile::from_run(&run, None).unwrap()
    }

    fn wait(woken: &Receiver<()>) {
        woken.recv_timeout(Duration::from_secs(60)).unwrap();
    }

    #[test]
    fn a_request_that_panics_is_reported_and_the_next_is_answered() {
        let (wake, woken) = channel();
        let worker = RunsWorker::start(Arc::new(move || wake.send(()).unwrap_or(())));
        let mut list = RunList::default();
        worker.keep(small_run());
        // There is no third place.
        worker.ask(RunsRequest::Pin(PLACES.len(), None));
        (0..2).for_each(|_| wait(&woken));
        let Some(Notice::Failed(reason)) = list.take_events(&worker) else {
            panic!("no failure")
        };
        assert!(
            reason.contains("an internal error stopped the thread 'run list'"),
            "{reason}"
        );
        assert_eq!(list.workspace.runs.len(), 1, "the run of this session is still there");
        worker.keep(small_run());
        wait(&woken);
        assert_eq!(list.take_events(&worker), None);
        assert_eq!(list.workspace.runs.len(), 2);
    }

    #[test]
    fn a_run_removed_or_renamed_is_not_brought_back_by_an_older_list() {
        let folder = tempfile::tempdir().unwrap();
        let (wake, woken) = channel();
        let worker = RunsWorker::start(Arc::new(move || wake.send(()).unwrap_or(())));
        let mut list = RunList::default();
        worker.open(folder.path().to_owned());
        for _ in 0..2 {
            worker.keep(small_run());
        }
        (0..3).for_each(|_| wait(&woken));
        assert!(list.take_events(&worker).is_none());
        let [first, second] = [0, 1].map(|place: usize| list.workspace.runs[place].id);
        // A list is on its way when the user removes one run and renames the other.
        worker.look();
        wait(&woken);
        list.remove(first, &worker);
        list.rename(second, "mine", &worker);
        assert!(list.take_events(&worker).is_none());
        let names = |list: &RunList| Vec::from_iter(list.workspace.runs.iter().map(|run| run.name.clone()));
        assert_eq!(names(&list), ["mine"]);
        (0..2).for_each(|_| wait(&woken));
        assert!(list.take_events(&worker).is_none());
        assert_eq!(names(&list), ["mine"]);
        assert!(list.path.is_some());
    }
}
