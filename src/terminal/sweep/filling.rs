use std::{
    collections::VecDeque,
    io::Write,
    num::NonZero,
    panic::resume_unwind,
    path::Path,
    sync::{
        Mutex, PoisonError,
        mpsc::{Sender, channel},
    },
    thread,
    time::Duration,
};

use indicatif::ProgressBar;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{
    command::{Claim, Claimed, Stop},
    specification::TrainOptions,
    trials::{Trials, train},
};
use crate::terminal::{failure::Failure, output::messages};
use decoupler_core::evaluation::RunError;
use decoupler_files::export::WriteError;

/// Interval of checking a trial that another program trains.
const PATIENCE: Duration = Duration::from_millis(200);

/// Numbers of trials in a folder after a call of [`fill`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Filled {
    /// Existing results, and those added by other programs.
    pub(super) present: usize,
    pub(super) trained: usize,
    pub(super) failed: usize,
}

enum Event {
    Present,
    Trained,
    /// A trial that cannot be trained, by position, with the reason.
    Failed(usize, String),
    /// Results cannot be written.
    Ended(WriteError),
}

/// Trains the missing trials at `positions` into `folder`, and waits for those that other programs train: if such a
/// program ends without a result, the trial is trained here. Each trial is trained on a separate thread.
///
/// # Errors
/// If results cannot be written. A trial that cannot be trained is reported on standard error, and the others continue.
pub(super) fn fill(
    folder: &Path,
    trials: &Trials,
    positions: Vec<usize>,
    threads: NonZero<usize>,
    bar: &ProgressBar,
    stop: &Stop,
) -> Result<Filled, Failure> {
    let threads = threads.get().min(positions.len());
    let pool = |_| {
        ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "trial".to_owned())
            .build()
    };
    let pools: Result<Vec<ThreadPool>, _> = (0..threads).map(pool).collect();
    let pools = pools.map_err(|error| Failure::Run(RunError::Threads(error.to_string())))?;
    let worker = Worker {
        folder,
        trials,
        parallel: threads,
        queue: &Mutex::new(Queue {
            new: positions.into(),
            others: VecDeque::new(),
        }),
        stop,
    };
    let (sender, receiver) = channel();
    let mut filled = Filled::default();
    let mut end = Ok(());
    thread::scope(|scope| {
        let workers = Vec::from_iter(pools.iter().map(|pool| {
            let (sender, worker) = (sender.clone(), &worker);
            scope.spawn(move || pool.install(|| worker.work(&sender)))
        }));
        drop(sender);
        for event in receiver {
            match event {
                Event::Present => filled.present += 1,
                Event::Trained => filled.trained += 1,
                Event::Failed(position, failure) => {
                    filled.failed += 1;
                    let message = format!(
                        "warning: {}: {failure}; the other trials continue",
                        trials.describe(position)
                    );
                    // There is no one to report to if this fails.
                    bar.suspend(|| drop(writeln!(messages(), "{message}")));
                }
                Event::Ended(failure) => {
                    stop.fail();
                    end = Err(failure.into());
                    continue;
                }
            }
            bar.inc(1);
        }
        for worker in workers {
            // The panic of the scope itself would not contain the reason.
            worker.join().unwrap_or_else(|panic| resume_unwind(panic));
        }
    });
    end.map(|()| filled)
}

/// Positions of trials that are neither done nor trained here.
struct Queue {
    new: VecDeque<usize>,
    /// Trials that other programs train.
    others: VecDeque<usize>,
}

struct Worker<'a> {
    folder: &'a Path,
    trials: &'a Trials,
    /// Number of trials trained at the same time.
    parallel: usize,
    queue: &'a Mutex<Queue>,
    stop: &'a Stop,
}

impl Worker<'_> {
    /// Trains until no trial is left.
    fn work(&self, events: &Sender<Event>) {
        let mut options = TrainOptions::new();
        while !self.stop.is_requested() {
            let Some((position, is_waiting)) = self.next() else {
                return;
            };
            if is_waiting {
                thread::sleep(PATIENCE);
            }
            let Some(event) = self.attempt(position, &mut options) else {
                continue;
            };
            // The receiver is gone only if the calling thread panicked.
            if events.send(event).is_err() {
                return;
            }
        }
    }

    /// The next position, and whether another program was training it.
    fn next(&self) -> Option<(usize, bool)> {
        let mut queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        let new = queue.new.pop_front().map(|position| (position, false));
        new.or_else(|| Some((queue.others.pop_front()?, true)))
    }

    /// Trains the trial at `position` unless it is finished or being trained. Returns none if it is not finished yet.
    fn attempt(&self, position: usize, options: &mut TrainOptions) -> Option<Event> {
        let claim = match Claim::take(self.folder, self.trials.plan().trials[position]) {
            Ok(Claimed::Ours(claim)) => claim,
            Ok(Claimed::Done) => return Some(Event::Present),
            Ok(Claimed::Theirs) => {
                let mut queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
                queue.others.push_back(position);
                return None;
            }
            Err(error) => return Some(Event::Ended(error)),
        };
        let trained = self.trials.get(position, options).map_err(Failure::from);
        let trained = trained.and_then(|trial| train(&trial, &claim, self.parallel, || self.stop.is_requested()));
        let trial = match trained {
            Ok(trial) => trial?,
            Err(failure) => return Some(Event::Failed(position, failure.to_string())),
        };
        match trial.save_in(self.folder) {
            Ok(()) => {
                claim.finish();
                Some(Event::Trained)
            }
            Err(error) => Some(Event::Ended(error)),
        }
    }
}
