//! The axes around a plot.

use std::ops::RangeInclusive;

use super::{
    canvas::{Anchor, Area, At, CHARACTER, Canvas, Stroke, TEXT},
    colours::{DIM, GRID, INK},
};
use crate::figure::{PlotAxis, share};

/// Room that a number takes across and up, in points.
const NUMBER: At = [36.0, 20.0];

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

    /// Position on the canvas of the places on both axes.
    pub fn at(&self, [x, y]: [f64; 2]) -> At {
        [self.x_at(x), self.y_at(y)]
    }

    /// Grid, ticks and names.
    pub fn draw(&self, canvas: &mut Canvas) {
        let area = self.area;
        let (grid, edge) = (Stroke::new(GRID, 0.5), Stroke::new(DIM, 0.7));
        let (axis, range) = &self.x;
        let ticks = axis.ticks(range, (range.end() - range.start()) * NUMBER[0] / area.width);
        for &place in &ticks.places {
            let (x, text) = (self.x_at(place), axis.tick_text(place, ticks.step));
            canvas.line([x, area.top], [x, area.bottom()], grid);
            canvas.line([x, area.bottom()], [x, area.bottom() + 3.0], edge);
            canvas.text([x, area.bottom() + 3.0 + TEXT], Anchor::Middle, INK, &text);
        }
        let (axis, range) = &self.y;
        let ticks = axis.ticks(range, (range.end() - range.start()) * NUMBER[1] / area.height);
        // The name is next to the longest number.
        let mut characters = 3;
        for &place in &ticks.places {
            let (y, text) = (self.y_at(place), axis.tick_text(place, ticks.step));
            characters = characters.max(text.chars().count());
            canvas.line([area.left, y], [area.right(), y], grid);
            canvas.line([area.left - 3.0, y], [area.left, y], edge);
            canvas.text([area.left - 5.0, y], Anchor::End, INK, &text);
        }
        canvas.outline(area, edge);
        let [middle_x, middle_y] = area.centre();
        canvas.text([middle_x, area.bottom() + 24.0], Anchor::Middle, INK, &self.x.0.name);
        let name_x = area.left - 14.0 - CHARACTER * characters as f64;
        canvas.upright_text([name_x, middle_y], INK, &self.y.0.name);
    }
}
