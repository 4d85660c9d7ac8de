//! Round numbers for axes.

use std::ops::RangeInclusive;

/// Steps of 1, 2 and 5 times a power of ten, ascending from at least `smallest`.
pub(crate) fn round_steps(smallest: f64) -> impl Iterator<Item = f64> {
    let decade = smallest.log10().floor() as i32;
    (decade..decade + 20)
        .flat_map(|power| [1.0, 2.0, 5.0].map(|factor| factor * 10_f64.powi(power)))
        .filter(move |step| *step >= smallest * (1.0 - 1e-9))
}

/// The multiples of `step` in a range.
pub fn multiples(range: &RangeInclusive<f64>, step: f64) -> Vec<f64> {
    let first = (range.start() / step - 1e-6).ceil() as i64;
    let last = (range.end() / step + 1e-6).floor() as i64;
    (first..=last).map(|multiple| multiple as f64 * step).collect()
}

/// A round step that divides a range into at most `parts`.
pub fn step_for(range: &RangeInclusive<f64>, parts: usize) -> f64 {
    let width = range.end() - range.start();
    if width > 0.0 && width.is_finite() {
        round_steps(width / parts as f64).next().unwrap_or(width)
    } else {
        1.0
    }
}

/// A tick's number, with as many decimals as its step needs and a true minus sign.
pub fn tick_text(value: f64, step: f64) -> String {
    let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    let value = if value.abs() < 0.5 * 10_f64.powi(-(decimals as i32)) {
        0.0
    } else {
        value
    };
    format!("{value:.decimals$}").replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        assert_eq!(round_steps(0.13).take(3).collect::<Vec<_>>(), [0.2, 0.5, 1.0]);
        assert_eq!(step_for(&(4.0..=5.0), 10), 0.1);
        assert_eq!(step_for(&(3.0..=3.0), 10), 1.0);
    }

    #[test]
    fn ticks_have_the_decimals_of_their_step() {
        for (value, step, text) in [
            (4.0, 0.2, "4.0"),
            (-0.25, 0.05, "−0.25"),
            (-1e-17, 0.1, "0.0"),
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
