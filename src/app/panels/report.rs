use eframe::egui::{Align, Grid, Layout, RichText, ScrollArea, Ui, WidgetInfo, accesskit::Role};

use super::fields::capitalised;
use crate::{
    app::{
        action::Action,
        export_kind::ExportKind,
        state::{RunResult, RunView, State},
        theme::{Theme, ghost_button, note_ui, section_heading_ui, semibold, space, type_size},
    },
    evaluation::{Errors, error_rows},
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
        section_heading_ui(ui, "Take it with you");
        export_ui(ui, &mut actions);
    });
    actions
}

/// Headings of the error columns with what they mean.
const COLUMNS: [(&str, &str); 5] = [
    (
        "Z %",
        "AveZerr of the paper: mean |error| of z in percent of the coordinate z",
    ),
    ("X %", "AveXerr: mean |error| of x in percent of the coordinate x"),
    ("Y %", "AveYerr: mean |error| of y in percent of the coordinate y"),
    ("mm", "Mean |error| of z in millimetres"),
    (
        "stroke %",
        "Mean |error| of z in percent of the full scale, the distance a node can travel",
    ),
];

fn error_table_ui(ui: &mut Ui, run: &RunView, result: &RunResult) {
    let palette = Theme::of(ui).palette;
    let grid = Grid::new("errors")
        .num_columns(6)
        .spacing([space(3), space(2)])
        .min_col_width(0.0);
    grid.show(ui, |ui| {
        ui.label("");
        for (heading, meaning) in COLUMNS {
            let text = RichText::new(heading).size(type_size().small).color(palette.dim);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.label(text).on_hover_text(meaning)
            });
        }
        ui.end_row();
        for row in error_rows(&result.errors, &run.baselines, run.published.as_ref()) {
            let is_network = row.name == "network";
            let colour = match row.name {
                "network" => palette.accent,
                "published" => palette.dim,
                _ => palette.text,
            };
            let styled = |text: &str| {
                let text = RichText::new(text).size(type_size().note).color(colour);
                if is_network {
                    text.font(semibold(type_size().note))
                } else {
                    text
                }
            };
            ui.label(styled(&capitalised(row.name)));
            for ((heading, _), value) in COLUMNS.iter().zip(row.values()) {
                let cell = format_number(value);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    let response = ui.label(styled(&cell));
                    let text = format!("{}, {heading}: {cell}", row.name);
                    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &text));
                });
            }
            ui.end_row();
        }
    });
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
    rows.push(("Decoding a snapshot", format_duration(result.frame_time)));
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
