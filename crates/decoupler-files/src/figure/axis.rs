//! Axes of plots, and round numbers for their ticks.

use std::ops::RangeInclusive;

use decoupler_core::text::format_number;

/// Maximum number of parts into which ticks divide an axis.
const MAX_PARTS: f64 = 8.0;
/// Values beyond this have no place, because differences between them would overflow.
const LARGEST: f64 = 1e300;

/// Scale of an axis with its ticks.
#[derive(Clone, Debug, PartialEq)]
pub enum Scale {
    /// Ticks at round numbers.
    Linear,
    /// Ticks at decades, and at 2 and 5 between them where there is room; values that are not positive are left out.
    Logarithmic,
    /// Linear, with ticks at multiples of this number; of 1, for integers.
    Multiples(f64),
    /// Linear, with ticks at the values 0, 1, 2 …, which have these names.
    Names(Vec<String>),
    /// Linear, without ticks: the axis is not drawn.
    Hidden,
}

/// An axis of a plot. A *place* is a position along it: the value itself, or its decimal logarithm.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotAxis {
    /// Name of the quantity, with its unit.
    pub name: String,
    /// Positions of the values and of the ticks.
    pub scale: Scale,
    /// Values that are always in view; if one is the minimum or maximum, the axis ends there.
    pub includes: Vec<f64>,
    /// Values beyond this range are drawn at its ends.
    pub limits: Option<RangeInclusive<f64>>,
}

/// Ticks of an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ticks {
    /// Their places, ascending.
    pub places: Vec<f64>,
    /// Smallest distance between two of them.
    pub step: f64,
}

impl PlotAxis {
    /// An axis of this scale.
    pub fn new(name: impl Into<String>, scale: Scale) -> Self {
        Self {
            name: name.into(),
            scale,
            includes: Vec::new(),
            limits: None,
        }
    }

    /// A linear axis.
    pub fn linear(name: impl Into<String>) -> Self {
        Self::new(name, Scale::Linear)
    }

    /// A logarithmic axis.
    pub fn logarithmic(name: impl Into<String>) -> Self {
        Self::new(name, Scale::Logarithmic)
    }

    /// An axis with ticks at integers only.
    pub fn integers(name: impl Into<String>) -> Self {
        Self::new(name, Scale::Multiples(1.0))
    }

    /// An axis of values with names, with room for all of them.
    pub fn of_names(name: impl Into<String>, names: Vec<String>) -> Self {
        let end = names.len() as f64 - 0.5;
        Self::new(name, Scale::Names(names)).including([-0.5, end])
    }

    /// The axis with these values always in view.
    #[must_use]
    pub fn including(mut self, values: impl IntoIterator<Item = f64>) -> Self {
        self.includes.extend(values);
        self
    }

    /// The axis on which values beyond `limits` are drawn at the ends of that range.
    #[must_use]
    pub fn limited(mut self, limits: RangeInclusive<f64>) -> Self {
        self.limits = Some(limits);
        self
    }

    /// Returns the place of a value; `None` if it has none.
    pub fn place(&self, value: f64) -> Option<f64> {
        let limits = self.limits.as_ref();
        let within = limits.map_or(value, |limits| value.max(*limits.start()).min(*limits.end()));
        let place = match self.scale {
            Scale::Logarithmic if value > 0.0 => within.log10(),
            Scale::Logarithmic => return None,
            _ => within,
        };
        (place.abs() < LARGEST).then_some(place)
    }

    /// Returns a value as text: `12`, `0.0123`, the name of a named value.
    pub fn value_text(&self, value: f64) -> String {
        match &self.scale {
            Scale::Names(_) => self.tick_text(value, 1.0, &(0.0..=0.0)),
            _ if value.fract() == 0.0 && value.abs() < 1e9 => format!("{value:.0}").replace('-', "−"),
            _ => format_number(value).replace('-', "−"),
        }
    }

    /// Returns the range of places that contains all `places`, with a margin.
    pub(crate) fn range(&self, places: impl Iterator<Item = f64>) -> RangeInclusive<f64> {
        let (data_low, data_high) = ends(places);
        let (fixed_low, fixed_high) = ends(self.includes.iter().filter_map(|&value| self.place(value)));
        let (low, high) = (data_low.min(fixed_low), data_high.max(fixed_high));
        if low > high {
            return 0.0..=1.0;
        }
        // A single value, or values that differ only by rounding, still have a range.
        let width = (high - low).max(1e-9 * low.abs().max(high.abs())).max(1e-12);
        let margin = if high > low { 0.05 * width } else { 0.5 };
        let beyond = |end: f64, fixed: f64| if fixed == end && high > low { 0.0 } else { margin };
        low - beyond(low, fixed_low)..=high + beyond(high, fixed_high)
    }

    /// Returns the ticks within a range of places, separated by at least `apart`, the width of a number.
    pub fn ticks(&self, range: &RangeInclusive<f64>, apart: f64) -> Ticks {
        let width = range.end() - range.start();
        if !(width.is_finite() && width > 0.0) {
            return Ticks::default();
        }
        let least = apart.max(width / MAX_PARTS);
        match &self.scale {
            Scale::Linear => Ticks::at_multiples(range, linear_step(range, least)),
            Scale::Logarithmic => logarithmic_ticks(range, apart, least),
            Scale::Multiples(unit) => Ticks::at_multiples(range, unit * round_step(least / unit).max(1.0)),
            Scale::Hidden => Ticks::default(),
            Scale::Names(names) => {
                // The width is that of a number of six characters.
                let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
                let needed = apart * (longest + 2) as f64 / 6.0;
                let mut ticks = Ticks::at_multiples(range, needed.ceil().max(1.0));
                ticks.places.retain(|place| (0.0..names.len() as f64).contains(place));
                ticks
            }
        }
    }

    /// Returns the positions of the ticks in a range of places, from 0 to 1, with their numbers, which are separated by at
    /// least the share `apart` of the range.
    pub(crate) fn numbers(&self, range: &RangeInclusive<f64>, apart: f32) -> Vec<(f64, String)> {
        let ticks = self.ticks(range, f64::from(apart) * (range.end() - range.start()));
        let number = |&place: &f64| (share(place, range), self.tick_text(place, ticks.step, range));
        ticks.places.iter().map(number).collect()
    }

    /// Returns the text at a tick, given the distance to the next and the range of places, which have numbers of one kind.
    pub fn tick_text(&self, place: f64, step: f64, range: &RangeInclusive<f64>) -> String {
        match &self.scale {
            Scale::Names(names) => names.get(place.round() as usize).cloned().unwrap_or_default(),
            Scale::Logarithmic => power_text(place, range),
            _ => tick_text(place, step),
        }
    }
}

impl Ticks {
    fn at_multiples(range: &RangeInclusive<f64>, step: f64) -> Self {
        let places = multiples(range, step);
        Self { places, step }
    }
}

/// Returns the minimum and maximum; without values, the first is larger than the second.
pub(crate) fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

/// Returns the position of `place` in its range, from 0 to 1.
pub(super) fn share(place: f64, range: &RangeInclusive<f64>) -> f64 {
    (place - range.start()) / (range.end() - range.start())
}

/// A round step, at least `least`. Where only zero would be a multiple, which gives no scale, it is the largest number of one
/// digit in the range, if there is room.
fn linear_step(range: &RangeInclusive<f64>, least: f64) -> f64 {
    let (step, end) = (round_step(least), range.end().max(-range.start()));
    let decade = decade_below(end);
    let digit = (end / decade).floor() * decade;
    let is_zero_alone = *range.start() < 0.0 && *range.end() > 0.0 && end < step;
    let is_digit = is_zero_alone && digit > 0.8 * least;
    if is_digit { digit } else { step }
}

/// Whole decades; 2 and 5 between them where there is room; round numbers within less than a decade.
fn logarithmic_ticks(range: &RangeInclusive<f64>, apart: f64, least: f64) -> Ticks {
    let (low, high, two) = (*range.start(), *range.end(), 2.0_f64.log10());
    if high - low < 0.9 {
        let [low, top] = [low, high].map(|end| 10.0_f64.powf(end));
        // The upper end is more crowded.
        let number = top - 10.0_f64.powf(high - apart);
        let step = round_step(number.max((top - low) / MAX_PARTS));
        let places = multiples(&(low..=top), step).into_iter().map(f64::log10);
        return Ticks {
            places: places.filter(|place| place.is_finite()).collect(),
            step: (1.0 + step / top).log10(),
        };
    }
    if two <= apart || high - low >= 4.0 {
        return Ticks::at_multiples(range, round_step(least).max(1.0));
    }
    let places = multiples(&(low - 1.0..=high), 1.0).into_iter();
    let places = places.flat_map(|decade| [0.0, two, 1.0 - two].map(|part| decade + part));
    Ticks {
        places: places.filter(|place| range.contains(place)).collect(),
        step: two,
    }
}

/// Returns the number at a tick of a logarithmic axis, given its decimal logarithm: `0.02`, or `2e−2` on an axis that spans
/// very small or large numbers.
fn power_text(log: f64, range: &RangeInclusive<f64>) -> String {
    // Three digits distinguish any two ticks. The exponent is split off before 10 to its power overflows.
    let decade = (log + 1e-9).floor();
    let is_plain = *range.start() > -3.2 && *range.end() < 5.5;
    let exponent = if is_plain { 0.0 } else { decade };
    let decimals = (2.0 + exponent - decade).max(0.0) as usize;
    let number = format!("{:.decimals$}", 10.0_f64.powf(log - exponent));
    let digits = number.trim_end_matches('0').trim_end_matches('.');
    let short = if number.contains('.') { digits } else { &number };
    let power = if is_plain { String::new() } else { format!("e{decade}") };
    format!("{short}{power}").replace('-', "−")
}

/// Returns the largest power of ten up to a positive value.
fn decade_below(value: f64) -> f64 {
    10_f64.powi(value.log10().floor() as i32)
}

/// Returns 1, 2 or 5 times a power of ten, at least `smallest`.
fn round_step(smallest: f64) -> f64 {
    let decade = decade_below(smallest);
    let steps = [1.0, 2.0, 5.0].map(|factor| factor * decade).into_iter();
    let mut large = steps.filter(|step| *step >= smallest * (1.0 - 1e-9));
    large.next().unwrap_or(10.0 * decade)
}

/// The multiples of `step` in a range.
pub(super) fn multiples(range: &RangeInclusive<f64>, step: f64) -> Vec<f64> {
    let first = (range.start() / step - 1e-6).ceil() as i64;
    let last = (range.end() / step + 1e-6).floor() as i64;
    (first..=last).map(|multiple| multiple as f64 * step).collect()
}

/// A round step that divides a range into at most `parts`.
pub(super) fn step_for(range: &RangeInclusive<f64>, parts: usize) -> f64 {
    let width = range.end() - range.start();
    match width > 0.0 && width.is_finite() {
        true => round_step(width / parts as f64),
        false => 1.0,
    }
}

/// Returns the number at a tick, with as many digits as its step needs and a true minus sign: `0`, `0.25`, `2.5e−9`.
pub fn tick_text(value: f64, step: f64) -> String {
    let decade = (step.log10() + 1e-9).floor();
    let digits = |decades: f64| decades.clamp(0.0, 9.0) as usize;
    let text = match (-6.0..6.0).contains(&decade) {
        _ if value.abs() < 0.5 * 10_f64.powf(decade) => "0".to_owned(),
        true => format!("{value:.*}", digits(-decade)),
        false => format!("{value:.*e}", digits(value.abs().log10().floor() - decade)),
    };
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texts at the ticks of an axis of length `points` on which a number is `number` points wide.
    fn texts(axis: &PlotAxis, [low, high]: [f64; 2], points: f64, number: f64) -> Vec<String> {
        let ticks = axis.ticks(&(low..=high), (high - low) * number / points);
        let places = ticks.places.iter();
        places
            .map(|&place| axis.tick_text(place, ticks.step, &(low..=high)))
            .collect()
    }

    #[test]
    fn ticks_of_a_plain_axis_are_round_and_few() {
        let axis = PlotAxis::linear("");
        let texts = |low, high, points| texts(&axis, [low, high], points, 50.0);
        assert_eq!(texts(-0.3, 1.1, 300.0), ["0", "0.5", "1.0"]);
        assert_eq!(texts(-0.45, 0.45, 120.0), ["−0.4", "0", "0.4"]);
        assert_eq!(texts(-0.45, 0.45, 60.0), ["0"]);
        assert_eq!(texts(3.98, 5.02, 300.0), ["4.0", "4.2", "4.4", "4.6", "4.8", "5.0"]);
        assert_eq!(texts(0.0, 1000.0, 300.0), ["0", "200", "400", "600", "800", "1000"]);
        assert_eq!(texts(0.0, 1000.0, 120.0), ["0", "500", "1000"], "a narrow chart");
        assert!(texts(1.0, 1.0, 300.0).is_empty());
        assert!(texts(f64::NAN, 1.0, 300.0).is_empty());
    }

    #[test]
    fn ticks_of_a_logarithmic_axis_are_in_view_and_read_as_numbers() {
        let axis = PlotAxis::logarithmic("");
        let texts = |low, high, points| texts(&axis, [low, high], points, 16.0);
        assert_eq!(texts(-3.1, 0.1, 150.0), ["0.001", "0.01", "0.1", "1"]);
        assert_eq!(texts(-4.2, 0.1, 150.0), ["1e−4", "1e−3", "1e−2", "1e−1", "1e0"]);
        assert_eq!(texts(-1.1, 0.2, 150.0), ["0.1", "0.2", "0.5", "1"]);
        assert_eq!(texts(-1.1, 0.2, 60.0), ["0.1", "1"]);
        assert_eq!(texts(-0.73, -0.69, 150.0), ["0.19", "0.195", "0.2"]);
        assert!(texts(f64::NAN, 1.0, 150.0).is_empty());
    }

    #[test]
    fn the_axis_of_a_diverged_training_has_numbers_at_any_height() {
        let axis = PlotAxis::logarithmic("");
        for points in [40.0, 80.0, 120.0, 200.0] {
            for high in [3.0, 20.0, 80.0, 300.0] {
                let range = -0.5..=high;
                let ticks = axis.ticks(&range, (high + 0.5) * 16.0 / points);
                assert!((2..=12).contains(&ticks.places.len()), "{ticks:?}");
                let apart = ticks.step * points / (high + 0.5);
                assert!(apart >= 16.0, "{apart} points between numbers");
            }
        }
    }

    #[test]
    fn counts_have_no_ticks_between_integers() {
        let axis = PlotAxis::integers("");
        assert_eq!(texts(&axis, [-0.08, 1.08], 150.0, 16.0), ["0", "1"]);
        assert_eq!(
            texts(&axis, [-0.08, 6.4], 150.0, 16.0),
            ["0", "1", "2", "3", "4", "5", "6"]
        );
    }

    #[test]
    fn names_are_at_their_values_and_thinned_where_crowded() {
        let names = ["10×6_3×18", "10×8_4×24", "10×10_5×30"].map(str::to_owned).to_vec();
        let axis = PlotAxis::new("array", Scale::Names(names.clone()));
        assert_eq!(texts(&axis, [-0.5, 2.5], 400.0, 36.0), names);
        assert_eq!(texts(&axis, [-0.5, 2.5], 150.0, 36.0), [&*names[0], &*names[2]]);
        assert_eq!(axis.value_text(1.0), names[1]);
    }

    #[test]
    fn an_axis_ends_at_included_extremes_and_has_a_margin_elsewhere() {
        let axis = PlotAxis::linear("").including([0.0]);
        let range = axis.range([1.0, 4.0].into_iter());
        assert_eq!(*range.start(), 0.0);
        assert!(*range.end() > 4.0);
        let below = axis.range([-1.0, 4.0].into_iter());
        assert!(*below.start() < -1.0, "no value is hidden");
    }

    #[test]
    fn values_beyond_the_limits_are_drawn_at_the_ends() {
        let axis = PlotAxis::logarithmic("").limited(0.0..=100.0);
        assert_eq!(
            [1.0, 1e9, f64::INFINITY].map(|value| axis.place(value)),
            [0.0, 2.0, 2.0].map(Some)
        );
        assert_eq!([0.0, -1.0, f64::NAN].map(|value| axis.place(value)), [None; 3]);
        let unlimited = PlotAxis::linear("");
        assert_eq!(
            [f64::INFINITY, f64::MAX, f64::NAN].map(|value| unlimited.place(value)),
            [None; 3]
        );
    }

    #[test]
    fn steps_are_round() {
        assert_eq!([0.13, 0.2, 0.21, 0.51].map(round_step), [0.2, 0.2, 0.5, 1.0]);
        assert_eq!(step_for(&(4.0..=5.0), 10), 0.1);
        assert_eq!(step_for(&(3.0..=3.0), 10), 1.0);
    }

    #[test]
    fn ticks_have_the_decimals_of_their_step() {
        for (value, step, text) in [
            (4.0, 0.2, "4.0"),
            (-0.25, 0.05, "−0.25"),
            (-1e-17, 0.1, "0"),
            (2e-12, 2e-12, "2e−12"),
            (-1.2e-9, 2e-10, "−1.2e−9"),
            (3e7, 1e7, "3e7"),
            (10.0, 5.0, "10"),
            (0.1, 0.1, "0.1"),
        ] {
            assert_eq!(tick_text(value, step), text);
        }
    }

    #[test]
    fn both_ends_of_a_range_are_ticks() {
        assert_eq!(multiples(&(4.0..=5.0), 0.2).len(), 6);
        assert_eq!(multiples(&(-0.1..=0.1), 0.05).len(), 5);
    }
}
