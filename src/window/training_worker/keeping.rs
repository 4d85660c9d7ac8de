use std::{
    io,
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use decoupler_core::evaluation::Run;
use decoupler_files::{
    export::{CheckpointFile, CheckpointPlace, Checkpointing},
    import::Recorded,
};

/// Place of the checkpoint of the running training, shared by the worker and the window; `None` if none is kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept(Arc<Mutex<Option<CheckpointPlace>>>);

impl Kept {
    fn lock(&self) -> MutexGuard<'_, Option<CheckpointPlace>> {
        // A panic elsewhere cannot leave a place in an invalid state.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes the checkpoint, and keeps none from now on.
    pub(super) fn forget(&self) {
        if let Some(place) = self.lock().take() {
            place.clear();
        }
    }
}

/// Checkpoints from which a training is resumed at the next start if the program ends during it.
pub(super) struct Keeping {
    kept: Kept,
    interval: Duration,
    checkpointing: Option<Checkpointing>,
    /// Checkpoints of trainings that were cut short; the last is offered first.
    left: Vec<CheckpointPlace>,
}

impl Keeping {
    /// Keeps nothing yet.
    pub(super) fn new(kept: Kept) -> Self {
        Self {
            kept,
            interval: Duration::ZERO,
            checkpointing: None,
            left: Vec::new(),
        }
    }

    /// Keeps the running training in `folder` from now on, saved every `interval`.
    ///
    /// # Errors
    /// If the folder cannot be used.
    pub(super) fn open(&mut self, folder: &Path, interval: Duration) -> io::Result<()> {
        let (free, left) = CheckpointPlace::find(folder)?;
        self.interval = interval;
        self.left = left;
        *self.kept.lock() = Some(free);
        Ok(())
    }

    /// Keeps another training from now on, in the place that it was `resumed` from, if any.
    pub(super) fn begin(&mut self, resumed: Option<CheckpointPlace>, recorded: Option<&Recorded>) {
        let mut kept = self.kept.lock();
        let Some(place) = kept.as_mut() else { return };
        place.clear();
        if let Some(resumed) = resumed {
            *place = resumed;
        }
        self.checkpointing = Some(Checkpointing::every(self.interval, place.path().to_owned(), recorded));
    }

    /// Saves `run` if due. Returns the reason the first time that it fails.
    pub(super) fn save_if_due(&mut self, run: &Run) -> Option<String> {
        let kept = self.kept.lock();
        let checkpointing = self.checkpointing.as_mut().filter(|_| kept.is_some())?;
        checkpointing.save_if_due(run).map(|error| error.to_string())
    }

    /// Saves `run` now.
    pub(super) fn save(&self, run: &Run) {
        let kept = self.kept.lock();
        if let Some(checkpointing) = self.checkpointing.as_ref().filter(|_| kept.is_some()) {
            // The last checkpoint stays; a failure at intervals is reported.
            let _ = checkpointing.save(run);
        }
    }

    /// Removes the checkpoint of the training, which has ended.
    pub(super) fn clear(&self) {
        if let Some(place) = &*self.kept.lock() {
            place.clear();
        }
    }

    /// Takes the checkpoint that is offered.
    pub(super) fn take_left(&mut self) -> Option<CheckpointPlace> {
        self.left.pop()
    }

    /// Offers `place` again.
    pub(super) fn put_back(&mut self, place: CheckpointPlace) {
        self.left.push(place);
    }

    /// Returns the question about the checkpoint that is offered, if there is one.
    pub(super) fn offer(&self) -> Option<String> {
        let place = self.left.last()?;
        Some(match CheckpointFile::load(place.path()) {
            Ok(file) => {
                let epochs = file.starts.iter().filter_map(|start| start.history().last());
                let epoch = epochs.map(|latest| latest.epoch).max().unwrap_or(0);
                format!(
                    "Resume the training of {}, which was cut short at epoch {epoch} of {}?",
                    file.setup().source_name(),
                    file.settings.training.stopping.epochs
                )
            }
            Err(error) => format!("A training was cut short and cannot be resumed: {error}"),
        })
    }
}
