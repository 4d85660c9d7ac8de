use std::path::Path;

use thiserror::Error;

use crate::{
    evaluation::{Run, SimulatedSettings, error_rows},
    export::{
        CheckpointFile, CheckpointFileError, NetworkFile, NetworkFileError, WriteError, atomic_write, write_errors,
        write_loss_curves,
    },
};

/// What can be written about a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ExportKind {
    /// The network with everything needed to use and reproduce it, as JSON.
    Network,
    /// The error table, as CSV.
    Errors,
    /// The loss curves, as CSV.
    LossCurves,
    /// The training as it stands, to go on from there.
    Checkpoint,
}

/// Why a file is not written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The network file.
    #[error(transparent)]
    Network(#[from] NetworkFileError),
    /// The checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointFileError),
    /// A table.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl ExportKind {
    /// In the order offered.
    pub const ALL: [Self; 4] = [Self::Network, Self::Errors, Self::LossCurves, Self::Checkpoint];

    /// The word on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Network => "Network…",
            Self::Errors => "Error table…",
            Self::LossCurves => "Loss curves…",
            Self::Checkpoint => "Save checkpoint…",
        }
    }

    /// What the file holds, in a word or two.
    pub fn file_kind(self) -> &'static str {
        match self {
            Self::Network => "network",
            Self::Errors => "error table",
            Self::LossCurves => "loss curves",
            Self::Checkpoint => "checkpoint",
        }
    }

    /// What the file is, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Network => {
                "Layers, scaling, array, geometry, training record and errors, as JSON; the terminal command decode reads it."
            }
            Self::Errors => "The table of errors, as CSV.",
            Self::LossCurves => "Training, validation and test error of every epoch, as CSV.",
            Self::Checkpoint => {
                "The training as it stands, while paused or at its end: opened here or in a terminal (train --checkpoint \
                 FILE --resume) it goes on with the same bits."
            }
        }
    }

    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Network => "json",
            Self::Errors | Self::LossCurves => "csv",
            Self::Checkpoint => "checkpoint",
        }
    }

    /// A name that tells the files of different runs apart.
    pub fn file_name(self, settings: &SimulatedSettings) -> String {
        let what = match self {
            Self::Network => "network",
            Self::Errors => "errors",
            Self::LossCurves => "loss",
            Self::Checkpoint => "training",
        };
        file_name(what, self.extension(), settings)
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written; nothing is left half-written.
    pub fn write(self, run: &Run, path: &Path) -> Result<(), ExportError> {
        match self {
            Self::Network => NetworkFile::from_run(run)?.save(path)?,
            Self::Errors => {
                let NetworkFile {
                    settings,
                    errors,
                    baselines,
                    ..
                } = NetworkFile::from_run(run)?;
                let rows = error_rows(&errors, &baselines, settings.published().as_ref());
                atomic_write(path, |writer| write_errors(&rows, writer))?;
            }
            Self::LossCurves => atomic_write(path, |writer| write_loss_curves(run.leader().history(), writer))?,
            Self::Checkpoint => CheckpointFile::from_run(run)?.save(path)?,
        }
        Ok(())
    }
}

/// A name that tells the files of different runs apart: what the file holds, and of which run.
pub fn file_name(what: &str, extension: &str, settings: &SimulatedSettings) -> String {
    let array = settings.source.sensor.scale.to_string().replace('×', "x");
    let (hidden, method) = (settings.hidden, settings.training.method.short_name());
    let starts = match settings.starts {
        1 => String::new(),
        starts => format!("-starts{starts}"),
    };
    format!(
        "{what}-{array}-h{hidden}-{method}{starts}-seed{}.{}",
        settings.seed, extension
    )
}
