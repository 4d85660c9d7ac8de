//! The axes around a plot.

use std::ops::RangeInclusive;

use super::{
    canvas::{Anchor, Area, At, Canvas, Stroke, TEXT},
    colours::{DIM, GRID, INK},
    plot_axis::{PlotAxis, share},
};

/// Position of both axes on the canvas.
pub(super) struct Frame<'a> {
    pub area: Area,
    pub x: (&'a PlotAxis, RangeInclusive<f64>),
    pub y: (&'a PlotAxis, RangeInclusive<f64>),
}

impl Frame<'_> {
    pub fn x_at(&self, place: f64) -> f64 {
        self.area.left + self.area.width * share(place, &self.x.1)
    }

    pub fn y_at(&self, place: f64) -> f64 {
        self.area.bottom() - self.area.height * share(place, &self.y.1)
    }

    /// Position of a point on the canvas; `None` if an axis has no place for it.
    pub fn at(&self, x: f64, y: f64) -> Option<At> {
        Some([self.x_at(self.x.0.place(x)?), self.y_at(self.y.0.place(y)?)])
    }

    /// Grid, ticks and names.
    pub fn draw(&self, canvas: &mut Canvas) {
        let area = self.area;
        let (grid, edge) = (Stroke::new(GRID, 0.5), Stroke::new(DIM, 0.7));
        // A number takes about 36 points across and 20 up.
        let most = |length: f64, each: f64| ((length / each) as usize).clamp(2, 8);
        for (place, text) in self.x.0.ticks(&self.x.1, most(area.width, 36.0)) {
            let x = self.x_at(place);
            canvas.line([x, area.top], [x, area.bottom()], grid);
            canvas.line([x, area.bottom()], [x, area.bottom() + 3.0], edge);
            canvas.text([x, area.bottom() + 3.0 + TEXT], Anchor::Middle, INK, &text);
        }
        for (place, text) in self.y.0.ticks(&self.y.1, most(area.height, 20.0)) {
            let y = self.y_at(place);
            canvas.line([area.left, y], [area.right(), y], grid);
            canvas.line([area.left - 3.0, y], [area.left, y], edge);
            canvas.text([area.left - 5.0, y], Anchor::End, INK, &text);
        }
        canvas.outline(area, edge);
        self.draw_names(canvas);
    }

    pub fn draw_names(&self, canvas: &mut Canvas) {
        let area = self.area;
        let [middle_x, middle_y] = area.centre();
        canvas.text([middle_x, area.bottom() + 24.0], Anchor::Middle, INK, &self.x.0.name);
        canvas.upright_text([area.left - 38.0, middle_y], INK, &self.y.0.name);
    }
}
