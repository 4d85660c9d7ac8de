use std::{
    num::NonZero,
    sync::{
        atomic::{AtomicUsize, Ordering},
        mpsc::channel,
    },
    thread,
    time::{Duration, Instant},
};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{
    Experiment, ExperimentError, Trial, TrialFailure,
    time_left::{TimeLeft, work},
};
use crate::evaluation::{CrossValidation, SimulatedSettings};

/// A trial that has come to something.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Which of the experiments, from 0.
    pub experiment: usize,
    /// Which of its cells, from 0: to be handed to [`ExperimentResults::record`](super::ExperimentResults::record).
    pub cell: usize,
    /// What it came to.
    pub outcome: Result<Trial, TrialFailure>,
    /// How many trials of all experiments have come to something.
    pub done: usize,
    /// How many there are.
    pub trials: usize,
    /// How long the others take, from what the finished ones took.
    pub time_left: Option<Duration>,
}

/// As many threads as there are cores, or one fewer, which leaves a core to the window.
pub fn worker_threads(leave_one_core: bool) -> NonZero<usize> {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let threads = cores.saturating_sub(usize::from(leave_one_core));
    NonZero::new(threads).unwrap_or(NonZero::<usize>::MIN)
}

/// Runs all trials of `experiments` on `threads` threads, one trial on a thread, and hands over each as it is
/// finished, on the calling thread. Returns when all are done or, once `is_cancelled`, when the epochs in progress
/// are: it is asked before every epoch, from every thread.
///
/// What a trial comes to depends on its settings alone, not on the number of threads or on other trials; only its
/// times do.
///
/// # Errors
/// An experiment that cannot be run; then none is.
pub fn run_experiments(
    experiments: &[Experiment],
    threads: NonZero<usize>,
    is_cancelled: impl Fn() -> bool + Sync,
    mut on_finished: impl FnMut(Finished),
) -> Result<(), ExperimentError> {
    experiments.iter().try_for_each(Experiment::check)?;
    let Queue { jobs, mut time_left } = Queue::new(experiments, threads);
    let threads = threads.get().min(jobs.len());
    // A pool of one thread for each worker: what a training divides among threads stays on its own, so that its time
    // is its own, too.
    let pool = |_| {
        ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "experiment".to_owned())
            .build()
    };
    let pools: Result<Vec<ThreadPool>, _> = (0..threads).map(pool).collect();
    let pools = pools.map_err(|error| ExperimentError::Threads(error.to_string()))?;
    let next = AtomicUsize::new(0);
    let (sender, receiver) = channel();
    thread::scope(|scope| {
        for pool in &pools {
            let (sender, jobs, next, is_cancelled) = (sender.clone(), &jobs, &next, &is_cancelled);
            let work_off = move || {
                while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let begun = Instant::now();
                    let Some(outcome) = job.run(is_cancelled) else { break };
                    // The receiver is gone only if the calling thread panicked.
                    if sender.send((job, outcome, begun.elapsed())).is_err() {
                        break;
                    }
                }
            };
            scope.spawn(move || pool.install(work_off));
        }
        drop(sender);
        for (done, (job, outcome, took)) in (1..).zip(receiver) {
            time_left.finished(job.time_cell, took);
            on_finished(Finished {
                experiment: job.experiment,
                cell: job.cell,
                outcome,
                done,
                trials: jobs.len(),
                time_left: time_left.estimate(),
            });
        }
    });
    Ok(())
}

/// What is to be done, in the order of doing.
struct Queue {
    jobs: Vec<Job>,
    time_left: TimeLeft,
}

/// One trial.
struct Job {
    experiment: usize,
    cell: usize,
    /// The cell among the cells of all experiments.
    time_cell: usize,
    /// With the seed of the trial.
    settings: SimulatedSettings,
    cross_validation: Option<CrossValidation>,
    repeat: usize,
    work: f64,
    /// How many trials of its cell come before it.
    round: usize,
}

impl Queue {
    /// First one trial of every cell, so that the outline of each table shows soon, then the second, and so on; in
    /// each round the longest first, so that no core is idle at the end for long.
    fn new(experiments: &[Experiment], threads: NonZero<usize>) -> Self {
        let mut jobs: Vec<Job> = Vec::new();
        let mut cells = Vec::new();
        for (number, experiment) in experiments.iter().enumerate() {
            for (cell_number, cell) in experiment.cells().iter().enumerate() {
                let work = work(experiment, cell);
                let seeds = experiment.seeds_of(&cell.settings);
                let trials = seeds.flat_map(|seed| (0..experiment.repeats()).map(move |repeat| (seed, repeat)));
                let before = jobs.len();
                jobs.extend(trials.enumerate().map(|(round, (seed, repeat))| Job {
                    experiment: number,
                    cell: cell_number,
                    time_cell: cells.len(),
                    settings: SimulatedSettings { seed, ..cell.settings },
                    cross_validation: experiment.cross_validation,
                    repeat,
                    work,
                    round,
                }));
                cells.push((work, jobs.len() - before));
            }
        }
        jobs.sort_by(|one, other| one.round.cmp(&other.round).then(other.work.total_cmp(&one.work)));
        let time_left = TimeLeft::new(cells, threads.get());
        Self { jobs, time_left }
    }
}

impl Job {
    /// `None` if cancelled.
    fn run(&self, is_cancelled: impl Fn() -> bool) -> Option<Result<Trial, TrialFailure>> {
        if is_cancelled() {
            return None;
        }
        let trial = match self.cross_validation {
            None => Trial::on_drawn_sets(self.settings, is_cancelled),
            Some(validation) => Trial::by_cross_validation(self.settings, validation, self.repeat, is_cancelled),
        };
        trial.transpose().map(|trial| {
            trial.map_err(|reason| TrialFailure {
                seed: self.settings.seed,
                repeat: self.repeat,
                reason,
            })
        })
    }
}
