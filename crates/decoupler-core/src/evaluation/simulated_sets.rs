use super::{RunError, SimulatedSettings, Simulation, further_samples::MAX_HELD};
use crate::{
    dataset::{Dataset, LARGEST_SAMPLES, Split, Stream, hold_out},
    training::TrainingError,
};

impl SimulatedSettings {
    /// Draws the training, validation and test sets of these settings.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn draw(&self) -> Result<(Split, Dataset), RunError> {
        Ok(self.draw_unless(&|| false)?.expect("nothing cancels it"))
    }

    /// As [`Self::draw`], but only those training samples that a run holds.
    pub(crate) fn draw_held(&self) -> Result<(Split, Dataset), RunError> {
        Ok(self.draw_held_unless(&|| false)?.expect("nothing cancels it"))
    }

    /// As [`Self::draw_held`]; returns `None` once `is_cancelled`, which is called after each set.
    pub(super) fn draw_held_unless(
        &self,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<(Split, Dataset)>, RunError> {
        self.check_counts()?;
        let mut held = *self;
        held.source.samples = self.source.samples.min(MAX_HELD);
        held.draw_unless(is_cancelled)
    }

    fn draw_unless(&self, is_cancelled: &dyn Fn() -> bool) -> Result<Option<(Split, Dataset)>, RunError> {
        self.check_counts()?;
        self.training.check().map_err(TrainingError::from)?;
        let Simulation {
            samples: training,
            validation_samples: validation,
            ..
        } = self.source;
        let rows = self.source.model_size()?.rows;
        let held_out = validation.div_ceil(rows);
        let total = (training.div_ceil(rows) + held_out) * rows;
        if total > LARGEST_SAMPLES {
            return Err(RunError::TooManySamples {
                training,
                validation,
                rows,
                total,
                most: LARGEST_SAMPLES,
            });
        }
        let test = self.draw_test()?;
        if is_cancelled() {
            return Ok(None);
        }
        let drawn = self.draw_training(total)?;
        if is_cancelled() {
            return Ok(None);
        }
        let split = hold_out(drawn, held_out, &mut self.seed.rng(Stream::Split));
        Ok(Some((split, test)))
    }

    /// Draws at least `samples` samples with the noise of the training set.
    ///
    /// # Errors
    /// If the sensor, scene, or number of samples is invalid.
    pub(super) fn draw_training(&self, samples: usize) -> Result<Dataset, RunError> {
        let Simulation { sensor, scene, .. } = &self.source;
        sensor.check()?;
        scene.check()?;
        let mut set = Dataset::simulate(sensor, scene, samples, &mut self.seed.rng(Stream::Training))?;
        set.disturb(
            sensor,
            &scene.noise.in_training(),
            &mut self.seed.rng(Stream::TrainingNoise),
        )?;
        Ok(set)
    }

    /// Draws the samples of `set`, drawn by [`Self::draw_training`], with the noise of the test set; `None` if that is the
    /// same.
    pub(super) fn draw_tested_folds(&self, set: &Dataset) -> Result<Option<Dataset>, RunError> {
        let Simulation { sensor, scene, .. } = &self.source;
        let noise = scene.noise.in_test();
        if noise == scene.noise.in_training() {
            return Ok(None);
        }
        let mut tested = Dataset::simulate(sensor, scene, set.samples(), &mut self.seed.rng(Stream::Training))?;
        tested.disturb(sensor, &noise, &mut self.seed.rng(Stream::TestNoise))?;
        Ok(Some(tested))
    }

    /// Draws the test set of these settings, which the window shows before anything is trained.
    ///
    /// # Errors
    /// If the sensor, scene, or number of samples is invalid.
    pub fn draw_test(&self) -> Result<Dataset, RunError> {
        let Simulation { sensor, scene, .. } = &self.source;
        sensor.check()?;
        scene.check()?;
        let samples = self.source.test_samples;
        let mut set = Dataset::simulate(sensor, scene, samples, &mut self.seed.rng(Stream::Test))?;
        set.disturb(sensor, &scene.noise.in_test(), &mut self.seed.rng(Stream::TestNoise))?;
        Ok(set)
    }
}
