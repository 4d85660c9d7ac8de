//! Curves of this many points that several share a pixel: of each stretch the least and the largest remain, so that no peak
//! is lost.

use std::ops::RangeInclusive;

use ndarray::Array2;

use super::{
    axis::{PlotAxis, share},
    colour_map::SequentialMap,
};

/// Values over two axes as colours, with the number in each cell.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Name of the columns' quantity.
    pub x_name: String,
    /// Name of the rows' quantity.
    pub y_name: String,
    /// Value of each column, in words.
    pub columns: Vec<String>,
    /// Value of each row, in words; the first is at the top.
    pub rows: Vec<String>,
    /// Rows × columns; NaN where there is none.
    pub values: Array2<f64>,
    /// Words about each cell, rows × columns.
    pub notes: Array2<String>,
    /// Name of the values, and the scale of the colours.
    pub value_axis: PlotAxis,
    /// Colours of the values.
    pub colours: SequentialMap,
}

impl HeatMap {
    /// The map in these colours.
    #[must_use]
    pub fn coloured(self, colours: SequentialMap) -> Self {
        Self { colours, ..self }
    }

    /// Returns the position of a value on the scale of colours over `range`, from 0 to 1; `None` for no value.
    pub fn colour_share(&self, value: f64, range: &RangeInclusive<f64>) -> Option<f64> {
        match self.value_axis.place(value) {
            Some(place) => Some(share(place, range)),
            // A zero where colours go by the logarithm.
            None if value.is_finite() => Some(0.0),
            None => None,
        }
    }

    /// Returns the range of places that the colours span: those of the values, and of what the axis includes.
    pub fn range(&self) -> RangeInclusive<f64> {
        let values = self.values.iter().chain(&self.value_axis.includes);
        let places = values.filter_map(|&value| self.value_axis.place(value));
        let (low, high) = places.fold((f64::MAX, f64::MIN), |(low, high), place| {
            (low.min(place), high.max(place))
        });
        match low < high {
            true => low..=high,
            false if low == high => low - 0.5..=high + 0.5,
            false => 0.0..=1.0,
        }
    }
}

/// Stretches into which a long curve is divided: more than the widest chart has pixels.
pub(super) const STRETCHES: usize = 2048;

/// Returns the indices of the items at which `of` is least or largest within its stretch, ascending, with both ends; all
/// indices where there are few. Where a value is missing or not a number, one such item of the stretch remains.
pub(super) fn outline<T>(items: &[T], of: impl Fn(&T) -> Option<f64>) -> Vec<usize> {
    if items.len() <= 2 * STRETCHES {
        return (0..items.len()).collect();
    }
    let mut kept = Vec::with_capacity(2 * STRETCHES + 2);
    kept.push(0);
    for stretch in 0..STRETCHES {
        let [from, to] = [stretch, stretch + 1].map(|end| end * items.len() / STRETCHES);
        extremes(&items[from..to], &of, |place| kept.push(from + place));
    }
    kept.push(items.len() - 1);
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// Tells the places at which `of` is least and largest, and the first without a number.
pub(super) fn extremes<T>(items: &[T], of: impl Fn(&T) -> Option<f64>, mut tell: impl FnMut(usize)) {
    let (mut least, mut largest, mut missing) = (None, None, None);
    for (place, item) in items.iter().enumerate() {
        match of(item).filter(|value| value.is_finite()) {
            Some(value) => {
                if least.is_none_or(|(_, least)| value < least) {
                    least = Some((place, value));
                }
                if largest.is_none_or(|(_, largest)| value > largest) {
                    largest = Some((place, value));
                }
            }
            None => missing = missing.or(Some(place)),
        }
    }
    let found = [least, largest].into_iter().flatten().map(|(place, _)| place);
    found.chain(missing).for_each(&mut tell);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_points_keep_every_peak_and_both_ends() {
        let mut values: Vec<f64> = (0..1_000_000).map(|i| (f64::from(i) * 1e-4).sin()).collect();
        for spike in [17, 123_456, 999_998] {
            values[spike] = 5.0;
            values[spike - 3] = -5.0;
        }
        let kept = outline(&values, |value| Some(*value));
        assert!(kept.len() <= 2 * STRETCHES + 2, "{}", kept.len());
        assert_eq!((kept[0], kept[kept.len() - 1]), (0, 999_999));
        let peaks: Vec<usize> = kept.iter().copied().filter(|&at| values[at].abs() > 4.0).collect();
        assert_eq!(peaks, [14, 17, 123_453, 123_456, 999_995, 999_998]);
        // Every pixel of a chart 2000 wide is as dark as with all points.
        for pixel in 0..2000 {
            let range = pixel * 500..(pixel + 1) * 500;
            let largest = values[range.clone()].iter().copied().fold(f64::MIN, f64::max);
            let near = range.start.saturating_sub(500)..range.end + 500;
            let shown = kept.iter().filter(|at| near.contains(at)).map(|&at| values[at]);
            assert!(shown.fold(f64::MIN, f64::max) >= largest, "pixel {pixel}");
        }
    }

    #[test]
    fn few_points_stay_and_gaps_are_kept() {
        assert_eq!(outline(&[3, 1, 2], |_| Some(0.0)), [0, 1, 2]);
        assert!(outline::<u8>(&[], |_| None).is_empty());
        let mut values = vec![1.0; 10_000];
        values[5000] = f64::NAN;
        assert!(outline(&values, |value| Some(*value)).contains(&5000));
    }
}
