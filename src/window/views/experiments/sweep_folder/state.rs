use std::{
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    time::{Duration, Instant},
};

use decoupler_files::export::{MergedSweep, SweepFiles};

use super::table::SweepTable;
use crate::window::{
    job::{Job, Report, Wake},
    shared::{FileTask, FileWords, Purpose},
    widgets::SortBy,
};

/// The folder of a sweep.
const FOLDER: FileWords = FileWords {
    kind: "sweep folder",
    description: "A folder that decoupler sweep fills. Its finished trials are shown, and new ones as they come.",
    extensions: &[],
};

/// The current folder, if any, and the dialogs that ask for one.
#[derive(Debug)]
pub(in crate::window::views::experiments) struct SweepFolder {
    pub(super) open: Option<OpenFolder>,
    job: Job<FolderEvent>,
    choices: Sender<PathBuf>,
    chosen: Receiver<PathBuf>,
}

/// A displayed folder.
#[derive(Debug)]
pub(in crate::window::views::experiments) struct OpenFolder {
    pub(super) path: PathBuf,
    /// Its table, or why there is none; `None` until it is read.
    pub(super) table: Option<Result<Box<SweepTable>, String>>,
    pub(super) sort: SortBy,
    /// Dropped, it ends the watch.
    _watched: Sender<()>,
}

impl SweepFolder {
    /// No folder. `wake` is called when there is events of one.
    pub(in crate::window::views::experiments) fn new(wake: Wake) -> Self {
        let (choices, chosen) = channel();
        Self {
            open: None,
            job: Job::new("sweep folder", wake),
            choices,
            chosen,
        }
    }

    /// Asks for a folder.
    pub(in crate::window::views::experiments) fn choose(&self) -> FileTask {
        FileTask {
            words: FOLDER,
            suggestion: String::new(),
            purpose: Purpose::Choose(self.choices.clone()),
        }
    }

    /// The current folder.
    pub(in crate::window::views::experiments) fn shown(&self) -> Option<&OpenFolder> {
        self.open.as_ref()
    }

    pub(in crate::window::views::experiments) fn close(&mut self) {
        self.open = None;
        self.job.abandon();
    }

    pub(in crate::window::views::experiments) fn take_events(&mut self) {
        while let Ok(path) = self.chosen.try_recv() {
            self.show(path);
        }
        while let Some(event) = self.job.next_event() {
            let table = match event {
                FolderEvent::Read(table) => table,
                FolderEvent::Ended(Err(reason)) => Err(reason),
                FolderEvent::Ended(Ok(())) => continue,
            };
            if let Some(open) = &mut self.open {
                open.table = Some(table);
            }
        }
    }

    fn show(&mut self, path: PathBuf) {
        let (watched, open) = channel();
        let of_job = path.clone();
        self.open = Some(OpenFolder {
            path,
            table: None,
            sort: SortBy::default(),
            _watched: watched,
        });
        self.job.start(
            move |report| watch(&of_job, &open, report),
            |ended| FolderEvent::Ended(ended.map_err(|error| error.to_string())),
        );
    }
}

impl OpenFolder {
    /// Name of the folder.
    pub(in crate::window::views::experiments) fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or(Path::new("").as_os_str());
        name.to_string_lossy().into_owned()
    }

    /// Trials finished and planned, once they are read.
    pub(in crate::window::views::experiments) fn trials(&self) -> Option<(usize, usize)> {
        let table = self.table.as_ref()?.as_ref().ok()?;
        Some((table.finished(), table.trials))
    }
}

/// Shortest time between two looks at the folder.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);
/// Share of the time that reading may take: a look at a large folder is followed by this much longer a rest.
const REST: u32 = 10;

/// Events of a folder.
#[derive(Debug)]
pub(in crate::window::views::experiments) enum FolderEvent {
    /// It has changed, or why it cannot be read.
    Read(Result<Box<SweepTable>, String>),
    /// No one looks at it any more, or why that ended.
    Ended(Result<(), String>),
}

/// Reads the folder at `path` whenever its files change, until the other end of `open` is gone.
pub(super) fn watch(path: &Path, open: &Receiver<()>, report: &Report<FolderEvent>) {
    let mut before = None;
    loop {
        let begun = Instant::now();
        let files = SweepFiles::list(path).map_err(|error| error.to_string());
        if before.as_ref() != Some(&files) {
            let table = match &files {
                Ok(_) => read(path),
                Err(error) => Err(error.clone()),
            };
            // Of tables that no one has looked at, the newest is enough.
            report.progress(FolderEvent::Read(table), |_, _| ());
            before = Some(files);
        }
        match open.recv_timeout(BETWEEN_LOOKS.max(REST * begun.elapsed())) {
            Err(RecvTimeoutError::Timeout) if !report.is_cancelled() => {}
            _ => return,
        }
    }
}

fn read(path: &Path) -> Result<Box<SweepTable>, String> {
    let merged = MergedSweep::read(&[PathBuf::from(path)]).map_err(|error| error.to_string())?;
    Ok(Box::new(SweepTable::of(&merged)))
}
