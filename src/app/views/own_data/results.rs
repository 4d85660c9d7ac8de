use eframe::egui::{ComboBox, DragValue, Ui, UiBuilder};

use super::{
    charts::{Chart, ChartChoice, ChartTab},
    state::OwnDataView,
    surfaces::surfaces_ui,
};
use crate::app::{
    plotting::{Pointer, cells_ui, legend_ui, plots_ui},
    shared::{Effect, Look, Phase},
    theme::{Theme, space},
    widgets::{placeholder_ui, tabs_ui},
};

/// Height of the card from which on a chart has room below the surfaces.
const TALL: f32 = space(125);
/// Share of the surfaces then.
const SURFACES: f32 = 0.62;

/// Charts of the network on show.
pub(super) fn results_ui(ui: &mut Ui, view: &mut OwnDataView, look: Look, effects: &mut Vec<Effect>) {
    let Some(shown) = &view.shown else {
        placeholder_ui(
            ui,
            match view.phase {
                Phase::Preparing => "The files are being read; the first epochs follow.",
                _ => "Press Train: the error of each epoch and what the network tells of each target appear here.",
            },
        );
        return;
    };
    let before = (view.chart.tab, view.chart.target, view.chart.sample);
    ui.horizontal(|ui| {
        if let Some(tab) = tabs_ui(ui, "Charts", &ChartTab::offered(shown), view.chart.tab) {
            view.chart.tab = tab;
        }
        let targets = &shown.file.targets;
        if before.0 == ChartTab::Regression && targets.len() > 1 {
            ui.add_space(space(2));
            let label = ui.label("Target");
            let selected = targets
                .get(view.chart.target)
                .map_or(String::new(), |target| target.title());
            let combo = ComboBox::from_id_salt("target").selected_text(selected);
            let picked = combo.show_ui(ui, |ui| {
                for (index, target) in targets.iter().enumerate() {
                    ui.selectable_value(&mut view.chart.target, index, target.title());
                }
            });
            picked.response.labelled_by(label.id);
        }
        let samples = shown.tested.as_ref().map_or(0, |tested| tested.set().samples());
        if matches!(before.0, ChartTab::Sample | ChartTab::Surfaces) && samples > 0 {
            ui.add_space(space(2));
            let label = ui.label("Test sample");
            let mut number = view.chart.sample.min(samples - 1) + 1;
            let field = ui.add(
                DragValue::new(&mut number)
                    .range(1..=samples)
                    .suffix(format!(" of {samples}")),
            );
            field.labelled_by(label.id);
            view.chart.sample = number - 1;
        }
    });
    match view.chart.chart(shown, &view.curves) {
        Chart::Plots(figure) => {
            legend_ui(ui, &figure.keys);
            plots_ui(ui, before.0.file_word(), &figure, Pointer::Moves);
        }
        Chart::Map(map) => {
            if let Some(([row, column], response)) = cells_ui(
                ui,
                "Error over the position",
                &map,
                (&[], &[], Theme::of(ui).palette.warning),
            ) {
                response.on_hover_text_at_pointer(&map.notes[[row, column]]);
            }
        }
        Chart::Surfaces => surfaces_and_sample_ui(ui, view, look, effects),
        Chart::None(reason) => placeholder_ui(ui, reason),
    }
    if (view.chart.tab, view.chart.target, view.chart.sample) != before {
        ui.request_repaint();
    }
}

/// The surfaces, and where there is room the values of all targets below them.
fn surfaces_and_sample_ui(ui: &mut Ui, view: &mut OwnDataView, look: Look, effects: &mut Vec<Effect>) {
    let whole = ui.available_rect_before_wrap();
    let values = ChartChoice {
        tab: ChartTab::Sample,
        ..view.chart
    };
    let values = view.shown.as_ref().map(|shown| values.chart(shown, &view.curves));
    match values {
        Some(Chart::Plots(figure)) if whole.height() > TALL => {
            let (upper, lower) = whole.split_top_bottom_at_y(whole.top() + (SURFACES * whole.height()).floor());
            ui.scope_builder(UiBuilder::new().max_rect(upper), |ui| {
                surfaces_ui(ui, view, look, effects);
            });
            ui.scope_builder(UiBuilder::new().max_rect(lower), |ui| {
                legend_ui(ui, &figure.keys);
                plots_ui(ui, ChartTab::Sample.file_word(), &figure, Pointer::Moves);
            });
        }
        _ => surfaces_ui(ui, view, look, effects),
    }
}
