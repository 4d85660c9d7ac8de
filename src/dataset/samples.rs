use glam::DVec3;
use ndarray::{Array2, Axis};
use rand::Rng;
use thiserror::Error;

use crate::{
    scene::{Noise, Scene, SceneError},
    sensor::{SensorError, SensorModel},
};

/// The most samples of one set: what fits in memory with room to work.
pub const LARGEST_SAMPLES: usize = 1_000_000;

/// Samples of one array, in the order drawn: snapshot by snapshot, and in each the rows from first to last.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// Row-column resistances in ohm: samples × M4.
    pub resistances_ohm: Array2<f64>,
    /// Absolute node coordinates in millimetres: samples × 3·M2, each node's x, y, z together.
    pub coordinates_mm: Array2<f64>,
    /// Row-wires read, hence samples of each snapshot.
    rows: usize,
}

/// Why samples cannot be drawn.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The number of samples is out of range.
    #[error("{0} samples: give from 1 to {LARGEST_SAMPLES}")]
    Count(usize),
    /// The array has no such row-wire.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The model gives no resistance for a drawn deformation.
    #[error("snapshot {snapshot}: {source}")]
    Sensor {
        /// Snapshot, from 0.
        snapshot: usize,
        /// What the model said.
        source: SensorError,
    },
}

impl Dataset {
    /// Draws at least `samples` samples of the row-wires that the scene reads, as whole snapshots: 101 samples of 10
    /// rows become 110.
    ///
    /// # Errors
    /// A number of samples out of range, a row that the array does not have, or a deformation for which the model has
    /// no resistance.
    pub fn simulate(
        model: &SensorModel,
        scene: &Scene,
        samples: usize,
        rng: &mut impl Rng,
    ) -> Result<Self, DatasetError> {
        if !(1..=LARGEST_SAMPLES).contains(&samples) {
            return Err(DatasetError::Count(samples));
        }
        let read = scene.rows.read(model.scale.rows())?;
        let rows = read.len();
        let snapshots = samples.div_ceil(rows);
        let mut resistances_ohm = Array2::zeros((snapshots * rows, model.scale.columns()));
        let mut coordinates_mm = Array2::zeros((snapshots * rows, model.scale.coordinates_per_row()));
        let sampler = scene.sampler(model);
        let readings = resistances_ohm.axis_chunks_iter_mut(Axis(0), rows);
        let positions = coordinates_mm.axis_chunks_iter_mut(Axis(0), rows);
        for (snapshot, (mut readings, mut positions)) in readings.zip(positions).enumerate() {
            let deformation = sampler.draw(rng);
            for (place, &row) in read.iter().enumerate() {
                let mut reading = readings.row_mut(place);
                let reading = reading.as_slice_mut().expect("a row of a standard array is contiguous");
                model
                    .row_resistances_into(row, deformation.row_mm(row), reading)
                    .map_err(|source| DatasetError::Sensor { snapshot, source })?;
                let coordinates = deformation
                    .row_positions_mm(model, row)
                    .flat_map(|position| position.to_array());
                for (target, value) in positions.row_mut(place).iter_mut().zip(coordinates) {
                    *target = value;
                }
            }
        }
        Ok(Self {
            resistances_ohm,
            coordinates_mm,
            rows,
        })
    }

    /// Disturbs the readings, snapshot by snapshot. Deformations stay as they are, so sets with different noise compare.
    ///
    /// # Errors
    /// A model without resistances at rest.
    pub fn disturb(&mut self, model: &SensorModel, noise: &Noise, rng: &mut impl Rng) -> Result<(), SensorError> {
        if noise.is_none() {
            return Ok(());
        }
        let source = noise.source(model)?;
        for mut snapshot in self.resistances_ohm.axis_chunks_iter_mut(Axis(0), self.rows) {
            let readings = snapshot
                .as_slice_mut()
                .expect("rows of a standard array are contiguous");
            source.disturb(readings, rng);
        }
        Ok(())
    }

    /// The samples of the row-wire in place `row` of those read, of whole snapshots, in their order.
    ///
    /// # Panics
    /// If there is no such place.
    pub fn of_row(&self, row: usize) -> Self {
        assert!(row < self.rows);
        let samples: Vec<usize> = (row..self.samples()).step_by(self.rows).collect();
        Self {
            rows: 1,
            ..self.select(&samples)
        }
    }

    /// The same samples as if each were a snapshot of one row-wire: what a decoder sees that is not told the row.
    #[must_use]
    pub fn as_one_row(&self) -> Self {
        Self {
            rows: 1,
            ..self.clone()
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.resistances_ohm.nrows()
    }

    /// Row-wires read, hence samples of each snapshot.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of whole snapshots.
    pub fn snapshots(&self) -> usize {
        self.samples() / self.rows
    }

    /// The samples with these numbers, in this order. They need not be whole snapshots any more.
    pub fn select(&self, samples: &[usize]) -> Self {
        Self {
            resistances_ohm: self.resistances_ohm.select(Axis(0), samples),
            coordinates_mm: self.coordinates_mm.select(Axis(0), samples),
            rows: self.rows,
        }
    }

    /// Position in millimetres of each node of one snapshot, row by row (M1·M2 of them), read from `coordinates_mm`,
    /// which has the shape of [`Self::coordinates_mm`]: the true ones or decoupled ones.
    pub fn snapshot_nodes_mm(&self, coordinates_mm: &Array2<f64>, snapshot: usize) -> Vec<DVec3> {
        let first = snapshot * self.rows;
        let nodes = (first..first + self.rows).flat_map(|sample| {
            let row = coordinates_mm.row(sample);
            (0..row.len() / 3).map(move |node| DVec3::new(row[3 * node], row[3 * node + 1], row[3 * node + 2]))
        });
        nodes.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        sensor::ArrayScale,
    };

    fn draw(scale: &str, samples: usize, seed: u64) -> Dataset {
        let model = SensorModel::new(scale.parse().unwrap());
        Dataset::simulate(
            &model,
            &Scene::default(),
            samples,
            &mut Seed(seed).rng(Stream::Training),
        )
        .unwrap()
    }

    #[test]
    fn samples_come_as_whole_snapshots() {
        let set = draw("10x6_3x18", 101, 0);
        assert_eq!((set.samples(), set.snapshots()), (110, 11));
        assert_eq!((set.resistances_ohm.ncols(), set.coordinates_mm.ncols()), (18, 18));
        assert_eq!(draw("1x1_1x3", 1, 0).samples(), 1);
    }

    #[test]
    fn coordinates_are_absolute_and_only_z_varies_within_a_row() {
        let set = draw("10x6_3x18", 200, 1);
        for (sample, coordinates) in set.coordinates_mm.rows().into_iter().enumerate() {
            for node in 0..6 {
                assert_eq!(coordinates[3 * node], 8.0 + (sample % 10) as f64);
                assert_eq!(coordinates[3 * node + 1], 9.5 + 2.0 * (node as f64 - 2.5));
                assert!((4.0..=5.0).contains(&coordinates[3 * node + 2]));
            }
        }
    }

    #[test]
    fn a_seed_gives_the_same_samples_and_another_gives_others() {
        assert_eq!(draw("10x6_3x18", 50, 7), draw("10x6_3x18", 50, 7));
        assert_ne!(draw("10x6_3x18", 50, 7), draw("10x6_3x18", 50, 8));
    }

    #[test]
    fn more_samples_extend_a_set_without_changing_its_beginning() {
        let (few, many) = (draw("10x6_3x18", 20, 3), draw("10x6_3x18", 40, 3));
        assert_eq!(few, many.select(&(0..20).collect::<Vec<_>>()));
    }

    #[test]
    fn a_row_is_every_sample_of_it() {
        let set = draw("10x6_3x18", 30, 3);
        let row = set.of_row(4);
        assert_eq!((row.samples(), row.snapshots()), (3, 3));
        assert_eq!(row.resistances_ohm, set.select(&[4, 14, 24]).resistances_ohm);
    }

    #[test]
    fn noise_changes_readings_and_not_deformations() {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let clean = draw("10x6_3x18", 30, 3);
        let mut noisy = clean.clone();
        let mut rng = Seed(3).rng(Stream::TrainingNoise);
        noisy.disturb(&model, &Noise::relative(1e-3), &mut rng).unwrap();
        assert_eq!(noisy.coordinates_mm, clean.coordinates_mm);
        let ratio = (&noisy.resistances_ohm / &clean.resistances_ohm).mapv(|ratio| (ratio - 1.0).abs());
        let mean = ratio.mean().unwrap();
        // Mean of the absolute value of a normal deviate.
        let expected = 1e-3 * (2.0 / std::f64::consts::PI).sqrt();
        assert!((mean / expected - 1.0).abs() < 0.1, "{mean}");
    }

    #[test]
    fn no_samples_or_too_many_are_refused() {
        let model = SensorModel::new(ArrayScale::default());
        for samples in [0, LARGEST_SAMPLES + 1] {
            let result = Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(Stream::Test));
            assert_eq!(result, Err(DatasetError::Count(samples)));
        }
    }
}
