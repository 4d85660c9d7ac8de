//! Small trainings.

use std::path::PathBuf;

use decoupler_core::{
    dataset::{Seed, Simulation},
    evaluation::{Run, RunSettings},
    job::Job,
    sensor::SensorModel,
};
use decoupler_files::export::{CheckpointFile, NetworkFile};
use tempfile::TempDir;

pub(crate) fn settings(array: &str, hidden: usize, epochs: usize) -> RunSettings {
    let mut settings = RunSettings {
        source: Simulation {
            sensor: SensorModel::new(array.parse().unwrap()),
            samples: 40,
            validation_samples: 8,
            test_samples: 8,
            ..Simulation::default()
        }
        .into(),
        hidden,
        seed: Seed(u64::MAX),
        ..RunSettings::default()
    };
    settings.training.stopping.epochs = epochs;
    settings
}

/// A run after this many epochs, or at its end.
pub(crate) fn stepped(settings: RunSettings, epochs: usize) -> Run {
    let mut run = Run::prepare(settings).unwrap();
    for _ in 0..epochs {
        run.step();
    }
    run
}

pub(crate) fn network(array: &str, hidden: usize, epochs: usize) -> NetworkFile {
    let run = stepped(settings(array, hidden, epochs), epochs);
    NetworkFile::from_run(&run, None).unwrap()
}

/// The run of a checkpoint that is read back.
pub(crate) fn resumed(file: CheckpointFile) -> Run {
    file.resume(&Job::UNINTERRUPTED, &mut |_| ()).unwrap().0
}

/// A folder, and a path in it.
pub(crate) fn place() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.json");
    (folder, path)
}
