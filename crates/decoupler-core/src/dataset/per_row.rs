use super::Dataset;
use crate::scene::RowModel;

/// One value shared by all row-wires read, or one value per row-wire.
#[derive(Clone, Debug, PartialEq)]
pub struct PerRow<T>(
    /// Never empty. A single value is shared by all row-wires.
    Vec<T>,
);

impl<T> PerRow<T> {
    /// Creates a value shared by all row-wires.
    pub fn shared(value: T) -> Self {
        Self(vec![value])
    }

    /// Creates one value per row-wire read, in ascending order. A single value is shared by all row-wires.
    ///
    /// # Panics
    /// If `values` is empty.
    pub fn each(values: Vec<T>) -> Self {
        assert!(!values.is_empty(), "at least one row-wire is read");
        Self(values)
    }

    /// Fits one value to all samples of `training`, or one value per row-wire to its samples.
    ///
    /// # Errors
    /// If `fit` fails.
    pub fn fit<E>(
        training: &Dataset,
        model: RowModel,
        mut fit: impl FnMut(&Dataset) -> Result<T, E>,
    ) -> Result<Self, E> {
        match model {
            RowModel::Shared => Ok(Self::shared(fit(training)?)),
            RowModel::Each => {
                let rows = (0..training.row_count()).map(|row_index| fit(&training.of_row(row_index)));
                Ok(Self::each(rows.collect::<Result<_, _>>()?))
            }
        }
    }

    /// Returns the value for the row-wire with this index among those read; a shared value serves every index.
    ///
    /// # Panics
    /// If there is one value per row-wire and no row-wire with this index.
    #[inline]
    pub fn at(&self, row_index: usize) -> &T {
        &self.0[if self.0.len() == 1 { 0 } else { row_index }]
    }

    /// Returns the same value as [`Self::at`], mutably.
    ///
    /// # Panics
    /// If there is one value per row-wire and no row-wire with this index.
    #[inline]
    pub fn at_mut(&mut self, row_index: usize) -> &mut T {
        let index = if self.0.len() == 1 { 0 } else { row_index };
        &mut self.0[index]
    }

    /// Returns the shared value, if there is only one.
    pub fn only(&self) -> Option<&T> {
        match &self.0[..] {
            [only] => Some(only),
            _ => None,
        }
    }

    /// Returns all values: one, or one per row-wire read.
    pub fn values(&self) -> &[T] {
        &self.0
    }

    /// Applies `make` to each value.
    pub fn map<U>(&self, make: impl FnMut(&T) -> U) -> PerRow<U> {
        PerRow(self.0.iter().map(make).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use ndarray::Array2;

    use super::*;

    #[test]
    fn one_serves_every_row_and_each_row_has_its_own() {
        let shared = PerRow::shared('a');
        assert_eq!((shared.at(0), shared.at(7), shared.only()), (&'a', &'a', Some(&'a')));
        let each = PerRow::each(vec!['a', 'b', 'c']);
        assert_eq!((each.at(0), each.at(2), each.only()), (&'a', &'c', None));
        assert_eq!(each.map(|c| c.to_ascii_uppercase()).values(), ['A', 'B', 'C']);
    }

    #[test]
    fn each_row_is_fitted_to_its_own_samples_in_any_order() {
        let readings = Array2::from_shape_fn((5, 1), |(sample, _)| sample as f64);
        let set = Dataset::new(readings.clone(), readings, Some(&[9, 4, 4, 9, 4]), vec![0, 0, 1, 1, 2]).unwrap();
        let samples = |set: &Dataset| Ok::<_, Infallible>(set.readings().column(0).to_vec());
        let each = PerRow::fit(&set, RowModel::Each, samples).unwrap();
        assert_eq!(each.values(), [vec![1.0, 2.0, 4.0], vec![0.0, 3.0]]);
        let shared = PerRow::fit(&set, RowModel::Shared, samples).unwrap();
        assert_eq!(shared.only().map(Vec::len), Some(5));
    }
}
