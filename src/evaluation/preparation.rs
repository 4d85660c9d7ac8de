use std::{sync::Arc, time::Instant};

use rayon::prelude::*;

use super::{
    Baselines, Errors, NoReference, Run, RunError, RunSettings, SimulatedSettings, StartTrainer, TargetErrors,
    TargetRow,
    baselines::{fit_baselines, linear_name},
    further_samples::FurtherSamples,
    reference_errors,
    sets::check_sets,
    task::{Task, tasks},
    workload::Workload,
};
use crate::{
    dataset::{Dataset, Split, Stream},
    decoupling::decode_set,
    network::nguyen_widrow,
    training::{ResumeError, Trainer, TrainerState, check_width},
};

impl Run {
    /// Draws and scales the sets, initialises the networks and measures the baselines.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn prepare(settings: SimulatedSettings) -> Result<Self, RunError> {
        whole(Self::prepare_unless(settings, &|| false))
    }

    /// As [`Self::prepare`]; returns `None` once `is_cancelled`, which is called between the parts of the work.
    pub(crate) fn prepare_unless(
        settings: SimulatedSettings,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        Workload::of(&settings)?.check_memory()?;
        Self::with_drawn_sets(settings, is_cancelled, |tasks| begin(settings.into(), tasks))
    }

    /// Prepares a run on sets that are drawn, with the trainings of `begin`; `None` once `is_cancelled`.
    fn with_drawn_sets(
        settings: SimulatedSettings,
        is_cancelled: &dyn Fn() -> bool,
        begin: impl FnOnce(&[Task]) -> Result<Vec<StartTrainer>, RunError>,
    ) -> Result<Option<Self>, RunError> {
        let Some((split, test)) = settings.draw_held_unless(is_cancelled)? else {
            return Ok(None);
        };
        let further = FurtherSamples::of(&settings)?.map(Arc::new);
        if let Some(further) = &further
            && !further.check(is_cancelled)?
        {
            return Ok(None);
        }
        Self::with_sets(settings.into(), (split, further), test, is_cancelled, begin)
    }

    /// Prepares a run on existing sets, measured or from a cross-validation; see [`Self::prepare`].
    ///
    /// # Errors
    /// If the settings are invalid, or the sets do not belong together.
    pub fn on_sets(settings: RunSettings, split: Split, test: Dataset) -> Result<Self, RunError> {
        whole(Self::with_sets(settings, (split, None), test, &|| false, |tasks| {
            begin(settings, tasks)
        }))
    }

    /// Resumes a run of these settings from the states of all its trainings.
    ///
    /// # Errors
    /// If the settings are invalid, or the states are damaged or from another run.
    pub fn resume(settings: SimulatedSettings, states: Vec<TrainerState>) -> Result<Self, RunError> {
        whole(Self::resume_unless(settings, states, &|| false))
    }

    /// As [`Self::resume`]; returns `None` once `is_cancelled`, which is called between the parts of the work.
    pub(crate) fn resume_unless(
        settings: SimulatedSettings,
        states: Vec<TrainerState>,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        settings.check_counts()?;
        check_states(&states, settings.starts * settings.source.model_size()?.networks)?;
        let run = Self::with_drawn_sets(settings, is_cancelled, |tasks| take_up(settings.into(), states, tasks))?;
        Ok(run.map(Self::with_time_of_saved))
    }

    /// Trainings side by side do not know how long they took together.
    fn with_time_of_saved(mut self) -> Self {
        self.wall_time = match &self.starts[..] {
            [only] if only.rows().len() == 1 => Some(only.elapsed()),
            _ => None,
        };
        self
    }

    /// Resumes a run on the sets it was started on; see [`Self::resume`].
    ///
    /// # Errors
    /// As [`Self::on_sets`], or if the states are damaged or do not match these settings and sets.
    pub fn resume_on_sets(
        settings: RunSettings,
        states: Vec<TrainerState>,
        split: Split,
        test: Dataset,
    ) -> Result<Self, RunError> {
        let run = Self::with_sets(settings, (split, None), test, &|| false, |tasks| {
            take_up(settings, states, tasks)
        });
        Ok(whole(run)?.with_time_of_saved())
    }

    /// Prepares a run whose trainings are those of `begin`, on a split and on samples that are not held; `None` once
    /// `is_cancelled`.
    fn with_sets(
        settings: RunSettings,
        (split, further): (Split, Option<Arc<FurtherSamples>>),
        test: Dataset,
        is_cancelled: &dyn Fn() -> bool,
        begin: impl FnOnce(&[Task]) -> Result<Vec<StartTrainer>, RunError>,
    ) -> Result<Option<Self>, RunError> {
        settings.check_network()?;
        check_sets(&settings, &split, &test)?;
        let (mut mean, mut linear) = fit_baselines(&split.training, &settings)?;
        if is_cancelled() {
            return Ok(None);
        }
        let (mean, linear) = (decode_set(&mut mean, &test)?, decode_set(&mut linear, &test)?);
        let baselines = match settings.simulated() {
            Some(simulated) => {
                let errors = |answers| Errors::measure(&test, answers, simulated.source.stroke_mm());
                let reference = reference(&simulated, &test)?;
                Some(Baselines {
                    mean: errors(&mean),
                    linear: errors(&linear),
                    reference: reference.ok(),
                    no_reference: reference.err(),
                })
            }
            None => None,
        };
        let linear_row = (linear_name(&settings.source), &linear);
        let target_baselines = [("training mean", &mean), linear_row].map(|(name, answers)| TargetRow {
            name,
            targets: TargetErrors::measure(test.targets(), answers.view()),
        });
        if is_cancelled() {
            return Ok(None);
        }
        let run = Self::of_networks(settings, (split, further), test, is_cancelled, begin)?;
        Ok(run.map(|run| Self {
            target_baselines: target_baselines.to_vec(),
            baselines,
            ..run
        }))
    }

    /// Prepares a run whose networks are all that is asked of it: without baselines and reference, such as that of a fold.
    pub(super) fn of_networks_on_sets(settings: RunSettings, split: Split, test: Dataset) -> Result<Self, RunError> {
        whole(Self::of_networks(settings, (split, None), test, &|| false, |tasks| {
            begin(settings, tasks)
        }))
    }

    /// As [`Self::with_sets`], without baselines and reference.
    fn of_networks(
        settings: RunSettings,
        (split, further): (Split, Option<Arc<FurtherSamples>>),
        test: Dataset,
        is_cancelled: &dyn Fn() -> bool,
        begin: impl FnOnce(&[Task]) -> Result<Vec<StartTrainer>, RunError>,
    ) -> Result<Option<Self>, RunError> {
        settings.check_network()?;
        check_sets(&settings, &split, &test)?;
        let tasks = tasks(&settings, &split, further.as_ref(), &test)?;
        // The tasks hold the samples scaled; large sets need not be held twice.
        drop(split);
        let first = tasks.at(0);
        let samples = first.problem.training.samples();
        let trainings = settings.starts * tasks.values().len();
        check_width(&settings.training.method, first.shape, samples, trainings)?;
        if is_cancelled() {
            return Ok(None);
        }
        let begun = Instant::now();
        let starts = begin(tasks.values())?;
        let wall_time = Some(begun.elapsed());
        Ok(Some(Self {
            wall_time,
            settings,
            test: Arc::new(test),
            scalings: tasks.map(|task| task.scaling.clone()),
            starts,
            target_baselines: Vec::new(),
            baselines: None,
        }))
    }
}

/// The run of a preparation that nothing cancels.
fn whole(prepared: Result<Option<Run>, RunError>) -> Result<Run, RunError> {
    Ok(prepared?.expect("nothing cancels it"))
}

/// Trainings from random initialisations.
fn begin(settings: RunSettings, tasks: &[Task]) -> Result<Vec<StartTrainer>, RunError> {
    let starts = (0..settings.starts).into_par_iter().map(|number| {
        let mut rng = settings.seed.start_rng(number);
        let begun: Vec<_> = tasks
            .iter()
            .map(|task| (task, nguyen_widrow(task.shape, &mut rng)))
            .collect();
        let rows = begun
            .into_par_iter()
            .map(|(task, start)| Trainer::new(start, task.problem.clone(), settings.training));
        Ok(StartTrainer::new(rows.collect::<Result<_, _>>()?))
    });
    starts.collect()
}

/// Trainings as they stood.
fn take_up(settings: RunSettings, states: Vec<TrainerState>, tasks: &[Task]) -> Result<Vec<StartTrainer>, RunError> {
    let networks = tasks.len();
    check_states(&states, settings.starts * networks)?;
    let trainers = states.into_par_iter().enumerate().map(|(number, state)| {
        let (start, task) = (number / networks, &tasks[number % networks]);
        let refused = |source| RunError::Resume { start, source };
        let trainer = Trainer::resume(state, task.problem.clone()).map_err(refused)?;
        if trainer.present().shape() != task.shape {
            return Err(refused(ResumeError::Damaged("it has another number of hidden nodes")));
        }
        Ok(trainer)
    });
    let mut trainers = trainers.collect::<Result<Vec<_>, RunError>>()?.into_iter();
    let starts = (0..settings.starts).map(|_| StartTrainer::new(trainers.by_ref().take(networks).collect()));
    Ok(starts.collect())
}

/// Checks the number of saved trainings.
fn check_states(states: &[TrainerState], expected: usize) -> Result<(), RunError> {
    let found = states.len();
    if found == expected {
        Ok(())
    } else {
        Err(RunError::Starts { found, expected })
    }
}

/// The errors of the Bayesian reference on `test`, or the reason for which there are none.
pub(super) fn reference(settings: &SimulatedSettings, test: &Dataset) -> Result<Result<Errors, NoReference>, RunError> {
    let SimulatedSettings { source, seed, .. } = settings;
    let mut rng = seed.rng(Stream::Expectation);
    Ok(reference_errors(&source.sensor, &source.scene, test, &mut rng)?)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// A run of few samples, cancelled at this look at the token; and how often the token was looked at.
    fn cancelled_at(look: usize, prepare: &dyn Fn(&dyn Fn() -> bool) -> Option<Run>) -> (Option<Run>, usize) {
        let looks = Cell::new(0);
        let run = prepare(&|| {
            looks.set(looks.get() + 1);
            looks.get() > look
        });
        (run, looks.get())
    }

    #[test]
    fn a_preparation_ends_at_the_next_part_once_it_is_cancelled() {
        let mut settings = SimulatedSettings::default();
        settings.source.sensor.scale = "4x4_2x12".parse().unwrap();
        (settings.hidden, settings.source.samples, settings.source.test_samples) = (3, 40, 8);
        let whole = Run::prepare(settings).unwrap();
        let (states, answers_mm) = (whole.states(), whole.decouple_test());
        let begun = |is_cancelled: &dyn Fn() -> bool| Run::prepare_unless(settings, is_cancelled).unwrap();
        let resumed =
            |is_cancelled: &dyn Fn() -> bool| Run::resume_unless(settings, states.clone(), is_cancelled).unwrap();
        for prepare in [&begun as &dyn Fn(&dyn Fn() -> bool) -> Option<Run>, &resumed] {
            let (run, parts) = cancelled_at(usize::MAX, prepare);
            assert_eq!(run.map(|run| run.decouple_test()).as_ref(), Some(&answers_mm));
            assert!(parts >= 4, "looked at only {parts} times");
            for part in 0..parts {
                let (run, looks) = cancelled_at(part, prepare);
                assert!(run.is_none() && looks == part + 1, "part {part}: {looks} looks");
            }
        }
    }
}
