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
