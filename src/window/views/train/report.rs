//! Report of a training in figures.
//!
//! Note of the report on ill-conditioned scenes.

use std::time::Duration;

use decoupler_core::{
    dataset::SplitBy,
    evaluation::{
        Combination, ErrorTable, Errors, Initialization, NodeAddress, Outlook, Scores, Spread, StartRecord, TestErrors,
        auto::{Tried, TriedModel},
        best_start, error_remarks,
    },
    identifiability::Identifiability,
    problem::Problem,
    text::counted,
    training::StopReason,
};
use decoupler_files::{
    export::{Cell, Table, TableColumn, describe_search, format_duration, format_number},
    figure::frame_time,
};
use eframe::egui::{Align, Layout, RichText, Ui};

use crate::window::{
    glossary,
    shared::{Effect, NetworkSource, Phase, RunResult, RunView, Shared, SourceKind, error_table_ui, sentence},
    test_view::TestView,
    theme::{Theme, space, type_size},
    views::train::{
        decoders::decoders_ui, exports::open_task, inspect::TestPlace, press::press_section_ui, recording::bias,
        view::TrainView,
    },
    widgets::{
        described_table_ui, dim_ui, fields::capitalised, fold_ui, ghost_button, note_ui, scrolled_ui,
        section_heading_ui,
    },
};

/// The error table, the buttons that open a checkpoint, and the cost of the training. Before a training, the baselines.
pub fn report_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "report", |ui| {
        press_section_ui(ui, &mut view.press, shared);
        section_heading_ui(ui, "Errors on the test set");
        let result = view.result(shared).cloned();
        let shown = shared.shown_run().zip(result.as_ref());
        if let Some((run, result)) = shown {
            let baselines = &run.baselines;
            error_table_ui(ui, &run.error_table(result));
            match view.scrub.epoch() {
                Some(_) => {
                    dim_ui(ui, &format!("Of the network of epoch {}.", result.epochs_run));
                }
                None => verdict_ui(ui, shared, run, result),
            }
            if let Some(test) = run.test.array() {
                conditioning_ui(ui, test);
            }
            if let Some(note) = baselines.model_based_note() {
                note_ui(ui, note);
            }
            if let (Some(worst), Some(test)) = (worst_node_ui(ui, result), run.test.array()) {
                view.go_to(TestPlace::of_node(worst, test));
            }
            let model_based = baselines.model_based.as_ref().and_then(TestErrors::nodes);
            let measured = (&*run.problem, model_based);
            let is_open = view.decoders.is_open;
            let source = is_open.then(|| NetworkSource::Training(run.id, Box::new(run.setup.clone())));
            let (decoders, target) = (&mut view.decoders, &mut view.target);
            let asked = decoders_ui(ui, decoders, shared.phase, measured, target, source.as_ref());
            effects.extend(asked.map(|exporting| Effect::Export(Box::new(exporting))));
            effective_parameters_ui(ui, run, result);
            spread_ui(ui, &run.problem, run.settings().combine, &run.starts);
            search_ui(ui, run);
        } else {
            expectation_ui(ui, shared);
        }
        section_heading_ui(ui, "Open");
        let can_open = !shared.phase.is_busy() && shared.phase != Phase::Died;
        ui.add_enabled_ui(can_open, |ui| open_ui(ui, shared, effects));
        if let Some((run, result)) = shown {
            section_heading_ui(ui, "Cost");
            cost_ui(ui, run, run.result.as_ref().unwrap_or(result));
        }
    });
}

/// The candidates from which the settings were chosen, folded.
fn search_ui(ui: &mut Ui, run: &RunView) {
    let Some(search) = &run.search else { return };
    let summary = format!("{} tried", search.tried.len());
    fold_ui(ui, "Choice of settings", &summary, |ui| {
        dim_ui(ui, &format!("{}.", describe_search(search)));
        dim_ui(
            ui,
            "Cross-validation error, % of the targets' standard deviation, best first:",
        );
        let mut candidates: Vec<(usize, &Tried)> = search.tried.iter().enumerate().collect();
        candidates.sort_by(|(_, one), (_, other)| one.error.total_cmp(&other.error));
        for (place, tried) in candidates {
            ui.scope(|ui| tried_ui(ui, tried, place == search.chosen || tried.share > 0.0));
        }
        for remark in search.remarks(&run.problem.targets) {
            note_ui(ui, &remark);
        }
    });
}

/// A candidate in two lines that fit the card: model and error, inputs and epochs.
fn tried_ui(ui: &mut Ui, tried: &Tried, is_chosen: bool) {
    let palette = Theme::of(ui).palette;
    let mark = if is_chosen { "* " } else { "" };
    let colour = if is_chosen { palette.accent } else { palette.text };
    let error = format!("{:.1} ± {:.1} %", 100.0 * tried.error, 100.0 * tried.standard_error);
    ui.spacing_mut().item_spacing.y = 0.0;
    ui.spacing_mut().interact_size.y = space(5);
    ui.horizontal(|ui| {
        ui.label(RichText::new(format!("{mark}{}", tried.model)).color(colour));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(RichText::new(error).color(colour));
        });
    });
    let mut text = tried.features();
    if tried.share > 0.0 {
        text = format!("{:.0} % of the answer; {text}", 100.0 * tried.share);
    }
    if let TriedModel::Network { begin, epochs, .. } = tried.model {
        text += &format!("; {}", counted(epochs, "epoch"));
        if begin != Initialization::default() {
            text += &format!(" from {begin}");
        }
        if tried.is_cut_off {
            text += ", cut off by the budget";
        }
    }
    dim_ui(ui, &text);
    ui.add_space(space(1));
}

/// The table with the network's row still empty.
fn expectation_ui(ui: &mut Ui, shared: &Shared) {
    if shared.source == SourceKind::Recording {
        dim_ui(
            ui,
            "Press Train: the errors of each target appear here, next to those of the mean and of ridge regression.",
        );
        return;
    }
    let known = shared.preview.as_ref();
    let compared = known.and_then(|preview| {
        let simulation = preview.settings.simulation()?;
        Some((preview, simulation, preview.baselines.clone()?))
    });
    if let Some((preview, simulation, baselines)) = compared {
        // The settings may have changed to a scene whose baselines are still being computed.
        let is_of_draft = shared
            .draft
            .simulation()
            .is_some_and(|of_draft| (simulation.sensor, simulation.scene) == (of_draft.sensor, of_draft.scene));
        let published = shared.draft.published().filter(|_| is_of_draft);
        let scores = Scores {
            network: baselines.mean.clone(),
            network_alone: None,
            baselines,
            coverage: Vec::new(),
        };
        let mut tables = ErrorTable::of_scores(&simulation.problem(), &scores, published.as_ref());
        let rows = tables.iter_mut().flat_map(|table| &mut table.rows);
        for row in rows.filter(|row| row.name == NETWORK) {
            row.errors.fill(None);
        }
        error_table_ui(ui, &tables);
        conditioning_ui(ui, &preview.test);
        ui.add_space(space(2));
    }
    let text = "Press Train to fill in the network's row.";
    // The paper's own network, not only its scene.
    if shared.draft.published().is_some() {
        dim_ui(ui, &format!("{text} The paper's network takes a few seconds."));
    } else {
        dim_ui(ui, text);
    }
}

/// The name of the network's row.
const NETWORK: &str = "network";

/// Reports where a baseline is better and what would help, or by how much the network is better; nothing during training.
fn verdict_ui(ui: &mut Ui, shared: &Shared, run: &RunView, result: &RunResult) {
    let Some(reason) = run.stop_reason else { return };
    ui.add_space(space(2));
    match (result.errors.nodes(), run.baselines.linear.nodes()) {
        (Some(errors), Some(linear)) => {
            verdict_on_nodes_ui(ui, (run, result, reason), errors, linear);
        }
        _ => verdict_on_targets_ui(ui, run, result),
    }
    if shared.setup().is_ok_and(|setup| setup != run.asked) {
        dim_ui(ui, "The settings have changed since this training.");
    }
}

/// Remarks on the errors of a recording, or by how much the network is better than ridge regression.
fn verdict_on_targets_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let defect = result.defect.as_ref().map(|defect| capitalised(defect));
    for remark in defect.iter().chain(&result.remarks) {
        note_ui(ui, &sentence(remark));
    }
    let (network, ridge) = (result.errors.targets(), run.baselines.linear.targets());
    let ratios = network
        .iter()
        .zip(ridge)
        .map(|(network, ridge)| ridge.rmse / network.rmse);
    let ratios = Vec::from_iter(ratios.filter(|ratio| ratio.is_finite()));
    let extreme = |pick: fn(f64, f64) -> f64| ratios.iter().copied().reduce(pick).map(format_number);
    if let (true, Some(low), Some(high)) = (defect.is_none(), extreme(f64::min), extreme(f64::max))
        && ratios.iter().all(|ratio| *ratio > 1.0)
    {
        let times = if low == high { low } else { format!("{low} to {high}") };
        dim_ui(ui, &format!("{times} times as accurate as ridge regression."));
    }
    let plan = run.setup.plan();
    if plan.is_some_and(|plan| plan.test.is_none() && plan.division.by == SplitBy::Random) {
        note_ui(ui, bias(SplitBy::Random));
    }
}

fn verdict_on_nodes_ui(
    ui: &mut Ui,
    (run, result, reason): (&RunView, &RunResult, StopReason),
    errors: &Errors,
    linear: &Errors,
) {
    let settings = run.settings();
    let remarks = error_remarks(settings, &run.scores(result), Some(reason));
    let of_network = remarks.iter().find(|(row, _)| *row == NETWORK);
    let fault = if let Some(defect) = &result.defect {
        Some(defect.clone())
    } else if let Some((row, remark)) = of_network {
        Some(format!("{row}: {remark}"))
    } else if errors.z_mm > linear.z_mm {
        let remedy = reason.remedy(&settings.training.method);
        Some(format!(
            "a linear map of the resistances is better on z than this network: {remedy}"
        ))
    } else {
        None
    };
    if let Some(fault) = fault {
        note_ui(ui, &sentence(&capitalised(&fault)));
    } else if errors.z_mm > 0.0 {
        let times = format_number(linear.z_mm / errors.z_mm);
        let model_based = run.baselines.model_based.as_ref().and_then(TestErrors::nodes);
        let ratio = model_based.and_then(|model_based| errors.times(model_based));
        let text = match ratio.map(format_number) {
            None => format!("On z {times} times as accurate as the linear map."),
            Some(ratio) => {
                format!("On z {times} times as accurate as the linear map; {ratio} times the model-based error.")
            }
        };
        dim_ui(ui, &text);
    }
}

/// Returns the worst node, if the user wants to see it.
fn worst_node_ui(ui: &mut Ui, result: &RunResult) -> Option<NodeAddress> {
    let mut is_wanted = false;
    let errors = result.errors.nodes()?;
    let worst = errors.worst_node;
    ui.add_space(space(1));
    ui.horizontal(|ui| {
        let text = format!("Worst node {} mm", format_number(errors.worst_mm));
        ui.label(RichText::new(text).size(type_size().note))
            .on_hover_text(glossary::WORST_NODE.hint);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let place = format!(
                "snapshot {}, row {}, node {}",
                worst.snapshot + 1,
                worst.row + 1,
                worst.node + 1
            );
            let show = ui.small_button("Show").on_hover_text(format!("Go to {place}"));
            is_wanted = show.clicked();
        });
    });
    is_wanted.then_some(worst)
}

/// Shows the number of weights that the data determine, where the method estimates it.
fn effective_parameters_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let best = run.history.get(result.best_epoch);
    let Some(effective) = best.and_then(|epoch| epoch.effective_parameters) else {
        return;
    };
    let text = format!(
        "Effective parameters {} of {} weights",
        format_number(effective),
        run.weights
    );
    ui.label(RichText::new(text).size(type_size().note))
        .on_hover_text(glossary::EFFECTIVE_PARAMETERS.hint);
}

fn cost_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let epochs = result.epochs_run;
    let training = if run.settings().starts > 1 {
        "Training, all starts"
    } else {
        "Training"
    };
    let text = |time: Option<Duration>| time.map_or_else(|| "–".to_owned(), format_duration);
    let mut rows = vec![(training, text(result.wall_time))];
    if epochs > 0 {
        let an_epoch = result.wall_time.map(|time| time.div_f64(epochs as f64));
        rows.push(("Time per epoch", text(an_epoch)));
    }
    rows.push(("Best epoch", result.best_epoch.to_string()));
    if let Some(time) = result.frame_time {
        let decoding = if run.problem.has_nodes() {
            "Decoding a snapshot"
        } else {
            "Decoding a sample"
        };
        rows.push((decoding, frame_time(1e6 * time.as_secs_f64())));
    }
    for (name, value) in rows {
        ui.horizontal(|ui| {
            ui.label(name);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(value));
        });
    }
}

/// The button that asks for the path of a checkpoint.
fn open_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
    let button = ghost_button("Open checkpoint…").min_size([ui.available_width(), space(7)].into());
    let task = open_task(shared);
    if ui.add(button).on_hover_text(task.words.description).clicked() {
        effects.push(Effect::ChooseFile(task));
    }
}

fn is_badly_conditioned(outlook: &Outlook) -> bool {
    outlook.worst_row.condition() >= Identifiability::LARGEST_CONDITION
}

/// Notes that the scene is ill-conditioned, so that its errors are not blamed on the network.
pub fn conditioning_ui(ui: &mut Ui, test: &TestView) {
    let Some(outlook) = test.outlook.as_ref().filter(|outlook| is_badly_conditioned(outlook)) else {
        return;
    };
    ui.add_space(space(2));
    let condition = match outlook.worst_row.condition() {
        condition if condition.is_finite() => format!("{condition:.0e}"),
        _ => "infinite".to_owned(),
    };
    let text = format!(
        "This scene is ill-conditioned (condition number {condition}): no decoder can \
         distinguish some deformations. The note under Scene says what to change."
    );
    note_ui(ui, &text);
}

/// Shows the spread of the results of several starts: three figures of each error. Nothing for one start.
pub fn spread_ui(ui: &mut Ui, problem: &Problem, combine: Combination, starts: &[StartRecord]) {
    let Some(best) = best_start(starts).filter(|_| starts.len() > 1) else {
        return;
    };
    let palette = Theme::of(ui).palette;
    section_heading_ui(ui, &format!("Spread over {} starts", starts.len()));
    let spread = Spread::of(starts.iter().filter_map(StartRecord::percent));
    let of_test = problem.test_percent_name();
    let is_held_out = starts.iter().all(|start| start.validation_mse.is_some());
    let error = if is_held_out { "validation mse" } else { "training mse" };
    let errors = Spread::of(starts.iter().map(StartRecord::deciding_mse));
    described_table_ui(ui, "spread", &spread_table(&[(of_test, spread), (error, errors)]));
    let text = match combine {
        Combination::Best => format!("Start {} is kept: it has the lowest {error}.", best + 1),
        Combination::Mean => format!(
            "The mean of all starts is kept; start {} has the lowest {error}.",
            best + 1
        ),
    };
    ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
}

/// The figures of each spread.
fn spread_table(spreads: &[(&'static str, Option<Spread>)]) -> Table {
    let row = |(name, spread): &(&'static str, Option<Spread>)| {
        let figures = spread.map(|spread| [spread.smallest, spread.median, spread.largest]);
        let cells = figures?.map(Cell::from);
        Some([vec![(*name).into()], cells.into()].concat())
    };
    Table {
        columns: vec![
            TableColumn::new("error", "", ""),
            TableColumn::new("min", "min", "").meaning("Best start."),
            TableColumn::new("median", "median", "")
                .meaning("Median of all starts: the typical result of a single start."),
            TableColumn::new("max", "max", "").meaning("Worst start."),
        ],
        rows: spreads.iter().filter_map(row).collect(),
    }
}
