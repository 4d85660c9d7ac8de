//! The run list: every finished training is kept and survives a restart.
//!
//! A separate thread keeps the runs in a folder. It answers each request with the updated list, which wakes the window.
//! When the window closes, it waits for pending writes.
//!
//! The run list is changed only there: the displayed list is what the thread answered last.

use std::{
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
    job::{Background, JobError, Jobs, caught},
    shared::Notice,
};

/// Longest time that closing waits for the files.
const LONGEST_WRITE: Duration = Duration::from_secs(5);

/// Name of the thread.
const THREAD: &str = "run list";

/// Requests to the thread.
#[derive(Clone, Debug)]
pub enum RunsRequest {
    /// Keep the runs in this folder.
    Open(PathBuf),
    /// Take over the changes of other windows.
    Look,
    /// Add a finished training.
    Keep(Box<NetworkFile>),
    /// Give a run another name, unless that is empty.
    Rename(u64, String),
    /// Show this run in one of the two places, or nothing.
    Pin(usize, Option<u64>),
    /// Remove a run for good.
    Remove(u64),
}

/// The window's end of the thread.
#[derive(Debug)]
pub struct RunsWorker {
    requests: Option<Sender<RunsRequest>>,
    job: Background<Listed>,
}

/// The run list after a request and the problems with files, or the reason why the thread has ended.
type Listed = Result<(RunList, Vec<String>), Option<JobError>>;

impl RunsWorker {
    /// Starts the thread.
    pub fn start(jobs: &Jobs) -> Self {
        let (requests, incoming) = channel();
        let mut job = Background::new(THREAD, jobs);
        job.start(
            move |report| {
                let mut folder = RunFolder::default();
                while let Ok(request) = report.waiting(|| incoming.recv()) {
                    report.send(Ok(answer(request, &mut folder)));
                }
            },
            |ended| Err(ended.err()),
        );
        Self {
            requests: Some(requests),
            job,
        }
    }

    /// Sends a request.
    pub fn ask(&self, request: RunsRequest) {
        if let Some(requests) = &self.requests {
            // The receiver is gone only if the thread died, which is reported as its last event.
            let _ = requests.send(request);
        }
    }
}

impl Drop for RunsWorker {
    fn drop(&mut self) {
        // The thread ends when all requests are done.
        self.requests = None;
        self.job.wait(LONGEST_WRITE);
    }
}

fn answer(request: RunsRequest, folder: &mut RunFolder) -> (RunList, Vec<String>) {
    // The thread keeps the runs that could not be written, so it must survive.
    let answered = caught(THREAD, || {
        // Changes apply to the current contents of the folder.
        let mut problems = folder.look();
        problems.extend(carry_out(request, folder).err());
        problems.extend(folder.load_used());
        problems
    });
    let problems = answered.unwrap_or_else(|error| vec![format!("{error}; the change is not kept")]);
    let list = RunList {
        workspace: folder.runs().clone(),
        path: folder.path().map(PathBuf::from),
        unwritten: folder.unwritten(),
    };
    (list, problems)
}

/// Carries out a request, or returns the problem.
fn carry_out(request: RunsRequest, folder: &mut RunFolder) -> Result<(), String> {
    let unkept = |error: &dyn fmt::Display| format!("{error}; the change is not kept");
    match request {
        RunsRequest::Open(path) => {
            let opened = RunFolder::open(&path);
            let (opened, found) = opened.map_err(|error| format!("{error}; runs of this session are not kept"))?;
            *folder = opened;
            if found.is_empty() {
                Ok(())
            } else {
                Err(found.join(". "))
            }
        }
        RunsRequest::Keep(file) => folder.keep(Arc::from(file)).map_err(|error| unkept(&error)),
        RunsRequest::Rename(id, name) if !name.trim().is_empty() => {
            folder.rename(id, name.trim()).map_err(|error| unkept(&error))
        }
        RunsRequest::Look | RunsRequest::Rename(..) => Ok(()),
        RunsRequest::Pin(place, id) => {
            let mut pinned = folder.runs().pinned;
            pinned[place] = id;
            folder.pin(pinned).map_err(|error| unkept(&error))
        }
        RunsRequest::Remove(id) => folder.remove(id).map_err(|error| unkept(&error)),
    }
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

    /// Takes the list from the thread; returns a notice for the user, if any.
    pub fn take_events(&mut self, worker: &RunsWorker) -> Option<Notice> {
        let mut notice = None;
        while let Some(listed) = worker.job.next_event() {
            match listed {
                Ok((list, problems)) => {
                    *self = list;
                    if !problems.is_empty() {
                        notice = Some(Notice::Failed(problems.join(". ")));
                    }
                }
                Err(reason) => {
                    self.path = None;
                    let reason = reason.map(|error| format!(" ({error})")).unwrap_or_default();
                    let text = format!("New runs are no longer kept{reason}. Restart the program.");
                    notice = Some(Notice::Failed(text));
                }
            }
        }
        notice
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
        woken.recv_timeout(Duration::from_secs(600)).unwrap();
    }

    #[test]
    fn a_request_that_panics_is_reported_and_the_next_is_answered() {
        let (wake, woken) = channel();
        let worker = RunsWorker::start(&Jobs::new(Arc::new(move || wake.send(()).unwrap_or(()))));
        let mut list = RunList::default();
        worker.ask(RunsRequest::Keep(Box::new(small_run())));
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
        worker.ask(RunsRequest::Keep(Box::new(small_run())));
        wait(&woken);
        assert_eq!(list.take_events(&worker), None);
        assert_eq!(list.workspace.runs.len(), 2);
    }
}
