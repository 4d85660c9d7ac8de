//! The scale of colours beside a picture.

use std::ops::RangeInclusive;

use super::{
    canvas::{Anchor, Area, Canvas, Stroke},
    colours::{DIM, INK, viridis},
};
use crate::export::ticks::{multiples, step_for, tick_text};

const STEPS: usize = 64;
const WIDTH: f64 = 9.0;

/// What the bar takes with its numbers and name, in points.
pub(super) const COLOUR_BAR_WIDTH: f64 = 54.0;

/// Where a value stands in its range, from 0 to 1.
pub(super) fn share(value: f64, range: &RangeInclusive<f64>) -> f64 {
    (value - range.start()) / (range.end() - range.start())
}

/// Draws the bar from `top` down, `height` high.
pub(super) fn draw_colour_bar(
    canvas: &mut Canvas,
    left: f64,
    top: f64,
    height: f64,
    range: &RangeInclusive<f64>,
    name: &str,
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
        canvas.block(block, viridis((at as f64 + 0.5) / STEPS as f64));
    }
    let edge = Stroke::new(DIM, 0.5);
    canvas.outline(bar, edge);
    let step = step_for(range, 6);
    for value in multiples(range, step) {
        let y = bar.bottom() - height * share(value, range);
        canvas.line([bar.right(), y], [bar.right() + 2.5, y], edge);
        canvas.text([bar.right() + 5.0, y], Anchor::Start, INK, &tick_text(value, step));
    }
    canvas.upright_text([left + COLOUR_BAR_WIDTH - 14.0, bar.centre()[1]], INK, name);
}
