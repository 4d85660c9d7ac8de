//! The key to the colours of one or more surfaces.

use std::ops::RangeInclusive;

use glam::Vec2;

use super::{
    edge::TICK,
    labels::Labels,
    quantity::Quantity,
    shapes::{Bounds, Ink, Line, Text},
};
use crate::figure::{
    colour_map::SequentialMap,
    ticks::{multiples, round_steps, tick_text},
};

const BAR_WIDTH: f32 = 12.0;

/// Scale of colours: a quantity and its range.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourScale {
    /// Quantity of the values.
    pub quantity: Quantity,
    /// Values at both ends.
    pub range: RangeInclusive<f64>,
    /// Colours of values that do not diverge.
    pub colours: SequentialMap,
}

/// A laid-out colour scale: a bar from the lowest value at the bottom to the highest at the top.
#[derive(Clone, Debug)]
pub struct ScaleDrawing {
    /// The bar.
    pub bar: Bounds,
    /// Its ticks.
    pub lines: Vec<Line>,
    /// Numbers and name.
    pub texts: Vec<Text>,
}

impl ColourScale {
    /// Width that the bar takes with its numbers, in points.
    pub const WIDTH: f32 = 64.0;

    /// Lays the scale out in `area`; `None` if that or the range is too small. `measure` tells the size of a text.
    pub fn lay_out(&self, area: Bounds, measure: &dyn Fn(&str) -> Vec2) -> Option<ScaleDrawing> {
        let (low, high) = (*self.range.start(), *self.range.end());
        let name = self.quantity.axis_name();
        let line = measure(&name).y;
        let left = area.min.x + 8.0;
        let bar = Bounds {
            min: Vec2::new(left, area.min.y + line + 12.0),
            max: Vec2::new(left + BAR_WIDTH, area.max.y - line),
        };
        let height = bar.size().y;
        if height < 20.0 || high.partial_cmp(&low) != Some(std::cmp::Ordering::Greater) || !(high - low).is_finite() {
            return None;
        }
        let mut labels = Labels::new(measure);
        let points_per_unit = f64::from(height) / (high - low);
        let step = round_steps((high - low) / 10.0)
            .find(|step| step * points_per_unit >= f64::from(line + 14.0))
            .unwrap_or(high - low);
        let mut lines = Vec::new();
        for value in multiples(&self.range, step) {
            let at = Vec2::new(bar.max.x, bar.max.y - ((value - low) * points_per_unit) as f32);
            lines.push(Line {
                from: at,
                to: at + Vec2::new(TICK, 0.0),
                ink: Ink::Edge,
            });
            labels.beside(at, Vec2::X, TICK + 3.0, 0.0, &tick_text(value, step));
        }
        let name_at = Vec2::new(area.min.x + 4.0 + 0.5 * measure(&name).x, bar.min.y - 6.0);
        labels.beside(name_at, Vec2::NEG_Y, 2.0, 8.0, &name);
        Some(ScaleDrawing {
            bar,
            lines,
            texts: labels.into_texts(),
        })
    }
}
