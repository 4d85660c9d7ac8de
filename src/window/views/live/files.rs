//! Files of the Live view, as the user is asked for them.

use std::{fs::File, io, path::Path, path::PathBuf, sync::mpsc::Sender};

use super::engine::Recorded;
use crate::window::shared::{Contents, FileTask, FileWords, Purpose};
use decoupler_core::live::ZeroGains;
use decoupler_files::export::{WriteError, atomic_write};

const NETWORK: FileWords = FileWords {
    kind: "network",
    description: "A network saved by the Train view or by train --out in a terminal.",
    extensions: &["json"],
};

const FRAMES: FileWords = FileWords {
    kind: "frames",
    description: "A recording made here, or lines of resistances in ohm as the terminal command decode reads them.",
    extensions: &["csv"],
};

const RECORDING: FileWords = FileWords {
    kind: "recording",
    description: "Every frame with its time, as CSV: a line for each row-wire. It can be replayed here, and the \
                  terminal command decode reads it.",
    extensions: &["csv"],
};

const ZERO: FileWords = FileWords {
    kind: "unloaded state",
    description: "Gain of every reading in the unloaded state, and the rows that were in contact, as JSON.",
    extensions: &["json"],
};

/// Words of a file about frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiveFile {
    /// A network to decode with.
    Network,
    /// Frames to replay.
    Frames,
}

impl LiveFile {
    /// Name of its button.
    pub fn button(self) -> &'static str {
        match self {
            Self::Network => "Open network file…",
            Self::Frames => "Choose file…",
        }
    }

    /// Words that describe it.
    pub fn words(self) -> FileWords {
        match self {
            Self::Network => NETWORK,
            Self::Frames => FRAMES,
        }
    }

    /// Asks for its path, which `chosen` is told.
    pub fn choose(self, chosen: Sender<PathBuf>) -> FileTask {
        let suggestion = match self {
            Self::Network => "network.json",
            Self::Frames => "recording.csv",
        };
        FileTask {
            words: self.words(),
            suggestion: suggestion.to_owned(),
            purpose: Purpose::Choose(chosen),
        }
    }
}

/// Saves a copy of a recording.
pub fn save_recording(recorded: &Recorded) -> FileTask {
    let from = recorded.path.clone();
    let write = move |path: &Path| -> Result<(), WriteError> {
        // The copy may be asked for where the recording itself is.
        let is_same = path
            .canonicalize()
            .ok()
            .is_some_and(|path| from.canonicalize().ok() == Some(path));
        if is_same {
            return Ok(());
        }
        atomic_write(path, |file| io::copy(&mut File::open(&from)?, file).map(drop))
    };
    FileTask::save(RECORDING, "recording", Contents::new(write))
}

/// Saves the unloaded state.
pub fn save_zero(zero: &ZeroGains) -> FileTask {
    let zero = zero.clone();
    let write = move |path: &Path| {
        atomic_write(path, |file| {
            serde_json::to_writer_pretty(file, &zero).map_err(Into::into)
        })
    };
    FileTask::save(ZERO, "zero", Contents::new(write))
}
