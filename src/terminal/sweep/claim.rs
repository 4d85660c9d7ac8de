use std::{
    fs::{self, File, TryLockError},
    path::{Path, PathBuf},
};

use decoupler_files::export::{Trial, TrialId, WriteError};

/// The right to train a trial, held by a lock that the system releases however the program ends.
pub(super) struct Claim {
    path: PathBuf,
    /// Locked as long as it is open.
    _file: File,
}

/// State of a trial for a program that would train it.
pub(super) enum Claimed {
    /// To be trained here and now.
    Ours(Claim),
    /// Another program is at it.
    Theirs,
    /// Its result is there.
    Done,
}

impl Claim {
    /// Claims the trial `id` of `folder`.
    pub(super) fn take(folder: &Path, id: TrialId) -> Result<Claimed, WriteError> {
        let result = Trial::path(folder, id);
        let path = folder.join(format!("{id}.claim"));
        if result.exists() {
            // A program that was killed just then has left its claim next to the result; one that still runs holds it.
            if let Ok(file) = File::options().write(true).open(&path)
                && file.try_lock().is_ok()
            {
                Self { path, _file: file }.finish();
            }
            return Ok(Claimed::Done);
        }
        let mut options = File::options();
        let file = options.create(true).truncate(false).write(true).open(&path);
        let file = file.map_err(|source| WriteError::io(&path, source))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Ok(Claimed::Theirs),
            // Some file systems have no locks: two programs may train a trial there, and the first to finish counts.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let claim = Self { path, _file: file };
        // Its last holder may have finished it before the lock was free. The file is removed only when the result is
        // there, so no one can hold another lock of the same name and find no result.
        if result.exists() {
            claim.finish();
            return Ok(Claimed::Done);
        }
        Ok(Claimed::Ours(claim))
    }

    /// File in which the unfinished training is saved.
    pub(super) fn checkpoint(&self) -> PathBuf {
        self.path.with_extension("checkpoint")
    }

    /// Ends the claim on a trial whose result is there, and leaves nothing but the result.
    pub(super) fn finish(self) {
        for path in [self.checkpoint(), self.path] {
            match fs::remove_file(path) {
                // What stays does no harm.
                Ok(()) | Err(_) => {}
            }
        }
    }
}
