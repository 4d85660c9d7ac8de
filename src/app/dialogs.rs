//! Native file dialogs, waited for on a thread of their own.

use std::{
    path::PathBuf,
    sync::mpsc::{Receiver, Sender, channel},
    thread,
    time::{Duration, Instant},
};

use super::file_kind::FileKind;

/// An answer sooner than this was no person's: the desktop has no dialog to show.
const NO_PERSON: Duration = Duration::from_millis(250);

/// What became of a question for a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The user chose this file.
    Chosen(FileKind, PathBuf),
    /// The user thought better of it.
    Cancelled,
    /// There is no dialog here; ask in the window.
    NoDialog(FileKind),
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

    /// Asks where to write a file; `wake` is called when the answer is there. Must run on the window's thread, which
    /// some desktops require.
    pub fn ask(&self, kind: FileKind, suggestion: &std::path::Path, wake: impl FnOnce() + Send + 'static) {
        let send = self.outgoing.clone();
        let no_dialog = Answer::NoDialog(kind);
        if self.kind == DialogKind::None {
            // The receiver lives as long as `self`.
            let _ = send.send(no_dialog);
            return;
        }
        let mut dialog = rfd::AsyncFileDialog::new()
            .set_title(format!("Save {}", kind.file_kind()))
            .add_filter(kind.extension().to_uppercase(), &[kind.extension()]);
        if let Some(name) = suggestion.file_name() {
            dialog = dialog.set_file_name(name.to_string_lossy());
        }
        if let Some(folder) = suggestion.parent() {
            dialog = dialog.set_directory(folder);
        }
        let asked = Instant::now();
        let choice = dialog.save_file();
        let wait = move || {
            let answer = match pollster::block_on(choice) {
                Some(file) => Answer::Chosen(kind, file.path().to_owned()),
                None if asked.elapsed() < NO_PERSON => Answer::NoDialog(kind),
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
