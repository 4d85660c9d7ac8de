use eframe::egui::{Align, Layout, RichText, Ui};

use super::{lighting::places_in_bar, place::TestPlace, section::step_ui};
use crate::window::{
    shared::Shared,
    theme::{Theme, semibold, type_size},
    views::train::state::TrainView,
    widgets::{ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui},
};
use decoupler_core::text::counted;
use decoupler_files::{export::format_number, figure::ErrorBins};

const fn figure<'a>(heading: &'a str, widest: &'a str) -> TableColumn<'a> {
    TableColumn::figure(heading).width(ColumnWidth::Fits(widest))
}

/// The values of the test set whose errors the chosen bar of the histogram holds: nodes, or samples of a recording. The one
/// under the pointer lights up; a click goes to its snapshot.
pub fn bar_nodes_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let Some(bar) = view.lights.bar else { return };
    let Some(bins) = view.drawn.pairs().map(ErrorBins::new) else {
        return;
    };
    let places = places_in_bar(view, shared);
    let channel = shared
        .recorded_test()
        .and_then(|test| test.problem.targets.get(view.target_of(test)));
    let unit = match channel {
        None => Some("mm"),
        Some(channel) => channel.unit.as_deref(),
    };
    let with_unit = |text: &str| unit.map_or_else(|| text.to_owned(), |unit| format!("{text} {unit}"));
    let [low, high] = bins.range(bar).map(|end| format_number(end).replace('-', "−"));
    let last = ErrorBins::COUNT - 1;
    ui.horizontal(|ui| {
        let what = if channel.is_some() { "sample" } else { "node" };
        ui.label(RichText::new(counted(places.len(), what)).font(semibold(type_size().note)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if step_ui(ui, "›", "Next bar", "Goes to the bar on the right (]).", bar < last) {
                view.lights.bar = Some(bar + 1);
            }
            if step_ui(ui, "‹", "Previous bar", "Goes to the bar on the left ([).", bar > 0) {
                view.lights.bar = Some(bar - 1);
            }
        });
    });
    dim_ui(ui, &with_unit(&format!("{low} to {high}")));
    let palette = Theme::of(ui).palette;
    let numbers = |place: TestPlace| -> Vec<usize> {
        match (shared.test(), place.node) {
            (Some(test), Some(node)) => {
                let per_row = test.sensor.scale.nodes_per_row();
                let row = test.rows.get(node / per_row).copied().unwrap_or_default();
                vec![place.snapshot, row, node % per_row]
            }
            _ => vec![place.snapshot],
        }
    };
    let row = |at: usize| {
        let (place, error) = places[at];
        let texts = Vec::from_iter(numbers(place).into_iter().map(|number| (number + 1).to_string()));
        let error = format_number(error).replace('-', "−");
        let is_here = place.snapshot == view.snapshot;
        let label = match &texts[..] {
            [snapshot, row, node] => format!("Snapshot {snapshot}, row {row}, node {node}: {error} mm"),
            texts => with_unit(&format!("Sample {}: {error}", texts.join(" "))),
        };
        TableRow::new(texts.into_iter().chain([error]).map(TableCell::new))
            .labelled(label)
            .selected(is_here && (channel.is_some() || place.node == view.lights.node))
            .colour(if is_here { palette.text } else { palette.dim })
    };
    let error_heading = unit.map_or_else(|| "Error".to_owned(), |unit| format!("Error {unit}"));
    let error = figure(&error_heading, "−0.0123");
    let columns = match channel {
        None => vec![
            figure("Snapshot", "1000"),
            figure("Row", "100"),
            figure("Node", "100"),
            error,
        ],
        Some(_) => vec![figure("Sample", "100000"), error],
    };
    match TableView::new("nodes in bar", &columns)
        .clickable()
        .show(ui, places.len(), row)
    {
        Some(TableClick::Point(at)) => {
            let here = places.get(at).filter(|(place, _)| place.snapshot == view.snapshot);
            let node = here.and_then(|(place, _)| place.node);
            if node != view.lights.node {
                view.lights.node = node;
                ui.request_repaint();
            }
        }
        Some(TableClick::Select(at) | TableClick::Open(at)) => {
            if let Some((place, _)) = places.get(at) {
                view.go_to(*place);
                ui.request_repaint();
            }
        }
        Some(TableClick::Sort(_)) | None => {}
    }
}
