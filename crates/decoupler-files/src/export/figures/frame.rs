//! Axes around a plot, colour bars and legends.

use std::ops::RangeInclusive;

use super::{
    canvas::{Anchor, Area, At, Canvas, Stroke, TEXT},
    picture::{DIM, GRID, INK},
    plot::draw_sample,
};
use crate::figure::{ColourMap, Key, PlotAxis, share};

/// Width and height of a number, in points.
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

    /// Returns the position on the canvas of a place on each axis.
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

const STEPS: usize = 64;
const WIDTH: f64 = 9.0;

/// Width of the bar with its numbers and name, in points.
pub(super) const COLOUR_BAR_WIDTH: f64 = 54.0;

/// Draws the colour bar for `range` of `axis`, from `top` downwards and `height` high.
pub(super) fn draw_colour_bar(
    canvas: &mut Canvas,
    left: f64,
    top: f64,
    height: f64,
    (axis, colours): (&PlotAxis, &ColourMap),
    range: &RangeInclusive<f64>,
) {
    let bar = Area {
        left,
        top,
        width: WIDTH,
        height,
    };
    let step = height / STEPS as f64;
    for at in (0..STEPS).rev() {
        let block = Area {
            top: bar.bottom() - step * (at + 1) as f64,
            height: step,
            ..bar
        };
        canvas.block(block, colours.at((at as f32 + 0.5) / STEPS as f32));
    }
    let edge = Stroke::new(DIM, 0.5);
    canvas.outline(bar, edge);
    let ticks = axis.ticks(range, (range.end() - range.start()) / 6.0);
    for &place in &ticks.places {
        let text = axis.tick_text(place, ticks.step);
        let y = bar.bottom() - height * share(place, range);
        canvas.line([bar.right(), y], [bar.right() + 2.5, y], edge);
        canvas.text([bar.right() + 5.0, y], Anchor::Start, INK, &text);
    }
    canvas.upright_text([left + COLOUR_BAR_WIDTH - 14.0, bar.centre()[1]], INK, &axis.name);
}

/// Average width of a character of a name.
const CHARACTER: f64 = 0.52 * TEXT;
const SAMPLE: f64 = 16.0;
const GAP: f64 = 4.0;
const BETWEEN: f64 = 14.0;

/// Height of a line of the legend, in points.
pub(super) const LINE: f64 = 1.6 * TEXT;

/// Returns the left end and the line of each key of a legend of this width in points.
fn positions(keys: &[Key], width: f64) -> Vec<(f64, usize)> {
    let (mut left, mut line) = (0.0, 0);
    let position = |key: &Key| {
        let taken = SAMPLE + GAP + CHARACTER * key.name.chars().count() as f64;
        if left > 0.0 && left + taken > width {
            (left, line) = (0.0, line + 1);
        }
        let position = (left, line);
        left += taken + BETWEEN;
        position
    };
    keys.iter().map(position).collect()
}

/// Height of the legend, in points.
pub(super) fn legend_height(keys: &[Key], width: f64) -> f64 {
    let last = positions(keys, width).last().copied();
    last.map_or(0.0, |(_, line)| LINE * (line + 1) as f64)
}

/// Draws the legend from the upper left corner.
pub(super) fn draw_legend(keys: &[Key], [left, top]: [f64; 2], width: f64, canvas: &mut Canvas) {
    for (key, (offset, line)) in keys.iter().zip(positions(keys, width)) {
        let at = [left + offset, top + LINE * (line as f64 + 0.5)];
        draw_sample(key.look, at, SAMPLE, canvas);
        canvas.text([at[0] + SAMPLE + GAP, at[1]], Anchor::Start, INK, &key.name);
    }
}
