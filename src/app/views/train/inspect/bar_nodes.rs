use eframe::egui::{Align, Layout, RichText, Ui};

use super::{lighting::addresses_in_bar, section::step_ui};
use crate::{
    app::{
        shared::Shared,
        theme::{Theme, semibold, type_size},
        views::train::state::TrainView,
        widgets::{ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui},
    },
    evaluation::NodeAddress,
    export::format_number,
    figure::ErrorBins,
    sensor::counted,
};

const COLUMNS: [TableColumn<'static>; 4] = [
    figure("Snapshot", "1000"),
    figure("Row", "100"),
    figure("Node", "100"),
    figure("Error mm", "−0.0123"),
];

const fn figure(heading: &'static str, widest: &'static str) -> TableColumn<'static> {
    TableColumn::figure(heading).width(ColumnWidth::Fits(widest))
}

/// The nodes whose errors the chosen bar of the histogram holds. The one under the pointer lights up; a click goes to its
/// snapshot.
pub fn bar_nodes_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let (Some(bar), Some(test)) = (view.lights.bar, shared.test()) else {
        return;
    };
    let Some(bins) = view.drawn.pairs_mm().map(ErrorBins::new) else {
        return;
    };
    let nodes = addresses_in_bar(view, test);
    let [low, high] = bins.range_mm(bar).map(|end| format_number(end).replace('-', "−"));
    let last = ErrorBins::COUNT - 1;
    ui.horizontal(|ui| {
        ui.label(RichText::new(counted(nodes.len(), "node")).font(semibold(type_size().note)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if step_ui(ui, "›", "Next bar", "Goes to the bar on the right (]).", bar < last) {
                view.lights.bar = Some(bar + 1);
            }
            if step_ui(ui, "‹", "Previous bar", "Goes to the bar on the left ([).", bar > 0) {
                view.lights.bar = Some(bar - 1);
            }
        });
    });
    dim_ui(ui, &format!("{low} to {high} mm"));
    let palette = Theme::of(ui).palette;
    let row = |place: usize| {
        let (address, error_mm) = nodes[place];
        let NodeAddress { snapshot, row, node } = address;
        let texts = [snapshot + 1, row + 1, node + 1].map(|number| number.to_string());
        let error = format_number(error_mm).replace('-', "−");
        let is_lit = snapshot == view.snapshot && test.node(address) == view.lights.node;
        let label = format!("Snapshot {}, row {}, node {}: {error} mm", texts[0], texts[1], texts[2]);
        let colour = if snapshot == view.snapshot {
            palette.text
        } else {
            palette.dim
        };
        TableRow::new(texts.into_iter().chain([error]).map(TableCell::new))
            .labelled(label)
            .selected(is_lit)
            .colour(colour)
    };
    let table = TableView::new("nodes in bar", &COLUMNS).clickable();
    match table.show(ui, nodes.len(), row) {
        Some(TableClick::Point(place)) => {
            let here = nodes
                .get(place)
                .filter(|(address, _)| address.snapshot == view.snapshot);
            let node = here.and_then(|(address, _)| test.node(*address));
            if node != view.lights.node {
                view.lights.node = node;
                ui.request_repaint();
            }
        }
        Some(TableClick::Select(place) | TableClick::Open(place)) => {
            if let Some((address, _)) = nodes.get(place) {
                view.go_to(*address, shared);
                ui.request_repaint();
            }
        }
        Some(TableClick::Sort(_)) | None => {}
    }
}
