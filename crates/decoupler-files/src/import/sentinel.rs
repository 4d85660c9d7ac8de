//! Numbers that are no measurements: markers of missing values, and constants with rounding errors.

use std::collections::HashSet;

use serde::Serialize;

/// Number that seems to mean "none": it is repeated at one end of a column, apart from the other numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sentinel {
    /// The number.
    pub value: f64,
    /// Number of cells.
    pub cells: usize,
    /// The nearest other number.
    pub nearest: f64,
}

/// Numbers that programs write for "none".
const CODES: [f64; 12] = [
    -1.0, -9.0, -99.0, -999.0, -9999.0, -99999.0, 999.0, 9999.0, 99999.0, 65535.0, -32768.0, 1e9,
];
/// Minimum number of cells.
const MIN_CELLS: usize = 5;
/// Minimum share of cells for numbers that are no usual codes.
const MIN_SHARE: f64 = 1e-3;
/// Minimum gap to the other numbers, relative to their range, for numbers that are no usual codes.
const MIN_GAP: f64 = 3.0;
/// Number of values above which a column is not a list of codes such as -1, 0 and 1.
const MAX_LEVELS: usize = 20;

impl Sentinel {
    /// Finds the number among those of a column, in which NaN is missing.
    pub(super) fn find(numbers: &[f64]) -> Option<Self> {
        let [[min, above_min], [max, below_max]] = extremes(numbers)?;
        // A few values at regular distances are codes, like the classes -1, 0 and 1.
        let (low, high) = (above_min - min, max - below_max);
        if low.max(high) <= 3.0 * low.min(high) && distinct(numbers, MAX_LEVELS) <= MAX_LEVELS {
            return None;
        }
        let present = numbers.iter().filter(|number| !number.is_nan()).count();
        let ends = [(min, above_min, max), (max, below_max, min)];
        ends.into_iter().find_map(|(value, nearest, opposite)| {
            let cells = numbers.iter().filter(|number| **number == value).count();
            let (gap, range) = ((nearest - value).abs(), (opposite - nearest).abs());
            let is_code = CODES.contains(&value);
            // All other numbers have the other sign, or are far away.
            let is_apart = match value {
                -1.0 => nearest >= 0.0,
                _ if is_code => gap > range,
                _ => gap > MIN_GAP * range && range > 0.0 && cells as f64 >= MIN_SHARE * present as f64,
            };
            (cells >= MIN_CELLS && is_apart).then_some(Self { value, cells, nearest })
        })
    }

    /// Returns a warning about a column, with the marker to use.
    pub(super) fn warning(&self, name: &str) -> String {
        let Self { value, cells, nearest } = self;
        let side = if nearest > value { "at least" } else { "at most" };
        format!(
            "{name} is {value} in {cells} cells, and {side} {nearest} elsewhere: if {value} means \"none\", mark it as missing \
             by {name}={value}"
        )
    }
}

/// Returns the smallest and the second smallest, and the largest and the second largest of different numbers; `None` unless there
/// are two.
fn extremes(numbers: &[f64]) -> Option<[[f64; 2]; 2]> {
    // Negated, the largest are the smallest; NaN never is.
    let two = |sign: f64| {
        let numbers = numbers.iter().map(|number| sign * number);
        let smallest = numbers.fold([f64::INFINITY; 2], |[first, second], number| match number {
            _ if number < first => [number, first],
            _ if number > first && number < second => [first, number],
            _ => [first, second],
        });
        smallest.map(|number| sign * number)
    };
    let found = [two(1.0), two(-1.0)];
    (found[0][0] < found[1][0]).then_some(found)
}

/// Counts different numbers, up to one more than `limit`.
fn distinct(numbers: &[f64], limit: usize) -> usize {
    let mut known = HashSet::new();
    // −0 and 0 are the same number.
    let present = numbers.iter().filter(|number| !number.is_nan());
    let new = present.filter(|number| known.insert((**number + 0.0).to_bits()));
    new.take(limit + 1).count()
}

/// Returns `true` if numbers differ, but by rounding only.
pub(super) fn is_rounding(numbers: &[f64]) -> bool {
    const FRACTION: f64 = 1e-5;
    const FRACTION_OF_FEW: f64 = 1e-3;
    const FEW: usize = 3;
    let Some([[min, _], [max, _]]) = extremes(numbers) else {
        return false;
    };
    let (range, value) = (max - min, min.abs().max(max.abs()));
    // A clock that counts from 1970 has many values.
    (range <= FRACTION * value && distinct(numbers, MAX_LEVELS) <= MAX_LEVELS)
        || (range <= FRACTION_OF_FEW * value && distinct(numbers, FEW) <= FEW)
}

/// Returns a warning about a column whose numbers differ by rounding only.
pub(super) fn rounding_warning(name: &str) -> String {
    format!("{name} varies within its rounding only: it is a constant, not a target")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(number: f64, times: usize, rest: impl Iterator<Item = f64>) -> Vec<f64> {
        std::iter::repeat_n(number, times).chain(rest).collect()
    }

    #[test]
    fn repeated_numbers_apart_from_the_rest_are_found() {
        let forces = || (0..200).map(|row| 3.25 + 0.7 * f64::from(row % 97));
        let classes = || (0..90).map(|row| f64::from(row % 3 - 1));
        let cases = [
            (
                with(-1.0, 40, forces()),
                Some(-1.0),
                "-1 before forces that are positive",
            ),
            (
                with(9999.0, 6, forces()),
                Some(9999.0),
                "a usual code far from the rest",
            ),
            (with(5000.0, 6, forces()), Some(5000.0), "any number far from the rest"),
            (with(5000.0, 2, forces()), None, "an outlier is not repeated"),
            (
                with(70.0, 40, forces()),
                None,
                "a number near the others, such as saturation",
            ),
            (
                with(-1.0, 40, forces().map(|force| force - 40.0)),
                None,
                "-1 among negative numbers",
            ),
            (classes().collect(), None, "classes"),
            (with(0.0, 500, [1.0; 300].into_iter()), None, "two states"),
            (vec![-1.0; 50], None, "a constant"),
            (vec![f64::NAN; 50], None, "no numbers"),
        ];
        for (numbers, expected, case) in cases {
            assert_eq!(Sentinel::find(&numbers).map(|found| found.value), expected, "{case}");
        }
        let found = Sentinel::find(&with(-1.0, 40, forces())).unwrap();
        assert_eq!((found.cells, found.nearest), (40, 3.25));
        assert!(found.warning("c5").ends_with("by c5=-1"), "{}", found.warning("c5"));
    }

    #[test]
    fn constants_with_rounding_are_found() {
        let cases = [
            (vec![145.1, 145.100_01, 145.1], true),
            (vec![145.1, 145.1, 145.1], false),
            (vec![0.0, 1.0, 0.0], false),
            (vec![20.0, 20.01, 20.02], true),
            (vec![20.0, 20.01, 20.02, 20.005], false),
            (vec![0.0, 1e-9], false),
            ((0..50).map(|row| 1.7e9 + f64::from(row)).collect(), false),
        ];
        for (numbers, expected) in cases {
            assert_eq!(is_rounding(&numbers), expected, "{numbers:?}");
        }
    }
}
