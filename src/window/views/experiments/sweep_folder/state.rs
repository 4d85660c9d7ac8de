use std::{
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, Sender, channel},
};

use super::{
    table::SweepTable,
    watching::{FolderEvent, watch},
};
use crate::window::{
    job::{Job, Wake},
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
