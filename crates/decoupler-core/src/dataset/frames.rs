use super::{Dataset, DatasetError};
use crate::scene::RowModel;

impl Dataset {
    /// Groups the readings into whole frames, each with those of all row-wires at one moment, row by row: the input of a
    /// decoder. They are in the order of [`Self::snapshots`], rows in ascending order.
    ///
    /// # Errors
    /// If a snapshot lacks a row-wire, or has one twice.
    pub fn frames(&self) -> Result<Vec<Vec<f64>>, DatasetError> {
        let frame = |snapshot: Vec<usize>| {
            let mut readings = Vec::with_capacity(snapshot.len() * self.channels());
            for row_index in 0..self.row_count() {
                let of_row = snapshot.iter().filter(|&&sample| self.row_index(sample) == row_index);
                let [&sample] = Vec::from_iter(of_row.clone())[..] else {
                    return Err(DatasetError::Incomplete {
                        sample: snapshot[0],
                        row_wire: self.row_wires_read().map_or(0, |read| read[row_index]),
                        found: of_row.count(),
                    });
                };
                readings.extend(self.sample_readings(sample));
            }
            Ok(readings)
        };
        self.snapshots().into_iter().map(frame).collect()
    }
}

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
        Self::of_rows(model, training.row_count(), |row| match row {
            Some(row_index) => fit(&training.of_row(row_index)),
            None => fit(training),
        })
    }

    /// Creates one value for all row-wires, or one for each of `rows` row-wires, whose index is passed to `create`.
    ///
    /// # Errors
    /// If `create` fails.
    pub(crate) fn of_rows<E>(
        model: RowModel,
        rows: usize,
        mut create: impl FnMut(Option<usize>) -> Result<T, E>,
    ) -> Result<Self, E> {
        match model {
            RowModel::Shared => create(None).map(Self::shared),
            RowModel::Each => Ok(Self::each(
                (0..rows).map(|row| create(Some(row))).collect::<Result<_, _>>()?,
            )),
        }
    }

    /// Returns the value for the row-wire with this index among those read; a shared value applies to every index.
    ///
    /// # Panics
    /// If there is one value per row-wire and no row-wire with this index.
    #[inline]
    pub fn at(&self, row_index: usize) -> &T {
        &self.0[if self.0.len() == 1 { 0 } else { row_index }]
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

    fn set(row_wires: Option<&[usize]>, groups: &[usize]) -> Dataset {
        let readings = Array2::from_shape_fn((groups.len(), 2), |(s, c)| (10 * s + c) as f64);
        Dataset::new(readings.clone(), readings, row_wires, groups.to_vec()).unwrap()
    }

    #[test]
    fn frames_follow_groups_and_row_wires_in_any_order() {
        let frames = set(Some(&[5, 3, 3, 5]), &[8, 8, 2, 2]).frames().unwrap();
        assert_eq!(frames.len(), 2);
        assert_eq!(frames[0], [10.0, 11.0, 0.0, 1.0]);
        assert_eq!(frames[1], [20.0, 21.0, 30.0, 31.0]);
    }

    #[test]
    fn without_row_wires_every_sample_is_a_frame() {
        let frames = set(None, &[0, 1, 2]).frames().unwrap();
        assert_eq!((frames.len(), frames[0].len()), (3, 2));
    }

    #[test]
    fn incomplete_snapshots_are_refused() {
        let lacking = set(Some(&[0, 1, 1]), &[0, 0, 1]).frames().unwrap_err();
        assert_eq!(
            lacking.to_string().split(':').next(),
            Some("the snapshot of sample 3 is incomplete")
        );
        let is = |error: &DatasetError, row: usize, count: usize| matches!(error, DatasetError::Incomplete { row_wire, found, .. } if (*row_wire, *found) == (row, count));
        assert!(is(&lacking, 0, 0), "{lacking}");
        let twice = set(Some(&[0, 1, 1]), &[0, 0, 0]).frames().unwrap_err();
        assert!(is(&twice, 1, 2), "{twice}");
        let both = set(None, &[4, 4]).frames().unwrap_err();
        assert!(is(&both, 0, 2), "{both}");
    }

    #[test]
    fn a_value_is_shared_or_one_per_row() {
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
