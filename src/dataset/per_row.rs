use super::Dataset;
use crate::scene::RowModel;

/// One value for every row-wire read, or one for each.
#[derive(Clone, Debug, PartialEq)]
pub struct PerRow<T>(
    /// Never empty. A single value serves every row-wire.
    Vec<T>,
);

impl<T> PerRow<T> {
    /// One for every row-wire.
    pub fn shared(value: T) -> Self {
        Self(vec![value])
    }

    /// One for each row-wire read, in ascending order. A single one serves every row-wire.
    ///
    /// # Panics
    /// If there is none.
    pub fn each(values: Vec<T>) -> Self {
        assert!(!values.is_empty(), "at least one row-wire is read");
        Self(values)
    }

    /// Makes one value from all samples of `training`, or one from those of each row-wire.
    ///
    /// # Errors
    /// What `fit` says.
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

    /// The value for the row-wire with this index among those read: the only index rule.
    ///
    /// # Panics
    /// If each row-wire has a value of its own and there is no such row-wire.
    #[inline]
    pub fn at(&self, row_index: usize) -> &T {
        &self.0[if self.0.len() == 1 { 0 } else { row_index }]
    }

    /// As [`Self::at`], to be changed.
    ///
    /// # Panics
    /// If each row-wire has a value of its own and there is no such row-wire.
    #[inline]
    pub fn at_mut(&mut self, row_index: usize) -> &mut T {
        let index = if self.0.len() == 1 { 0 } else { row_index };
        &mut self.0[index]
    }

    /// The one that serves every row-wire, if there is only one.
    pub fn only(&self) -> Option<&T> {
        match &self.0[..] {
            [only] => Some(only),
            _ => None,
        }
    }

    /// All values: one, or one for each row-wire read.
    pub fn values(&self) -> &[T] {
        &self.0
    }

    /// Makes another value of each.
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
