use eframe::egui::Ui;
use egui_plot::{MarkerShape, PlotPoints, Points};
use glam::DVec3;

use super::plot_style::{legend, plot};
use crate::app::{state::Frames, theme::Theme};

/// The nodes of the snapshot, row by row: actual as squares, decoupled as discs, as in the paper's Fig. 6.
pub fn nodes_ui(ui: &mut Ui, frames: &Frames) {
    let palette = Theme::of(ui).palette;
    let heights = |nodes_mm: &[DVec3]| -> PlotPoints<'static> {
        nodes_mm
            .iter()
            .enumerate()
            .map(|(node, position)| [(node + 1) as f64, position.z])
            .collect()
    };
    plot(ui, "nodes", "node, row by row", "z (mm)")
        .legend(legend())
        .show(ui, |plot_ui| {
            let actual = Points::new("actual", heights(&frames.actual.nodes_mm))
                .shape(MarkerShape::Square)
                .filled(false);
            plot_ui.points(actual.radius(3.5).color(palette.dim));
            if let Some((decoupled, _)) = &frames.decoupled {
                let discs = Points::new("decoupled", heights(&decoupled.nodes_mm)).shape(MarkerShape::Circle);
                plot_ui.points(discs.radius(2.5).color(palette.accent));
            }
        });
}
