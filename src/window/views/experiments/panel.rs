//! The form and the status line of an experiment.

use std::sync::Arc;

use decoupler_core::{
    dataset::SplitBy,
    evaluation::{
        MAX_STARTS,
        experiments::{AxisKind, PaperTable},
    },
    text::counted,
    training::StoppingRules,
};
use decoupler_files::{
    export::{
        atomic_write, cells_table, describe_conditions, format_duration, trials_table, write_experiment_markdown,
    },
    figure::{Figure, SequentialMap},
    import::{Plan, Setup},
};
use eframe::egui::{Button, ComboBox, Key, TextEdit, Ui, vec2};

use super::{
    AxisForm, Ending, ExperimentsView, Form, Outcome, Running, Topic,
    form::{axis_example, axis_label},
    sweep_folder::folder_form_ui,
};
use crate::window::{
    shared::{Effect, FileTask, FileWords, Shared, Shown, Status, Tone},
    theme::space,
    widgets::{
        dim_ui,
        fields::{count_ui, seed_ui},
        ghost_button, note_ui, primary_button, progress_bar_ui, scrolled_ui, section_heading_ui, segmented_ui,
        with_shortcut,
    },
};

/// Maximum number of seeds or repeats.
const MAX_TRIALS: usize = 1000;

/// Shows the form: the choice of an experiment, its lists and numbers, Run and Cancel.
pub fn form_ui(ui: &mut Ui, experiments: &mut ExperimentsView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "experiment form", |ui| {
        section_heading_ui(ui, "Experiment");
        let options = Topic::ALL.map(|topic| (topic, topic.name()));
        if let Some(topic) = segmented_ui(ui, "Experiment", &options, experiments.topic, true) {
            experiments.choose(topic);
        }
        dim_ui(ui, description(experiments.topic));
        let mut form = experiments.form().clone();
        let is_idle = experiments.running.is_none();
        ui.add_enabled_ui(is_idle, |ui| fields_ui(ui, experiments.topic, &mut form, shared));
        match experiments.checked() {
            Ok(trials) => {
                dim_ui(ui, &describe_size(&form, *trials));
            }
            Err(problem) => {
                ui.add_space(space(1));
                note_ui(ui, problem);
            }
        }
        ui.add_space(space(2));
        run_buttons_ui(ui, experiments, effects);
        if let Some(running) = &experiments.running {
            progress_ui(ui, running);
        }
        ui.add_space(space(2));
        let paper = Form::new(experiments.topic);
        let text = match experiments.topic {
            Topic::Table(_) => "Reset to the paper's values",
            Topic::Sweep => "Reset to the default sweep",
        };
        let can_reset = is_idle && form == *experiments.form() && form != paper;
        if ui.add_enabled(can_reset, Button::new(text)).clicked() {
            form = paper;
        }
        if form != *experiments.form() {
            experiments.edit(form);
        }
        if experiments.topic == Topic::Sweep {
            folder_form_ui(ui, &experiments.folder, experiments.specification(), effects);
        }
        ui.add_space(space(4));
    });
}

fn description(topic: Topic) -> &'static str {
    match topic {
        Topic::Table(PaperTable::HiddenNodes) => {
            "Errors of networks with different numbers of hidden nodes on the paper's array."
        }
        Topic::Table(PaperTable::CrossValidation) => {
            "Cross-validation of a large and a small dataset, shuffled again in each repeat, and the scatter of the errors over the folds (the paper's Fig. 5)."
        }
        Topic::Table(PaperTable::ArrayScales) => "Errors on arrays of different scales, with 12 hidden nodes.",
        Topic::Sweep => "Any two settings varied against each other, all others fixed.",
    }
}

fn describe_size(form: &Form, trials: usize) -> String {
    let folds = form.template.cross_validation.map_or(1, |validation| validation.folds);
    let networks = trials.saturating_mul(folds).saturating_mul(form.template.base.starts);
    let epochs = counted(form.template.base.training.stopping.epochs, "epoch");
    format!("{} of at most {epochs}", counted(networks, "training"))
}

fn fields_ui(ui: &mut Ui, topic: Topic, form: &mut Form, shared: &Shared) {
    section_heading_ui(ui, "Values");
    match topic {
        Topic::Table(_) => form
            .axes
            .iter_mut()
            .for_each(|axis| list_ui(ui, axis_label(axis.kind), axis)),
        Topic::Sweep => {
            let offered: Vec<AxisKind> = form.offered().collect();
            for (number, axis) in form.axes.iter_mut().enumerate() {
                axis_ui(ui, number, axis, &offered);
            }
        }
    }
    if form.template.cross_validation.is_some() {
        cross_validation_ui(ui, form);
    }
    section_heading_ui(ui, "Training");
    if topic == Topic::Sweep {
        base_ui(ui, form, shared);
    }
    let template = &mut form.template;
    let hint = "Number of consecutive seeds for each cell, which show the spread of the results.";
    count_ui(ui, "Seeds", hint, &mut template.seeds, 1..=MAX_TRIALS);
    let hint = "First of the consecutive seeds. The same seeds give the same results.";
    seed_ui(ui, "First seed", hint, &mut template.base.seed.0, 0);
    let hint = "Largest number of epochs per training. The paper does not state its own.";
    let epochs = &mut template.base.training.stopping.epochs;
    count_ui(ui, "Epochs", hint, epochs, 1..=StoppingRules::MAX_EPOCHS);
    let hint = "Number of trainings from different random weights; the one with the lowest validation error is kept.";
    count_ui(ui, "Starts", hint, &mut template.base.starts, 1..=MAX_STARTS);
}

fn cross_validation_ui(ui: &mut Ui, form: &mut Form) {
    let Some(validation) = &mut form.template.cross_validation else {
        return;
    };
    section_heading_ui(ui, "Cross-validation");
    count_ui(
        ui,
        "Folds",
        "Number of folds, k, into which the samples are split.",
        &mut validation.folds,
        2..=MAX_TRIALS,
    );
    let hint = "Number of shuffles into new folds, for each seed.";
    count_ui(ui, "Repeats", hint, &mut validation.repeats, 1..=MAX_TRIALS);
    let units = [(SplitBy::Random, "By sample"), (SplitBy::Group, "By snapshot")];
    if let Some(unit) = segmented_ui(ui, "Unit of the folds", &units, validation.by, true) {
        validation.by = unit;
    }
    dim_ui(
        ui,
        match validation.by {
            SplitBy::Random => "As in the paper: rows of one snapshot may be in both the training and the test folds.",
            SplitBy::Group | SplitBy::Time => {
                "Whole snapshots: no training sample is from the same moment as a test sample."
            }
        },
    );
}

/// Shows a list of values as a text field.
fn list_ui(ui: &mut Ui, name: &str, axis: &mut AxisForm) {
    let label = ui.label(name);
    let hint = "Values separated by commas";
    let edit = TextEdit::multiline(&mut axis.values)
        .desired_rows(1)
        .desired_width(f32::INFINITY)
        .hint_text(axis_example(axis.kind))
        .margin(vec2(space(2), space(1)));
    ui.add(edit).labelled_by(label.id).on_hover_text(hint);
}

fn axis_ui(ui: &mut Ui, number: usize, axis: &mut AxisForm, offered: &[AxisKind]) {
    let (name, values) = [("Across", "Values across"), ("Down", "Values down")][number.min(1)];
    let label = ui.label(name);
    let combo = ComboBox::from_id_salt(("sweep axis", number))
        .selected_text(axis_label(axis.kind))
        .width(ui.available_width());
    let shown = combo.show_ui(ui, |ui| {
        for &kind in offered {
            if ui.selectable_label(kind == axis.kind, axis_label(kind)).clicked() && kind != axis.kind {
                *axis = AxisForm::new(kind);
            }
        }
    });
    shown.response.labelled_by(label.id);
    list_ui(ui, values, axis);
    ui.add_space(space(1));
}

/// Shows the settings common to all cells of a sweep, and a button that takes them from the Train view.
fn base_ui(ui: &mut Ui, form: &mut Form, shared: &Shared) {
    let base = &form.template.base;
    let mut parts = Vec::from_iter(form.setup().map(|setup| setup.source_name()));
    parts.push(counted(base.hidden, "hidden node"));
    let samples = base.simulation().map(|source| counted(source.samples, "sample"));
    parts.extend(samples);
    parts.push(base.training.method.name().to_owned());
    dim_ui(ui, &format!("{}, unless an axis varies it", parts.join(", ")));
    let setup = shared.setup();
    let is_other = setup.as_ref().is_ok_and(|setup| form.setup().as_ref() != Some(setup));
    let button = ui.add_enabled(is_other, Button::new("Use the settings of the Train view"));
    let button = button
        .on_hover_text(
            "Copies the source of the samples, the network and the training settings from the Train view. The source \
             determines the available axes.",
        )
        .on_disabled_hover_text(match &setup {
            Ok(_) => "These are the settings of the Train view",
            Err(missing) => missing,
        });
    if let (true, Ok(setup)) = (button.clicked(), &setup) {
        form.take(setup);
    }
}

fn run_buttons_ui(ui: &mut Ui, experiments: &mut ExperimentsView, effects: &mut Vec<Effect>) {
    let half = ((ui.available_width() - space(2)) / 2.0).floor();
    ui.horizontal(|ui| {
        let size = vec2(half, space(7));
        let run = ui.add_enabled(experiments.can_run(), primary_button("▶ Run").min_size(size));
        if run
            .on_hover_text(with_shortcut(ui, "Runs all trainings in the background", Key::Enter))
            .clicked()
        {
            experiments.run(effects);
        }
        let can_cancel = experiments.running.is_some();
        let cancel = ui.add_enabled(can_cancel, ghost_button("■ Cancel").min_size(size));
        if cancel
            .on_hover_text(with_shortcut(
                ui,
                "Ends the experiment; finished trials are kept",
                Key::Period,
            ))
            .clicked()
        {
            experiments.cancel();
        }
    });
}

fn progress_ui(ui: &mut Ui, running: &Running) {
    ui.add_space(space(1));
    let share = running.done as f32 / running.trials.max(1) as f32;
    let text = format!(
        "{}: {} of {} trials",
        running.topic.name(),
        running.done,
        running.trials
    );
    progress_bar_ui(ui, "Experiment", share, &text);
    let left = match running.time_left {
        Some(time) => format!("about {} left", format_duration(time)),
        None => "estimating the time left".to_owned(),
    };
    dim_ui(ui, &left);
}

/// Shows the state of the experiment in the line at the bottom.
pub fn status(experiments: &ExperimentsView) -> Status {
    let folder = experiments.shown_folder().filter(|_| experiments.running.is_none());
    let of_folder = folder.and_then(|folder| Some((folder.name(), folder.trials()?)));
    if let Some((name, finished)) = of_folder {
        let text = format!("Sweep folder {name}: {} finished", counted(finished, "trial"));
        return Status::new(Tone::Good, text);
    }
    let (tone, text) = match (&experiments.running, experiments.outcome()) {
        (Some(running), _) => (Tone::Busy, format!("Running {}", running.topic.name())),
        (None, Some(outcome)) => {
            let (done, all) = outcome.trials();
            let took = outcome
                .took
                .map_or_else(String::new, |took| format!(" in {}", format_duration(took)));
            let name = experiments.topic.name();
            match outcome.ending {
                Some(Ending::Complete) => (Tone::Good, format!("{name} finished: {all} trials{took}")),
                _ => (
                    Tone::Warning,
                    format!("{name} ended early: {done} of {all} trials{took}"),
                ),
            }
        }
        (None, None) => (Tone::Calm, "Ready: press Run".to_owned()),
    };
    Status::new(tone, text)
}

/// Opens a cell in the Train view: its settings with the seed of its median trial, and the network of that trial. A
/// network that was not kept, as in a cross-validation, is trained there.
pub fn open_cell(shared: &Shared, outcome: &Outcome, cell: usize, effects: &mut Vec<Effect>) {
    let cell = outcome.results.cells.get(cell).filter(|_| !shared.phase.is_busy());
    let Some(cell) = cell else { return };
    let mut settings = cell.settings;
    let median = cell.median_trial();
    if let Some(trial) = median {
        settings.seed = trial.seed;
    }
    let plan = outcome.plan.clone().zip(cell.division);
    let plan = plan.map(|(plan, division)| Plan { division, ..plan });
    let Some(setup) = Setup::of(settings, plan).map(Box::new) else {
        return;
    };
    match median {
        Some(trial) if !trial.states.is_empty() => effects.push(Effect::TakeUp(setup, trial.states.clone())),
        Some(_) => effects.extend([Effect::TakeSetup(setup), Effect::Train]),
        None => effects.push(Effect::TakeSetup(setup)),
    }
    effects.push(Effect::ShowTraining);
}

const MARKDOWN: FileWords = FileWords {
    kind: "table",
    description: "The table as shown with the settings behind it, as Markdown.",
    extensions: &["md"],
};

/// Returns what the view shows of the current experiment: figure and tables.
pub(super) fn shown(view: &ExperimentsView, colours: SequentialMap) -> Vec<Shown<'_>> {
    let topic = view.topic;
    let stem = topic.name().to_lowercase().replace(' ', "_");
    let outcome = view.outcome().filter(|outcome| outcome.trials().0 > 0);
    let outcome = outcome.ok_or_else(|| "No trial has finished yet: press Run first.".to_owned());
    let figure = outcome.clone().map(|outcome| {
        move || match outcome.figure.clone() {
            Figure::HeatMap(map) => map.coloured(colours).into(),
            figure => figure,
        }
    });
    let table = outcome.clone().map(|outcome| || outcome.table.table());
    let cells = outcome.clone().map(|outcome| || cells_table(&outcome.results));
    let trials = outcome.clone().map(|outcome| || trials_table(&outcome.results));
    let markdown = outcome.clone().map(|outcome| {
        let (results, heading) = (Arc::clone(&outcome.results), topic.heading());
        FileTask::save(MARKDOWN, &stem, move |path| {
            let conditions = describe_conditions(&results.experiment);
            atomic_write(path, |writer| {
                write_experiment_markdown(&heading, &conditions, &results, writer)
            })
        })
    });
    let shown = [
        Shown::figure("Figure", stem.clone(), figure),
        Shown::table("Table", format!("{stem}_table"), table),
        Shown::table("Every cell", stem.clone(), cells),
        Shown::table("Every trial", format!("{stem}_trials"), trials),
        Shown::file("Table with settings", markdown),
    ];
    match outcome {
        Ok(outcome) => shown.map(|shown| shown.noting(&outcome.is_saved)).into(),
        Err(_) => shown.into(),
    }
}
