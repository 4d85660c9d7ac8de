//! Native file dialogs, waited for on a thread of their own.

use std::{
    path::{Path, PathBuf},
    pin::Pin,
    time::{Duration, Instant},
};

use rfd::FileHandle;

use super::{
    file_task::FileTask,
    job::{Job, Wake},
};
use crate::export::figures::PictureFormat;

/// An answer sooner than this was no person's: the desktop has no dialog to show.
const NO_PERSON: Duration = Duration::from_millis(250);

/// What became of a question for a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The user chose this file.
    Chosen(PathBuf),
    /// The user thought better of it.
    Cancelled,
    /// There is no dialog here; ask in the window.
    NoDialog,
}

/// Where questions for a path go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DialogKind {
    /// The desktop's own dialog.
    Native,
    /// None: the window asks itself. For tests, which have no desktop.
    None,
}

/// Questions under way, each with the task that it was asked for.
#[derive(Debug)]
pub struct Dialogs {
    kind: DialogKind,
    asked: Vec<(FileTask, Job<Answer>)>,
}

impl Dialogs {
    /// No questions yet.
    pub fn new(kind: DialogKind) -> Self {
        Self {
            kind,
            asked: Vec::new(),
        }
    }

    /// Asks for the path of a file; returns whether there is a dialog to ask with. `wake` is called when the answer is
    /// there. Must run on the window's thread, which some desktops require.
    pub fn ask(&mut self, task: FileTask, suggestion: &Path, wake: Wake) -> bool {
        if self.kind == DialogKind::None {
            return false;
        }
        let choice = choice(task, suggestion);
        let asked = Instant::now();
        let mut job = Job::new("file dialog", wake);
        job.start(
            move |_| match pollster::block_on(choice) {
                Some(file) => Answer::Chosen(file.path().to_owned()),
                None if asked.elapsed() < NO_PERSON => Answer::NoDialog,
                None => Answer::Cancelled,
            },
            |answer| answer.unwrap_or(Answer::NoDialog),
        );
        self.asked.push((task, job));
        true
    }

    /// The next answer, if one has come, with the task that it was asked for.
    pub fn next_answer(&mut self) -> Option<(FileTask, Answer)> {
        let mut jobs = self.asked.iter().enumerate();
        let (number, answer) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (task, _) = self.asked.remove(number);
        Some((task, answer))
    }

    /// Whether an answer is still to come.
    pub fn is_asking(&self) -> bool {
        !self.asked.is_empty()
    }
}

/// Shows the dialog.
fn choice(task: FileTask, suggestion: &Path) -> Pin<Box<dyn Future<Output = Option<FileHandle>> + Send>> {
    let extension = task.extension();
    let mut dialog = rfd::AsyncFileDialog::new()
        .set_title(format!("{} {}", task.verb(), task.file_kind()))
        .add_filter(extension.to_uppercase(), &[extension]);
    if let Some(folder) = suggestion.parent() {
        dialog = dialog.set_directory(folder);
    }
    if let FileTask::SavePicture(_) = task {
        dialog = dialog.add_filter("SVG", &[PictureFormat::Svg.extension()]);
    }
    match task {
        FileTask::Save(_) | FileTask::SaveExperiment(..) | FileTask::SaveTrade(_) | FileTask::SavePicture(_) => {
            if let Some(name) = suggestion.file_name() {
                dialog = dialog.set_file_name(name.to_string_lossy());
            }
            Box::pin(dialog.save_file())
        }
        // The terminal gives checkpoints any name.
        FileTask::OpenCheckpoint => Box::pin(dialog.add_filter("All files", &["*"]).pick_file()),
    }
}
