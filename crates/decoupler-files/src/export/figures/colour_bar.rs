//! The scale of colours next to a picture.

use std::ops::RangeInclusive;

use super::{
    canvas::{Anchor, Area, Canvas, Stroke},
    colours::{DIM, INK},
};
use crate::figure::{ColourMap, PlotAxis, share};

const STEPS: usize = 64;
const WIDTH: f64 = 9.0;

/// Width of the bar with its numbers and name, in points.
pub(super) const COLOUR_BAR_WIDTH: f64 = 54.0;

/// Draws the bar of the places in `range` on `axis` from `top` down, `height` high.
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
