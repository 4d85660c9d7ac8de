use eframe::egui::{Align, Layout, RichText, Ui};
use ndarray::Array2;

use super::{
    LiveView,
    engine::{LiveFrame, Watched},
};
use crate::window::{
    plotting::cells_ui,
    theme::{Theme, semibold, space, type_size},
    widgets::segmented_ui,
};
use decoupler_core::live::ZeroGains;
use decoupler_files::{
    export::format_number,
    figure::{HeatMap, SequentialMap, readings_figure, zero_gains_figure},
};

/// Readings of the frame as a map of rows and columns, or the gains of the unloaded state.
pub fn readings_ui(ui: &mut Ui, view: &mut LiveView, colours: SequentialMap) {
    let Some(frame) = &view.shown.frame else { return };
    let gains = view.zero.as_ref().and_then(|zero| gains_of(zero, frame));
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new("Readings").font(semibold(type_size().title)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if gains.is_some() {
                let options = [(false, "Frame"), (true, "Zero")];
                let picked = segmented_ui(ui, "Displayed readings", &options, view.shows_zero, false);
                view.shows_zero = picked.unwrap_or(view.shows_zero);
            }
        });
    });
    let (label, map) = match &gains {
        Some(gains) if view.shows_zero => ("Gains of the unloaded state", zero_gains_figure(gains, &frame.rows)),
        _ => ("Live readings", figure_of(frame, view.drops.largest_percent())),
    };
    let map = map.coloured(colours);
    let (rows, columns) = marked(frame);
    let warning = Theme::of(ui).palette.warning;
    let Some(([row, column], cell)) = cells_ui(ui, label, &map, (&rows, &columns, warning)) else {
        return;
    };
    let value = format_number(map.values[[row, column]]);
    let text = if gains.is_some() && view.shows_zero {
        format!("gain − 1: {value} %")
    } else {
        format!("drop from unloaded: {value} %")
    };
    let row = frame.rows.get(row).map_or(0, |row| row + 1);
    cell.on_hover_text_at_pointer(format!("Row-wire {row}, column-wire {}\n{text}", column + 1));
}

/// The map of the readings of a frame.
pub fn figure_of(frame: &LiveFrame, largest_percent: f64) -> HeatMap {
    readings_figure(frame.drops_percent.clone(), &frame.rows, largest_percent)
}

/// Gains in the shape of the frame.
fn gains_of(zero: &ZeroGains, frame: &LiveFrame) -> Option<Array2<f64>> {
    Array2::from_shape_vec(frame.drops_percent.dim(), zero.gains.clone()).ok()
}

/// Places of the rows and columns whose wires are at fault.
fn marked(frame: &LiveFrame) -> (Vec<usize>, Vec<usize>) {
    let Watched::Named(diagnosis) = &frame.watched else {
        return (Vec::new(), Vec::new());
    };
    let rows = frame.rows.iter().enumerate();
    let rows = rows
        .filter(|(_, row)| diagnosis.wire.is_row(**row))
        .map(|(place, _)| place);
    let columns = diagnosis.wire.columns().into_iter().flatten();
    (rows.collect(), columns.collect())
}
