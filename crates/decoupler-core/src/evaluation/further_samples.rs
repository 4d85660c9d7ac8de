use std::sync::Arc;

use ndarray::Array2;
use rayon::prelude::*;

use super::{RunError, SimulatedSettings};
use crate::{
    dataset::{Dataset, Seed, SimulationError},
    network::{Inputs, MinMax},
    scene::{DeformationSampler, NoiseSource, RowModel},
    sensor::SensorModel,
    training::{BLOCK, DrawnBlocks},
};

/// Training samples beyond those that a run holds. They are drawn from the seed whenever a training walks over them, so
/// that memory does not grow with their number; each block has random numbers of its own.
///
/// A walk over them takes as long as drawing them, and an epoch of Levenberg-Marquardt walks over all samples about three
/// times. Scalings, baselines and other decoders are fitted to the samples that are held.
#[derive(Debug)]
pub(super) struct FurtherSamples {
    model: SensorModel,
    sampler: DeformationSampler,
    noise: NoiseSource,
    seed: Seed,
    /// Row-wires read.
    rows: Vec<usize>,
    row_model: RowModel,
    snapshots: usize,
}

/// Largest number of training samples that a run holds.
pub(super) const MAX_HELD: usize = 100_000;
/// Blocks that are checked between two looks at whether the preparation is cancelled.
const CHECKED_TOGETHER: usize = 64;

impl FurtherSamples {
    /// Prepares to draw what `settings` asks for beyond [`MAX_HELD`]; `None` if that is nothing.
    ///
    /// # Errors
    /// If the sensor or scene is invalid.
    pub(super) fn of(settings: &SimulatedSettings) -> Result<Option<Self>, RunError> {
        let source = &settings.source;
        let rows = source.scene.rows.read(source.sensor.scale.rows())?;
        let snapshots = source.samples.div_ceil(rows.len()) - source.samples.min(MAX_HELD).div_ceil(rows.len());
        if snapshots == 0 {
            return Ok(None);
        }
        Ok(Some(Self {
            model: source.sensor,
            sampler: source.scene.sampler(&source.sensor),
            noise: source.scene.noise.in_training().source(&source.sensor)?,
            seed: settings.seed,
            rows,
            row_model: source.scene.rows.model(),
            snapshots,
        }))
    }

    /// Checks that the model has resistances for all deformations; returns `false` once `is_cancelled`.
    ///
    /// # Errors
    /// If it has none.
    pub(super) fn check(&self, is_cancelled: &dyn Fn() -> bool) -> Result<bool, RunError> {
        let blocks = self.blocks();
        for first in (0..blocks).step_by(CHECKED_TOGETHER) {
            if is_cancelled() {
                return Ok(false);
            }
            let together = first..blocks.min(first + CHECKED_TOGETHER);
            together.into_par_iter().try_for_each(|block| self.check_block(block))?;
        }
        Ok(true)
    }

    fn check_block(&self, block: usize) -> Result<(), RunError> {
        let mut rng = self.seed.block_rng(block);
        let mut readings_ohm = vec![0.0; self.model.scale.columns()];
        for place in 0..self.snapshots_of(block) {
            let deformation = self.sampler.draw(&mut rng);
            for &row in &self.rows {
                let drawn = self
                    .model
                    .row_resistances_into(row, deformation.row_mm(row), &mut readings_ohm);
                drawn.map_err(|source| SimulationError::Sensor {
                    snapshot: MAX_HELD.div_ceil(self.rows.len()) + block * self.snapshots_per_block() + place,
                    source,
                })?;
            }
        }
        Ok(())
    }

    /// As many whole snapshots as a block of the training holds samples of one network.
    fn snapshots_per_block(&self) -> usize {
        match self.row_model {
            RowModel::Shared => (BLOCK / self.rows.len()).max(1),
            RowModel::Each => BLOCK,
        }
    }

    fn blocks(&self) -> usize {
        self.snapshots.div_ceil(self.snapshots_per_block())
    }

    fn snapshots_of(&self, block: usize) -> usize {
        let first = block * self.snapshots_per_block();
        self.snapshots_per_block().min(self.snapshots - first)
    }

    /// Draws the samples of a block for one network: those of the row at `row_index`, or of all.
    fn draw(&self, block: usize, row_index: Option<usize>) -> Dataset {
        let rows = match row_index {
            Some(index) => &self.rows[index..=index],
            None => &self.rows,
        };
        let (snapshots, mut rng) = (self.snapshots_of(block), self.seed.block_rng(block));
        let set = Dataset::draw(&self.model, &self.sampler, rows, snapshots, &mut rng);
        let mut set = set.expect("all deformations were checked");
        set.disturb_by(self.noise, &mut self.seed.block_noise_rng(block, row_index));
        set
    }
}

/// The [`FurtherSamples`] of one network, scaled as those that are held.
#[derive(Debug)]
pub(super) struct ScaledFurther {
    pub(super) further: Arc<FurtherSamples>,
    /// Index of the row-wire among those read, if the network has only one.
    pub(super) row_index: Option<usize>,
    pub(super) inputs: Inputs,
    pub(super) outputs: MinMax,
}

impl DrawnBlocks for ScaledFurther {
    fn blocks(&self) -> usize {
        self.further.blocks()
    }

    fn samples(&self) -> usize {
        let rows = match self.row_index {
            Some(_) => 1,
            None => self.further.rows.len(),
        };
        self.further.snapshots * rows
    }

    fn block(&self, index: usize) -> (Array2<f64>, Array2<f64>) {
        let set = self.further.draw(index, self.row_index);
        (self.inputs.of(set.readings()), self.outputs.scale(set.targets()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        evaluation::{Preset, Run},
        scene::{Noise, Rows},
    };

    fn settings(rows: Rows, samples: usize) -> SimulatedSettings {
        let mut settings = Preset::Best.settings();
        settings.source.sensor.scale = "3x2_1x4".parse().unwrap();
        settings.source.scene.rows = rows;
        settings.source.scene.noise = Noise {
            drift: 1e-3,
            ..Noise::relative(1e-3)
        };
        (settings.source.samples, settings.hidden) = (samples, 3);
        settings
    }

    #[test]
    fn what_a_run_can_hold_is_not_drawn_again() {
        for rows in [Rows::All, Rows::Known, Rows::One(1)] {
            assert!(FurtherSamples::of(&settings(rows, MAX_HELD)).unwrap().is_none());
            assert!(FurtherSamples::of(&settings(rows, MAX_HELD + 3)).unwrap().is_some());
        }
    }

    /// All row-wires at once see the deformations that each sees alone, and every block comes back as it was.
    #[test]
    fn a_block_is_the_same_each_time_and_no_block_is_another() {
        let mut settings = settings(Rows::Known, MAX_HELD + 3 * 1100);
        settings.source.scene.noise = Noise::default();
        let further = FurtherSamples::of(&settings).unwrap().unwrap();
        assert!(further.check(&|| false).unwrap());
        assert_eq!((further.blocks(), further.snapshots), (3, 1100));
        let sizes = [0, 1, 2].map(|block| further.draw(block, Some(0)).samples());
        assert_eq!(sizes, [512, 512, 76]);
        assert_eq!(further.draw(1, Some(2)), further.draw(1, Some(2)));
        assert_ne!(further.draw(0, Some(2)), further.draw(1, Some(2)));
        assert_eq!(
            further.draw(2, None).of_row(1).targets(),
            further.draw(2, Some(1)).targets()
        );
    }

    #[test]
    fn noise_differs_from_row_to_row_and_is_as_large_as_asked_for() {
        let noisy = FurtherSamples::of(&settings(Rows::Known, MAX_HELD + 3 * 512))
            .unwrap()
            .unwrap();
        let mut quiet = settings(Rows::Known, MAX_HELD + 3 * 512);
        quiet.source.scene.noise = Noise::default();
        let quiet = FurtherSamples::of(&quiet).unwrap().unwrap();
        let errors = |row| &noisy.draw(0, Some(row)).readings() / &quiet.draw(0, Some(row)).readings() - 1.0;
        let (first, second) = (errors(0), errors(1));
        assert!(first[[0, 0]] != second[[0, 0]]);
        for errors in [first, second] {
            // Relative noise and drift of 1e-3 each.
            let rms = errors.mapv(|error| error * error).mean().unwrap().sqrt();
            assert!((rms / 2.0_f64.sqrt() / 1e-3 - 1.0).abs() < 0.1, "{rms}");
        }
    }

    /// Weights and errors of a training on samples that are drawn again are those of one that holds them all.
    #[test]
    fn training_on_drawn_samples_is_training_on_all_of_them() {
        for rows in [Rows::All, Rows::Known] {
            let mut settings = settings(rows, MAX_HELD + 3 * 700);
            settings.training.stopping.epochs = 2;
            (settings.source.validation_samples, settings.source.test_samples) = (30, 30);
            let mut run = Run::prepare(settings).unwrap();
            while run.step().is_none() {}
            let further = FurtherSamples::of(&settings).unwrap().unwrap();
            let networks = run.network();
            for (index, network) in networks.values().iter().enumerate() {
                let trainer = &run.trainers()[0].rows()[index];
                let row_index = (rows == Rows::Known).then_some(index);
                let held = settings.draw_held().unwrap().0.training;
                let held = row_index.map_or(held.clone(), |row| held.of_row(row));
                let (mut squares, mut count) = (0.0, 0);
                let drawn = (0..further.blocks()).map(|block| further.draw(block, row_index));
                for set in std::iter::once(held).chain(drawn) {
                    let outputs = network.mlp().forward(network.inputs().of(set.readings()).view());
                    let targets = network.outputs().scale(set.targets());
                    squares += (&outputs - &targets).mapv(|error| error * error).sum();
                    count += targets.len();
                }
                let best = trainer.history()[trainer.best_epoch()].training_mse;
                assert!((squares / count as f64 / best - 1.0).abs() < 1e-9, "{rows}: {best}");
            }
        }
    }
}
