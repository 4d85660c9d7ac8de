use std::{
    num::NonZero,
    panic::resume_unwind,
    path::Path,
    sync::{Mutex, PoisonError},
    thread,
};

use indicatif::ProgressBar;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{
    command::{Claim, Claimed, Stop},
    specification::TrainOptions,
    trials::{Trials, train},
};
use crate::terminal::{failure::Failure, output::warn};
use decoupler_core::evaluation::RunError;
use decoupler_files::export::WriteError;

/// Numbers of trials after a call of [`fill`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Filled {
    /// Finished before.
    pub(super) present: usize,
    pub(super) trained: usize,
    /// In training by other programs, and left to them.
    pub(super) elsewhere: usize,
    pub(super) failed: usize,
}

impl Filled {
    pub(super) fn total(self) -> usize {
        self.present + self.trained + self.elsewhere + self.failed
    }

    fn and(self, other: Self) -> Self {
        Self {
            present: self.present + other.present,
            trained: self.trained + other.trained,
            elsewhere: self.elsewhere + other.elsewhere,
            failed: self.failed + other.failed,
        }
    }
}

/// Trains those of the trials at `positions` that neither have a result in `folder` nor are being trained by another program,
/// each on one of `threads` threads. Returns early once `stop` is requested.
///
/// # Errors
/// If results cannot be written. A trial that cannot be trained is reported on standard error, and the others continue.
pub(super) fn fill(
    folder: &Path,
    trials: &Trials,
    positions: impl Iterator<Item = usize> + Send,
    threads: NonZero<usize>,
    bar: &ProgressBar,
    stop: &Stop,
) -> Result<Filled, Failure> {
    let threads = threads.get();
    let pool = |_| {
        ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "trial".to_owned())
            .build()
    };
    let pools: Result<Vec<ThreadPool>, _> = (0..threads).map(pool).collect();
    let pools = pools.map_err(|error| Failure::Run(RunError::Threads(error.to_string())))?;
    let positions = Mutex::new(positions);
    let next = || positions.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = || {
        let mut options = TrainOptions::new();
        let mut filled = Filled::default();
        while let Some(position) = next().filter(|_| !stop.is_requested()) {
            match attempt(folder, trials, position, threads, stop, &mut options)? {
                Attempt::Present => filled.present += 1,
                Attempt::Trained => filled.trained += 1,
                Attempt::Elsewhere => filled.elsewhere += 1,
                Attempt::Stopped => break,
                Attempt::Failed(failure) => {
                    filled.failed += 1;
                    let trial = trials.describe(position);
                    bar.suspend(|| warn(format_args!("{trial}: {failure}; the other trials continue")));
                }
            }
            bar.inc(1);
        }
        Ok(filled)
    };
    thread::scope(|scope| {
        let workers = pools.iter().map(|pool| {
            scope.spawn(|| {
                let worked: Result<Filled, WriteError> = pool.install(work);
                worked.inspect_err(|_| stop.fail())
            })
        });
        // All are started before the first is joined.
        let mut workers = Vec::from_iter(workers).into_iter();
        workers.try_fold(Filled::default(), |filled, worker| {
            // The panic of the scope itself would not contain the reason.
            let worked = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
            Ok(filled.and(worked?))
        })
    })
}

enum Attempt {
    Present,
    Trained,
    Elsewhere,
    /// Saved in a checkpoint.
    Stopped,
    /// The trial cannot be trained.
    Failed(Failure),
}

/// Trains the trial at `position` unless it is finished or being trained.
fn attempt(
    folder: &Path,
    trials: &Trials,
    position: usize,
    parallel: usize,
    stop: &Stop,
    options: &mut TrainOptions,
) -> Result<Attempt, WriteError> {
    let claim = match Claim::take(folder, trials.id(position))? {
        Claimed::Ours(claim) => claim,
        Claimed::Done => return Ok(Attempt::Present),
        Claimed::Theirs => return Ok(Attempt::Elsewhere),
    };
    match trials
        .get(position, options)
        .and_then(|trial| train(&trial, &claim, parallel, || stop.is_requested()))
    {
        Ok(Some(trial)) => {
            trial.save_in(folder)?;
            claim.finish();
            Ok(Attempt::Trained)
        }
        Ok(None) => Ok(Attempt::Stopped),
        Err(failure) => Ok(Attempt::Failed(failure)),
    }
}
