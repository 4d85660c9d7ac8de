use std::path::Path;

use decoupler_core::{
    dataset::{Seed, SplitBy},
    evaluation::{
        Intervals, RunSettings,
        auto::{AutoChoice, AutoFixed, AutoProgress, AutoSamples, choose_settings, dead_channels},
        recorded::Findings,
    },
    job::Job,
    scene::RowModel,
};

use super::{ImportError, Plan, Progress, Recording, Setup, SetupError, SetupSets, setup::watch};
use crate::machine::memory_budget;

/// Setup whose settings were chosen from its training samples.
#[derive(Clone, Debug)]
pub struct ChosenSetup {
    /// Setup with the chosen settings and memory.
    pub setup: Setup,
    /// Its datasets, with the chosen features.
    pub sets: SetupSets,
    /// The choice and its held-out answers; `None` if there were too few samples to choose, so that the settings are as
    /// given.
    pub choice: Option<AutoChoice>,
}

/// Progress of a choice of settings.
#[derive(Clone, Debug, PartialEq)]
pub enum ChoosingProgress {
    /// Reading the files.
    Reading(Progress),
    /// Trying candidates.
    Trying(AutoProgress),
}

/// Minimum number of training samples to choose settings for.
const MIN_SAMPLES: usize = 10;

impl Setup {
    /// Returns `true` if settings can be chosen: for a recording with one network for all rows.
    pub fn can_choose(&self) -> bool {
        self.plan().is_some() && self.settings().source.row_model() == RowModel::Shared
    }

    /// Reads the recording, whose paths are relative to `folder`, and chooses settings by cross-validation on its training
    /// samples, within `budget_s` seconds of one core; see [`choose_settings`]. A memory of the recipe is kept.
    ///
    /// # Errors
    /// If the files cannot be read, their samples cannot be split or scaled, or the job is cancelled.
    ///
    /// # Panics
    /// If the setup is not that of a recording.
    pub fn choose(
        &self,
        fixed: &AutoFixed,
        budget_s: f64,
        folder: &Path,
        job: &Job<'_>,
        on_progress: &mut dyn FnMut(ChoosingProgress),
    ) -> Result<ChosenSetup, SetupError> {
        let mut plan = self.plan().expect("settings are chosen for a recording").clone();
        let mut read = |plan: &Plan| {
            let mut on_reading = |progress| on_progress(ChoosingProgress::Reading(progress));
            plan.recordings(folder, &mut watch(job, &mut on_reading))
        };
        let (mut recording, mut test_recording) = read(&plan)?;
        let left_out = leave_out_dead(&mut plan, &recording, self.settings().seed)?;
        if !left_out.is_empty() {
            // Rows in which only these channels have no value are samples now.
            (recording, test_recording) = read(&plan)?;
        }
        let raw = recording.with_memory(None)?;
        let seed = self.settings().seed;
        let training = plan.division.training(&raw.set, test_recording.is_some(), seed)?;
        let mut choice = None;
        if training.len() >= MIN_SAMPLES {
            let set = raw.set.select(&training);
            let samples = AutoSamples {
                set: &set,
                past: Some((&raw.history, &training)),
                by: plan.division.by,
            };
            let fixed = AutoFixed {
                memory: plan.import.memory.take().or_else(|| fixed.memory.clone()),
                ..fixed.clone()
            };
            let mut on_trying = |progress| on_progress(ChoosingProgress::Trying(progress));
            let limits = (budget_s, memory_budget());
            let mut chosen = choose_settings(self.settings(), &fixed, &samples, limits, job, &mut on_trying)?;
            chosen.record.left_out = left_out;
            plan.import.memory = Some(chosen.memory.clone()).filter(|memory| !memory.is_empty());
            choice = Some(chosen);
        }
        let settings = choice.as_ref().map_or(*self.settings(), |choice| choice.settings);
        let recording = raw.with_memory(plan.import.memory.as_ref())?;
        // Lags in seconds have as many samples as in training.
        let memory = recording.problem.memory.as_ref();
        let test_recording = test_recording.map(|test| test.with_memory(memory)).transpose()?;
        let recordings = (recording, test_recording);
        let mut sets = SetupSets::of_plan(&plan, folder, recordings, settings.seed, &mut watch(job, &mut |_| {}))?;
        if let (Some(recordings), Some(choice)) = (&mut sets.recordings, &choice) {
            recordings.recorded.search = Some(choice.record.clone());
            recordings.recorded.combined = Some(choice.combined.clone());
            // The held-out answers of the combination. Its weights, and the epochs, were chosen for these same answers, which
            // makes their errors slightly too small; that they come from fewer training samples makes them too large.
            let (training, by) = (&sets.sets.split.training, plan.division.by);
            recordings.recorded.chosen_intervals = Some(Intervals::calibrate(training, choice.answers.view(), by));
        }
        Ok(ChosenSetup {
            setup: Self::recording(settings, plan),
            sets,
            choice,
        })
    }
}

impl Recording {
    /// Measures how well the readings determine the targets, by the rule that divides the samples.
    ///
    /// # Errors
    /// If the samples cannot be divided, or the job is cancelled.
    pub fn findings(&self, settings: &RunSettings, by: SplitBy, job: &Job<'_>) -> Result<Findings, SetupError> {
        let raw = self.with_memory(None)?;
        let all = Vec::from_iter(0..raw.set.samples());
        let samples = AutoSamples {
            set: &raw.set,
            past: Some((&raw.history, &all)),
            by,
        };
        let fixed = AutoFixed {
            memory: self.problem.memory.clone(),
            ..AutoFixed::default()
        };
        Ok(Findings::measure(settings, &samples, &fixed, job)?)
    }
}

/// Removes channels that are nearly dead in the training samples from the plan, and returns their names. A pipe cannot be read
/// again without them, so that all of its channels stay.
fn leave_out_dead(plan: &mut Plan, recording: &Recording, seed: Seed) -> Result<Vec<String>, ImportError> {
    let raw = recording.with_memory(None)?;
    let training = plan.division.training(&raw.set, plan.test.is_some(), seed)?;
    if plan.irregular().is_some() || training.len() < MIN_SAMPLES {
        return Ok(Vec::new());
    }
    let dead = dead_channels(&raw.set.select(&training));
    let named = |is_dead: bool| {
        let channels = raw.problem.inputs.iter().enumerate();
        let found = channels.filter(|(channel, _)| dead.contains(channel) == is_dead);
        Vec::from_iter(found.map(|(_, input)| input.name.clone()))
    };
    if !dead.is_empty() {
        plan.import.inputs = named(false);
    }
    Ok(named(true))
}
