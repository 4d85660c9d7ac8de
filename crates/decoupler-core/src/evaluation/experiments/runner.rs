use std::{
    num::NonZero,
    panic::resume_unwind,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
        mpsc::channel,
    },
    thread,
    time::{Duration, Instant},
};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{Cell, Experiment};
use crate::{
    dataset::{Dataset, Division, Seed},
    evaluation::{
        Baselines, Run, RunError, RunSets, RunSettings, Scores, TrainingSize, Workload, cross_validation::Effort,
    },
    job::Job,
    machine::MemoryBudget,
    problem::Problem,
    training::TrainerState,
};

/// A finished trial.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Index of the experiment, from 0.
    pub experiment: usize,
    /// Index of the cell, from 0, for [`ExperimentResults::record`](super::ExperimentResults::record).
    pub cell: usize,
    /// Result of the trial, or its failure: [`RunError::Trial`].
    pub outcome: Result<Trial, RunError>,
    /// Number of trials finished so far, over all experiments.
    pub done: usize,
    /// Estimated time for the remaining trials, from the time of the finished ones.
    pub time_left: Option<Duration>,
}

/// Returns the number of worker threads: one per core.
pub fn worker_threads() -> NonZero<usize> {
    thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN)
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
) -> Result<(), RunError> {
    for experiment in experiments {
        experiment.check()?;
        if experiment.recording.is_some() != matches!(samples, TrialSamples::Recorded { .. }) {
            return Err(RunError::OtherSamples);
        }
    }
    let planned = planned(experiments, samples);
    let all_work: f64 = planned.iter().map(|trial| trial.work).sum();
    let (mut work, mut seconds) = (0.0, 0.0);
    let threads = threads.get().min(planned.len());
    // One single-threaded pool per worker: parallel code within a training stays on its thread, so that other trainings
    // do not affect its times.
    let pool = |_| {
        let builder = ThreadPoolBuilder::new().num_threads(1);
        builder.thread_name(|_| "experiment".to_owned()).build()
    };
    let pools: Result<Vec<ThreadPool>, _> = (0..threads).map(pool).collect();
    let pools = pools.map_err(|error| RunError::Threads(error.to_string()))?;
    let next = AtomicUsize::new(0);
    let (sender, receiver) = channel();
    thread::scope(|scope| {
        let workers = Vec::from_iter(pools.iter().map(|pool| {
            let (sender, planned, next, is_cancelled) = (sender.clone(), &planned, &next, &is_cancelled);
            let work_off = move || {
                while let Some(trial) = planned.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let begun = Instant::now();
                    let (of, at) = (&trial.cell, trial.seed_and_repeat);
                    let outcome = Trial::run(trial.experiment, of, at, samples, &Job::new(is_cancelled));
                    // The receiver is dropped only if the calling thread panicked.
                    if matches!(outcome, Err(RunError::Cancelled(_)))
                        || sender.send((trial, outcome, begun.elapsed())).is_err()
                    {
                        break;
                    }
                }
            };
            scope.spawn(move || pool.install(work_off))
        }));
        drop(sender);
        for (done, (trial, outcome, took)) in (1..).zip(receiver) {
            work += trial.work;
            seconds += took.as_secs_f64();
            let (seed, repeat) = trial.seed_and_repeat;
            on_finished(Finished {
                experiment: trial.place.0,
                cell: trial.place.1,
                outcome: outcome.map_err(|source| RunError::Trial {
                    seed,
                    repeat,
                    source: Box::new(source),
                }),
                done,
                time_left: time_left((work, all_work), seconds, threads),
            });
        }
        for worker in workers {
            // Otherwise the scope would panic without the original message.
            worker.join().unwrap_or_else(|panic| resume_unwind(panic));
        }
    });
    Ok(())
}

/// A single trial.
struct Planned<'a> {
    experiment: &'a Experiment,
    cell: Cell,
    /// Indices of the experiment and of the cell.
    place: (usize, usize),
    seed_and_repeat: (Seed, usize),
    /// Approximate number of multiplications.
    work: f64,
    /// Number of earlier trials of the same cell.
    round: usize,
}

/// Returns the trials in the order of execution: first one trial of every cell, so that preliminary tables appear early,
/// then the second trials, and so on; in each round the longest first, so that no core is idle for long at the end.
fn planned<'a>(experiments: &'a [Experiment], samples: &TrialSamples) -> Vec<Planned<'a>> {
    let mut planned = Vec::new();
    for (number, experiment) in experiments.iter().enumerate() {
        for (cell_number, cell) in experiment.cells().into_iter().enumerate() {
            let work = work(experiment, &cell, samples);
            let trials = experiment.trials_of(&cell.settings).enumerate();
            planned.extend(trials.map(|(round, seed_and_repeat)| Planned {
                experiment,
                cell: cell.clone(),
                place: (number, cell_number),
                seed_and_repeat,
                work,
                round,
            }));
        }
    }
    planned.sort_by(|one, other| one.round.cmp(&other.round).then(other.work.total_cmp(&one.work)));
    planned
}

/// Estimates the time until all trials are finished, at the speed of the finished ones: `work` of all `all_work`
/// multiplications in `seconds` on one thread.
fn time_left((work, all_work): (f64, f64), seconds: f64, threads: usize) -> Option<Duration> {
    Duration::try_from_secs_f64((all_work - work) * seconds / (work * threads as f64)).ok()
}

/// Approximate number of multiplications in one trial of `cell`, if it runs all of its epochs.
fn work(experiment: &Experiment, cell: &Cell, samples: &TrialSamples) -> f64 {
    let settings = &cell.settings;
    let size = match samples {
        TrialSamples::Recorded { set, .. } => Ok(TrainingSize::of(settings, set)),
        TrialSamples::Drawn(_) => TrainingSize::drawn(settings),
    };
    let of_training = size.map_or(1.0, |size| Workload::of(settings, size).multiplications());
    experiment.repeats_and_folds().1 as f64 * of_training
}

/// Result of one trial of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Seed of the trial.
    pub seed: Seed,
    /// Index of the repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// Errors of the network, the training mean and the linear baseline on the test set; in a cross-validation, on all
    /// samples, each decoupled by the models for which it was held out.
    pub scores: Scores,
    /// Epochs and time of the trainings.
    pub effort: Effort,
    /// Final state of every training, for [`Run::new`]; empty for a cross-validation, which has one network per
    /// fold.
    pub states: Vec<TrainerState>,
}

/// Samples of the trials of an experiment.
#[derive(Clone, Debug)]
pub enum TrialSamples {
    /// Samples drawn by each trial from the model of its settings, within this memory.
    Drawn(MemoryBudget),
    /// Recorded samples, read once for all trials and divided by each.
    Recorded {
        /// All samples except those of the test files.
        set: Arc<Dataset>,
        /// Samples of the test files, if there are any.
        test: Option<Arc<Dataset>>,
        /// Description of the readings and targets.
        problem: Arc<Problem>,
        /// Memory that a trial may use.
        memory: MemoryBudget,
    },
}

impl TrialSamples {
    /// Returns the sets of a trial with these settings and this division of recorded samples.
    ///
    /// # Errors
    /// If the samples cannot be drawn or divided in this way.
    ///
    /// # Panics
    /// If recorded samples have no division.
    pub fn sets(
        &self,
        settings: &RunSettings,
        division: Option<&Division>,
        job: &Job<'_>,
    ) -> Result<RunSets, RunError> {
        match self {
            Self::Drawn(memory) => RunSets::draw(settings, *memory, job),
            Self::Recorded {
                set,
                test,
                problem,
                memory,
            } => {
                let division = division.expect("recorded samples have a division");
                let (split, test) = division.sets(set, test.as_deref(), settings.seed)?;
                Ok(RunSets {
                    problem: Arc::clone(problem),
                    memory: *memory,
                    ..RunSets::new(split, test)
                })
            }
        }
    }
}

impl Trial {
    /// Runs a trial of a cell with this seed; a cross-validation draws one set with it.
    fn run(
        experiment: &Experiment,
        cell: &Cell,
        (seed, repeat): (Seed, usize),
        samples: &TrialSamples,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        job.check()?;
        let settings = RunSettings { seed, ..cell.settings };
        let (scores, effort, states) = if let Some(validation) = experiment.cross_validation {
            let simulation = settings.drawn()?;
            let set = simulation.draw_training(simulation.samples, seed)?;
            let tested = simulation.draw_tested_folds(&set, seed)?;
            let sets = (&set, tested.as_ref().unwrap_or(&set));
            let validated = validation.run(&settings, sets, repeat, job)?;
            let scores = validated.scores_of(&simulation.problem(), &set);
            (scores, validated.effort, Vec::new())
        } else {
            let sets = samples.sets(&settings, cell.division.as_ref(), job)?;
            let baselines = Baselines::fitted(&settings, &sets)?;
            let mut run = Run::new(settings, sets, None, job)?;
            let mut effort = Effort::default();
            effort.train(&mut run, job)?;
            let scores = Scores {
                network: run.errors(),
                network_alone: None,
                baselines,
                coverage: Vec::new(),
            };
            (scores, effort, run.states())
        };
        Ok(Self {
            seed,
            repeat,
            scores,
            effort,
            states,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remaining_time_follows_from_the_finished_jobs() {
        // A third of the work took 2 s.
        assert_eq!(time_left((1.0, 3.0), 2.0, 1), Some(Duration::from_secs(4)));
        assert_eq!(time_left((1.0, 3.0), 2.0, 2), Some(Duration::from_secs(2)));
        assert_eq!(time_left((3.0, 3.0), 7.0, 2), Some(Duration::ZERO));
        assert_eq!(time_left((0.0, 0.0), 0.0, 1), None);
    }
}
