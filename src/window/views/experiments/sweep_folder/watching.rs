use std::{
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, RecvTimeoutError},
    time::{Duration, Instant},
};

use super::table::SweepTable;
use crate::window::job::Report;
use decoupler_files::export::{MergedSweep, SweepFiles};

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
