//! Report of a training in figures.

use std::time::Duration;

use decoupler_core::{
    dataset::SplitBy,
    evaluation::{Combination, ErrorTable, Scores, Spread, StartRecord, TestErrors, best_start, error_remarks},
    identifiability::Identifiability,
    training::StopReason,
};
use decoupler_files::{
    export::{Cell, Table, TableColumn, describe_search, format_duration, format_number, search_table},
    figure::frame_time,
};
use eframe::egui::{Align, Layout, Response, RichText, Ui};

use super::{decoders::decoders_ui, press::press_section_ui, recording::bias, view::TrainView};
use crate::window::{
    glossary,
    shared::{Effect, NetworkSource, RunResult, RunView, Shared, SourceKind, error_table_ui, sentence},
    test_view::Skin,
    theme::{space, type_size},
    widgets::{described_table_ui, dim_ui, fields::capitalised, fold_ui, note_ui, scrolled_ui, section_heading_ui},
};

/// The name of the network's row.
const NETWORK: &str = "network";

/// The error table, the button that opens a checkpoint, and the cost of the training. Before a training, the baselines.
pub fn report_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "report", |ui| {
        press_section_ui(ui, &mut view.press, shared);
        section_heading_ui(ui, "Errors on the test set");
        let result = view.result(shared).cloned();
        let shown = shared.shown_run().zip(result.as_ref());
        match shown {
            Some((run, result)) => errors_ui(ui, view, shared, (run, result), effects),
            None => expectation_ui(ui, shared),
        }
        if let Some((run, result)) = shown {
            section_heading_ui(ui, "Cost");
            cost_ui(ui, run, run.result.as_ref().unwrap_or(result));
        }
    });
}

/// The errors of the displayed network, what they mean, and how they came about.
fn errors_ui(
    ui: &mut Ui,
    view: &mut TrainView,
    shared: &Shared,
    (run, result): (&RunView, &RunResult),
    effects: &mut Vec<Effect>,
) {
    error_table_ui(ui, &run.error_table(result));
    match (view.scrub.epoch(), run.stop_reason) {
        (Some(_), _) => {
            dim_ui(ui, &format!("Of the network of epoch {}.", result.epochs_run));
        }
        (None, Some(reason)) => verdict_ui(ui, shared, (run, result), reason),
        (None, None) => {}
    }
    if let Some(skin) = &run.test.skin {
        conditioning_ui(ui, skin);
    }
    if let Some(note) = run.baselines.model_based_note() {
        note_ui(ui, note);
    }
    if let (Some(errors), Some(skin)) = (result.errors.nodes(), &run.test.skin) {
        let worst = errors.worst_node;
        ui.add_space(space(1));
        let text = format!("Worst node {} mm", format_number(errors.worst_mm));
        let text = RichText::new(text).size(type_size().note);
        let show_ui = |ui: &mut Ui| {
            let [snapshot, row, node] = [worst.snapshot, worst.row, worst.node].map(|place| place + 1);
            let hint = format!("Go to snapshot {snapshot}, row {row}, node {node}");
            ui.small_button("Show").on_hover_text(hint)
        };
        let (name, show) = line_ui(ui, text, show_ui);
        name.on_hover_text(glossary::WORST_NODE.hint);
        if show.clicked() {
            view.go_to(worst.snapshot, skin.node(worst));
        }
    }
    let model_based = run.baselines.model_based.as_ref().and_then(TestErrors::nodes);
    let source = { view.decoders.is_open }.then(|| NetworkSource::of(run));
    let (decoders, target) = (&mut view.decoders, &mut view.target);
    let measured = (&*run.problem, model_based);
    let asked = decoders_ui(ui, decoders, measured, target, source.as_ref());
    effects.extend(asked.map(|exporting| Effect::Export(Box::new(exporting))));
    let best = run.history.get(result.best_epoch);
    if let Some(effective) = best.and_then(|epoch| epoch.effective_parameters) {
        let effective = format_number(effective);
        let text = format!("Effective parameters {effective} of {} weights", run.weights);
        ui.label(RichText::new(text).size(type_size().note))
            .on_hover_text(glossary::EFFECTIVE_PARAMETERS.hint);
    }
    spread_ui(ui, run);
    search_ui(ui, run);
}

/// A name, and its value at the right end of the line.
fn line_ui(ui: &mut Ui, name: RichText, value_ui: impl FnOnce(&mut Ui) -> Response) -> (Response, Response) {
    ui.horizontal(|ui| {
        let layout = Layout::right_to_left(Align::Center);
        (ui.label(name), ui.with_layout(layout, value_ui).inner)
    })
    .inner
}

/// The candidates from which the settings were chosen, folded; those with the lowest errors first.
fn search_ui(ui: &mut Ui, run: &RunView) {
    let Some(search) = &run.search else { return };
    let mut table = search_table(search);
    let place = |heading: &str| table.columns.iter().position(|column| column.heading == heading);
    if let (Some(model), Some(error)) = (place("model"), place("error")) {
        let error_of = |row: &[Cell]| row[error].number().unwrap_or(f64::INFINITY);
        table
            .rows
            .sort_by(|one, other| error_of(one).total_cmp(&error_of(other)));
        table.columns.swap(0, model);
        table.rows.iter_mut().for_each(|row| row.swap(0, model));
    }
    let summary = format!("{} tried", search.tried.len());
    fold_ui(ui, "Choice of settings", &summary, |ui| {
        dim_ui(ui, &format!("{}.", describe_search(search)));
        described_table_ui(ui, "candidates", &table);
        for remark in search.remarks(&run.problem.targets) {
            note_ui(ui, &remark);
        }
    });
}

/// The table with the network's row still empty.
fn expectation_ui(ui: &mut Ui, shared: &Shared) {
    if shared.source == SourceKind::Recording {
        let text =
            "Press Train: the errors of each target appear here, next to those of the mean and of ridge regression.";
        dim_ui(ui, text);
        return;
    }
    let preview = shared.preview.as_ref();
    let known = preview.and_then(|preview| Some((preview, preview.settings.simulation()?, preview.baselines.clone()?)));
    if let Some((preview, simulation, baselines)) = known {
        // The settings may have changed to a scene whose baselines are still being computed.
        let draft = shared.draft.simulation();
        let is_of_draft =
            draft.is_some_and(|draft| (simulation.sensor, simulation.scene) == (draft.sensor, draft.scene));
        let published = shared.draft.published().filter(|_| is_of_draft);
        let scores = Scores {
            network: baselines.mean.clone(),
            network_alone: None,
            baselines,
            coverage: Vec::new(),
        };
        let mut tables = ErrorTable::of_scores(&simulation.problem(), &scores, published.as_ref());
        let rows = tables.iter_mut().flat_map(|table| &mut table.rows);
        rows.filter(|row| row.name == NETWORK)
            .for_each(|row| row.errors.fill(None));
        error_table_ui(ui, &tables);
        if let Some(skin) = &preview.test.skin {
            conditioning_ui(ui, skin);
        }
        ui.add_space(space(2));
    }
    // The paper's own network, not only its scene.
    dim_ui(
        ui,
        match shared.draft.published() {
            Some(_) => "Press Train to fill in the network's row. The paper's network takes a few seconds.",
            None => "Press Train to fill in the network's row.",
        },
    );
}

/// Reports where a baseline is better and what would help, or by how much the network is better.
fn verdict_ui(ui: &mut Ui, shared: &Shared, (run, result): (&RunView, &RunResult), reason: StopReason) {
    ui.add_space(space(2));
    let (settings, baselines) = (run.settings(), &run.baselines);
    let defect = result.defect.clone();
    let (faults, praise) = if let (Some(errors), Some(linear)) = (result.errors.nodes(), baselines.linear.nodes()) {
        let remarks = error_remarks(settings, &run.scores(result), Some(reason));
        let remark = remarks.iter().find(|(row, _)| *row == NETWORK);
        let remark = remark.map(|(row, remark)| format!("{row}: {remark}"));
        let is_worse = (errors.z_mm > linear.z_mm).then(|| {
            let remedy = reason.remedy(&settings.training.method);
            format!("a linear map of the resistances is better on z than this network: {remedy}")
        });
        let fault = defect.or(remark).or(is_worse);
        let praise = (fault.is_none() && errors.z_mm > 0.0).then(|| {
            let text = format!(
                "On z {} times as accurate as the linear map",
                format_number(linear.z_mm / errors.z_mm)
            );
            let model_based = baselines.model_based.as_ref().and_then(TestErrors::nodes);
            match model_based.and_then(|model_based| errors.times(model_based)) {
                None => format!("{text}."),
                Some(ratio) => format!("{text}; {} times the model-based error.", format_number(ratio)),
            }
        });
        (Vec::from_iter(fault.map(|fault| capitalised(&fault))), praise)
    } else {
        let pairs = result.errors.targets().iter().zip(baselines.linear.targets());
        let ratios = pairs.map(|(network, ridge)| ridge.rmse / network.rmse);
        let ratios = Vec::from_iter(ratios.filter(|ratio| ratio.is_finite()));
        let extreme = |pick: fn(f64, f64) -> f64| ratios.iter().copied().reduce(pick).map(format_number);
        let is_better = defect.is_none() && ratios.iter().all(|ratio| *ratio > 1.0);
        let range = extreme(f64::min).zip(extreme(f64::max)).filter(|_| is_better);
        let praise = range.map(|(low, high)| {
            let times = if low == high { low } else { format!("{low} to {high}") };
            format!("{times} times as accurate as ridge regression.")
        });
        let defect = defect.map(|defect| capitalised(&defect)).into_iter();
        (defect.chain(result.remarks.iter().cloned()).collect(), praise)
    };
    for fault in &faults {
        note_ui(ui, &sentence(fault));
    }
    if let Some(praise) = praise {
        dim_ui(ui, &praise);
    }
    let plan = run.setup.plan();
    if plan.is_some_and(|plan| plan.test.is_none() && plan.division.by == SplitBy::Random) {
        note_ui(ui, bias(SplitBy::Random));
    }
    if shared.has_changed_since(run) {
        dim_ui(ui, "The settings have changed since this training.");
    }
}

fn cost_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let epochs = result.epochs_run;
    let training = match run.settings().starts {
        ..=1 => "Training",
        _ => "Training, all restarts",
    };
    let text = |time: Option<Duration>| time.map_or_else(|| "–".to_owned(), format_duration);
    let mut rows = vec![(training, text(result.wall_time))];
    if epochs > 0 {
        let an_epoch = result.wall_time.map(|time| time.div_f64(epochs as f64));
        rows.push(("Time per epoch", text(an_epoch)));
    }
    rows.push(("Best epoch", result.best_epoch.to_string()));
    if let Some(time) = result.frame_time {
        let decoding = match run.problem.has_nodes() {
            true => "Decoding a snapshot",
            false => "Decoding a sample",
        };
        rows.push((decoding, frame_time(1e6 * time.as_secs_f64())));
    }
    for (name, value) in rows {
        line_ui(ui, name.into(), |ui| ui.label(value));
    }
}

/// Notes that the scene is ill-conditioned, so that its errors are not blamed on the network.
fn conditioning_ui(ui: &mut Ui, skin: &Skin) {
    let condition = skin.outlook.as_ref().map(|outlook| outlook.worst_row.condition());
    let Some(condition) = condition.filter(|condition| *condition >= Identifiability::LARGEST_CONDITION) else {
        return;
    };
    let condition = match condition.is_finite() {
        true => format!("{condition:.0e}"),
        false => "infinite".to_owned(),
    };
    ui.add_space(space(2));
    let text = format!(
        "This scene is ill-conditioned (condition number {condition}): no decoder can \
         distinguish some deformations. The note under Scene says what to change."
    );
    note_ui(ui, &text);
}

/// Shows the spread of the results of several starts: three figures of each error. Nothing for one start.
fn spread_ui(ui: &mut Ui, run: &RunView) {
    let starts = &run.starts;
    let Some(best) = best_start(starts).filter(|_| starts.len() > 1) else {
        return;
    };
    section_heading_ui(ui, &format!("Spread over {} restarts", starts.len()));
    let is_held_out = starts.iter().all(|start| start.validation_mse.is_some());
    let error = if is_held_out { "validation mse" } else { "training mse" };
    let spreads = [
        (
            run.problem.test_percent_name(),
            Spread::of(starts.iter().filter_map(StartRecord::percent)),
        ),
        (error, Spread::of(starts.iter().map(StartRecord::deciding_mse))),
    ];
    let row = |(name, spread): (&str, Option<Spread>)| {
        let Spread {
            smallest,
            median,
            largest,
            ..
        } = spread?;
        Some(vec![Cell::from(name), smallest.into(), median.into(), largest.into()])
    };
    let table = Table {
        columns: vec![
            TableColumn::new("error", "", ""),
            TableColumn::field("min").meaning("Best start."),
            TableColumn::field("median").meaning("Median of all starts: the typical result of a single start."),
            TableColumn::field("max").meaning("Worst start."),
        ],
        rows: spreads.into_iter().filter_map(row).collect(),
    };
    described_table_ui(ui, "spread", &table);
    let best = best + 1;
    dim_ui(
        ui,
        &match run.settings().combine {
            Combination::Best => format!("Start {best} is kept: it has the lowest {error}."),
            Combination::Mean => format!("The mean of all starts is kept; start {best} has the lowest {error}."),
        },
    );
}
