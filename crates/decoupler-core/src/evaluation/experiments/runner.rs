use std::{
    num::NonZero,
    panic::resume_unwind,
    sync::{
        atomic::{AtomicUsize, Ordering},
        mpsc::channel,
    },
    thread,
    time::{Duration, Instant},
};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{Cell, Experiment, ExperimentError, Trial, TrialFailure, TrialSamples};
use crate::{
    dataset::Seed,
    evaluation::{CrossValidation, RunError, RunSettings},
    job::{Cancelled, Job},
    training::Method,
};

/// A finished trial.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Index of the experiment, from 0.
    pub experiment: usize,
    /// Index of the cell, from 0, for [`ExperimentResults::record`](super::ExperimentResults::record).
    pub cell: usize,
    /// Result of the trial, or the reason for its failure.
    pub outcome: Result<Trial, TrialFailure>,
    /// Number of trials finished so far, over all experiments.
    pub done: usize,
    /// Number of trials in all.
    pub trials: usize,
    /// Estimated time for the remaining trials, from the time of the finished ones.
    pub time_left: Option<Duration>,
}

/// Returns the number of worker threads: one per core, or one fewer to leave a core to the window.
pub fn worker_threads(leave_one_core: bool) -> NonZero<usize> {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let threads = cores.saturating_sub(usize::from(leave_one_core));
    NonZero::new(threads).unwrap_or(NonZero::<usize>::MIN)
}

/// Runs all trials of `experiments` on `samples` and on `threads` threads, one trial per thread, and passes each to
/// `on_finished` on the calling thread as soon as it finishes.
///
/// Returns when all trials are finished or, once `is_cancelled`, when the epochs in progress are finished;
/// `is_cancelled` is called before every epoch, from every thread.
///
/// The result of a trial depends only on its settings, not on the number of threads or on other trials; only times
/// vary.
///
/// # Errors
/// If any experiment cannot be run; none is then run.
pub fn run_experiments(
    experiments: &[Experiment],
    samples: &TrialSamples,
    threads: NonZero<usize>,
    is_cancelled: impl Fn() -> bool + Sync,
    mut on_finished: impl FnMut(Finished),
) -> Result<(), ExperimentError> {
    for experiment in experiments {
        experiment.check()?;
        if experiment.recording.is_some() != matches!(samples, TrialSamples::Recorded(_)) {
            return Err(ExperimentError::OtherSamples);
        }
    }
    let Queue { jobs, mut time_left } = Queue::new(experiments, samples, threads);
    let threads = threads.get().min(jobs.len());
    // One single-threaded pool per worker: parallel code within a training stays on its thread, so that other trainings
    // do not affect its times.
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
        let workers = Vec::from_iter(pools.iter().map(|pool| {
            let (sender, jobs, next, is_cancelled) = (sender.clone(), &jobs, &next, &is_cancelled);
            let work_off = move || {
                while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let begun = Instant::now();
                    let Ok(outcome) = job.run(samples, &Job::new(is_cancelled)) else {
                        break;
                    };
                    // The receiver is dropped only if the calling thread panicked.
                    if sender.send((job, outcome, begun.elapsed())).is_err() {
                        break;
                    }
                }
            };
            scope.spawn(move || pool.install(work_off))
        }));
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
        for worker in workers {
            // Otherwise the scope would panic without the original message.
            worker.join().unwrap_or_else(|panic| resume_unwind(panic));
        }
    });
    Ok(())
}

/// Queue of jobs in the order of execution.
struct Queue {
    jobs: Vec<TrialJob>,
    time_left: TimeLeft,
}

/// A single trial.
struct TrialJob {
    experiment: usize,
    cell: usize,
    /// Index of the cell among the cells of all experiments.
    time_cell: usize,
    /// Settings of the cell.
    of_cell: Cell,
    seed: Seed,
    cross_validation: Option<CrossValidation>,
    repeat: usize,
    work: f64,
    /// Number of earlier trials of the same cell.
    round: usize,
}

impl Queue {
    /// Orders the jobs: first one trial of every cell, so that preliminary tables appear early, then the second trials,
    /// and so on; in each round the longest first, so that no core is idle for long at the end.
    fn new(experiments: &[Experiment], samples: &TrialSamples, threads: NonZero<usize>) -> Self {
        let mut jobs: Vec<TrialJob> = Vec::new();
        let mut cells = Vec::new();
        for (number, experiment) in experiments.iter().enumerate() {
            for (cell_number, cell) in experiment.cells().iter().enumerate() {
                let work = work(experiment, cell, samples);
                let seeds = experiment.seeds_of(&cell.settings);
                let trials = seeds.flat_map(|seed| (0..experiment.repeats()).map(move |repeat| (seed, repeat)));
                let before = jobs.len();
                jobs.extend(trials.enumerate().map(|(round, (seed, repeat))| TrialJob {
                    experiment: number,
                    cell: cell_number,
                    time_cell: cells.len(),
                    of_cell: *cell,
                    seed,
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

impl TrialJob {
    /// Runs the trial.
    fn run(&self, samples: &TrialSamples, job: &Job<'_>) -> Result<Result<Trial, TrialFailure>, Cancelled> {
        job.check()?;
        let trial = match self.cross_validation {
            None => Trial::on_sets(&self.of_cell, self.seed, samples, job),
            Some(validation) => {
                let settings = RunSettings {
                    seed: self.seed,
                    ..self.of_cell.settings
                };
                Trial::by_cross_validation(settings, validation, self.repeat, job)
            }
        };
        match trial {
            Err(RunError::Cancelled(cancelled)) => Err(cancelled),
            trial => Ok(trial.map_err(|reason| TrialFailure {
                seed: self.seed,
                repeat: self.repeat,
                reason,
            })),
        }
    }
}

/// Estimate of the remaining time from the finished jobs. Jobs of a cell with finished jobs are assumed to take their
/// mean time; for other jobs it follows from the number of multiplications of the training, at the speed of all
/// finished jobs.
pub(super) struct TimeLeft {
    threads: usize,
    cells: Vec<CellTime>,
}

struct CellTime {
    /// Approximate number of multiplications in one job.
    work: f64,
    jobs: usize,
    finished: usize,
    seconds: f64,
}

impl TimeLeft {
    /// Creates an estimate from `(work, jobs)` of each cell: approximate number of multiplications per job, and number
    /// of jobs.
    pub(super) fn new(cells: impl IntoIterator<Item = (f64, usize)>, threads: usize) -> Self {
        let cells = cells.into_iter().map(|(work, jobs)| CellTime {
            work,
            jobs,
            finished: 0,
            seconds: 0.0,
        });
        Self {
            threads,
            cells: cells.collect(),
        }
    }

    /// Records the time of a finished job of cell `cell`.
    pub(super) fn finished(&mut self, cell: usize, took: Duration) {
        let cell = &mut self.cells[cell];
        cell.finished += 1;
        cell.seconds += took.as_secs_f64();
    }

    /// Returns the time until all jobs are finished; `None` before the first is finished.
    pub(super) fn estimate(&self) -> Option<Duration> {
        let (seconds, work) = self.cells.iter().fold((0.0, 0.0), |(seconds, work), cell| {
            (seconds + cell.seconds, work + cell.work * cell.finished as f64)
        });
        if work == 0.0 {
            return None;
        }
        let rest = self.cells.iter().map(|cell| {
            let of_one = match cell.finished {
                0 => cell.work * seconds / work,
                finished => cell.seconds / finished as f64,
            };
            of_one * cell.jobs.saturating_sub(cell.finished) as f64
        });
        Duration::try_from_secs_f64(rest.sum::<f64>() / self.threads as f64).ok()
    }
}

/// Approximate number of multiplications in one job of `cell`, if it runs all of its epochs.
pub(super) fn work(experiment: &Experiment, cell: &Cell, samples: &TrialSamples) -> f64 {
    let settings = &cell.settings;
    let (inputs, outputs, samples) = match (settings.simulation(), samples) {
        (Some(source), _) => {
            let scale = source.sensor.scale;
            (scale.columns(), scale.coordinates_per_row(), source.samples)
        }
        (None, TrialSamples::Recorded(recorded)) => {
            (recorded.set.channels(), recorded.set.outputs(), recorded.set.samples())
        }
        (None, TrialSamples::Drawn(_)) => (1, 1, 1),
    };
    let (n1, h) = ((inputs + 1) as f64, settings.hidden as f64);
    let (outputs, samples) = (outputs as f64, samples as f64);
    // Forward and backward passes, and the test and validation sets.
    let passes = 4.0 * samples * h * (n1 + outputs);
    let second_order = samples * (h * n1).powi(2) / 4.0 + 0.5 * (h * n1).powi(3);
    let epoch = match settings.training.method {
        Method::LevenbergMarquardt(_) | Method::BayesianRegularization(_) => passes + second_order,
        _ => passes,
    };
    let trainings = experiment.folds() * settings.starts * settings.training.stopping.epochs;
    epoch * trainings as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remaining_time_follows_from_the_finished_jobs() {
        let mut time = TimeLeft::new([(1.0, 4), (3.0, 2)], 2);
        assert_eq!(time.estimate(), None);
        time.finished(0, Duration::from_secs(2));
        // 3 more jobs of 2 s, and 2 with three times the work: 18 s for two threads.
        assert_eq!(time.estimate(), Some(Duration::from_secs(9)));
        time.finished(1, Duration::from_secs(4));
        // Now the measured time of the cell counts: 3 jobs of 2 s and 1 of 4 s.
        assert_eq!(time.estimate(), Some(Duration::from_secs(5)));
        for cell in [0, 0, 0, 1] {
            time.finished(cell, Duration::from_secs(1));
        }
        assert_eq!(time.estimate(), Some(Duration::ZERO));
    }
}
