use ndarray::Array2;
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::{Dataset, DatasetError, LARGEST_SAMPLES};
use crate::{
    scene::{DeformationSampler, Noise, NoiseSource, Scene, SceneError},
    sensor::{ArrayScale, SensorError, SensorModel},
};

/// A simulated sensor, its scene, and the numbers of samples to draw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Simulation {
    /// Model of the sensor.
    pub sensor: SensorModel,
    /// Scene: rows, axes, loading and noise.
    pub scene: Scene,
    /// Number of training samples, over all row-wires read.
    pub samples: usize,
    /// Number of validation samples, drawn in addition to select the best weights and to stop the training; 0 for none.
    pub validation_samples: usize,
    /// Number of test samples.
    pub test_samples: usize,
}

impl Default for Simulation {
    /// Returns the paper's main experiment: 10×10_5×30, 1000 training and 100 test samples.
    fn default() -> Self {
        Self {
            sensor: SensorModel::new(ArrayScale::default()),
            scene: Scene::default(),
            samples: 1000,
            validation_samples: 200,
            test_samples: 100,
        }
    }
}

impl Simulation {
    /// Number of row-wires read.
    ///
    /// # Errors
    /// If the array lacks a row of the scene.
    pub fn rows(&self) -> Result<usize, SceneError> {
        Ok(self.scene.rows.read(self.sensor.scale.rows())?.len())
    }

    /// Maximum travel of a node in millimetres, the full scale of its deformation.
    pub fn stroke_mm(&self) -> f64 {
        self.scene.stroke_mm(&self.sensor.geometry)
    }
}

impl Dataset {
    /// Draws at least `samples` samples of the row-wires that the scene reads, as whole snapshots: 101 samples of 10
    /// rows become 110. Snapshots follow one another, each with its rows in ascending order.
    ///
    /// # Errors
    /// If the number of samples is out of range, the array lacks a row of the scene, or the model has no resistance for
    /// a drawn deformation.
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
        let (sampler, snapshots) = (DeformationSampler::new(scene, model), samples.div_ceil(read.len()));
        let samples = snapshots * read.len();
        let mut resistances_ohm = Array2::zeros((samples, model.scale.columns()));
        let mut coordinates_mm = Array2::zeros((samples, model.scale.coordinates_per_row()));
        let mut drawn = resistances_ohm.rows_mut().into_iter().zip(coordinates_mm.rows_mut());
        for snapshot in 0..snapshots {
            let deformation = sampler.draw(rng);
            for (&row_wire, (mut readings, mut positions)) in read.iter().zip(drawn.by_ref()) {
                let readings = readings
                    .as_slice_mut()
                    .expect("a row of a standard array is contiguous");
                model
                    .row_resistances_into(row_wire, deformation.row_mm(row_wire), readings)
                    .map_err(|source| DatasetError::Sensor { snapshot, source })?;
                let nodes = deformation.row_positions_mm(model, row_wire);
                for (to, value) in positions.iter_mut().zip(nodes.flat_map(|node| node.to_array())) {
                    *to = value;
                }
            }
        }
        let row_wires: Vec<usize> = read.iter().copied().cycle().take(samples).collect();
        let groups = (0..snapshots)
            .flat_map(|snapshot| read.iter().map(move |_| snapshot))
            .collect();
        let set = Self::new(resistances_ohm, coordinates_mm, Some(&row_wires), groups);
        Ok(set.expect("one row-wire and one group for each sample"))
    }

    /// Adds noise to the readings, snapshot by snapshot; consecutive samples of one group are one snapshot. The targets
    /// do not change, so sets with different noise are comparable.
    ///
    /// # Errors
    /// If the model has no resistances at rest.
    pub fn disturb(&mut self, model: &SensorModel, noise: &Noise, rng: &mut impl Rng) -> Result<(), SensorError> {
        if !noise.is_none() {
            self.disturb_by(noise.source(model)?, rng);
        }
        Ok(())
    }

    /// Adds noise to the readings, snapshot by snapshot; see [`Self::disturb`].
    pub(crate) fn disturb_by(&mut self, source: NoiseSource, rng: &mut impl Rng) {
        if source.is_none() {
            return;
        }
        let channels = self.channels();
        let lengths: Vec<usize> = self.groups().chunk_by(|a, b| a == b).map(<[usize]>::len).collect();
        let mut rest = self.readings_mut();
        for samples in lengths {
            let (snapshot, others) = rest.split_at_mut(samples * channels);
            source.disturb(snapshot, rng);
            rest = others;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Rows,
        sensor::ArrayScale,
    };

    fn draw(scale: &str, samples: usize, seed: u64) -> Dataset {
        let model = SensorModel::new(scale.parse().unwrap());
        let mut rng = Seed(seed).rng(Stream::Training);
        Dataset::simulate(&model, &Scene::default(), samples, &mut rng).unwrap()
    }

    #[test]
    fn samples_come_as_whole_snapshots() {
        let set = draw("10x6_3x18", 101, 0);
        assert_eq!((set.samples(), set.snapshots().len()), (110, 11));
        assert_eq!((set.channels(), set.outputs()), (18, 18));
        assert_eq!(draw("1x1_1x3", 1, 0).samples(), 1);
        for (sample, &group) in set.groups().iter().enumerate() {
            assert_eq!((group, set.row_wire(sample)), (sample / 10, Some(sample % 10)));
        }
    }

    #[test]
    fn a_scene_of_one_row_declares_it() {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let scene = Scene {
            rows: Rows::One(3),
            ..Scene::default()
        };
        let set = Dataset::simulate(&model, &scene, 7, &mut Seed(0).rng(Stream::Training)).unwrap();
        assert_eq!(
            (set.row_wires_read(), set.row_wire(6), set.row_index(6)),
            (Some(&[3][..]), Some(3), 0)
        );
        assert_eq!(set.snapshots().len(), 7);
    }

    #[test]
    fn coordinates_are_absolute_and_only_z_varies_within_a_row() {
        let set = draw("10x6_3x18", 200, 1);
        for sample in 0..set.samples() {
            let (coordinates, row) = (set.sample_targets(sample), set.row_wire(sample).unwrap());
            for node in 0..6 {
                assert_eq!(coordinates[3 * node], 8.0 + row as f64);
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
    fn selecting_a_row_gives_all_its_samples() {
        let set = draw("10x6_3x18", 30, 3);
        assert_eq!(set.of_row(4), set.select(&[4, 14, 24]));
    }

    #[test]
    fn noise_changes_readings_and_not_deformations() {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let clean = draw("10x6_3x18", 30, 3);
        let mut noisy = clean.clone();
        let mut rng = Seed(3).rng(Stream::TrainingNoise);
        noisy.disturb(&model, &Noise::relative(1e-3), &mut rng).unwrap();
        assert_eq!(noisy.targets(), clean.targets());
        let ratio = (&noisy.readings() / &clean.readings()).mapv(|ratio| (ratio - 1.0).abs());
        let mean = ratio.mean().unwrap();
        // Mean absolute value of a normal deviate.
        let expected = 1e-3 * (2.0 / std::f64::consts::PI).sqrt();
        assert!((mean / expected - 1.0).abs() < 0.1, "{mean}");
    }

    #[test]
    fn drift_is_shared_within_a_group() {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let clean = draw("10x6_3x18", 30, 3);
        let mut drifting = clean.clone();
        let drift = Noise {
            drift: 1e-2,
            ..Noise::default()
        };
        drifting
            .disturb(&model, &drift, &mut Seed(3).rng(Stream::TrainingNoise))
            .unwrap();
        let gains = &drifting.readings() / &clean.readings();
        for snapshot in clean.snapshots() {
            let gain = gains[[snapshot[0], 0]];
            assert!(gain != 1.0);
            let of_snapshot = gains.select(ndarray::Axis(0), &snapshot);
            assert!(of_snapshot.iter().all(|other| (other - gain).abs() < 1e-14));
        }
        assert!((gains[[0, 0]] - gains[[10, 0]]).abs() > 1e-6);
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
