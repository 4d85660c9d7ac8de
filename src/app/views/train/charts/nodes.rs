use eframe::egui::{Color32, Stroke, Ui};
use egui_plot::{BoxElem, BoxPlot, BoxSpread, GridInput, GridMark, MarkerShape, PlotPoints, Points};
use glam::DVec3;

use crate::app::{
    plotting::{Key, Mark, plot_style::plot},
    theme::{Palette, Theme},
    views::train::drawn::Frames,
};

const ACTUAL_RADIUS: f32 = 4.5;
const DECOUPLED_RADIUS: f32 = 2.5;

/// What is in the chart: nothing decoupled before a training.
pub fn nodes_keys(palette: &Palette, frames: &Frames) -> Vec<Key> {
    let actual = Key {
        name: "actual",
        mark: Mark::Squares,
        colour: palette.dim,
    };
    let decoupled = Key {
        name: "decoupled",
        mark: Mark::Discs,
        colour: palette.accent,
    };
    let decoupled = frames.decoupled.is_some().then_some(decoupled);
    std::iter::once(actual).chain(decoupled).collect()
}

/// The nodes of the snapshot, row by row: actual as squares, decoupled as discs, as in the paper's Fig. 6; with
/// bars where the spread of each is given.
pub fn nodes_ui(ui: &mut Ui, frames: &Frames, spread_mm: Option<&[f64]>, nodes_per_row: usize) {
    let palette = Theme::of(ui).palette;
    let heights = |nodes_mm: &[DVec3]| -> PlotPoints<'static> {
        nodes_mm
            .iter()
            .enumerate()
            .map(|(node, position)| [(node + 1) as f64, position.z])
            .collect()
    };
    plot(ui, "nodes", "node, row by row", "z (mm)")
        .x_grid_spacer(move |input| row_marks(input, nodes_per_row))
        .show(ui, |plot_ui| {
            let actual = Points::new("actual", heights(&frames.actual.nodes_mm))
                .shape(MarkerShape::Square)
                .filled(false);
            plot_ui.points(actual.radius(ACTUAL_RADIUS).color(palette.dim));
            if let Some((decoupled, _)) = &frames.decoupled {
                if let Some(spread_mm) = spread_mm {
                    plot_ui.box_plot(error_bars(&decoupled.nodes_mm, spread_mm, palette.accent));
                }
                let discs = Points::new("decoupled", heights(&decoupled.nodes_mm)).shape(MarkerShape::Circle);
                plot_ui.points(discs.radius(DECOUPLED_RADIUS).color(palette.accent));
            }
        });
}

/// A bar of ± the spread through each node.
fn error_bars(nodes_mm: &[DVec3], spread_mm: &[f64], colour: Color32) -> BoxPlot {
    const CAP: f64 = 0.5;
    let bar = |(node, (position, spread)): (usize, (&DVec3, &f64))| {
        let z = position.z;
        BoxElem::new((node + 1) as f64, BoxSpread::new(z - spread, z, z, z, z + spread))
            .whisker_width(CAP)
            .box_width(0.0)
            .fill(colour)
            .stroke(Stroke::new(1.0, colour.gamma_multiply(0.7)))
    };
    let bars = nodes_mm.iter().zip(spread_mm).enumerate().map(bar);
    BoxPlot::new("spread", bars.collect()).color(colour).allow_hover(false)
}

/// A mark at the last node of a row, of every row or of every so many.
fn row_marks(input: GridInput, nodes_per_row: usize) -> Vec<GridMark> {
    /// About as many as are told apart.
    const MOST: f64 = 12.0;
    let (low, high) = input.bounds;
    let row = nodes_per_row.max(1) as f64;
    if !(low.is_finite() && high.is_finite()) {
        return Vec::new();
    }
    let step = row * ((high - low) / (row * MOST)).ceil().max(1.0);
    let first = (low / step).ceil().max(0.0);
    let count = ((high / step).floor() - first).clamp(0.0, MOST) as usize;
    let marks = (0..=count).map(|index| (first + index as f64) * step);
    let seen = marks.filter(|mark| (low..=high).contains(mark));
    seen.map(|value| GridMark { value, step_size: step }).collect()
}
