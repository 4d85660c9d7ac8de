use super::{
    canvas::{Anchor, Area, Canvas},
    colours::DIM,
    legend::{LINE, draw_legend, legend_height},
    picture::Picture,
    plot::draw_plot,
};
use crate::figure::PlotFigure;

/// Width of a page, in points (1/72 inch).
pub(super) const PAGE_WIDTH: f64 = 510.0;
/// Width of a figure whose plot has one scale for both axes.
const SQUARE_WIDTH: f64 = 300.0;

const PLOT_HEIGHT: f64 = 190.0;
const LEFT: f64 = 50.0;
const TOP: f64 = 10.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 34.0;

impl PlotFigure {
    /// Draws the figure, as wide as a page; a single square plot takes less.
    pub fn draw(&self) -> Picture {
        let square = self
            .plots
            .first()
            .filter(|plot| plot.has_equal_scales && self.plots.len() == 1);
        let width = square.map_or(PAGE_WIDTH, |_| SQUARE_WIDTH);
        let slot = width / self.plots.len().max(1) as f64;
        let plot_width = slot - LEFT - RIGHT;
        let plot_height = square.map_or(PLOT_HEIGHT, |_| plot_width);
        let legend_width = width - LEFT - RIGHT;
        let mut top = TOP + legend_height(&self.keys, legend_width);
        let notes = top;
        top += LINE * self.notes.len() as f64 + 4.0;
        let mut canvas = Canvas::new(width, top + plot_height + BOTTOM);
        draw_legend(&self.keys, [LEFT, 0.5 * TOP], legend_width, &mut canvas);
        for (line, note) in self.notes.iter().enumerate() {
            let y = notes - 0.5 * TOP + LINE * (line as f64 + 0.5);
            canvas.text([LEFT, y], Anchor::Start, DIM, note);
        }
        for (index, plot) in self.plots.iter().enumerate() {
            let area = Area {
                left: slot * index as f64 + LEFT,
                top,
                width: plot_width,
                height: plot_height,
            };
            draw_plot(plot, area, &mut canvas);
        }
        canvas.finish()
    }
}
