use std::{ops::Deref, sync::Arc, time::Duration};

use decoupler_core::{
    dataset::{Dataset, SplitBy},
    evaluation::{
        Baselines, ErrorTable, PublishedErrors, RunSettings, Scores, StartRecord, auto::AutoRecord, frame_us,
        recorded::Determination,
    },
    problem::Problem,
    training::{EpochRecord, Stage, StopReason},
};
use decoupler_files::{
    export::{NetworkFile, describe_coverage, describe_determinacy, describe_worse_than_ridge},
    figure::EpochOutline,
    import::{Plan, Setup},
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::{
    message::{Progress, RunId, RunResult, TrainedRun, append_epochs},
    past_networks::PastNetworks,
};
use crate::window::test_view::{TestView, TestViewError};

/// Plan of a recording, which the settings, the training and the file of the window share: comparing it costs nothing.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OpenPlan(pub Arc<Plan>);

impl PartialEq for OpenPlan {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0 == other.0
    }
}

impl Deref for OpenPlan {
    type Target = Arc<Plan>;

    fn deref(&self) -> &Arc<Plan> {
        &self.0
    }
}

/// What a training is asked for: settings, and the plan of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// Settings.
    pub settings: RunSettings,
    /// Plan; `None` for a simulated array.
    pub plan: Option<OpenPlan>,
}

impl Asked {
    /// What this setup asks for.
    pub fn of(setup: &Setup) -> Self {
        Self {
            settings: *setup.settings(),
            plan: setup.plan().map(|plan| OpenPlan(Arc::new(plan.clone()))),
        }
    }
}

/// A training as known to the window.
#[derive(Debug)]
pub struct RunView {
    /// Its identity.
    pub id: RunId,
    /// Setup it is trained with.
    pub setup: Setup,
    /// What was on the left when it began or was continued: as [`Self::setup`], but with the number of epochs requested
    /// from that point.
    pub asked: Asked,
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
    /// Name and file of the run of the list that it is; `None` if the worker has it.
    pub kept: Option<(String, Arc<NetworkFile>)>,
}

impl RunView {
    /// Describes a training that begins; `asked` is its setup before the settings were chosen.
    ///
    /// # Errors
    /// If its test set cannot be drawn.
    pub fn begun(id: RunId, trained: &TrainedRun, asked: Option<Setup>) -> Result<Self, TestViewError> {
        let (run, recorded) = (&trained.run, trained.recorded.as_ref());
        let plan = recorded.map(|recorded| recorded.plan.clone());
        let order = plan.as_ref().map_or(SplitBy::Time, Plan::test_order);
        let setup = Setup::of(*run.settings(), plan).expect("a recorded run has its plan");
        let baselines = run.baselines().cloned();
        let mut test = TestView::new(Arc::clone(run.test()), Arc::clone(run.problem()), order)?;
        test.timeline = trained.timeline.clone().unwrap_or(test.timeline);
        let baselines = baselines.expect("the baselines of a whole run are measured");
        Ok(Self {
            id,
            asked: Asked::of(asked.as_ref().unwrap_or(&setup)),
            search: recorded.and_then(|recorded| recorded.search.clone()),
            weights: run.leader().weights(),
            ..Self::new(setup, test, baselines)
        })
    }

    /// Describes the run `name` of the list, whose test set is drawn or read again.
    ///
    /// # Errors
    /// If it cannot be drawn or read.
    pub fn kept(name: String, file: Arc<NetworkFile>) -> Result<Self, String> {
        let set = file.test_set().map_err(|error| error.to_string())?;
        let plan = file.recorded.as_ref().map(|recorded| &recorded.plan);
        let order = plan.map_or(SplitBy::Time, Plan::test_order);
        let test = TestView::new(Arc::clone(&set), Arc::new(file.problem.clone()), order);
        let test = test.map_err(|error| error.to_string())?;
        let answers = file.decoder().answers_to(&set);
        let mut outline = EpochOutline::default();
        outline.extend(&file.training.history);
        let (scores, training, networks) = (&file.scores, &file.training, file.network.clone());
        let remarks = plan.map(|plan| describe(&test.problem, &set, &answers, scores, plan.division.by));
        let frame_time = frame_us(&mut networks.decoder(), &set).ok();
        let result = RunResult {
            charts: Arc::new(test.charts(&answers)),
            answers: Arc::new(answers),
            remarks: remarks.unwrap_or_default(),
            errors: scores.network.clone(),
            network_alone: scores.network_alone.clone(),
            coverage: scores.coverage.clone(),
            intervals: file.intervals.clone(),
            best_epoch: training.best_epoch,
            defect: None,
            epochs_run: training.epochs,
            starts_ended: training.starts.len(),
            wall_time: None,
            frame_time: frame_time.map(|microseconds| Duration::from_secs_f64(1e-6 * microseconds)),
            is_idle: true,
            networks: Arc::new(networks),
        };
        Ok(Self {
            weights: file.network.weights(),
            history: training.history.clone(),
            outline,
            stages: training.stages.clone(),
            starts: training.starts.clone(),
            result: Some(result),
            stop_reason: training.stop_reason.or(Some(StopReason::Stopped)),
            search: file.recorded.as_ref().and_then(|recorded| recorded.search.clone()),
            kept: Some((name, Arc::clone(&file))),
            ..Self::new(file.setup(), test, scores.baselines.clone())
        })
    }

    fn new(setup: Setup, test: TestView, baselines: Baselines) -> Self {
        Self {
            id: RunId::new(),
            published: setup.settings().published(),
            asked: Asked::of(&setup),
            setup,
            problem: Arc::clone(&test.problem),
            weights: 0,
            test,
            baselines,
            history: Vec::new(),
            outline: EpochOutline::default(),
            stages: Vec::new(),
            starts: Vec::new(),
            past: PastNetworks::default(),
            result: None,
            stop_reason: None,
            search: None,
            is_saved: false,
            kept: None,
        }
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

/// Returns the remarks on the decoded test samples of a recording that is divided by `by`.
pub(super) fn describe(
    problem: &Problem,
    test: &Dataset,
    answers: &Array2<f64>,
    scores: &Scores,
    by: SplitBy,
) -> Vec<String> {
    let (targets, has_combined) = (&problem.targets, scores.network_alone.is_some());
    let determined = Determination::measure(test, answers.view(), by);
    let mut remarks = describe_determinacy(targets, &determined, has_combined);
    remarks.extend(describe_worse_than_ridge(problem, scores));
    remarks.extend(describe_coverage(targets, &scores.coverage));
    remarks
}
