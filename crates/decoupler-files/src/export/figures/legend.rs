//! The legend above a figure.

use super::{
    canvas::{Anchor, Canvas, TEXT},
    colours::INK,
    plot::draw_sample,
};
use crate::figure::Key;

/// Average width of a character of a name.
const CHARACTER: f64 = 0.52 * TEXT;
const SAMPLE: f64 = 16.0;
const GAP: f64 = 4.0;
const BETWEEN: f64 = 14.0;

/// Height of a line of the legend, in points.
pub(super) const LINE: f64 = 1.6 * TEXT;

/// Left end of each key and the line in which it is, within this many points across.
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
