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

/// Checkpoint of the running training, from which it is resumed at the next start if the program ends during it. The
/// window shares it with the worker, which may be busy with an epoch; `None` if nothing is kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Keeping(Arc<Mutex<Option<Kept>>>);

#[derive(Debug)]
struct Kept {
    place: CheckpointPlace,
    interval: Duration,
    checkpointing: Option<Checkpointing>,
}

impl Keeping {
    fn lock(&self) -> MutexGuard<'_, Option<Kept>> {
        // A panic elsewhere cannot leave a place in an invalid state.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps trainings in `folder` from now on, saved every `interval`. Returns the checkpoints of trainings that were cut
    /// short there.
    pub(super) fn open(&self, folder: &Path, interval: Duration) -> io::Result<Vec<CheckpointPlace>> {
        let (place, left) = CheckpointPlace::find(folder)?;
        *self.lock() = Some(Kept {
            place,
            interval,
            checkpointing: None,
        });
        Ok(left)
    }

    /// Removes the checkpoint, and keeps none from now on.
    pub(super) fn forget(&self) {
        if let Some(kept) = self.lock().take() {
            kept.place.clear();
        }
    }

    /// Keeps another training from now on, in the place that it was `resumed` from, if any.
    pub(super) fn begin(&self, resumed: Option<CheckpointPlace>, recorded: Option<&Recorded>) {
        if let Some(kept) = &mut *self.lock() {
            kept.place.clear();
            if let Some(resumed) = resumed {
                kept.place = resumed;
            }
            let path = kept.place.path().to_owned();
            kept.checkpointing = Some(Checkpointing::every(kept.interval, path, recorded));
        }
    }

    /// Saves `run` if due. Returns the reason the first time that it fails.
    pub(super) fn save_if_due(&self, run: &Run) -> Option<String> {
        let mut kept = self.lock();
        let failed = kept.as_mut()?.checkpointing.as_mut()?.save_if_due(run);
        failed.map(|error| error.to_string())
    }

    /// Saves `run` now.
    pub(super) fn save(&self, run: &Run) {
        if let Some(checkpointing) = self.lock().as_ref().and_then(|kept| kept.checkpointing.as_ref()) {
            // The last checkpoint stays; a failure at intervals is reported.
            let _ = checkpointing.save(run);
        }
    }

    /// Removes the checkpoint of the training, which has ended.
    pub(super) fn clear(&self) {
        if let Some(kept) = &*self.lock() {
            kept.place.clear();
        }
    }
}

/// Returns the question about the training that was cut short at this place.
pub(super) fn question(place: &CheckpointPlace) -> String {
    match CheckpointFile::load(place.path()) {
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
    }
}
