use ndarray::{Array3, ArrayView2, Axis};
use thiserror::Error;

use super::Dataset;

/// Whole frames, each with the readings of all row-wires at one moment: the input of a decoder in use.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Snapshots × rows × channels.
    readings: Array3<f64>,
    /// Index of the sample behind each row of each snapshot, snapshot by snapshot.
    samples: Vec<usize>,
}

/// Error for a set that does not consist of whole frames.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("the snapshot of sample {} is not whole: {found} samples of row-wire {}, where each row-wire read needs one", .sample + 1, .row_wire + 1)]
pub struct FramesError {
    /// Index of the first sample of the snapshot, from 0.
    pub sample: usize,
    /// Row-wire at fault, from 0.
    pub row_wire: usize,
    /// Number of samples of this row-wire in the snapshot.
    pub found: usize,
}

impl Frames {
    /// Number of snapshots.
    pub fn count(&self) -> usize {
        self.readings.len_of(Axis(0))
    }

    /// Number of row-wires in a frame.
    pub fn rows(&self) -> usize {
        self.readings.len_of(Axis(1))
    }

    /// Readings of one frame: rows × channels.
    pub fn readings(&self, snapshot: usize) -> ArrayView2<'_, f64> {
        self.readings.index_axis(Axis(0), snapshot)
    }

    /// Readings of one frame as a slice, row by row.
    pub fn frame(&self, snapshot: usize) -> &[f64] {
        let all = self.readings.as_slice().expect("built in standard layout");
        let length = all.len() / self.count();
        &all[snapshot * length..(snapshot + 1) * length]
    }

    /// Indices of the samples behind the rows of one frame.
    pub fn samples(&self, snapshot: usize) -> &[usize] {
        &self.samples[snapshot * self.rows()..(snapshot + 1) * self.rows()]
    }
}

impl Dataset {
    /// Groups the samples into whole frames, in the order in which snapshots first occur, rows in ascending order.
    ///
    /// # Errors
    /// If a snapshot lacks a row-wire, or has one twice.
    pub fn frames(&self) -> Result<Frames, FramesError> {
        let rows = self.row_count();
        let mut samples = Vec::with_capacity(self.samples());
        for snapshot in self.snapshots() {
            for row_index in 0..rows {
                let mut of_row = snapshot.iter().filter(|&&sample| self.row_index(sample) == row_index);
                match (of_row.next(), of_row.count()) {
                    (Some(&sample), 0) => samples.push(sample),
                    (first, others) => {
                        return Err(FramesError {
                            sample: snapshot[0],
                            row_wire: self.row_wires_read().map_or(0, |read| read[row_index]),
                            found: others + usize::from(first.is_some()),
                        });
                    }
                }
            }
        }
        let shape = (samples.len() / rows, rows, self.channels());
        let readings = samples.iter().flat_map(|&sample| self.sample_readings(sample));
        let readings = Array3::from_shape_vec(shape, readings.copied().collect());
        Ok(Frames {
            readings: readings.expect("one sample for each row of each snapshot"),
            samples,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    fn set(row_wires: Option<&[usize]>, groups: &[usize]) -> Dataset {
        let readings = Array2::from_shape_fn((groups.len(), 2), |(s, c)| (10 * s + c) as f64);
        Dataset::new(readings.clone(), readings, row_wires, groups.to_vec()).unwrap()
    }

    #[test]
    fn frames_follow_groups_and_row_wires_whatever_the_order() {
        let frames = set(Some(&[5, 3, 3, 5]), &[8, 8, 2, 2]).frames().unwrap();
        assert_eq!((frames.count(), frames.rows()), (2, 2));
        assert_eq!(frames.samples(0), [1, 0]);
        assert_eq!(frames.samples(1), [2, 3]);
        assert_eq!(frames.frame(0), [10.0, 11.0, 0.0, 1.0]);
        assert_eq!(frames.readings(1)[[1, 0]], 30.0);
    }

    #[test]
    fn without_row_wires_every_sample_is_a_frame() {
        let frames = set(None, &[0, 1, 2]).frames().unwrap();
        assert_eq!((frames.count(), frames.rows()), (3, 1));
    }

    #[test]
    fn snapshots_that_are_not_whole_are_named() {
        let lacking = set(Some(&[0, 1, 1]), &[0, 0, 1]).frames().unwrap_err();
        assert_eq!(
            lacking.to_string().split(':').next(),
            Some("the snapshot of sample 3 is not whole")
        );
        assert_eq!((lacking.row_wire, lacking.found), (0, 0));
        let twice = set(Some(&[0, 1, 1]), &[0, 0, 0]).frames().unwrap_err();
        assert_eq!((twice.row_wire, twice.found), (1, 2));
        assert_eq!(set(None, &[4, 4]).frames().unwrap_err().found, 2);
    }
}
