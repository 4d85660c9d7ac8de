//! Native file dialogs, waited for on a thread of their own.

use std::{
    path::PathBuf,
    pin::Pin,
    time::{Duration, Instant},
};

use rfd::FileHandle;

use super::Desktop;
use crate::window::{
    job::{Job, Wake},
    shared::FileTask,
};

/// An answer sooner than this was no person's: the desktop has no dialog to show. On a busy machine that takes a while to
/// be found out; a person who cancels as fast is asked in the window.
const NO_PERSON: Duration = Duration::from_secs(1);

/// Answer to a question for a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The user chose this file.
    Chosen(PathBuf),
    /// The user thought better of it.
    Cancelled,
    /// There is no dialog here; ask in the window.
    NoDialog,
}

/// Questions under way, each with the task that it was asked for.
#[derive(Debug)]
pub struct Dialogs {
    desktop: Desktop,
    asked: Vec<(FileTask, Job<Answer>)>,
}

impl Dialogs {
    /// No questions yet.
    pub fn new(desktop: Desktop) -> Self {
        Self {
            desktop,
            asked: Vec::new(),
        }
    }

    /// Asks for the path of a file; returns whether there is a dialog to ask with. `wake` is called when the answer is
    /// there. Must run on the window's thread, which some desktops require.
    pub fn ask(&mut self, task: &FileTask, wake: Wake) -> bool {
        if self.desktop == Desktop::None {
            return false;
        }
        let choice = choice(task);
        let asked = Instant::now();
        let mut job = Job::prompt("file dialog", wake);
        job.start(
            move |_| match pollster::block_on(choice) {
                Some(file) => Answer::Chosen(file.path().to_owned()),
                None if asked.elapsed() < NO_PERSON => Answer::NoDialog,
                None => Answer::Cancelled,
            },
            |answer| answer.unwrap_or(Answer::NoDialog),
        );
        self.asked.push((task.clone(), job));
        true
    }

    /// The next answer, if one has come, with the task that it was asked for.
    pub fn next_answer(&mut self) -> Option<(FileTask, Answer)> {
        let mut jobs = self.asked.iter().enumerate();
        let (number, answer) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (task, _) = self.asked.remove(number);
        Some((task, answer))
    }

    /// Returns true while an answer is still to come.
    pub fn is_asking(&self) -> bool {
        !self.asked.is_empty()
    }
}

/// Shows the dialog.
fn choice(task: &FileTask) -> Pin<Box<dyn Future<Output = Option<FileHandle>> + Send>> {
    let suggestion = task.suggested_path();
    let mut dialog = rfd::AsyncFileDialog::new().set_title(format!("{} {}", task.verb(), task.words.kind));
    if task.is_read() && task.words.extensions.len() > 1 {
        dialog = dialog.add_filter(task.words.kind, task.words.extensions);
    }
    for extension in task.words.extensions {
        dialog = dialog.add_filter(extension.to_uppercase(), &[extension]);
    }
    if let Some(folder) = suggestion.parent() {
        dialog = dialog.set_directory(folder);
    }
    if task.is_read() && task.words.extensions.is_empty() {
        Box::pin(dialog.pick_folder())
    } else if task.is_read() {
        // The terminal gives checkpoints any name.
        Box::pin(dialog.add_filter("All files", &["*"]).pick_file())
    } else {
        if let Some(name) = suggestion.file_name() {
            dialog = dialog.set_file_name(name.to_string_lossy());
        }
        Box::pin(dialog.save_file())
    }
}
