//! The list of networks, and two of them side by side.

use std::sync::Arc;

use eframe::egui::{Button, RichText, ScrollArea, Ui};

use super::{error_table::error_tables_ui, model::Trained, runs::Runs, state::OwnDataView};
use crate::{
    app::{
        theme::{Theme, semibold, space, type_size},
        widgets::{
            ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui, note_ui, placeholder_ui,
        },
    },
    evaluation::TargetErrors,
    export::{MeasuredNetworkFile, format_number},
    import::Plan,
};

/// The list above, the comparison below.
pub(super) fn runs_ui(ui: &mut Ui, view: &mut OwnDataView) {
    if view.runs.runs.is_empty() {
        placeholder_ui(ui, "Every network trained or opened appears here, to be compared.");
        return;
    }
    let kept = match &view.keeping.folder {
        Some(_) => "They are kept from session to session.",
        None => "They are not kept after this session.",
    };
    dim_ui(
        ui,
        &format!("Click a network to compare it with the one on show; double-click to show it. {kept}"),
    );
    ui.add_space(space(1));
    let whole = ui.available_height();
    let shown = view.shown.as_ref().map(|shown| shown.file.clone());
    let mut click = None;
    ui.allocate_ui([ui.available_width(), 0.45 * whole].into(), |ui| {
        ui.set_min_height(0.45 * whole);
        click = list_ui(ui, &view.runs, |run| {
            shown.as_ref().is_some_and(|shown| Arc::ptr_eq(shown, &run.file))
        });
    });
    match click {
        Some(TableClick::Select(place)) => {
            view.runs.marked = (view.runs.marked != Some(place)).then_some(place);
            view.runs.is_removing = false;
            ui.request_repaint();
        }
        Some(TableClick::Open(place)) => {
            view.show_run(place);
            ui.request_repaint();
        }
        _ => {}
    }
    marked_ui(ui, view);
    let marked = view.runs.marked.and_then(|place| view.runs.get(place));
    match (marked.map(|(marked, _)| marked), &view.shown) {
        (Some(marked), Some(shown)) if !Arc::ptr_eq(&marked.file, &shown.file) => {
            ScrollArea::vertical()
                .id_salt("compared")
                .auto_shrink(false)
                .show(ui, |ui| {
                    comparison_ui(ui, shown, marked);
                });
        }
        (Some(_), Some(_)) => {
            dim_ui(ui, "This is the network on show. Click another one to compare them.");
        }
        _ => {}
    }
}

/// Actions on the marked network.
fn marked_ui(ui: &mut Ui, view: &mut OwnDataView) {
    let Some(place) = view.runs.marked else { return };
    let is_busy = view.phase.is_busy();
    ui.horizontal(|ui| {
        if view.runs.is_removing {
            ui.label("Remove this network?");
            if ui.button("Remove").clicked() {
                if let Some(file) = view.runs.remove_marked() {
                    view.keeping.remove(file);
                }
            } else if ui.button("Keep").clicked() {
                view.runs.is_removing = false;
            }
            return;
        }
        if ui.add_enabled(!is_busy, Button::new("Show")).clicked() {
            view.show_run(place);
        }
        view.runs.is_removing = ui.button("Remove…").clicked();
    });
}

fn list_ui(ui: &mut Ui, runs: &Runs, is_shown: impl Fn(&Trained) -> bool) -> Option<TableClick> {
    let palette = Theme::of(ui).palette;
    // As many targets as there is room for; all are in the report.
    const MOST_TARGETS: usize = 3;
    let mut targets: Vec<String> = Vec::new();
    for target in runs
        .runs
        .iter()
        .flat_map(|run| run.trained.file.targets.iter().take(MOST_TARGETS))
    {
        let name = target.title();
        if targets.len() < MOST_TARGETS && !targets.contains(&name) {
            targets.push(name);
        }
    }
    let headings = Vec::from_iter(targets.iter().map(|name| format!("RMSE {name}")));
    let figure = |heading, text| TableColumn::figure(heading).width(ColumnWidth::Fits(text));
    let name = TableColumn::text("network").width(ColumnWidth::Rest);
    let mut columns = vec![name, figure("split", "random"), figure("epochs", "10000")];
    columns.extend(headings.iter().map(|heading| figure(heading.as_str(), "0.00012")));
    let row = |place: usize| {
        let run = &runs.runs[place].trained;
        let rmse = |title: &String| {
            let index = run.file.targets.iter().position(|target| target.title() == *title);
            let errors: Option<&TargetErrors> = index.and_then(|index| run.file.errors.get(index));
            TableCell::new(format_number(errors.map(|errors| errors.rmse)))
        };
        let mut cells = vec![
            TableCell::new(&run.name).strong(is_shown(run)),
            TableCell::new(split(&run.file.plan)),
            TableCell::new(run.epochs_run.to_string()),
        ];
        cells.extend(targets.iter().map(rmse));
        TableRow::new(cells)
            .labelled(&run.name)
            .selected(runs.marked == Some(place))
            .meaning("Click to compare, double-click to show.")
            .dot(is_shown(run).then_some(palette.accent))
    };
    let table = TableView::new("own data runs", &columns).clickable();
    table.show(ui, runs.runs.len(), row)
}

fn split(plan: &Plan) -> String {
    match plan.test {
        Some(_) => "file".to_owned(),
        None => plan.division.by.to_string(),
    }
}

/// Errors of two networks, target by target.
fn comparison_ui(ui: &mut Ui, shown: &Trained, marked: &Trained) {
    ui.label(RichText::new("Errors on the test samples").font(semibold(type_size().title)));
    dim_ui(ui, &format!("A: {}. B, on show: {}.", marked.name, shown.name));
    let (one, other) = (&marked.file, &shown.file);
    let samples = |plan: &Plan| {
        let mut plan = plan.clone();
        plan.import.inputs.clear();
        plan.import.units.clear();
        plan
    };
    if samples(&one.plan) != samples(&other.plan) || one.settings.seed != other.settings.seed {
        note_ui(
            ui,
            "These networks were tested on other samples or have other targets, so their errors do not compare directly.",
        );
    }
    let common: Vec<_> = other
        .targets
        .iter()
        .filter(|target| one.targets.contains(target))
        .cloned()
        .collect();
    let of = |file: &MeasuredNetworkFile| -> Vec<TargetErrors> {
        let index = |target| file.targets.iter().position(|other| other == target);
        common
            .iter()
            .filter_map(|target| file.errors.get(index(target)?))
            .copied()
            .collect()
    };
    let (one, other) = (of(one), of(other));
    error_tables_ui(ui, &common, &[("A", &one), ("B", &other)]);
}
