//! The thread that keeps networks from session to session, each as a network file of its own in a folder.

use std::{
    collections::BTreeSet,
    fs, io,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use crate::{
    app::job::{Job, Report, Wake},
    export::MeasuredNetworkFile,
};

/// Longest time that closing waits for the files.
const LONGEST_WRITE: Duration = Duration::from_secs(5);

enum Request {
    Open(PathBuf),
    Keep(Arc<MeasuredNetworkFile>),
    Remove(Arc<MeasuredNetworkFile>),
}

/// News from the thread.
#[derive(Debug)]
pub(super) enum KeepingEvent {
    /// A network was found in the folder.
    Found(PathBuf, Arc<MeasuredNetworkFile>),
    /// A network that was to be kept is there now.
    Kept(PathBuf, Arc<MeasuredNetworkFile>),
    /// A file cannot be read, written or removed.
    Failed(String),
    /// The thread has ended.
    Ended,
}

/// The view's end of the thread. Dropped, it waits for what is still to be written.
#[derive(Debug)]
pub(super) struct Keeping {
    requests: Option<Sender<Request>>,
    job: Job<KeepingEvent>,
    /// Folder in which networks are kept, if they are.
    pub(super) folder: Option<PathBuf>,
}

impl Keeping {
    pub(super) fn new(wake: Wake) -> Self {
        let (requests, incoming) = channel();
        let mut job = Job::new("own data runs", wake);
        job.start(move |report| answer(&incoming, report), |_| KeepingEvent::Ended);
        Self {
            requests: Some(requests),
            job,
            folder: None,
        }
    }

    /// Keeps networks in this folder from now on, and tells of those in it.
    pub(super) fn open(&mut self, folder: PathBuf) {
        self.ask(Request::Open(folder.clone()));
        self.folder = Some(folder);
    }

    /// Keeps a network, if networks are kept.
    pub(super) fn keep(&self, file: &Arc<MeasuredNetworkFile>) {
        self.ask(Request::Keep(Arc::clone(file)));
    }

    /// Removes the file of a network that was found or is to be kept, for good.
    pub(super) fn remove(&self, file: Arc<MeasuredNetworkFile>) {
        self.ask(Request::Remove(file));
    }

    fn ask(&self, request: Request) {
        if let Some(requests) = &self.requests {
            // A thread that has ended said so.
            let _ = requests.send(request);
        }
    }

    /// The next event, if one has come.
    pub(super) fn next_event(&self) -> Option<KeepingEvent> {
        self.job.next_event()
    }
}

impl Drop for Keeping {
    fn drop(&mut self) {
        // The thread ends when everything asked for is done.
        self.requests = None;
        self.job.wait(LONGEST_WRITE);
    }
}

fn answer(requests: &Receiver<Request>, report: &Report<KeepingEvent>) {
    let mut folder = None;
    // A network may be removed before the view knows its path.
    let mut kept: Vec<(PathBuf, Arc<MeasuredNetworkFile>)> = Vec::new();
    for request in requests {
        let done = match request {
            Request::Open(path) => {
                let listed = list(&path, &mut kept, report);
                folder = Some(path);
                listed
            }
            Request::Keep(file) => folder.as_deref().map_or(Ok(()), |folder| {
                let path = keep(folder, &file)?;
                kept.push((path.clone(), Arc::clone(&file)));
                report.send(KeepingEvent::Kept(path, file));
                Ok(())
            }),
            Request::Remove(file) => {
                kept.extract_if(.., |(_, kept)| Arc::ptr_eq(kept, &file))
                    .try_for_each(|(path, _)| {
                        fs::remove_file(&path).map_err(|error| format!("cannot remove '{}': {error}", path.display()))
                    })
            }
        };
        if let Err(reason) = done {
            report.send(KeepingEvent::Failed(reason));
        }
    }
}

/// Tells of the networks in the folder, the oldest first.
fn list(
    folder: &Path,
    kept: &mut Vec<(PathBuf, Arc<MeasuredNetworkFile>)>,
    report: &Report<KeepingEvent>,
) -> Result<(), String> {
    let names = match fs::read_dir(folder) {
        // Nothing was kept yet.
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        found => found.and_then(Iterator::collect::<io::Result<Vec<_>>>),
    };
    let names = names.map_err(|error| format!("cannot read the list of networks '{}': {error}", folder.display()))?;
    let is_run = |path: &PathBuf| number(path).is_some();
    let paths: BTreeSet<PathBuf> = names.into_iter().map(|entry| entry.path()).filter(is_run).collect();
    for path in paths {
        match MeasuredNetworkFile::load(&path) {
            Ok(file) => {
                let file = Arc::new(file);
                kept.push((path.clone(), Arc::clone(&file)));
                report.send(KeepingEvent::Found(path, file));
            }
            Err(error) => report.send(KeepingEvent::Failed(format!(
                "a network is left out of the list: {error}"
            ))),
        }
    }
    Ok(())
}

/// Writes a network under a name that no other has.
fn keep(folder: &Path, file: &MeasuredNetworkFile) -> Result<PathBuf, String> {
    fs::create_dir_all(folder)
        .map_err(|error| format!("the network is not kept: cannot make '{}': {error}", folder.display()))?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let mut number = now.as_micros();
    let path = |number| folder.join(format!("run-{number}.json"));
    while path(number).exists() {
        number += 1;
    }
    let path = path(number);
    match file.save(&path) {
        Ok(()) => Ok(path),
        Err(error) => Err(format!("the network is not kept: {error}")),
    }
}

/// Number in the name of the file of a network: microseconds from 1970 to its end.
fn number(path: &Path) -> Option<u128> {
    let name = path.file_name()?.to_str()?;
    name.strip_prefix("run-")?.strip_suffix(".json")?.parse().ok()
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::{
        app::views::own_data::{model::Trained, runs::Runs},
        dataset::Seed,
        evaluation::{Measured, Run, RunSettings},
        import::{Plan, Recipe},
        scene::RowModel,
    };

    fn network(folder: &Path) -> Arc<MeasuredNetworkFile> {
        let mut text = "u,x\n".to_owned();
        for row in 0..40 {
            writeln!(text, "{row},{}", (row * 7) % 11).unwrap();
        }
        let data = folder.join("press.csv");
        fs::write(&data, text).unwrap();
        let names = |name: &str| vec![name.to_owned()];
        let import = Recipe {
            data,
            inputs: names("u"),
            targets: names("x"),
            ..Recipe::default()
        };
        let plan = Plan {
            import,
            ..Plan::default()
        };
        let watch = &mut |_| std::ops::ControlFlow::Continue(());
        let sets = plan.sets(Path::new(""), Seed::default(), watch).unwrap();
        let (inputs, targets) = (sets.recording.inputs.clone(), sets.recording.targets.clone());
        let mut settings = RunSettings::from(Measured { rows: RowModel::Shared });
        settings.training.stopping.epochs = 1;
        let mut run = Run::on_sets(settings, sets.split, sets.test).unwrap();
        while run.step().is_none() {}
        Arc::new(MeasuredNetworkFile::from_run(&run, plan, (&inputs, &targets)).unwrap())
    }

    #[test]
    fn a_network_removed_while_it_is_being_written_stays_removed() {
        let folder = tempfile::tempdir().unwrap();
        let kept = folder.path().join("own-data");
        let file = network(folder.path());
        let (wake, woken) = channel();
        let mut keeping = Keeping::new(Arc::new(move || wake.send(()).unwrap_or(())));
        keeping.open(kept.clone());
        let mut runs = Runs::default();
        runs.add(&Trained::of_file(Arc::clone(&file)));
        runs.marked = Some(0);
        // The view removes it before it has heard that the file is there.
        keeping.keep(&file);
        keeping.remove(runs.remove_marked().unwrap());
        woken.recv_timeout(Duration::from_secs(60)).unwrap();
        let Some(KeepingEvent::Kept(path, told)) = keeping.next_event() else {
            panic!("the file was written first")
        };
        runs.note_kept(path, &told);
        assert!(runs.runs.is_empty());
        // Dropping waits for what was asked for.
        drop(keeping);
        assert_eq!(fs::read_dir(&kept).unwrap().count(), 0);
    }

    #[test]
    fn a_network_found_in_the_folder_is_removed_from_it() {
        let folder = tempfile::tempdir().unwrap();
        let kept = folder.path().join("own-data");
        let file = network(folder.path());
        super::keep(&kept, &file).unwrap();
        let (wake, woken) = channel();
        let mut keeping = Keeping::new(Arc::new(move || wake.send(()).unwrap_or(())));
        keeping.open(kept.clone());
        woken.recv_timeout(Duration::from_secs(60)).unwrap();
        let mut runs = Runs::default();
        // The same was opened by hand before the folder was listed.
        runs.add(&Trained::of_file(file));
        let Some(KeepingEvent::Found(path, found)) = keeping.next_event() else {
            panic!("the file is there")
        };
        runs.note_found(path, found);
        assert_eq!(runs.runs.len(), 1);
        runs.marked = Some(0);
        keeping.remove(runs.remove_marked().unwrap());
        drop(keeping);
        assert_eq!(fs::read_dir(&kept).unwrap().count(), 0);
    }

    #[test]
    fn only_files_of_runs_have_a_number() {
        for (name, expected) in [
            ("run-12.json", Some(12)),
            ("run-.json", None),
            ("run-x.json", None),
            ("run-12.name.json", None),
            ("pinned.json", None),
        ] {
            assert_eq!(number(Path::new(name)), expected, "{name}");
        }
    }
}
