use std::{
    fs::{self, File, TryLockError},
    io,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};
use serde_json::value::to_raw_value;

use super::{
    AtomicFile, DocumentError, DocumentKind, document::PROGRAM, network_file::check_settings, unfinished::folder_of,
};
use crate::import::{Progress, Recorded, Setup, SetupError, SetupSets, stored};
use decoupler_core::{
    evaluation::{Run, RunSettings},
    job::Job,
    training::TrainerState,
};

const KIND: DocumentKind = DocumentKind::Checkpoint;

/// A run saved at an epoch. A resumed run gives bit-identical results.
///
/// The file is JSON. It does not contain the samples: those of a simulated array follow from the settings, those of a recording
/// are read again by its plan and recognised by their checksum. Another checksum (CRC-32) detects changes to the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointFile {
    /// Program and version that wrote the file.
    #[serde(skip)]
    pub program: String,
    /// Settings of the run, with the method and stopping rules of that epoch.
    pub settings: RunSettings,
    /// Origin of recorded samples, with absolute paths; `None` for a simulated array.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded: Option<Recorded>,
    /// Time that all starts together have taken: [`Run::wall_time`].
    pub wall_time: Option<Duration>,
    /// State of every trainer: by start, then, if there is a network for each row-wire, by row.
    pub starts: Vec<TrainerState>,
}

impl CheckpointFile {
    /// Captures the current state of `run`; `recorded` is the origin of its samples if they are recorded.
    ///
    /// # Errors
    /// [`DocumentError::NoPlan`] if the samples are recorded and no plan is given.
    pub fn from_run(run: &Run, recorded: Option<&Recorded>) -> Result<Self, DocumentError> {
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings: *run.settings(),
            recorded: KIND.recorded_of(run, recorded)?,
            wall_time: run.wall_time(),
            starts: run.states(),
        })
    }

    /// Setup of the run.
    pub fn setup(&self) -> Setup {
        let plan = self.recorded.as_ref().map(|recorded| recorded.plan.clone());
        Setup::of(self.settings, plan).expect("reading and writing check that a recording has its plan")
    }

    /// Resumes the run from this epoch: draws or reads its samples again and restores every trainer. Returns the run and
    /// its samples.
    ///
    /// # Errors
    /// The settings are invalid, the recording has changed or is missing, the states do not fit the settings or each
    /// other, or the job is cancelled.
    pub fn resume(self, job: &Job<'_>, on_progress: &mut dyn FnMut(Progress)) -> Result<(Run, SetupSets), SetupError> {
        let setup = self.setup();
        if self.settings.simulation().is_some() {
            self.settings.check_states(&self.starts)?;
        }
        let mut sets = setup.sets(Path::new(""), job, on_progress)?;
        sets.check_saved(self.recorded.as_ref())?;
        if let (Some(recordings), Some(saved)) = (&mut sets.recordings, self.recorded) {
            recordings.recorded.search = saved.search;
            recordings.recorded.combined = saved.combined;
            recordings.recorded.chosen_intervals = saved.chosen_intervals;
        }
        let run = sets.run(&setup, Some(self.starts), job)?;
        Ok((run.with_wall_time(self.wall_time), sets))
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The run has numbers that JSON cannot hold, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), DocumentError> {
        let unsound = |error: serde_json::Error| DocumentError::unsound(path, error);
        let located = |recorded: &Recorded| recorded.with_paths(|file| stored(file, folder_of(path)));
        let file = Self {
            recorded: self.recorded.as_ref().map(located),
            ..self.clone()
        };
        let contents = to_raw_value(&file).map_err(unsound)?;
        // A weight that is not finite would be written as `null`, which cannot be read back.
        serde_json::from_str::<Self>(contents.get()).map_err(unsound)?;
        Ok(KIND.save(&self.program, &contents, path, AtomicFile::commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let (program, mut file): (_, Self) = KIND.load(path)?;
        file.program = program;
        file.recorded = file.recorded.map(|recorded| recorded.within(folder_of(path)));
        let checked = check_settings(&file.settings, file.recorded.as_ref());
        checked.map_err(|defect| KIND.damaged(path, defect))?;
        Ok(file)
    }
}

/// Reciprocal of the largest share of the time spent on saving.
const LARGEST_SHARE: u32 = 20;

/// Saves a run to a checkpoint at intervals.
#[derive(Debug)]
pub struct Checkpointing {
    path: PathBuf,
    interval: Duration,
    next: Instant,
    has_failed: bool,
    /// Origin of recorded samples.
    recorded: Option<Recorded>,
}

impl Checkpointing {
    /// Saves to `path` every `interval`, first after one interval; `recorded` is the origin of recorded samples.
    pub fn every(interval: Duration, path: PathBuf, recorded: Option<&Recorded>) -> Self {
        Self {
            path,
            interval,
            next: Instant::now() + interval,
            has_failed: false,
            recorded: recorded.cloned(),
        }
    }

    /// Saves first at once.
    pub fn from_now(mut self) -> Self {
        self.next = Instant::now();
        self
    }

    /// Saves `run` if due. Returns the reason the first time that it fails; later attempts may succeed.
    pub fn save_if_due(&mut self, run: &Run) -> Option<DocumentError> {
        let begun = Instant::now();
        if begun < self.next {
            return None;
        }
        let failed = self.save(run).err();
        self.next = Instant::now() + self.interval.max(LARGEST_SHARE * begun.elapsed());
        failed.filter(|_| !std::mem::replace(&mut self.has_failed, true))
    }

    /// Saves `run`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, run: &Run) -> Result<(), DocumentError> {
        CheckpointFile::from_run(run, self.recorded.as_ref())?.save(&self.path)
    }
}

/// A place in a folder for the checkpoint of a running training, locked while a program uses it: programs that share the
/// folder use different places.
#[derive(Debug)]
pub struct CheckpointPlace {
    path: PathBuf,
    /// Locked while it is open. A file of its own, because a checkpoint is replaced whenever it is saved.
    _lock: File,
}

impl CheckpointPlace {
    /// Returns a free place in `folder`, which is created if it is missing, and the places with the checkpoints of programs
    /// that ended during a training.
    ///
    /// # Errors
    /// If the folder cannot be written, or its file system has no locks.
    pub fn find(folder: &Path) -> io::Result<(Self, Vec<Self>)> {
        fs::create_dir_all(folder)?;
        let (mut free, mut left) = (None, Vec::new());
        let paths = (1..).map(|number| folder.join(format!("training-{number}.checkpoint")));
        for path in paths {
            let lock = path.with_extension("lock");
            if let Some(free) = free.take_if(|_| !lock.exists()) {
                return Ok((free, left));
            }
            let lock = File::options().create(true).truncate(false).write(true).open(lock)?;
            match lock.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => continue,
                Err(TryLockError::Error(error)) => return Err(error),
            }
            let place = Self { path, _lock: lock };
            if place.path.try_exists()? {
                left.push(place);
            } else {
                free.get_or_insert(place);
            }
        }
        unreachable!("there are places without end")
    }

    /// Path of the checkpoint.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Removes the checkpoint, if there is one.
    pub fn clear(&self) {
        // One that cannot be removed is offered at the next start.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_use_different_places_and_find_what_was_left() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("data");
        let name = |place: &CheckpointPlace| place.path().file_stem().unwrap().to_str().unwrap().to_owned();
        let [first, second, third] = [(); 3].map(|()| {
            let (free, left) = CheckpointPlace::find(&folder).unwrap();
            assert!(left.is_empty());
            free
        });
        assert_eq!(
            [&first, &second, &third].map(name),
            ["training-1", "training-2", "training-3"]
        );
        for place in [&first, &third] {
            fs::write(place.path(), "").unwrap();
        }
        drop((second, third));
        let (free, left) = CheckpointPlace::find(&folder).unwrap();
        assert_eq!(
            (name(&free), Vec::from_iter(left.iter().map(name))),
            ("training-2".into(), vec!["training-3".into()])
        );
        // Another program offers none of these, and the one in use is not offered at all.
        let (other, none) = CheckpointPlace::find(&folder).unwrap();
        assert!(name(&other) == "training-4" && none.is_empty());
        left[0].clear();
        drop((free, left));
        assert!(CheckpointPlace::find(&folder).unwrap().1.is_empty());
    }
}
