//! Quantities of surfaces, and their colour scales.

use std::{ops::RangeInclusive, sync::Arc};

use decoupler_core::text::format_number;
use glam::Vec2;

use crate::figure::{
    axis::PlotAxis,
    colour_map::{ColourMap, SequentialMap},
    drawing::{Bounds, Measure, Shape, lay_out_scale},
    titled, with_unit,
};

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

impl ColourScale {
    /// Width of the bar with its numbers, in points.
    pub const WIDTH: f32 = 64.0;

    /// Lays the scale out in `area` in the colours of `map`; empty if the area or the range is too small.
    pub fn lay_out(&self, mut area: Bounds, map: &ColourMap, measure: Measure<'_>) -> Vec<Shape> {
        area.max -= Vec2::new(0.0, 14.0);
        let axis = PlotAxis::linear(self.quantity.axis_name());
        lay_out_scale(area, &axis, &self.range, map, measure)
    }
}

/// Quantity that a surface shows, which determines its colours.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Heights.
    Height,
    /// Errors, diverging about zero.
    Error,
    /// A deformation pattern of arbitrary scale, diverging about zero.
    Pattern,
    /// Change of the readings with each node.
    Sensitivity,
    /// Values of measured targets in their unit, if that is known.
    Target(Option<Arc<str>>),
    /// Errors of measured targets in their unit, diverging about zero.
    TargetError(Option<Arc<str>>),
}

impl Quantity {
    /// Returns the name and the unit.
    fn name_and_unit(&self) -> (&'static str, Option<&str>) {
        match self {
            Self::Height => ("z", Some("mm")),
            Self::Error => ("error", Some("mm")),
            Self::Pattern => ("pattern", None),
            Self::Sensitivity => ("sensitivity", Some("per mm")),
            Self::Target(unit) => ("value", unit.as_deref()),
            Self::TargetError(unit) => ("error", unit.as_deref()),
        }
    }

    /// Name of the value axis, with its unit.
    pub fn axis_name(&self) -> String {
        let (name, unit) = self.name_and_unit();
        titled(name, unit)
    }

    /// Returns the range from `low` to `high` as text, with the unit: "z 4.00 to 5.00 mm".
    pub(in crate::figure) fn range_text(&self, low: f64, high: f64) -> String {
        let (name, unit) = self.name_and_unit();
        let text = |value: f64| match self {
            Self::Height | Self::Error => format!("{value:.2}"),
            _ => format_number(value),
        };
        let [low, high] = [low, high].map(|end| text(end).replace('-', "−"));
        with_unit(format!("{name} {low} to {high}"), unit)
    }

    /// Returns `true` if the colours diverge from zero.
    pub fn is_diverging(&self) -> bool {
        matches!(self, Self::Error | Self::Pattern | Self::TargetError(_))
    }
}
