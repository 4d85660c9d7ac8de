use std::sync::Arc;

use decoupler_core::{
    dataset::SplitBy,
    evaluation::{Baselines, ErrorTable, PublishedErrors, Run, RunSettings, Scores, StartRecord, auto::AutoRecord},
    problem::Problem,
    training::{EpochRecord, Stage, StopReason},
};
use decoupler_files::{
    figure::EpochOutline,
    import::{Plan, Recorded, Setup},
};

use super::{
    message::{Progress, RunId, RunResult, append_epochs},
    past_networks::PastNetworks,
};
use crate::window::test_view::{TestView, TestViewError};

/// A training as known to the window.
#[derive(Debug)]
pub struct RunView {
    /// Its identity.
    pub id: RunId,
    /// Setup it is trained with.
    pub setup: Setup,
    /// Setup on the left when it began or was continued: as [`Self::setup`], but with the number of epochs requested
    /// from that point.
    pub asked: Setup,
    /// Plan of [`Self::asked`] for a recording, shared with the settings on the left while they have the same.
    pub plan: Option<Arc<Plan>>,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
    /// Weights and biases of the network.
    pub weights: usize,
    /// Its test set.
    pub test: TestView,
    /// Errors of the baselines.
    pub baselines: Baselines,
    /// Errors that the paper reports for this configuration.
    pub published: Option<PublishedErrors>,
    /// Every epoch of the leader so far.
    pub history: Vec<EpochRecord>,
    /// The part of the history that the curves need.
    pub outline: EpochOutline,
    /// The methods that the leader went through.
    pub stages: Vec<Stage>,
    /// State of each start when last reported; empty if there is only one.
    pub starts: Vec<StartRecord>,
    /// Networks of the epochs so far.
    pub past: PastNetworks,
    /// Result of the best network on the test set.
    pub result: Option<RunResult>,
    /// Reason for which it ended, if it has.
    pub stop_reason: Option<StopReason>,
    /// What was tried to choose its settings, if they were chosen.
    pub search: Option<AutoRecord>,
    /// True while it is unchanged since it was opened from a checkpoint.
    pub is_saved: bool,
}

impl RunView {
    /// Describes a training that begins; `asked` is its setup before the settings were chosen.
    ///
    /// # Errors
    /// If its test set cannot be drawn.
    pub fn begun(
        id: RunId,
        run: &Run,
        recorded: Option<&Recorded>,
        asked: Option<Setup>,
    ) -> Result<Self, TestViewError> {
        let plan = recorded.map(|recorded| recorded.plan.clone());
        let order = plan.as_ref().map_or(SplitBy::Time, Plan::test_order);
        let setup = Setup::of(*run.settings(), plan).expect("a recorded run has its plan");
        let asked = asked.unwrap_or_else(|| setup.clone());
        let baselines = run.baselines().cloned();
        Ok(Self {
            id,
            published: setup.settings().published(),
            plan: asked.plan().map(|plan| Arc::new(plan.clone())),
            asked,
            setup,
            search: recorded.and_then(|recorded| recorded.search.clone()),
            problem: Arc::clone(run.problem()),
            weights: run.leader().weights(),
            test: TestView::new(Arc::clone(run.test()), Arc::clone(run.problem()), order)?,
            baselines: baselines.expect("the baselines of a whole run are measured"),
            history: Vec::new(),
            outline: EpochOutline::default(),
            stages: Vec::new(),
            starts: Vec::new(),
            past: PastNetworks::default(),
            result: None,
            stop_reason: None,
            is_saved: false,
        })
    }

    /// Settings it is trained with.
    pub fn settings(&self) -> &RunSettings {
        self.setup.settings()
    }

    /// Errors of this result and of the baselines.
    pub fn scores(&self, result: &RunResult) -> Scores {
        Scores {
            network: result.errors.clone(),
            network_alone: result.network_alone.clone(),
            baselines: self.baselines.clone(),
            coverage: result.coverage.clone(),
        }
    }

    /// Error table of this result.
    pub fn error_table(&self, result: &RunResult) -> Vec<ErrorTable> {
        ErrorTable::of_scores(&self.problem, &self.scores(result), self.published.as_ref())
    }

    /// Takes the progress reported by the worker.
    pub fn progress(&mut self, progress: Progress) {
        let Progress {
            epochs,
            stages,
            starts,
            past,
            result,
            is_calibrating: _,
            stop_reason,
        } = progress;
        self.stop_reason = stop_reason;
        self.outline.extend(&epochs);
        append_epochs(&mut self.history, epochs);
        self.stages = stages;
        self.past = past;
        self.starts = starts;
        self.result = Some(result);
    }

    /// Returns the latest epoch.
    pub fn latest(&self) -> Option<&EpochRecord> {
        self.history.last()
    }
}
