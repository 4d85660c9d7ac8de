use eframe::egui::{RichText, Ui};
use ndarray::Array2;

use crate::window::{
    glossary,
    plotting::cells_ui,
    test_view::TestView,
    theme::{Theme, semibold, space, type_size},
    widgets::{dim_ui, placeholder_ui},
};
use decoupler_core::text::counted;
use decoupler_files::{
    export::format_number,
    figure::{HeatMap, SequentialMap, readings_figure},
};

/// A reading under the pointer.
#[derive(Clone, Copy, Debug)]
pub struct ReadingPointed {
    /// Places of its row-wire among those read, and of its column-wire.
    pub cell: [usize; 2],
    /// True if it was clicked.
    pub is_clicked: bool,
}

/// The head of the card of the readings.
pub fn readings_head_ui(ui: &mut Ui, drops_percent: Option<&Array2<f64>>) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(6));
        ui.label(RichText::new("Readings").font(semibold(type_size().title)))
            .on_hover_text(glossary::READING.hint);
        if let Some(drops_percent) = drops_percent {
            let (rows, columns) = drops_percent.dim();
            let [rows, columns] =
                [(rows, "row-wire"), (columns, "column-wire")].map(|(count, noun)| counted(count, noun));
            dim_ui(ui, &format!("{rows} × {columns}"));
        }
    });
}

/// Readings of the displayed surface as a map of row-wires and column-wires, in `colours` and with one row pointed out;
/// `drops_percent` are their drops below those at rest. Returns the one under the pointer.
pub fn readings_ui(
    ui: &mut Ui,
    drops_percent: Option<&Array2<f64>>,
    test: Option<&TestView>,
    lit_row: Option<usize>,
    colours: SequentialMap,
) -> Option<ReadingPointed> {
    let Some((drops_percent, test)) = drops_percent.zip(test) else {
        placeholder_ui(ui, "The readings of the surface appear here.");
        return None;
    };
    let map = readings_map(drops_percent, &test.rows).coloured(colours);
    let marked = (lit_row.as_slice(), &[][..], Theme::of(ui).palette.text);
    let ([row, column], cell) = cells_ui(ui, "Readings of the actual surface", &map, marked)?;
    let is_clicked = cell.clicked();
    let value = format_number(map.values[[row, column]]);
    let wire = test.rows.get(row).map_or(0, |row| row + 1);
    cell.on_hover_text_at_pointer(format!(
        "Row-wire {wire}, column-wire {}\ndrop from unloaded: {value} %\n{}\nClick for the section along it.",
        column + 1,
        glossary::DROP.equation
    ));
    Some(ReadingPointed {
        cell: [row, column],
        is_clicked,
    })
}

/// Colours from none to the largest drop, up to a round number so that they hold while the finger moves a little.
fn readings_map(drops_percent: &Array2<f64>, rows: &[usize]) -> HeatMap {
    /// The end of the colours of a sensor at rest.
    const MIN_PERCENT: f64 = 0.01;
    let largest = drops_percent.iter().copied().filter(|drop| drop.is_finite());
    let largest = largest.fold(MIN_PERCENT, f64::max);
    let decade = 10_f64.powf(largest.log10().floor());
    let ends = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0].map(|end| end * decade);
    let end = ends.into_iter().find(|end| *end >= largest).unwrap_or(10.0 * decade);
    readings_figure(drops_percent.clone(), rows, end)
}
