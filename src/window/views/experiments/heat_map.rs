use eframe::egui::Ui;

use super::{ExperimentLook, Outcome, open_cell::open_cell};
use crate::window::{
    plotting::{CellPointed, heat_map_ui},
    shared::{Effect, Shared},
};
use decoupler_files::figure::HeatMap;

/// The map of a sweep. A click marks the cell, two open it in the Train view.
pub fn sweep_ui(
    ui: &mut Ui,
    (outcome, map): (&Outcome, &HeatMap),
    look: &mut ExperimentLook,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let columns = map.columns.len().max(1);
    let marked = look.marked.map(|cell| [cell / columns, cell % columns]);
    if let Some(([row, column], pointed)) = heat_map_ui(ui, map, marked) {
        let cell = row * columns + column;
        look.marked = Some(cell);
        if pointed == CellPointed::Twice {
            open_cell(shared, outcome, cell, effects);
        }
    }
}
