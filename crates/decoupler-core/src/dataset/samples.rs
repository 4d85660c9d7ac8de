use std::{collections::HashMap, sync::Arc};

use glam::DVec3;
use ndarray::{ArcArray2, ArrayView2, Axis};
use rand::Rng;

use super::DatasetError;
use crate::{
    scene::{Deformation, FaultySensor, Noise},
    sensor::{SensorError, SensorModel},
};

/// Largest number of samples in a set, limited by memory.
pub const LARGEST_SAMPLES: usize = 1_000_000;

/// Samples for training or testing, simulated or measured. A sample is one row-wire at one moment (or, for a sensor
/// without row-wires, everything read at one moment) and knows its row-wire and its snapshot.
///
/// For a simulated array, the readings are the M4 resistances in ohm and the targets the 3·M2 absolute coordinates of
/// the row's nodes in millimetres (x, y, z node by node). Measured samples contain any quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// Samples × channels, in standard (row-major) layout; shared with copies of the set.
    readings: ArcArray2<f64>,
    /// Samples × outputs, likewise.
    targets: ArcArray2<f64>,
    /// `None` if there are no row-wires, or the row-wires of the samples are unknown.
    rows: Option<SampleRows>,
    /// Group of each sample, which divisions keep together: its snapshot where row-wires are read together.
    groups: Vec<usize>,
}

/// Row-wires of the samples.
#[derive(Clone, Debug, PartialEq)]
struct SampleRows {
    /// Row-wires read, in ascending order. A selection keeps all of them, even those without samples.
    read: Arc<[usize]>,
    /// Index in `read` of each sample's row-wire.
    indices: Vec<usize>,
}

impl Dataset {
    /// Creates a set from `readings` (samples × channels), `targets` (samples × outputs), the row-wire of each sample
    /// (from 0) if known, and the group of each sample, the snapshot it belongs to. Cross-validation by snapshots never
    /// divides a group between training and test set.
    ///
    /// # Errors
    /// If a part is empty, or the parts differ in length.
    pub fn new(
        readings: impl Into<ArcArray2<f64>>,
        targets: impl Into<ArcArray2<f64>>,
        row_wires: Option<&[usize]>,
        groups: Vec<usize>,
    ) -> Result<Self, DatasetError> {
        let (readings, targets) = (standard(readings), standard(targets));
        for (what, values) in [("readings", &readings), ("targets", &targets)] {
            let (samples, columns) = values.dim();
            if samples == 0 || columns == 0 {
                return Err(DatasetError::Empty { what, samples, columns });
            }
        }
        let samples = readings.nrows();
        let lengths = [
            ("targets", targets.nrows()),
            ("row-wires", row_wires.map_or(samples, <[usize]>::len)),
            ("groups", groups.len()),
        ];
        if let Some((what, found)) = lengths.into_iter().find(|(_, length)| *length != samples) {
            return Err(DatasetError::Length { what, found, samples });
        }
        let set = Self {
            readings,
            targets,
            rows: None,
            groups,
        };
        let Some(row_wires) = row_wires else { return Ok(set) };
        let mut read = row_wires.to_vec();
        read.sort_unstable();
        read.dedup();
        set.with_row_wires(&read, row_wires)
    }

    /// Declares all row-wires `read` of the sensor, for a set without samples of some of them. The sets that train and
    /// test a network must agree on the row-wires read.
    ///
    /// # Errors
    /// If a sample belongs to another row-wire, or `read` is not in ascending order.
    pub fn among_rows(self, read: &[usize]) -> Result<Self, DatasetError> {
        let row_wires: Option<Vec<usize>> = (0..self.samples()).map(|sample| self.row_wire(sample)).collect();
        match row_wires {
            Some(row_wires) => self.with_row_wires(read, &row_wires),
            None => Ok(self),
        }
    }

    fn with_row_wires(self, read: &[usize], row_wires: &[usize]) -> Result<Self, DatasetError> {
        let is_in_order = read.windows(2).all(|pair| pair[0] < pair[1]);
        let index = |(sample, &row_wire): (usize, &usize)| {
            let found = read.binary_search(&row_wire).ok().filter(|_| is_in_order);
            found.ok_or(DatasetError::RowWire { sample, row_wire })
        };
        let indices = row_wires.iter().enumerate().map(index).collect::<Result<_, _>>()?;
        Ok(Self {
            rows: Some(SampleRows {
                read: read.into(),
                indices,
            }),
            ..self
        })
    }

    /// Readings: samples × channels.
    pub fn readings(&self) -> ArrayView2<'_, f64> {
        self.readings.view()
    }

    /// Targets: samples × outputs.
    pub fn targets(&self) -> ArrayView2<'_, f64> {
        self.targets.view()
    }

    /// Readings of one sample.
    pub fn sample_readings(&self, sample: usize) -> &[f64] {
        contiguous(&self.readings, sample)
    }

    /// Targets of one sample.
    pub fn sample_targets(&self, sample: usize) -> &[f64] {
        contiguous(&self.targets, sample)
    }

    /// Readings of all samples as one mutable slice, sample by sample.
    pub(super) fn readings_mut(&mut self) -> &mut [f64] {
        self.readings.as_slice_mut().expect("kept in standard layout")
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.readings.nrows()
    }

    /// Number of readings per sample.
    pub fn channels(&self) -> usize {
        self.readings.ncols()
    }

    /// Number of targets per sample.
    pub fn outputs(&self) -> usize {
        self.targets.ncols()
    }

    /// Returns `true` if a target is not the same in all samples.
    pub fn has_varying_target(&self) -> bool {
        let first = self.targets.row(0);
        self.targets.rows().into_iter().any(|targets| targets != first)
    }

    /// Row-wires read, from 0 in ascending order; `None` if unknown.
    pub fn row_wires_read(&self) -> Option<&[usize]> {
        self.rows.as_ref().map(|rows| &*rows.read)
    }

    /// Number of row-wires read; 1 if unknown.
    pub fn row_count(&self) -> usize {
        self.row_wires_read().map_or(1, <[usize]>::len)
    }

    /// Row-wire of a sample, from 0; `None` if unknown.
    pub fn row_wire(&self, sample: usize) -> Option<usize> {
        self.rows.as_ref().map(|rows| rows.read[rows.indices[sample]])
    }

    /// Index of a sample's row-wire among those read; 0 if unknown.
    pub fn row_index(&self, sample: usize) -> usize {
        self.rows.as_ref().map_or(0, |rows| rows.indices[sample])
    }

    /// Group of each sample, the snapshot it belongs to.
    pub fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Returns the indices of the samples of each snapshot, in the order in which snapshots first occur.
    pub fn snapshots(&self) -> Vec<Vec<usize>> {
        let mut order = HashMap::new();
        let mut snapshots: Vec<Vec<usize>> = Vec::new();
        for (sample, &group) in self.groups.iter().enumerate() {
            let snapshot = *order.entry(group).or_insert_with(|| {
                snapshots.push(Vec::new());
                snapshots.len() - 1
            });
            snapshots[snapshot].push(sample);
        }
        snapshots
    }

    /// Returns the samples with these indices, in this order; each keeps its row-wire and its group.
    #[must_use]
    pub fn select(&self, samples: &[usize]) -> Self {
        Self {
            readings: self.readings.select(Axis(0), samples).into_shared(),
            targets: self.targets.select(Axis(0), samples).into_shared(),
            rows: self.rows.as_ref().map(|rows| SampleRows {
                read: Arc::clone(&rows.read),
                indices: samples.iter().map(|&sample| rows.indices[sample]).collect(),
            }),
            groups: samples.iter().map(|&sample| self.groups[sample]).collect(),
        }
    }

    /// Returns the samples with each as a group of its own.
    #[must_use]
    pub(crate) fn ungrouped(&self) -> Self {
        Self {
            groups: (0..self.samples()).collect(),
            ..self.clone()
        }
    }

    /// Returns all samples with the readings of these channels only, in this order.
    ///
    /// # Panics
    /// If `channels` is empty, or there is no such channel.
    #[must_use]
    pub fn of_channels(&self, channels: &[usize]) -> Self {
        assert!(!channels.is_empty(), "a sample has at least one reading");
        Self {
            readings: standard(self.readings.select(Axis(1), channels)),
            ..self.clone()
        }
    }

    /// Returns the samples with other readings (samples × channels), such as the features of a [`Memory`](super::Memory).
    ///
    /// # Panics
    /// If there is not one row of readings for each sample, or there are no channels.
    #[must_use]
    pub fn with_readings(&self, readings: impl Into<ArcArray2<f64>>) -> Self {
        let readings = standard(readings);
        assert_eq!(readings.nrows(), self.samples(), "one row of readings for each sample");
        assert!(readings.ncols() > 0, "a sample has at least one reading");
        Self {
            readings,
            ..self.clone()
        }
    }

    /// Returns the samples of the row-wire with this index among those read, in order; all samples if row-wires are
    /// unknown.
    #[must_use]
    pub fn of_row(&self, row_index: usize) -> Self {
        let is_in = |sample: &usize| self.rows.is_none() || self.row_index(*sample) == row_index;
        self.select(&Vec::from_iter((0..self.samples()).filter(is_in)))
    }
}

/// Returns the values in standard layout, without a copy if they have it.
fn standard(values: impl Into<ArcArray2<f64>>) -> ArcArray2<f64> {
    let values = values.into();
    if values.is_standard_layout() {
        values
    } else {
        values.as_standard_layout().into_owned().into_shared()
    }
}

fn contiguous(values: &ArcArray2<f64>, sample: usize) -> &[f64] {
    let all = values.as_slice().expect("kept in standard layout");
    &all[sample * values.ncols()..(sample + 1) * values.ncols()]
}

impl Dataset {
    /// Replaces the readings of simulated snapshots by those of a faulty sensor with noise: its wires and amplifiers come
    /// before the noise, its converter after. `model` is the sensor without its fault.
    ///
    /// # Errors
    /// See [`Self::disturb`].
    pub fn disturb_faulty(
        &mut self,
        model: &SensorModel,
        faulty: &FaultySensor,
        noise: &Noise,
        rng: &mut impl Rng,
    ) -> Result<(), SensorError> {
        let firsts = (0..self.samples()).step_by(self.row_count());
        let deformations = Vec::from_iter(firsts.map(|first| self.simulated_deformation(model, first)));
        let read = self.row_wires_read().map_or_else(Vec::new, <[usize]>::to_vec);
        let length = read.len() * self.channels();
        for (snapshot, deformation) in self.readings_mut().chunks_exact_mut(length).zip(&deformations) {
            faulty.before_noise(&read, deformation, snapshot);
        }
        self.disturb(model, noise, rng)?;
        for snapshot in self.readings_mut().chunks_exact_mut(length) {
            faulty.after_noise(&read, snapshot);
        }
        Ok(())
    }

    /// Deformation of the simulated snapshot that begins with sample `first`. Row-wires that are not read are at rest.
    fn simulated_deformation(&self, model: &SensorModel, first: usize) -> Deformation {
        let read = self.row_wires_read().unwrap_or_default();
        Deformation::from_fn(model.scale, |row, node| {
            let index = read.iter().position(|&other| other == row);
            index.map_or(DVec3::ZERO, |index| {
                let coordinates_mm = &self.sample_targets(first + index)[3 * node..];
                model.displacement_mm(row, node, DVec3::from_slice(coordinates_mm))
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    /// Readings and targets that identify their sample.
    fn set(row_wires: Option<&[usize]>, groups: Vec<usize>) -> Result<Dataset, DatasetError> {
        let samples = groups.len();
        let readings = Array2::from_shape_fn((samples, 2), |(s, c)| (10 * s + c) as f64);
        let targets = Array2::from_shape_fn((samples, 1), |(s, _)| s as f64);
        Dataset::new(readings, targets, row_wires, groups)
    }

    #[test]
    fn selected_samples_keep_their_row_wire_and_group() {
        let set = set(Some(&[7, 2, 7, 2, 4]), vec![5, 5, 9, 9, 9]).unwrap();
        assert_eq!(set.row_wires_read(), Some(&[2, 4, 7][..]));
        assert_eq!(set.snapshots(), [vec![0, 1], vec![2, 3, 4]]);
        let part = set.select(&[4, 0, 2]);
        assert_eq!(part.row_count(), 3, "the rows read are those of the sensor");
        let row_wires: Vec<_> = (0..3).map(|sample| part.row_wire(sample).unwrap()).collect();
        assert_eq!(row_wires, [4, 7, 7]);
        assert_eq!(
            (0..3).map(|sample| part.row_index(sample)).collect::<Vec<_>>(),
            [1, 2, 2]
        );
        assert_eq!(part.groups(), [9, 5, 9]);
        assert_eq!(part.snapshots(), [vec![0, 2], vec![1]]);
        assert_eq!(part.targets().column(0).to_vec(), [4.0, 0.0, 2.0]);
        let row = part.of_row(2);
        assert_eq!(row.targets().column(0).to_vec(), [0.0, 2.0]);
        assert_eq!(row.row_wire(1), Some(7));
        assert_eq!(part.of_row(0).samples(), 0);
    }

    #[test]
    fn channels_are_selected_for_every_sample() {
        let set = set(Some(&[0, 1]), vec![0, 0]).unwrap();
        let second = set.of_channels(&[1]);
        assert_eq!(
            (second.sample_readings(0), second.sample_readings(1)),
            (&[1.0][..], &[11.0][..])
        );
        assert_eq!((second.targets(), second.row_wire(1)), (set.targets(), Some(1)));
        assert_eq!(set.of_channels(&[1, 0]).sample_readings(1), [11.0, 10.0]);
    }

    #[test]
    fn row_wires_are_optional() {
        let set = set(None, vec![0, 0, 1]).unwrap();
        assert_eq!(
            (set.row_wires_read(), set.row_count(), set.row_wire(2)),
            (None, 1, None)
        );
        assert_eq!(set.of_row(0), set);
        assert_eq!(set.clone().among_rows(&[3]).unwrap(), set);
    }

    #[test]
    fn a_set_can_declare_rows_without_samples() {
        let set = set(Some(&[4, 4]), vec![0, 1]).unwrap().among_rows(&[2, 4]).unwrap();
        assert_eq!((set.row_count(), set.row_index(1), set.row_wire(1)), (2, 1, Some(4)));
        for rows in [&[2][..], &[4, 2], &[]] {
            let message = set.clone().among_rows(rows).unwrap_err().to_string();
            assert!(message.contains("row-wire 5 is not among"), "{rows:?}: {message}");
        }
    }

    #[test]
    fn mismatched_parts_are_named() {
        let zeros = |shape: (usize, usize)| Array2::<f64>::zeros(shape);
        let cases = [
            (
                "no samples",
                Dataset::new(zeros((0, 2)), zeros((0, 1)), None, vec![]),
                "readings are 0 × 2",
            ),
            (
                "no channels",
                Dataset::new(zeros((3, 0)), zeros((3, 1)), None, vec![0; 3]),
                "readings are 3 × 0",
            ),
            (
                "no targets",
                Dataset::new(zeros((3, 2)), zeros((3, 0)), None, vec![0; 3]),
                "targets are 3 × 0",
            ),
            (
                "a target too few",
                Dataset::new(zeros((3, 2)), zeros((2, 1)), None, vec![0; 3]),
                "2 targets for 3",
            ),
            (
                "a group too many",
                Dataset::new(zeros((3, 2)), zeros((3, 1)), None, vec![0; 4]),
                "4 groups for 3",
            ),
            (
                "a row-wire too few",
                Dataset::new(zeros((3, 2)), zeros((3, 1)), Some(&[0, 1]), vec![0; 3]),
                "2 row-wires for 3",
            ),
        ];
        for (sentence, result, expected) in cases {
            let message = result.unwrap_err().to_string();
            assert!(message.contains(expected), "{sentence}: {message}");
        }
    }

    #[test]
    fn any_memory_layout_is_accepted() {
        let readings = Array2::from_shape_fn((2, 3), |(c, s)| (10 * s + c) as f64).reversed_axes();
        let set = Dataset::new(readings, Array2::zeros((3, 1)), None, vec![0, 1, 2]).unwrap();
        assert_eq!(set.sample_readings(1), [10.0, 11.0]);
    }
}
