//! Report of a training in figures.

use std::time::Duration;

use decoupler_core::{
    evaluation::{Combination, ErrorTable, Errors, Scores, Spread, StartRecord, TestErrors, best_start, error_remarks},
    identifiability::Identifiability,
    text::counted,
    training::StopReason,
};
use decoupler_files::{
    export::{
        Cell, Table, TableColumn, describe_search, describe_worse_than_ridge, format_duration, format_number,
        search_table,
    },
    figure::frame_time,
    import::Setup,
};
use eframe::egui::{Align, Button, Frame, Layout, Margin, Response, RichText, Stroke, Ui, WidgetInfo, accesskit::Role};

use super::{decoders::decoders_ui, press::press_section_ui, recording::Fix, view::TrainView};
use crate::window::{
    glossary,
    shared::{
        Command, Effect, ExportLine, Exporting, NetworkSource, RunResult, RunView, Shared, SourceKind, ViewKind,
        command_button_ui, error_table_ui, sentence, targets_table_ui,
    },
    test_view::Skin,
    theme::{Theme, radius, space, type_size},
    widgets::{
        described_table_ui, dim_ui, fields::capitalised, fold_ui, ghost_button, note_ui, primary_button, scrolled_ui,
        section_heading_ui,
    },
};

/// The name of the network's row.
const NETWORK: &str = "network";

/// The verdict on a training with what mends the cause, its errors, and what can be done with it; the rest in Details. Before
/// a training, the baselines.
pub fn report_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "report", |ui| {
        press_section_ui(ui, &mut view.press, shared);
        let result = view.result(shared).cloned();
        let Some((run, result)) = shared.shown_run().zip(result.as_ref()) else {
            section_heading_ui(ui, "Errors on the test set");
            return expectation_ui(ui, shared);
        };
        ui.add_space(space(1));
        let is_old = shared.is_old(run);
        if is_old {
            previous_ui(ui, run, shared, effects);
        }
        let remarks = match (view.scrub.epoch(), run.stop_reason) {
            (None, Some(reason)) if !is_old => verdict_ui(ui, view, shared, (run, result, reason), effects),
            _ => Vec::new(),
        };
        section_heading_ui(ui, "Errors on the test set");
        let tables = run.error_table(result);
        ui.scope(|ui| {
            if is_old {
                ui.multiply_opacity(OLD);
            }
            match run.problem.has_nodes() {
                true => error_table_ui(ui, &tables),
                false => targets_table_ui(ui, &tables),
            }
        });
        if view.scrub.epoch().is_some() {
            dim_ui(ui, &format!("Of the network of epoch {}.", result.epochs_run));
        }
        if let (Combination::Mean, 2..) = (run.settings().combine, run.starts.len()) {
            let text = format!(
                "The network is the average of {}; Details lists each of them.",
                run.starts.len()
            );
            dim_ui(ui, &text);
        }
        if let (Some(errors), Some(skin)) = (result.errors.nodes(), &run.test.skin) {
            worst_node_ui(ui, view, errors, skin);
        }
        let summary = match remarks.len() {
            0 => String::new(),
            count => counted(count, "remark"),
        };
        fold_ui(ui, "Details", &summary, |ui| {
            for remark in &remarks {
                note_ui(ui, remark);
            }
            if !run.problem.has_nodes() {
                error_table_ui(ui, &tables);
            }
            details_ui(ui, view, (run, result), effects);
        });
        use_ui(ui, run, shared, effects);
        runs_ui(ui, shared, effects);
    });
}

/// Opacity of a result of other settings than those on the left.
pub const OLD: f32 = 0.5;

/// Says that the settings have changed, with the ways out.
fn previous_ui(ui: &mut Ui, run: &RunView, shared: &Shared, effects: &mut Vec<Effect>) {
    dim_ui(ui, "Result of the previous settings.");
    ui.horizontal(|ui| {
        command_button_ui(ui, shared, Command::Train, ghost_button("Train again"), None, effects);
        let hint = "Goes back to the settings of this result.";
        if ui.add(ghost_button("Undo changes")).on_hover_text(hint).clicked() {
            let plan = run.asked.plan.as_deref().map(|plan| (**plan).clone());
            let setup = Setup::of(run.asked.settings, plan).expect("it was that of a training");
            effects.push(Effect::TakeSetup(Box::new(setup)));
            effects.push(Effect::ChooseAutomatically(run.search.is_some()));
        }
    });
}

/// The node with the largest error, and the way to it.
fn worst_node_ui(ui: &mut Ui, view: &mut TrainView, errors: &Errors, skin: &Skin) {
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

/// Other decoders, restarts, the choice of settings, and the cost.
fn details_ui(ui: &mut Ui, view: &mut TrainView, (run, result): (&RunView, &RunResult), effects: &mut Vec<Effect>) {
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
    section_heading_ui(ui, "Cost");
    cost_ui(ui, run, run.result.as_ref().unwrap_or(result));
}

/// What can be done with a trained network.
fn use_ui(ui: &mut Ui, run: &RunView, shared: &Shared, effects: &mut Vec<Effect>) {
    section_heading_ui(ui, "Use it");
    let exporting = |line| Effect::Export(Box::new(Exporting::new(line, "")));
    let live = "Decodes readings as they arrive.";
    let [network, report] = [ExportLine::Network, ExportLine::Report].map(|line| (line.words().1, exporting(line)));
    let buttons = [
        ("Test it live", live, Effect::Do(Command::Show(ViewKind::Live))),
        ("Export network…", network.0, network.1),
        ("Save report…", report.0, report.1),
    ];
    let width = 0.5 * (ui.available_width() - space(1));
    ui.spacing_mut().item_spacing = [space(1); 2].into();
    let button = |text| ghost_button(text).min_size([width, space(7)].into());
    ui.horizontal_wrapped(|ui| {
        command_button_ui(ui, shared, Command::DecodeFile, button("Decode file…"), None, effects);
        for (text, hint, effect) in buttons {
            let shown = ui.add_enabled(run.stop_reason.is_some(), button(text));
            if shown.on_hover_text(hint).clicked() {
                effects.push(effect);
            }
        }
    });
}

/// The latest runs of the list.
fn runs_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
    /// More are in the Compare view.
    const LATEST: usize = 5;
    let runs = &shared.runs.workspace.runs;
    if runs.is_empty() {
        return;
    }
    section_heading_ui(ui, "Runs");
    for run in runs.iter().rev().take(LATEST) {
        let name = format!("Open {}", run.name);
        let open_ui = |ui: &mut Ui| {
            let button = ui.add_enabled(!shared.phase.is_busy(), Button::new("Open").small());
            button.widget_info(|| WidgetInfo::labeled(Role::Button, true, &name));
            button
        };
        if line_ui(ui, RichText::new(&run.name), open_ui).1.clicked() {
            effects.push(Effect::OpenRun(run.id));
        }
    }
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
        if let Some(note) = preview.test.skin.as_ref().and_then(|skin| ill_conditioned(skin)) {
            note_ui(ui, &note);
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

/// A remark on a result, and what is offered to fix its cause.
type Remark<'a> = (String, Option<Offered<'a>>);

/// A button of a remark.
enum Offered<'a> {
    Fix(&'a Fix),
    UseRidge,
}

/// Reports the most urgent remark with what mends it, or by how much the network is better; returns the other remarks.
fn verdict_ui(
    ui: &mut Ui,
    view: &TrainView,
    shared: &Shared,
    (run, result, reason): (&RunView, &RunResult, StopReason),
    effects: &mut Vec<Effect>,
) -> Vec<String> {
    let fixes = view.recording.fixes.iter();
    let fixes = fixes.map(|fix| (fix.problem.clone(), Some(Offered::Fix(fix))));
    let mut remarks = Vec::<Remark<'_>>::from_iter(fixes);
    remarks.extend(result.defect.as_ref().map(|defect| (capitalised(defect), None)));
    let praise = match (result.errors.nodes(), run.baselines.linear.nodes()) {
        (Some(errors), Some(linear)) => of_nodes(run, (result, errors, linear), reason, &mut remarks),
        _ => of_targets(run, result, &mut remarks),
    };
    let mut remarks = remarks.into_iter();
    match (remarks.next(), praise) {
        (Some((text, offered)), _) => {
            note_ui(ui, &sentence(&text));
            let mut is_clicked = |name: &str| ui.add(primary_button(name)).clicked();
            match offered {
                Some(Offered::Fix(fix)) if is_clicked(&fix.button) => {
                    effects.extend(fix.effects(shared));
                    effects.push(Effect::Do(Command::Train));
                }
                Some(Offered::UseRidge) if is_clicked("Use ridge") => effects.push(Effect::UseRidge),
                _ => {}
            }
        }
        (None, Some(praise)) => good_ui(ui, &praise),
        (None, None) => {}
    }
    remarks.map(|(text, _)| sentence(&text)).collect()
}

/// Adds the remarks on the errors of nodes; returns by how much the network is better than the linear map.
fn of_nodes(
    run: &RunView,
    (result, errors, linear): (&RunResult, &Errors, &Errors),
    reason: StopReason,
    remarks: &mut Vec<Remark<'_>>,
) -> Option<String> {
    let (settings, baselines) = (run.settings(), &run.baselines);
    let of_network = error_remarks(settings, &run.scores(result), Some(reason));
    let of_network = of_network.iter().find(|(row, _)| *row == NETWORK);
    if let (Some((row, remark)), None) = (of_network, &result.defect) {
        remarks.push((capitalised(&format!("{row}: {remark}")), None));
    } else if errors.z_mm > linear.z_mm && result.defect.is_none() {
        let remedy = reason.remedy(&settings.training.method);
        let text = format!("A linear map of the resistances is better on z than this network: {remedy}");
        remarks.push((text, None));
    }
    let condition = run.test.skin.as_ref().and_then(|skin| ill_conditioned(skin));
    let notes = condition
        .into_iter()
        .chain(baselines.model_based_note().map(str::to_owned));
    let is_good = remarks.is_empty() && errors.z_mm > 0.0;
    remarks.extend(notes.map(|note| (note, None)));
    let times = format_number(linear.z_mm / errors.z_mm);
    let model_based = baselines.model_based.as_ref().and_then(TestErrors::nodes);
    let ratio = model_based.and_then(|model_based| errors.times(model_based));
    let ratio = ratio.map_or_else(String::new, |ratio| {
        format!("; {} times the model-based error", format_number(ratio))
    });
    is_good.then(|| format!("On z {times} times as accurate as the linear map{ratio}."))
}

/// Adds the remarks on the errors of targets; returns by how much the network is better than ridge regression.
fn of_targets(run: &RunView, result: &RunResult, remarks: &mut Vec<Remark<'_>>) -> Option<String> {
    let pairs = result.errors.targets().iter().zip(run.baselines.linear.targets());
    let ratios = pairs.map(|(network, ridge)| ridge.rmse / network.rmse);
    let ratios = Vec::from_iter(ratios.filter(|ratio| ratio.is_finite()));
    let extreme = |pick: fn(f64, f64) -> f64| ratios.iter().copied().reduce(pick).map(format_number);
    let may_use_ridge =
        run.kept.is_none() && run.stop_reason != Some(StopReason::Stopped) && result.networks.only().is_some();
    let worse = describe_worse_than_ridge(&run.problem, &run.scores(result));
    for remark in &result.remarks {
        let offered = (may_use_ridge && worse.as_ref() == Some(remark)).then_some(Offered::UseRidge);
        remarks.push((remark.clone(), offered));
    }
    // What has a button comes first.
    remarks.sort_by_key(|(_, offered)| offered.is_none());
    let (low, high) = extreme(f64::min).zip(extreme(f64::max))?;
    let times = if low == high { low } else { format!("{low} to {high}") };
    let holds = match result.coverage.iter().any(Option::is_some) {
        true => ", and its intervals hold on the test samples",
        false => "",
    };
    let is_better = ratios.iter().all(|ratio| *ratio > 1.0);
    is_better.then(|| format!("{times} times as accurate as ridge regression{holds}."))
}

/// Shows a tinted note, for a success.
fn good_ui(ui: &mut Ui, text: &str) {
    let good = Theme::of(ui).palette.good;
    Frame::new()
        .fill(good.gamma_multiply(0.08))
        .stroke(Stroke::new(1.0, good.gamma_multiply(0.3)))
        .corner_radius(radius())
        .inner_margin(Margin::symmetric(8, 8))
        .show(ui, |ui| {
            ui.set_width(ui.available_width());
            ui.label(RichText::new(text).size(type_size().note).color(good));
        });
}

fn cost_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let epochs = result.epochs_run;
    let text = |time: Option<Duration>| time.map_or_else(|| "–".to_owned(), format_duration);
    let mut rows = vec![("Training time", text(result.wall_time))];
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

/// Says that the scene is ill-conditioned, so that its errors are not blamed on the network.
fn ill_conditioned(skin: &Skin) -> Option<String> {
    let condition = skin.outlook.as_ref()?.worst_row.condition();
    let condition = match condition.is_finite() {
        _ if condition < Identifiability::LARGEST_CONDITION => return None,
        true => format!("{condition:.0e}"),
        false => "infinite".to_owned(),
    };
    Some(format!(
        "This scene is ill-conditioned (condition number {condition}): no decoder can distinguish some deformations. The note \
         under Scene says what to change."
    ))
}

/// Shows the spread of the results of several starts: three figures of each error. Nothing for one start.
fn spread_ui(ui: &mut Ui, run: &RunView) {
    let starts = &run.starts;
    let Some(best) = best_start(starts).filter(|_| starts.len() > 1) else {
        return;
    };
    let heading = match run.settings().combine {
        Combination::Best => format!("Spread over {} restarts", starts.len()),
        Combination::Mean => format!("The {} networks, each alone", starts.len()),
    };
    section_heading_ui(ui, &heading);
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
            TableColumn::field("min").meaning("Best restart."),
            TableColumn::field("median").meaning("Median of all restarts: the typical result of a single one."),
            TableColumn::field("max").meaning("Worst restart."),
        ],
        rows: spreads.into_iter().filter_map(row).collect(),
    };
    described_table_ui(ui, "spread", &table);
    let best = best + 1;
    dim_ui(
        ui,
        &match run.settings().combine {
            Combination::Best => format!("Restart {best} is kept: it has the lowest {error}."),
            Combination::Mean => format!(
                "Their average is used, which is often better than each; network {best} has the lowest {error}."
            ),
        },
    );
}
