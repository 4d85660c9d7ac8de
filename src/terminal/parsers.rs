//! Parsers of values that several commands take.

use std::ops::RangeInclusive;

/// Returns a parser of whole numbers in `allowed`.
pub(super) fn count(allowed: RangeInclusive<usize>) -> impl Fn(&str) -> Result<usize, String> + Clone {
    move |text| {
        let count = text.parse().ok().filter(|count| allowed.contains(count));
        count.ok_or_else(|| format!("give a whole number from {} to {}", allowed.start(), allowed.end()))
    }
}

/// Parses a finite number that is not negative.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .ok()
        .filter(|number: &f64| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| "give a number from 0, for example 1e-7".to_owned())
}

/// Parses a seed.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("give a whole number from 0 to {}", u64::MAX))
}
