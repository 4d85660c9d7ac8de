use eframe::egui::{Align, Layout, RichText, ScrollArea, Ui, WidgetInfo, accesskit::Role};

use super::table::{Column, Row, table_ui};
use crate::{
    app::{
        action::Action,
        export_kind::ExportKind,
        state::{RunResult, RunView, State},
        theme::{Theme, ghost_button, note_ui, section_heading_ui, space, type_size},
    },
    evaluation::{ErrorRow, Errors, error_rows},
    export::{format_duration, format_number},
};

/// The error table, what it cost, and what can be taken away.
pub fn report_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        section_heading_ui(ui, "Errors on the test set");
        let shown = state.shown_run().and_then(|run| Some((run, run.result.as_ref()?)));
        let dim = Theme::of(ui).palette.dim;
        let Some((run, result)) = shown else {
            let text = "Nothing trained for these settings yet. Press Train: the paper's network takes a few seconds.";
            ui.label(RichText::new(text).size(type_size().note).color(dim));
            return;
        };
        error_table_ui(ui, run, result);
        verdict_ui(ui, run, result);
        worst_node_ui(ui, result, &mut actions);
        section_heading_ui(ui, "Cost");
        cost_ui(ui, run, result);
        section_heading_ui(ui, "Export");
        export_ui(ui, &mut actions);
    });
    actions
}

/// The error columns, in the order of [`ErrorRow::values`]; the last, the worst node, stands below the table.
const COLUMNS: [Column; 5] = [
    Column {
        heading: "Z %",
        meaning: "AveZerr of the paper: mean |error| of z in percent of the coordinate z",
    },
    Column {
        heading: "X %",
        meaning: "AveXerr: mean |error| of x in percent of the coordinate x",
    },
    Column {
        heading: "Y %",
        meaning: "AveYerr: mean |error| of y in percent of the coordinate y",
    },
    Column {
        heading: "mm",
        meaning: "Mean |error| of z in millimetres",
    },
    Column {
        heading: "stroke %",
        meaning: "Mean |error| of z in percent of the full scale, the distance a node can travel",
    },
];

fn error_table_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let palette = Theme::of(ui).palette;
    let row = |row: ErrorRow| Row {
        name: row.name,
        cells: row.values()[..COLUMNS.len()]
            .iter()
            .map(|value| format_number(*value))
            .collect(),
        colour: match row.name {
            "network" => palette.accent,
            "published" => palette.dim,
            _ => palette.text,
        },
        is_strong: row.name == "network",
    };
    let rows = error_rows(&result.errors, &run.baselines, run.published.as_ref());
    ui.scope(|ui| table_ui(ui, &COLUMNS, &rows.into_iter().map(row).collect::<Vec<_>>()));
}

/// Says plainly where the network loses, and how.
fn verdict_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let loses_to = |baseline: &Errors| result.errors.z_mm > baseline.z_mm;
    let text = if loses_to(&run.baselines.mean) {
        "Always answering the mean of the training set would be better than this network. Train longer, or lower the learning rate."
    } else if loses_to(&run.baselines.linear) {
        "A linear map on resistance is better than this network on z. More epochs or more hidden nodes change that."
    } else {
        return;
    };
    ui.add_space(space(2));
    note_ui(ui, text);
}

fn worst_node_ui(ui: &mut Ui, result: &RunResult, actions: &mut Vec<Action>) {
    let worst = result.errors.worst_node;
    ui.add_space(space(1));
    ui.horizontal(|ui| {
        let text = format!("Worst node {} mm", format_number(result.errors.worst_mm));
        ui.label(RichText::new(text).size(type_size().note));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let place = format!(
                "snapshot {}, row {}, node {}",
                worst.snapshot + 1,
                worst.row + 1,
                worst.node + 1
            );
            if ui
                .small_button("Show")
                .on_hover_text(format!("Go to {place}"))
                .clicked()
            {
                actions.push(Action::GoTo(worst));
            }
        });
    });
}

fn cost_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let epochs = run.latest().map_or(0, |latest| latest.epoch);
    let mut rows = vec![("Training", format_duration(result.elapsed))];
    if epochs > 0 {
        rows.push(("An epoch", format_duration(result.elapsed.div_f64(epochs as f64))));
    }
    let microseconds = 1e6 * result.frame_time.as_secs_f64();
    rows.push(("Decoding a snapshot", format!("{} µs", format_number(microseconds))));
    rows.push(("Best epoch", result.best_epoch.to_string()));
    for (name, value) in rows {
        ui.horizontal(|ui| {
            ui.label(name);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(value));
        });
    }
}

fn export_ui(ui: &mut Ui, actions: &mut Vec<Action>) {
    let theme = Theme::of(ui);
    for kind in ExportKind::ALL {
        ui.horizontal(|ui| {
            let width = ui.available_width() - space(14);
            let button = ghost_button(theme, kind.name()).min_size([width, space(7)].into());
            if ui.add(button).on_hover_text(kind.description()).clicked() {
                actions.push(Action::ChooseFile(kind));
            }
            let path = ui.add(ghost_button(theme, "Path").min_size([space(12), space(7)].into()));
            path.widget_info(|| {
                WidgetInfo::labeled(Role::Button, true, format!("Type a path for the {}", kind.file_kind()))
            });
            if path.on_hover_text("Type the path instead of choosing it").clicked() {
                actions.push(Action::TypePath(kind));
            }
        });
    }
}
