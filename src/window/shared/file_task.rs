use std::{
    fmt,
    path::{Path, PathBuf},
    sync::{Arc, mpsc::Sender},
};

use crate::window::training_worker::{RunId, TrainedRun};

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
    /// Content in a word or two.
    pub kind: &'static str,
    /// Content in a sentence.
    pub description: &'static str,
    /// Extensions that it may have, without the dot; the first unless the user says otherwise. None for a folder.
    pub extensions: &'static [&'static str],
}

impl FileWords {
    /// Returns the name of the file with the usual extension.
    pub fn file_name(&self, stem: &str) -> String {
        match self.extensions.first() {
            Some(extension) => format!("{stem}.{extension}"),
            None => stem.to_owned(),
        }
    }
}

/// Action on a file once its path is known.
#[derive(Clone, Debug)]
pub enum Purpose {
    /// Take up the training saved in it.
    Open,
    /// Tell its path to the view that asked for it.
    Choose(Sender<PathBuf>),
    /// Write it about this training, which the worker has.
    SaveTraining(RunId, ContentsOfRun),
    /// Write it.
    Save(Contents),
}

/// Writes a file and tells what was written, or says why not.
#[derive(Clone)]
pub struct Contents(Arc<Write>);

type Write = dyn Fn(&Path) -> Result<String, String> + Send + Sync;

impl Contents {
    /// The contents that `write` writes.
    pub fn new<X: ToString>(write: impl Fn(&Path) -> Result<(), X> + Send + Sync + 'static) -> Self {
        Self::telling(move |path| {
            let saved = || format!("Saved {}", path.display());
            write(path).map(|()| saved()).map_err(|error| error.to_string())
        })
    }

    /// The contents that `write` writes, which returns the message for the user then.
    pub fn telling(write: impl Fn(&Path) -> Result<String, String> + Send + Sync + 'static) -> Self {
        Self(Arc::new(write))
    }

    /// Writes the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<String, String> {
        (self.0)(path)
    }
}

impl fmt::Debug for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Contents")
    }
}

/// Takes from a training what is to be written about it, or says why there is nothing.
#[derive(Clone)]
pub struct ContentsOfRun(Arc<Take>);

type Take = dyn Fn(&TrainedRun) -> Result<Contents, String> + Send + Sync;

impl ContentsOfRun {
    /// Contents of `run`.
    ///
    /// # Errors
    /// If it has none.
    pub fn take(&self, run: &TrainedRun) -> Result<Contents, String> {
        (self.0)(run)
    }
}

impl fmt::Debug for ContentsOfRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ContentsOfRun")
    }
}

impl FileTask {
    /// The file of these contents, named after `stem`.
    pub fn save(words: FileWords, stem: &str, contents: Contents) -> Self {
        Self {
            words,
            suggestion: words.file_name(stem),
            purpose: Purpose::Save(contents),
        }
    }

    /// The file about the training `run`, named after `stem`. `take` runs on the worker's thread and leaves the writing to what it returns.
    pub fn save_run(
        words: FileWords,
        stem: &str,
        run: RunId,
        take: impl Fn(&TrainedRun) -> Result<Contents, String> + Send + Sync + 'static,
    ) -> Self {
        Self {
            words,
            suggestion: words.file_name(stem),
            purpose: Purpose::SaveTraining(run, ContentsOfRun(Arc::new(take))),
        }
    }

    /// Returns true if `other` asks for the same file.
    pub fn is_same_file(&self, other: &Self) -> bool {
        (self.words, &self.suggestion) == (other.words, &other.suggestion)
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
