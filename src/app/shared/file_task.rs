use std::{
    fmt,
    path::{Path, PathBuf},
    sync::{Arc, mpsc::Sender},
};

use crate::app::training_worker::{RunId, WriteRun};

/// A file whose path is to be asked for. It carries what is to be written, as it is when it is asked for: what the user
/// does until the path is known changes nothing.
#[derive(Clone, Debug)]
pub struct FileTask {
    /// Words that describe the file.
    pub words: FileWords,
    /// Its name, unless the user says otherwise.
    pub suggestion: String,
    /// Read or write, and of which content.
    pub purpose: Purpose,
}

/// Words that describe a kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileWords {
    /// The words on its button.
    pub name: &'static str,
    /// Content in a word or two.
    pub kind: &'static str,
    /// Content in a sentence.
    pub description: &'static str,
    /// Extensions that it may have, without the dot; the first unless the user says otherwise.
    pub extensions: &'static [&'static str],
}

/// Action on a file once its path is known.
#[derive(Clone, Debug)]
pub enum Purpose {
    /// Take up the training saved in it.
    Open,
    /// Tell its path to the view that asked for it.
    Choose(Sender<PathBuf>),
    /// Write it about this training, which the worker has.
    SaveTraining(RunId, WriteRun),
    /// Write it.
    Save(Contents),
}

/// Writes a file, or says why not.
#[derive(Clone)]
pub struct Contents(Arc<Write>);

type Write = dyn Fn(&Path) -> Result<(), String> + Send + Sync;

impl Contents {
    /// Writes the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), String> {
        (self.0)(path)
    }
}

impl fmt::Debug for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Contents")
    }
}

impl FileTask {
    /// The file that `write` writes.
    pub fn save<X: ToString>(
        words: FileWords,
        suggestion: String,
        write: impl Fn(&Path) -> Result<(), X> + Send + Sync + 'static,
    ) -> Self {
        let write = move |path: &Path| write(path).map_err(|error| error.to_string());
        Self {
            words,
            suggestion,
            purpose: Purpose::Save(Contents(Arc::new(write))),
        }
    }

    /// Returns true if the file is read, not written.
    pub fn is_read(&self) -> bool {
        matches!(self.purpose, Purpose::Open | Purpose::Choose(_))
    }

    /// The word for what is done with it.
    pub fn verb(&self) -> &'static str {
        if self.is_read() { "Open" } else { "Save" }
    }

    /// Returns the path that is suggested to the user.
    pub fn suggested_path(&self) -> PathBuf {
        std::env::current_dir().unwrap_or_default().join(&self.suggestion)
    }
}
