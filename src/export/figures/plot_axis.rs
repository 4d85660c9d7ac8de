use std::ops::RangeInclusive;

use crate::figure::ticks::{multiples, step_for, tick_text};

/// Scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisScale {
    /// Linear.
    Linear,
    /// Logarithmic; values that are not positive are left out.
    Logarithmic,
}

/// An axis of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotAxis {
    /// Name of the quantity, with its unit.
    pub name: String,
    /// Linear or logarithmic.
    pub scale: AxisScale,
    /// Values with names of their own, in place of round numbers.
    pub named: Vec<(f64, String)>,
}

impl PlotAxis {
    /// A linear axis.
    pub fn linear(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            scale: AxisScale::Linear,
            named: Vec::new(),
        }
    }

    /// A logarithmic axis.
    pub fn logarithmic(name: impl Into<String>) -> Self {
        Self {
            scale: AxisScale::Logarithmic,
            ..Self::linear(name)
        }
    }

    /// Position of a value on the axis; `None` if it has none.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        let place = match self.scale {
            AxisScale::Linear => value,
            AxisScale::Logarithmic if value > 0.0 => value.log10(),
            AxisScale::Logarithmic => return None,
        };
        place.is_finite().then_some(place)
    }

    /// The range that holds all `places`, with a little room.
    pub(super) fn range(&self, places: impl Iterator<Item = f64>) -> RangeInclusive<f64> {
        let (low, high) = places.fold((f64::MAX, f64::MIN), |(low, high), place| {
            (low.min(place), high.max(place))
        });
        if low > high {
            return 0.0..=1.0;
        }
        // A single value, or values apart by rounding only, still have a range.
        let width = (high - low).max(1e-9 * low.abs().max(high.abs())).max(1e-12);
        let margin = if high > low { 0.05 * width } else { 0.5 };
        low - margin..=high + margin
    }

    /// Ticks within `range`: place and text.
    pub(super) fn ticks(&self, range: &RangeInclusive<f64>, most: usize) -> Vec<(f64, String)> {
        if !self.named.is_empty() {
            let placed = self
                .named
                .iter()
                .filter_map(|(value, name)| Some((self.place(*value)?, name.clone())));
            return placed.filter(|(place, _)| range.contains(place)).collect();
        }
        match self.scale {
            AxisScale::Linear => numbers(range, most),
            AxisScale::Logarithmic => decades(range, most),
        }
    }
}

/// Position of `place` in its range, from 0 to 1.
pub(super) fn share(place: f64, range: &RangeInclusive<f64>) -> f64 {
    (place - range.start()) / (range.end() - range.start())
}

fn numbers(range: &RangeInclusive<f64>, most: usize) -> Vec<(f64, String)> {
    let step = step_for(range, most);
    let marks = multiples(range, step).into_iter();
    marks.map(|value| (value, tick_text(value, step))).collect()
}

/// Whole decades; 2 and 5 between them where there are few; round numbers where there are none.
fn decades(range: &RangeInclusive<f64>, most: usize) -> Vec<(f64, String)> {
    let step = step_for(range, most).max(1.0);
    let powers = multiples(range, step);
    let factors: &[f64] = match powers.len() {
        0..=2 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let first = range.start().floor() as i32;
    let last = range.end().ceil() as i32;
    let is_chosen =
        |power: i32| factors.len() > 1 || powers.iter().any(|chosen| (chosen - f64::from(power)).abs() < 0.5);
    let marks = (first..=last).filter(|power| is_chosen(*power)).flat_map(|power| {
        factors
            .iter()
            .map(move |factor| (f64::from(power) + factor.log10(), *factor, power))
    });
    let ticks: Vec<_> = marks
        .filter(|(place, ..)| range.contains(place))
        .map(|(place, factor, power)| (place, decade_text(factor, power)))
        .collect();
    if ticks.len() >= 2 {
        return ticks;
    }
    let values = 10_f64.powf(*range.start())..=10_f64.powf(*range.end());
    let ticks = numbers(&values, most).into_iter();
    ticks
        .filter(|(value, _)| *value > 0.0)
        .map(|(value, text)| (value.log10(), text))
        .collect()
}

/// `0.05`, `20`, `1e−5`.
fn decade_text(factor: f64, power: i32) -> String {
    if (-3..=3).contains(&power) {
        let value = factor * 10_f64.powi(power);
        return tick_text(value, 10_f64.powi(power));
    }
    format!("{factor}e{power}").replace('-', "−")
}
