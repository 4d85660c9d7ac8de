//! Runs an experiment in the background: one thread reports finished trials, and one thread per core trains.

use std::{
    collections::HashMap,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use decoupler_core::{
    evaluation::experiments::{
        Experiment, ExperimentResults, Finished, PaperTable, Trial, TrialSamples, run_experiments, worker_threads,
    },
    job::Job,
    problem::Problem,
    training::EpochRecord,
};
use decoupler_files::{
    export::{ExperimentTable, sweep_specification},
    figure::{Figure, experiment_figure},
    import::{ImportError, Plan, Setup, SetupError},
};
use serde_json::Value;

use super::{
    Form,
    sweep_folder::{OpenFolder, SweepFolder},
};
use crate::window::{
    job::{Background, Wake},
    shared::{Effect, Matter},
    widgets::SortBy,
};

/// Experiment of the view: a table of the paper, or a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topic {
    /// A table of the paper.
    Table(PaperTable),
    /// A sweep over two axes.
    Sweep,
}

impl Topic {
    /// All topics, in display order.
    pub const ALL: [Self; 4] = [
        Self::Table(PaperTable::HiddenNodes),
        Self::Table(PaperTable::CrossValidation),
        Self::Table(PaperTable::ArrayScales),
        Self::Sweep,
    ];

    /// Returns the short name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Table(PaperTable::HiddenNodes) => "Table 1",
            Self::Table(PaperTable::CrossValidation) => "Table 2",
            Self::Table(PaperTable::ArrayScales) => "Table 3",
            Self::Sweep => "Sweep",
        }
    }

    /// Returns the title of its results.
    pub fn heading(self) -> String {
        match self {
            Self::Table(table) => table.heading(),
            Self::Sweep => "Sweep over two axes".to_owned(),
        }
    }
}

/// The Experiments view.
#[derive(Debug)]
pub struct ExperimentsView {
    /// Current experiment.
    pub topic: Topic,
    /// Ordering and marked cell of the table.
    pub look: ExperimentLook,
    /// Experiment that is running.
    pub running: Option<Running>,
    pub(super) job: Background<ExperimentEvent>,
    pub(super) folder: SweepFolder,
    forms: HashMap<Topic, CheckedForm>,
    outcomes: HashMap<Topic, Outcome>,
}

/// State of the display of an experiment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExperimentLook {
    /// The cell marked in the table and the figure.
    pub marked: Option<usize>,
    /// The order of the table.
    pub sort: SortBy,
}

#[derive(Debug)]
struct CheckedForm {
    form: Form,
    /// Number of trials, or the reason why the form is not valid.
    checked: Result<usize, String>,
    /// Results without trials, with the published figures.
    preview: Option<Outcome>,
    /// Specification for `decoupler sweep`, or the reason why there is none.
    specification: Result<Value, String>,
}

/// Memory limit for the finished trainings of one experiment. Trainings beyond it are not kept, but repeated when they
/// are opened.
const MAX_KEPT_BYTES: usize = 400_000_000;

/// An experiment under way.
#[derive(Clone, Copy, Debug)]
pub struct Running {
    /// The experiment.
    pub topic: Topic,
    /// Number of finished trials.
    pub done: usize,
    /// Number of trials.
    pub trials: usize,
    /// Estimated time of the remaining trials, once there is one.
    pub time_left: Option<Duration>,
    /// When it began.
    pub begun: Instant,
}

/// Ending of an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Every trial has finished or failed.
    Complete,
    /// Ended early by the user, or by an error that was reported.
    Cut,
}

/// Results of an experiment so far.
#[derive(Debug)]
pub struct Outcome {
    /// Results of all trials; shared with a file being written.
    pub results: Arc<ExperimentResults>,
    /// Plan by which its recording is read, if it is on one.
    pub plan: Option<Plan>,
    /// Results as a table.
    pub table: ExperimentTable,
    /// Results as a figure.
    pub figure: Figure,
    /// Ending of the experiment, once it has ended.
    pub ending: Option<Ending>,
    /// Time it took, once it has ended.
    pub took: Option<Duration>,
    /// True once a table of it has been saved.
    pub is_saved: Arc<AtomicBool>,
    kept_bytes: usize,
}

impl Outcome {
    fn new(experiment: Experiment, plan: Option<Plan>) -> Self {
        let results = ExperimentResults::new(experiment);
        Self {
            table: ExperimentTable::new(&results),
            figure: experiment_figure(&results),
            results: Arc::new(results),
            plan,
            ending: None,
            took: None,
            is_saved: Arc::default(),
            kept_bytes: 0,
        }
    }

    /// Returns the numbers of finished and planned trials.
    pub fn trials(&self) -> (usize, usize) {
        let cells = self.results.cells.iter();
        cells.fold((0, 0), |(done, all), cell| {
            (done + cell.trials.len() + cell.failures.len(), all + cell.expected)
        })
    }

    fn record(&mut self, finished: Finished) {
        let results = Arc::make_mut(&mut self.results);
        let settings = results.cells[finished.cell].settings;
        let problem = results.problem.clone();
        let outcome = finished.outcome.map(|mut trial| {
            let bytes = bytes_of(&trial, settings.hidden, problem.as_deref());
            if self.kept_bytes + bytes > MAX_KEPT_BYTES {
                trial.states = Vec::new();
            } else {
                self.kept_bytes += bytes;
            }
            trial
        });
        results.record(finished.cell, outcome);
    }

    fn refresh(&mut self) {
        self.table = ExperimentTable::new(&self.results);
        self.figure = experiment_figure(&self.results);
    }
}

impl ExperimentsView {
    /// Creates the view with the default forms; `wake` is called when there are events.
    pub fn new(wake: Wake) -> Self {
        let mut state = Self {
            topic: Topic::ALL[0],
            look: ExperimentLook::default(),
            running: None,
            folder: SweepFolder::new(Arc::clone(&wake)),
            job: Background::new("experiments", wake),
            forms: HashMap::new(),
            outcomes: HashMap::new(),
        };
        for topic in Topic::ALL {
            state.topic = topic;
            state.edit(Form::new(topic));
        }
        state.topic = Topic::ALL[0];
        state
    }

    /// Shows another experiment.
    pub fn choose(&mut self, topic: Topic) {
        self.topic = topic;
        self.look = ExperimentLook::default();
    }

    /// Returns the form of the current experiment.
    pub fn form(&self) -> &Form {
        &self.forms[&self.topic].form
    }

    /// Returns the number of trials of the form, or the reason why it cannot be run.
    pub fn checked(&self) -> &Result<usize, String> {
        &self.forms[&self.topic].checked
    }

    /// Returns the specification of the form for `decoupler sweep`, or the reason why there is none.
    pub(super) fn specification(&self) -> &Result<Value, String> {
        &self.forms[&self.topic].specification
    }

    /// Replaces the form of the current experiment.
    pub fn edit(&mut self, form: Form) {
        let (checked, preview, specification) = match form.experiment() {
            Ok(experiment) => {
                let specification = sweep_specification(&experiment, form.plan.as_ref()).map_err(|gap| gap.to_string());
                let preview = Outcome::new(experiment, form.plan.clone());
                (Ok(preview.trials().1), Some(preview), specification)
            }
            Err(error) => {
                let none = Err("The values above cannot be run yet.".to_owned());
                (Err(error.to_string()), None, none)
            }
        };
        let checked = CheckedForm {
            form,
            checked,
            preview,
            specification,
        };
        self.forms.insert(self.topic, checked);
    }

    /// Returns true if the current experiment can be run now.
    pub fn can_run(&self) -> bool {
        self.running.is_none() && self.checked().is_ok()
    }

    /// Runs the current experiment.
    pub(super) fn run(&mut self, effects: &mut Vec<Effect>) {
        let (Ok(experiment), Some(setup)) = (self.form().experiment(), self.form().setup()) else {
            return;
        };
        effects.push(Effect::Settle(Matter::Experiments));
        if self.topic == Topic::Sweep {
            // The folder would be shown in place of the results.
            self.folder.close();
        }
        self.begin(experiment.clone(), setup.plan().cloned());
        run(&mut self.job, experiment, setup);
    }

    /// Cancels the running experiment; finished trials are kept.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.end(Instant::now());
    }

    /// Prepares empty results for `experiment`.
    fn begin(&mut self, experiment: Experiment, plan: Option<Plan>) {
        let outcome = Outcome::new(experiment, plan);
        self.running = Some(Running {
            topic: self.topic,
            done: 0,
            trials: outcome.trials().1,
            time_left: None,
            begun: Instant::now(),
        });
        self.look = ExperimentLook::default();
        self.outcomes.insert(self.topic, outcome);
    }

    /// Takes the description of a recording that was read for the experiment under way.
    pub(super) fn describe(&mut self, problem: Arc<Problem>) {
        let running = self.running.as_ref();
        if let Some(outcome) = running.and_then(|running| self.outcomes.get_mut(&running.topic)) {
            Arc::make_mut(&mut outcome.results).problem = Some(problem);
        }
    }

    /// Adds trials that have finished or failed.
    pub fn record(&mut self, finished: Vec<Finished>) {
        let Some(running) = &mut self.running else { return };
        let Some(outcome) = self.outcomes.get_mut(&running.topic) else {
            return;
        };
        for finished in finished {
            running.done = finished.done;
            running.time_left = finished.time_left;
            outcome.record(finished);
        }
        outcome.refresh();
    }

    /// Records the end of the running experiment.
    pub fn end(&mut self, at: Instant) {
        let Some(running) = self.running.take() else { return };
        let Some(outcome) = self.outcomes.get_mut(&running.topic) else {
            return;
        };
        outcome.refresh();
        outcome.took = Some(at - running.begun);
        outcome.ending = Some(if outcome.results.is_complete() {
            Ending::Complete
        } else {
            Ending::Cut
        });
    }

    /// Returns the open sweep folder, if it is shown instead of an experiment.
    pub(super) fn shown_folder(&self) -> Option<&OpenFolder> {
        self.folder.shown().filter(|_| self.topic == Topic::Sweep)
    }

    /// Returns the finished experiments of which no table has been saved, with their numbers of trials.
    pub(super) fn unsaved(&self) -> impl Iterator<Item = (Topic, usize)> {
        let outcomes = Topic::ALL
            .into_iter()
            .filter_map(|topic| Some((topic, self.outcomes.get(&topic)?)));
        let unsaved = outcomes.filter(|(_, outcome)| {
            outcome.ending == Some(Ending::Complete) && !outcome.is_saved.load(Ordering::Relaxed)
        });
        unsaved.map(|(topic, outcome)| (topic, outcome.trials().0))
    }

    /// Returns the results of the current experiment.
    pub fn outcome(&self) -> Option<&Outcome> {
        self.outcomes.get(&self.topic)
    }

    /// Returns the results to show: those of the experiment or, before it is run, the published figures.
    pub fn shown(&self) -> Option<&Outcome> {
        self.outcome().or(self.forms[&self.topic].preview.as_ref())
    }
}

/// Returns the approximate size of the finished training of a trial in memory.
fn bytes_of(trial: &Trial, hidden: usize, problem: Option<&Problem>) -> usize {
    let weights = problem.map_or(0, |problem| {
        hidden * (problem.feature_count() + 1) + (hidden + 1) * problem.targets.len()
    });
    // Current weights, best weights, and about as many numbers again for the state of the method.
    let of_start = 4 * weights * size_of::<f64>();
    trial.states.len() * of_start + trial.effort.epochs * size_of::<EpochRecord>()
}

/// Event of the most recent experiment.
#[derive(Debug)]
pub enum ExperimentEvent {
    /// A recording has been read, with these channels.
    Read(Arc<Problem>),
    /// A trial has finished or failed.
    Finished(Box<Finished>),
    /// The experiment has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// Runs `experiment` on the samples of `setup`; a running experiment is cancelled, and ends after the epochs in
/// progress.
pub fn run(job: &mut Background<ExperimentEvent>, experiment: Experiment, setup: Setup) {
    job.start(
        move |report| {
            // The paths of the window's plans are absolute.
            let samples = setup.trial_samples(Path::new(""), &Job::new(&|| report.is_cancelled()), &mut |_| {});
            let samples = match samples {
                Err(SetupError::Import(ImportError::Cancelled)) => return Ok(()),
                samples => samples.map_err(|error| error.to_string())?,
            };
            if let TrialSamples::Recorded { problem, .. } = &samples {
                report.send(ExperimentEvent::Read(Arc::clone(problem)));
            }
            let run = run_experiments(
                &[experiment],
                &samples,
                worker_threads(),
                || report.is_cancelled(),
                |finished| report.send(ExperimentEvent::Finished(Box::new(finished))),
            );
            run.map_err(|error| error.to_string())
        },
        |ended| {
            let ended = ended.map_err(|error| format!("{error}; the finished trials are kept"));
            ExperimentEvent::Ended(ended.and_then(|run| run))
        },
    );
}
