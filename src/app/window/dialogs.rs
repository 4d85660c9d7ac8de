//! Native file dialogs, waited for on a thread of their own.

use std::{
    path::PathBuf,
    pin::Pin,
    sync::mpsc::{Receiver, Sender, channel},
    thread,
    time::{Duration, Instant},
};

use rfd::FileHandle;

use crate::app::{shared::FileTask, threads::Wake};

/// An answer sooner than this was no person's: the desktop has no dialog to show.
const NO_PERSON: Duration = Duration::from_millis(250);

/// What became of a question for a path.
#[derive(Clone, Debug)]
pub enum Answer {
    /// The user chose this file.
    Chosen(FileTask, PathBuf),
    /// The user thought better of it.
    Cancelled,
    /// There is no dialog here; ask in the window.
    NoDialog(FileTask),
}

/// Where questions for a path go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DialogKind {
    /// The desktop's own dialog.
    Native,
    /// None: the window asks itself. For tests, which have no desktop.
    None,
}

/// Questions under way.
#[derive(Debug)]
pub struct Dialogs {
    kind: DialogKind,
    outgoing: Sender<Answer>,
    answers: Receiver<Answer>,
}

impl Dialogs {
    /// No questions yet.
    pub fn new(kind: DialogKind) -> Self {
        let (outgoing, answers) = channel();
        Self {
            kind,
            outgoing,
            answers,
        }
    }

    /// Asks for the path of a file; `wake` is called when the answer is there. Must run on the window's thread, which
    /// some desktops require.
    pub fn ask(&self, task: FileTask, wake: Wake) {
        let send = self.outgoing.clone();
        let no_dialog = Answer::NoDialog(task.clone());
        if self.kind == DialogKind::None {
            // The receiver lives as long as `self`.
            let _ = send.send(no_dialog);
            return;
        }
        let suggestion = task.suggested_path();
        let mut dialog = rfd::AsyncFileDialog::new().set_title(format!("{} {}", task.verb(), task.words.kind));
        for extension in task.words.extensions {
            dialog = dialog.add_filter(extension.to_uppercase(), &[extension]);
        }
        if let Some(folder) = suggestion.parent() {
            dialog = dialog.set_directory(folder);
        }
        let asked = Instant::now();
        let choice: Pin<Box<dyn Future<Output = Option<FileHandle>> + Send>> = if task.is_read() {
            // The terminal gives checkpoints any name.
            Box::pin(dialog.add_filter("All files", &["*"]).pick_file())
        } else {
            if let Some(name) = suggestion.file_name() {
                dialog = dialog.set_file_name(name.to_string_lossy());
            }
            Box::pin(dialog.save_file())
        };
        let wait = move || {
            let answer = match pollster::block_on(choice) {
                Some(file) => Answer::Chosen(task, file.path().to_owned()),
                None if asked.elapsed() < NO_PERSON => Answer::NoDialog(task),
                None => Answer::Cancelled,
            };
            // The window may have closed meanwhile.
            let _ = send.send(answer);
            wake();
        };
        if thread::Builder::new()
            .name("file dialog".to_owned())
            .spawn(wait)
            .is_err()
        {
            let _ = self.outgoing.send(no_dialog);
        }
    }

    /// The next answer, if one has come.
    pub fn next_answer(&self) -> Option<Answer> {
        self.answers.try_recv().ok()
    }
}
