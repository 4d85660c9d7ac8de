//! The paper's tables, and sweeps over any two settings: many trials, one thread per core.

use std::{path::Path, sync::Arc};

use decoupler_core::{
    dataset::{Division, SplitBy},
    evaluation::{
        MAX_STARTS, RunSettings,
        experiments::{
            AxisKind, Cell, Experiment, ExperimentResults, Finished, PaperTable, TrialSamples, run_experiments,
            worker_threads,
        },
    },
    job::Job,
    text::counted,
    training::{EpochRecord, StoppingRules},
};
use decoupler_files::{
    export::{
        ExperimentColumnKind, ExperimentTable, cells_table, describe_conditions, describe_failures,
        describe_worse_than_mean, sweep_specification, trials_table,
    },
    figure::{TradeOffLimits, experiment_figure},
    import::{Plan, Setup},
};
use eframe::egui::Ui;

use super::{
    NamedTable, Note, Outcome, Page, Report, Reporter, Row, StudyEvent, Task, Tone, ValueList,
    value_list::{label, write_percent},
};
use crate::window::{
    shared::{Command, Effect},
    theme::space,
    widgets::{
        dim_ui, explained_options_ui,
        fields::{count_ui, list_ui, seed_ui},
        section_heading_ui,
    },
};

/// Maximum number of seeds, repeats or folds.
const MAX_TRIALS: usize = 1000;
/// Maximum number of cells that are displayed.
const MAX_CELLS: usize = 400;
/// Memory limit for the finished trainings of one experiment. Trainings beyond it are not kept, but repeated when they
/// are opened.
const MAX_KEPT_BYTES: usize = 400_000_000;

/// Form of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentForm {
    /// Title of the results.
    heading: String,
    /// The experiment without its axes, which are typed. A sweep takes its seed, epochs and restarts, and the rest from the
    /// Train view.
    template: Experiment,
    /// The axis of a table, or both of a sweep.
    axes: Vec<ValueList>,
}

impl ExperimentForm {
    /// Returns the form of a table, with the paper's own values.
    pub fn table(table: PaperTable) -> Self {
        let template = table.experiment();
        Self {
            heading: table.heading(),
            axes: vec![ValueList::of(&template.axis)],
            template,
        }
    }

    /// Returns the form of a small sweep.
    pub fn sweep() -> Self {
        let mut form = Self::table(PaperTable::HiddenNodes);
        form.heading = "Sweep over two axes".to_owned();
        form.template.base.training.stopping.epochs = 60;
        form.template.base.starts = 1;
        form.template.seeds = 1;
        form.axes = [AxisKind::Hidden, AxisKind::Samples].map(ValueList::new).into();
        form
    }

    fn is_sweep(&self) -> bool {
        self.axes.len() > 1
    }

    /// Returns the experiment and the setup of its samples, checked as far as possible without running it. `train` is the
    /// setup of the Train view, which a sweep is based on.
    fn experiment(&self, train: &Result<Setup, String>) -> Result<(Experiment, Setup), String> {
        let axes = self.axes.iter().map(ValueList::parse).collect::<Result<Vec<_>, _>>()?;
        let lengths = axes.iter().map(|axis| axis.values.len());
        let cells = lengths.fold(1, usize::saturating_mul);
        if cells > MAX_CELLS {
            let advice = format!("give fewer values, at most {MAX_CELLS} cells");
            return Err(format!("{cells} cells are too many to display: {advice}"));
        }
        let mut experiment = self.template.clone();
        let mut setup = Setup::from(experiment.base);
        if self.is_sweep() {
            let typed = experiment.base;
            let base = &mut experiment.base;
            *base = *train.as_ref()?.settings();
            (base.seed, base.starts) = (typed.seed, typed.starts);
            base.training.stopping.epochs = typed.training.stopping.epochs;
            setup = train.as_ref()?.with_settings(*base);
            experiment.recording = setup.experiment_recording();
        }
        let mut axes = axes.into_iter();
        experiment.axis = axes.next().unwrap_or(experiment.axis);
        experiment.second_axis = axes.next();
        experiment.check().map_err(|error| error.to_string())?;
        Ok((experiment, setup))
    }

    /// Returns the task of the form.
    ///
    /// # Errors
    /// If the form is not a valid experiment.
    pub fn task(&self, train: &Result<Setup, String>) -> Result<Task, String> {
        let (experiment, setup) = self.experiment(train)?;
        let mut results = ExperimentResults::new(experiment.clone());
        write_percent(&mut results.experiment.axis);
        results.experiment.second_axis.as_mut().map(write_percent);
        let outcome = ExperimentOutcome {
            heading: self.heading.clone(),
            results,
            plan: setup.plan().cloned(),
            kept_bytes: 0,
        };
        let folds = experiment.cross_validation.map_or(1, |validation| validation.folds);
        let (_, trials, _) = outcome.parts();
        let networks = trials.saturating_mul(folds).saturating_mul(experiment.base.starts);
        let epochs = counted(experiment.base.training.stopping.epochs, "epoch");
        let size = format!("{} of at most {epochs}", counted(networks, "training"));
        Ok(Task::new(size, outcome, move |reporter| {
            run(experiment, &setup, reporter)
        }))
    }

    /// Returns the sweep for the terminal.
    ///
    /// # Errors
    /// If the form is not valid, or the terminal has no options for it.
    pub fn specification(&self, train: &Result<Setup, String>) -> Result<serde_json::Value, String> {
        let (experiment, setup) = self.experiment(train)?;
        sweep_specification(&experiment, setup.plan()).map_err(|gap| gap.to_string())
    }

    /// Shows the fields. `train` is the setup of the Train view.
    pub fn fields_ui(&mut self, ui: &mut Ui, train: &Result<Setup, String>) {
        section_heading_ui(ui, "Values");
        let hint = "Values separated by commas";
        if self.is_sweep() {
            let settings = train.as_ref().map_or(self.template.base, |setup| *setup.settings());
            let offered = AxisKind::of_runs(&settings).map(|kind| (kind, label(kind), ""));
            let offered = Vec::from_iter(offered);
            let names = [("Across", "Values across"), ("Down", "Values down")];
            for (axis, (name, values)) in self.axes.iter_mut().zip(names) {
                if !offered.iter().any(|(kind, ..)| *kind == axis.kind) {
                    // The source has no such setting: the samples of a recording are given.
                    *axis = ValueList::new(AxisKind::Method);
                }
                let picked = list_ui(ui, name, "Setting that is varied", &offered, axis.kind);
                *axis = picked.map_or_else(|| axis.clone(), ValueList::new);
                axis.ui(ui, Some(values), hint);
                ui.add_space(space(1));
            }
            let source = train.as_ref().map_or_else(|_| String::new(), Setup::source_name);
            let (hidden, method) = (counted(settings.hidden, "hidden node"), settings.training.method.name());
            let base = format!("{source}, {hidden}, {method} as in the Train view, unless an axis varies it");
            dim_ui(ui, &base);
        } else {
            self.axes.iter_mut().for_each(|axis| axis.ui(ui, None, hint));
        }
        self.cross_validation_ui(ui);
        section_heading_ui(ui, "Training");
        let Experiment { base, seeds, .. } = &mut self.template;
        let hint = "Number of consecutive seeds for each cell, which show the spread of the results.";
        count_ui(ui, "Seeds", hint, seeds, 1..=MAX_TRIALS);
        let hint = "First of the consecutive seeds. The same seeds give the same results.";
        seed_ui(ui, "First seed", hint, &mut base.seed.0, 0);
        let hint = "Largest number of epochs per training. The paper does not state its own.";
        let epochs = &mut base.training.stopping.epochs;
        count_ui(ui, "Epochs", hint, epochs, 1..=StoppingRules::MAX_EPOCHS);
        let hint = "Number of trainings from other random weights; that with the lowest validation error is kept.";
        count_ui(ui, "Restarts", hint, &mut base.starts, 1..=MAX_STARTS);
    }

    fn cross_validation_ui(&mut self, ui: &mut Ui) {
        let Some(validation) = &mut self.template.cross_validation else {
            return;
        };
        section_heading_ui(ui, "Cross-validation");
        let hint = "Number of folds, k, into which the samples are split.";
        count_ui(ui, "Folds", hint, &mut validation.folds, 2..=MAX_TRIALS);
        let hint = "Number of shuffles into new folds, for each seed.";
        count_ui(ui, "Repeats", hint, &mut validation.repeats, 1..=MAX_TRIALS);
        let of_samples = "As in the paper: samples of one snapshot may be in both the training and the test folds.";
        let of_snapshots = "Whole snapshots: no training sample is from the same moment as a test sample.";
        let units = [
            (SplitBy::Random, "By sample", of_samples),
            (SplitBy::Group, "By snapshot", of_snapshots),
        ];
        let unit = explained_options_ui(ui, "Unit of the folds", &units, validation.by, true);
        validation.by = unit.unwrap_or(validation.by);
    }
}

/// Returns the setup of a cell with these settings and this division of its recording, whose plan is given.
pub fn setup_of(settings: RunSettings, division: Option<Division>, plan: Option<&Plan>) -> Setup {
    let plan = plan.cloned().zip(division);
    let plan = plan.map(|(plan, division)| Plan { division, ..plan });
    Setup::of(settings, plan).expect("a cell has the source of its experiment")
}

/// Runs every trial on the samples of `setup`, and reports each as it finishes.
fn run(experiment: Experiment, setup: &Setup, reporter: &Reporter) -> Result<(), String> {
    let is_cancelled = || reporter.is_cancelled();
    let on_progress = &mut |progress| reporter.progress(StudyEvent::Reading(progress), |_, _| ());
    // The paths of the window's plans are absolute.
    let samples = setup.trial_samples(Path::new(""), &Job::new(&is_cancelled), on_progress);
    let samples = samples.map_err(|error| error.to_string())?;
    if let TrialSamples::Recorded { problem, .. } = &samples {
        reporter.send(StudyEvent::Problem(Arc::clone(problem)));
    }
    let on_finished = |finished| reporter.send(StudyEvent::Trial(Box::new(finished)));
    let run = run_experiments(&[experiment], &samples, worker_threads(), is_cancelled, on_finished);
    run.map_err(|error| error.to_string())
}

/// Results of an experiment so far.
#[derive(Debug)]
struct ExperimentOutcome {
    heading: String,
    results: ExperimentResults,
    plan: Option<Plan>,
    kept_bytes: usize,
}

impl ExperimentOutcome {
    /// Adds a trial that has finished or failed.
    fn record(&mut self, finished: Finished) {
        let outcome = finished.outcome.map(|mut trial| {
            let weights = self.results.problem.as_ref().map_or(0, |problem| {
                let hidden = self.results.cells[finished.cell].settings.hidden;
                hidden * (problem.feature_count() + 1) + (hidden + 1) * problem.targets.len()
            });
            // Current weights, best weights, and about as many numbers again for the state of the method.
            let of_start = 4 * weights * size_of::<f64>();
            let bytes = trial.states.len() * of_start + trial.effort.epochs * size_of::<EpochRecord>();
            if self.kept_bytes + bytes > MAX_KEPT_BYTES {
                trial.states = Vec::new();
            } else {
                self.kept_bytes += bytes;
            }
            trial
        });
        self.results.record(finished.cell, outcome);
    }
}

impl Outcome for ExperimentOutcome {
    fn take(&mut self, event: StudyEvent) {
        match event {
            StudyEvent::Problem(problem) => self.results.problem = Some(problem),
            StudyEvent::Trial(finished) => self.record(*finished),
            _ => {}
        }
    }

    fn parts(&self) -> (usize, usize, &'static str) {
        let cells = &self.results.cells;
        let done = cells.iter().map(|cell| cell.trials.len() + cell.failures.len()).sum();
        (done, cells.iter().map(|cell| cell.expected).sum(), "trial")
    }

    fn report(&self, _limits: &TradeOffLimits) -> Report {
        let results = &self.results;
        let shown = ExperimentTable::new(results);
        let row = |(item, cell): (usize, &Cell)| {
            let both = cell.percent().median.zip(cell.linear_percent());
            let loses = both.is_some_and(|(network, linear)| network > linear);
            let tone = |kind: &ExperimentColumnKind| match kind {
                ExperimentColumnKind::Axis => Tone::Strong,
                ExperimentColumnKind::Ranking => Tone::Own,
                ExperimentColumnKind::Published => Tone::Dim,
                ExperimentColumnKind::Linear if loses => Tone::Warning,
                _ => Tone::Usual,
            };
            let meaning = match loses {
                true => "The linear baseline is more accurate here than the network.",
                false => "",
            };
            Row {
                item,
                meaning,
                name: results.cell_labels(cell).join(", "),
                tones: shown.kinds.iter().map(tone).collect(),
                ..Row::default()
            }
        };
        let failures = describe_failures(results)
            .into_iter()
            .map(|text| Note::Line(Tone::Bad, text));
        let remarks = describe_worse_than_mean(results)
            .into_iter()
            .map(|text| Note::Line(Tone::Warning, text));
        let mut notes = Vec::from_iter(failures.chain(remarks));
        if self.parts().0 == 0 && results.experiment.second_axis.is_none() {
            let text = "Our figures appear next to the published ones as the trials finish.";
            notes.push(Note::Line(Tone::Dim, text.to_owned()));
        }
        Report {
            headline: self.heading.clone(),
            conditions: format!("{}. {}", describe_conditions(&results.experiment), shown.note),
            pages: vec![Page {
                what: "Cell",
                rows: results.cells.iter().enumerate().map(row).collect(),
                table: shown.table(),
                figure: Some(experiment_figure(results)),
                notes,
                ..Page::default()
            }],
        }
    }

    /// Opens a cell: its settings with the seed of its median trial, and the network of that trial. A network that was not
    /// kept, as in a cross-validation, is trained there.
    fn open(&self, _page: usize, cell: usize) -> Vec<Effect> {
        let Some(cell) = self.results.cells.get(cell) else {
            return Vec::new();
        };
        let mut settings = cell.settings;
        let median = cell.median_trial();
        if let Some(trial) = median {
            settings.seed = trial.seed;
        }
        let setup = Box::new(setup_of(settings, cell.division, self.plan.as_ref()));
        match median {
            Some(trial) if !trial.states.is_empty() => vec![Effect::TakeUp(setup, trial.states.clone())],
            Some(_) => vec![Effect::TakeSetup(setup), Effect::Do(Command::Train)],
            None => vec![Effect::TakeSetup(setup)],
        }
    }

    fn tables(&self) -> Vec<NamedTable<'_>> {
        vec![
            ("Every cell", Box::new(|| cells_table(&self.results))),
            ("Every trial", Box::new(|| trials_table(&self.results))),
        ]
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::{evaluation::experiments::Axis, scene::RowModel, training::Method};

    use super::*;

    fn train() -> Result<Setup, String> {
        Ok(RunSettings::default().into())
    }

    #[test]
    fn the_default_forms_can_be_run() {
        for table in [
            PaperTable::HiddenNodes,
            PaperTable::CrossValidation,
            PaperTable::ArrayScales,
        ] {
            let (experiment, _) = ExperimentForm::table(table).experiment(&train()).unwrap();
            assert_eq!(experiment, table.experiment());
        }
        let (sweep, _) = ExperimentForm::sweep().experiment(&train()).unwrap();
        assert_eq!((sweep.cells().len(), sweep.base.training.stopping.epochs), (12, 60));
    }

    #[test]
    fn a_sweep_of_a_recording_has_its_settings() {
        let settings = RunSettings::measured(RowModel::Shared);
        let train = Ok(Setup::recording(settings, Plan::default()));
        let mut form = ExperimentForm::sweep();
        let refused = form.experiment(&train).unwrap_err();
        assert!(refused.contains("samples"), "samples are of arrays: {refused}");
        // Bayesian regularisation has the settings that suit recordings, as in the Train view.
        form.axes[1] = ValueList::of(&Axis::names(AxisKind::Method, ["lm", "br"]));
        let (experiment, setup) = form.experiment(&train).unwrap();
        let last = experiment.cells().last().unwrap().settings.training.method;
        assert_eq!(last, Method::recorded_regularization());
        assert_eq!(setup.plan(), train.as_ref().unwrap().plan());
        form.axes[1] = ValueList::new(AxisKind::Split);
        assert_eq!(form.experiment(&train).unwrap().0.cells().len(), 8);
        form.axes[1].values = "group".to_owned();
        assert!(form.experiment(&train).unwrap_err().contains("no column of groups"));
    }

    #[test]
    fn invalid_forms_give_a_reason() {
        let with = |values: &str| {
            let mut form = ExperimentForm::sweep();
            form.axes[0].values = values.to_owned();
            form.experiment(&train()).unwrap_err()
        };
        assert!(with("").contains("no values for hidden nodes"));
        assert!(with("0").contains("hidden nodes: 0 is not possible"));
        let many = Vec::from_iter((1..=200).map(|hidden| hidden.to_string()));
        assert!(with(&many.join(" ")).contains("600 cells"));
        let mut form = ExperimentForm::sweep();
        form.axes[1] = ValueList::new(AxisKind::Hidden);
        let same = form.experiment(&train()).unwrap_err();
        assert!(same.contains("both axes vary hidden nodes"));
    }
}
