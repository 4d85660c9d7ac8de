use std::{ops::ControlFlow, path::Path, sync::Arc};

use decoupler_core::{
    dataset::Seed,
    evaluation::{
        Intervals, Run, RunError, RunSets, RunSettings,
        experiments::{ExperimentRecording, TrialSamples},
    },
    job::{Cancelled, Job},
    live::{DriftReference, LiveError},
    training::TrainerState,
};
use ndarray::{Axis, Slice};
use thiserror::Error;

use super::{ImportError, Plan, Progress, Recorded, Recording, Watch, table::stem};
use crate::machine::memory_budget;

/// Everything needed to repeat a run: its settings and, for a recording, the plan that reads it.
#[derive(Clone, Debug)]
pub struct Setup {
    settings: RunSettings,
    plan: Option<Plan>,
    /// `true` if a file names the recording, not the user.
    is_stored: bool,
}

impl PartialEq for Setup {
    fn eq(&self, other: &Self) -> bool {
        self.settings == other.settings && self.plan == other.plan
    }
}

/// Datasets of a setup, and the origin of recorded samples.
#[derive(Clone, Debug)]
pub struct SetupSets {
    /// Datasets with a description of their channels.
    pub sets: RunSets,
    /// Recordings; `None` for a simulated array.
    pub recordings: Option<Recordings>,
}

/// Recordings from which datasets were made.
#[derive(Clone, Debug)]
pub struct Recordings {
    /// Plan and checksums, to be saved with the run.
    pub recorded: Recorded,
    /// All samples except those of the test files.
    pub training: Recording,
    /// Samples of the test files, if there are any.
    pub test: Option<Recording>,
}

/// Error of reading or drawing the samples of a setup.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SetupError {
    /// The recording cannot be read.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The samples cannot be drawn or trained on.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The recording has changed.
    #[error("'{0}' has other samples than when the run was saved; use the original files, or train again")]
    OtherSamples(String),
}

impl From<Cancelled> for SetupError {
    fn from(_: Cancelled) -> Self {
        Self::Import(ImportError::Cancelled)
    }
}

impl From<RunSettings> for Setup {
    /// Returns the setup of a simulated array. That of a recording lacks its plan: it has no [sets](Setup::sets).
    fn from(settings: RunSettings) -> Self {
        Self {
            settings,
            plan: None,
            is_stored: false,
        }
    }
}

impl Setup {
    /// Returns the setup of a recording, read by `plan`. The source of `settings` must be measured.
    ///
    /// # Panics
    /// If the source of `settings` is simulated.
    pub fn recording(settings: RunSettings, plan: Plan) -> Self {
        Self::of(settings, Some(plan)).expect("the source is a recording")
    }

    /// Returns the setup with these settings; `None` unless a plan is given for a measured source and only for that.
    /// The plan holds out for validation what the method needs, unless it gives a share.
    pub fn of(settings: RunSettings, mut plan: Option<Plan>) -> Option<Self> {
        let is_recording = settings.simulation().is_none();
        if let Some(Plan { division, .. }) = &mut plan {
            let usual = settings.validation_fraction();
            division.validation_fraction.get_or_insert(usual);
        }
        (is_recording == plan.is_some()).then_some(Self {
            plan,
            ..settings.into()
        })
    }

    /// Returns the setup of a run that is read from a file, which may name regular files only.
    #[must_use]
    pub(crate) fn stored(mut self) -> Self {
        self.is_stored = true;
        self
    }

    fn check_files(&self) -> Result<(), ImportError> {
        let irregular = self.plan.as_ref().filter(|_| self.is_stored).and_then(Plan::irregular);
        irregular.map_or(Ok(()), |path| Err(ImportError::Irregular(path)))
    }

    /// Returns the settings of the run.
    pub fn settings(&self) -> &RunSettings {
        &self.settings
    }

    /// Returns the setup with other settings of the same source.
    #[must_use]
    pub fn with_settings(&self, settings: RunSettings) -> Self {
        Self {
            settings,
            ..self.clone()
        }
    }

    /// Returns the plan of a recording; `None` for a simulated array.
    pub fn plan(&self) -> Option<&Plan> {
        self.plan.as_ref()
    }

    /// Returns the name of the source: the array scale, or the stem of the first file.
    pub fn source_name(&self) -> String {
        match (&self.plan, self.settings.simulation()) {
            (Some(plan), _) => stem(&plan.import.data),
            (None, Some(simulation)) => simulation.sensor.scale.to_string(),
            (None, None) => String::new(),
        }
    }

    /// Draws the samples of a simulated array, or reads those of a recording, whose paths are relative to `folder`.
    /// `on_progress` reports the progress of reading files.
    ///
    /// # Errors
    /// If the settings are invalid, the files cannot be read, their samples cannot be split, or the job is cancelled.
    pub fn sets(
        &self,
        folder: &Path,
        job: &Job<'_>,
        on_progress: &mut dyn FnMut(Progress),
    ) -> Result<SetupSets, SetupError> {
        let Some(plan) = &self.plan else {
            let sets = RunSets::draw(&self.settings, memory_budget(), job)?;
            return Ok(SetupSets { sets, recordings: None });
        };
        let watch = &mut watch(job, on_progress);
        self.check_files()?;
        let recordings = plan.recordings(folder, watch)?;
        Ok(SetupSets::of_plan(plan, folder, recordings, self.settings.seed, watch)?)
    }

    /// Returns the recording for an experiment; `None` for a simulated array.
    pub fn experiment_recording(&self) -> Option<ExperimentRecording> {
        let plan = self.plan.as_ref()?;
        Some(ExperimentRecording {
            name: self.source_name(),
            has_groups: plan.import.group.is_some(),
            has_test_files: plan.test.is_some(),
            division: plan.division,
        })
    }

    /// Reads the samples for the trials of an experiment; samples of a simulated array are drawn by each trial. The arguments
    /// are those of [`Self::sets`].
    ///
    /// # Errors
    /// If the files cannot be read, or the job is cancelled.
    pub fn trial_samples(
        &self,
        folder: &Path,
        job: &Job<'_>,
        on_progress: &mut dyn FnMut(Progress),
    ) -> Result<TrialSamples, SetupError> {
        let Some(plan) = &self.plan else {
            return Ok(TrialSamples::Drawn(memory_budget()));
        };
        self.check_files()?;
        let (recording, test) = plan.recordings(folder, &mut watch(job, on_progress))?;
        Ok(TrialSamples::Recorded {
            problem: Arc::new(recording.problem),
            set: Arc::new(recording.set),
            test: test.map(|test| Arc::new(test.set)),
            memory: memory_budget(),
        })
    }
}

/// Returns a callback that reports progress and ends the import once the job is cancelled.
pub(crate) fn watch(job: &Job<'_>, on_progress: &mut dyn FnMut(Progress)) -> impl FnMut(Progress) -> ControlFlow<()> {
    move |progress| {
        on_progress(progress);
        job.check().map_or(ControlFlow::Break(()), ControlFlow::Continue)
    }
}

impl SetupSets {
    /// Splits the samples of a plan, whose paths are relative to `folder`; `seed` is the seed of the run.
    pub(super) fn of_plan(
        plan: &Plan,
        folder: &Path,
        (training, test): (Recording, Option<Recording>),
        seed: Seed,
        watch: Watch<'_>,
    ) -> Result<Self, ImportError> {
        let (split, test_set) = plan.divide(&training, test.as_ref(), seed)?;
        let recorded = Recorded::of(plan.within(folder).absolute(), [&training.set, &test_set], watch)?;
        let sets = RunSets {
            memory: memory_budget(),
            ..RunSets::new(split, test_set).described(training.problem.clone())
        };
        let recordings = Some(Recordings {
            recorded,
            training,
            test,
        });
        Ok(Self { sets, recordings })
    }

    /// Prepares a run of `setup` on these datasets, with its baselines.
    ///
    /// # Errors
    /// As [`Run::with_baselines`].
    pub fn run(&self, setup: &Setup, states: Option<Vec<TrainerState>>, job: &Job<'_>) -> Result<Run, RunError> {
        let mut run = Run::with_baselines(setup.settings, self.sets.clone(), states, job)?;
        run.set_combined(self.recorded().and_then(|recorded| recorded.combined.clone()));
        Ok(run)
    }

    /// Describes the training readings of a recording, by which a later drift is detected.
    ///
    /// # Errors
    /// If they cannot be monitored, as those of an array, which are checked against its model.
    pub fn drift_reference(&self) -> Result<DriftReference, LiveError> {
        let training = &self.sets.split.training;
        if self.recordings.is_none() {
            return Err(LiveError::NotDescribed);
        }
        if training.row_wires_read().is_some() {
            return Err(LiveError::RowWires);
        }
        // With a memory, the readings are followed by values from the past, which a monitor does not need.
        let channels = self.sets.problem.inputs.len();
        let readings = training.readings();
        DriftReference::of(readings.slice_axis(Axis(1), Slice::from(..channels)))
    }

    /// Intervals of the network that is trained with chosen settings, from the held-out answers of the choice; `None` if
    /// nothing was chosen.
    pub fn chosen_intervals(&self) -> Option<Result<Intervals, RunError>> {
        self.recorded()?.chosen_intervals.clone().map(Intervals::checked)
    }

    /// Forgets the intervals and the combination of the choice, because the training continues with other settings.
    pub fn forget_choice(&mut self) {
        if let Some(recordings) = &mut self.recordings {
            recordings.recorded.forget_choice();
        }
    }

    /// Checks that recorded samples are those `saved` with a run.
    ///
    /// # Errors
    /// [`SetupError::OtherSamples`] if the recording has changed.
    pub fn check_saved(&self, saved: Option<&Recorded>) -> Result<(), SetupError> {
        match (saved, self.recorded()) {
            (Some(saved), Some(found)) if saved.samples_crc32 != found.samples_crc32 => {
                Err(SetupError::OtherSamples(saved.plan.import.data.display().to_string()))
            }
            _ => Ok(()),
        }
    }

    /// Returns the origin of recorded samples, to be saved with the run; `None` for a simulated array.
    pub fn recorded(&self) -> Option<&Recorded> {
        self.recordings.as_ref().map(|recordings| &recordings.recorded)
    }
}
