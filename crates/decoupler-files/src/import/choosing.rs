use std::path::Path;

use decoupler_core::{
    dataset::SplitBy,
    evaluation::{
        Intervals, RunSettings,
        auto::{AutoFixed, AutoProgress, AutoRecord, AutoSamples, choose_settings, dead_channels},
        recorded::Findings,
    },
    job::Job,
    scene::RowModel,
};

use super::{ImportError, Plan, Progress, Recording, Recordings, Setup, SetupError, SetupSets, setup::watch};
use crate::machine::memory_budget;

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
    /// samples, within `budget_s` seconds of one core; see [`choose_settings`]. Returns the setup with the chosen settings and
    /// memory, and its datasets; the settings are as given if there are too few samples. A memory of the recipe is kept.
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
    ) -> Result<(Self, SetupSets), SetupError> {
        let mut plan = self.plan().expect("settings are chosen for a recording").clone();
        let mut settings = *self.settings();
        let mut read = |plan: &Plan| -> Result<_, ImportError> {
            let mut on_reading = |progress| on_progress(ChoosingProgress::Reading(progress));
            let (recording, test) = plan.recordings(folder, &mut watch(job, &mut on_reading))?;
            let raw = recording.with_memory(None)?;
            let training = plan.division.divide(&raw.set, test.is_some(), settings.seed)?.training;
            Ok((raw, test, training))
        };
        let (mut raw, mut test, mut training) = read(&plan)?;
        let mut left_out = Vec::new();
        // A pipe cannot be read again, so that all of its channels stay.
        if training.len() >= MIN_SAMPLES && plan.irregular().is_none() {
            let dead = dead_channels(&raw.set.select(&training));
            let mut names = Vec::from_iter(raw.problem.inputs.iter().map(|input| input.name.clone()));
            left_out.extend(dead.iter().map(|&channel| names[channel].clone()));
            if !dead.is_empty() {
                names.retain(|name| !left_out.contains(name));
                plan.import.inputs = names;
                // Rows in which only these channels have no value are samples now.
                (raw, test, training) = read(&plan)?;
            }
        }
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
            let chosen = choose_settings(&settings, &fixed, &samples, limits, job, &mut on_trying)?;
            settings = chosen.settings;
            plan.import.memory = Some(chosen.memory.clone()).filter(|memory| !memory.is_empty());
            choice = Some(chosen);
        }
        let recording = raw.with_memory(plan.import.memory.as_ref())?;
        // Lags in seconds have as many samples as in training.
        let memory = recording.problem.memory.as_ref();
        let test = test.map(|test| test.with_memory(memory)).transpose()?;
        let (recordings, seed) = ((recording, test), settings.seed);
        let mut sets = SetupSets::of_plan(&plan, folder, recordings, seed, &mut watch(job, &mut |_| {}))?;
        if let (Some(Recordings { recorded, .. }), Some(choice)) = (&mut sets.recordings, choice) {
            // The held-out answers of the combination. Its weights, and the epochs, were chosen for these same answers, which
            // makes their errors slightly too small; that they come from fewer training samples makes them too large.
            let (training, by) = (&sets.sets.split.training, plan.division.by);
            recorded.chosen_intervals = Some(Intervals::calibrate(training, choice.answers.view(), by));
            recorded.search = Some(AutoRecord {
                left_out,
                ..choice.record
            });
            recorded.combined = Some(choice.combined);
        }
        Ok((Self::recording(settings, plan), sets))
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
