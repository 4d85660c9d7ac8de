use std::sync::Arc;

use crate::window::{
    test_view::TestSet,
    training_worker::{Began, Progress, RunId, RunResult, append_epochs},
};
use decoupler_core::{
    evaluation::{
        Baselines, ErrorTable, PastNetworks, Problem, PublishedErrors, RunSettings, Scores, SimulatedSettings,
        StartRecord,
    },
    training::{EpochRecord, Stage, StopReason},
};
use decoupler_files::{figure::EpochOutline, import::Setup};

/// A training as far as the window knows it.
#[derive(Debug)]
pub struct RunView {
    /// Its identity.
    pub id: RunId,
    /// Setup it is trained with.
    pub setup: Setup,
    /// Setup on the left when it began or was continued: as [`Self::setup`], but the epochs are those asked
    /// for from where it was.
    pub asked: Setup,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
    /// Weights and biases of the network.
    pub weights: usize,
    /// Its test set.
    pub test: TestSet,
    /// Errors of the baselines.
    pub baselines: Baselines,
    /// Errors that the paper reports for this configuration.
    pub published: Option<PublishedErrors>,
    /// Every epoch of the leader so far.
    pub history: Vec<EpochRecord>,
    /// Of these, what its curves need.
    pub outline: EpochOutline,
    /// The methods that the leader went through.
    pub stages: Vec<Stage>,
    /// State of each start when last reported; empty where there is one only.
    pub starts: Vec<StartRecord>,
    /// Networks of the epochs so far.
    pub past: PastNetworks,
    /// Result of the best network on the test set.
    pub result: Option<RunResult>,
    /// Reason for which it ended, if it has.
    pub stop_reason: Option<StopReason>,
    /// True while it is as in the checkpoint that it was opened from.
    pub is_saved: bool,
}

impl RunView {
    /// A training that has just begun.
    pub fn new(began: Began) -> Self {
        let Began {
            id,
            setup,
            problem,
            weights,
            test,
            baselines,
        } = began;
        Self {
            id,
            published: setup.simulated().and_then(|settings| settings.published()),
            asked: setup.clone(),
            setup,
            problem,
            weights,
            test,
            baselines,
            history: Vec::new(),
            outline: EpochOutline::new(),
            stages: Vec::new(),
            starts: Vec::new(),
            past: PastNetworks::default(),
            result: None,
            stop_reason: None,
            is_saved: false,
        }
    }

    /// Settings it is trained with.
    pub fn settings(&self) -> &RunSettings {
        self.setup.settings()
    }

    /// Settings of a simulated array, if it is one.
    pub fn simulated(&self) -> Option<SimulatedSettings> {
        self.setup.simulated()
    }

    /// Errors of this result and of the baselines.
    pub fn scores(&self, result: &RunResult) -> Scores {
        Scores {
            network: result.errors.clone(),
            baselines: self.baselines.clone(),
        }
    }

    /// Error table of this result.
    pub fn error_table(&self, result: &RunResult) -> ErrorTable {
        ErrorTable::of_scores(&self.problem, &self.scores(result), self.published.as_ref())
    }

    /// Takes the worker's events.
    pub fn progress(&mut self, progress: Progress) {
        let Progress {
            epochs,
            stages,
            starts,
            past,
            result,
            stop_reason,
        } = progress;
        self.stop_reason = stop_reason;
        self.outline.extend(&epochs);
        append_epochs(&mut self.history, epochs);
        self.stages = stages;
        self.past = past;
        if let Some(starts) = starts {
            self.starts = starts;
        }
        self.result = Some(result);
    }

    /// The latest epoch.
    pub fn latest(&self) -> Option<&EpochRecord> {
        self.history.last()
    }
}
