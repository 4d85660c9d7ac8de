use std::time::Instant;

use ndarray::Array2;

use super::{
    RunError, RunSets, RunSettings, TestErrors, TrainingSize,
    baselines::fit_baselines,
    preparation::unseen_noise,
    remark::{cause, missing_figures, worse_than_mean},
    table::frame_us,
};
use crate::{
    dataset::Dataset,
    decoupling::{Decoder, DecoderKind, FitProblem, Precision, SolvedRows, decode_set, resistance_residual},
    job::Job,
    machine::MemoryBudget,
    network::Networks,
    problem::Problem,
    sensor::SensorModel,
};

/// Errors and cost of a decoder on a test set.
#[derive(Clone, Debug, PartialEq)]
pub struct DecoderReport {
    /// Kind of decoder.
    pub kind: DecoderKind,
    /// Precision of the network; all other decoders compute in double precision.
    pub precision: Precision,
    /// Errors on the test set.
    pub errors: TestErrors,
    /// Root mean square of m/R − 1 over the readings m of the test set, where R are the resistances at the decoded
    /// coordinates. It needs no ground truth. `None` without a model of the sensor.
    pub residual: Option<f64>,
    /// Numbers of rows solved, for decoders that solve the equations of the sensor.
    pub solved: SolvedRows,
    /// Computing time.
    pub cost: DecoderCost,
    /// Remarks on the errors, with cause and remedy.
    pub remarks: Vec<String>,
}

/// Computing time of a decoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecoderCost {
    /// Median time to decode a frame on one thread, in microseconds.
    pub frame_us: f64,
    /// Time to fit the decoder to the training set in seconds, without training the network.
    pub fit_seconds: f64,
}

impl DecoderReport {
    /// Returns the name in files, such as `network_f32`.
    pub fn name(&self) -> String {
        match self.precision {
            Precision::Double => self.kind.to_string(),
            Precision::Single => format!("{}_f32", self.kind),
        }
    }
}

/// Builds and measures decoders for the source of a run.
pub struct DecoderSet {
    settings: RunSettings,
    problem: Problem,
    training: Dataset,
    networks: Option<Networks>,
}

impl DecoderSet {
    /// Returns decoders fitted to `training`. `networks` must have been trained on it with these settings.
    pub fn new(settings: RunSettings, training: Dataset, networks: Option<Networks>) -> Self {
        Self {
            problem: Problem::of(settings.simulation(), &training),
            settings,
            training,
            networks,
        }
    }

    /// Draws the training set of simulated `settings`, and returns decoders fitted to it. `networks` must have been
    /// trained with these settings.
    ///
    /// # Errors
    /// As for [`RunSets::draw`].
    pub fn drawn(
        settings: RunSettings,
        networks: Option<Networks>,
        memory: MemoryBudget,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        let sets = RunSets::draw(&settings, memory, job)?;
        Ok(Self::new(settings, sets.split.training, networks))
    }

    /// Replaces the networks.
    pub(super) fn set_networks(&mut self, networks: Option<Networks>) {
        self.networks = networks;
    }

    /// Fits a decoder; `precision` applies to networks only. Returns `None` if the decoder needs networks or a sensor
    /// and there are none.
    ///
    /// # Errors
    /// If samples cannot be scaled, or the sensor has no resistances at rest.
    pub fn decoder(&self, kind: DecoderKind, precision: Precision) -> Result<Option<Box<dyn Decoder>>, RunError> {
        let sensor = self.problem.sensor.as_ref();
        Ok(kind.fit(&FitProblem {
            training: &self.training,
            row_model: self.settings.source.row_model(),
            inputs: self.settings.inputs,
            unseen: unseen_noise(sensor)?,
            sensor: sensor.map(|simulation| (&simulation.sensor, &simulation.scene)),
            networks: self.networks.as_ref(),
            precision,
            seed: self.settings.seed,
        })?)
    }

    /// Fits the linear map of the error table.
    ///
    /// # Errors
    /// If samples cannot be scaled.
    pub fn linear(&self) -> Result<Box<dyn Decoder>, RunError> {
        Ok(Box::new(fit_baselines(&self.training, &self.settings)?.1))
    }

    /// Decoders that can be measured for this problem, with the precisions of each, in the order offered to the user.
    pub fn kinds(problem: &Problem) -> impl Iterator<Item = (DecoderKind, Precision)> + use<> {
        let has_sensor = problem.sensor.is_some();
        let kinds = DecoderKind::ALL
            .into_iter()
            .filter(move |kind| has_sensor || !kind.needs_sensor());
        kinds.flat_map(|kind| kind.precisions().iter().map(move |&precision| (kind, precision)))
    }

    /// Fits a decoder and measures its speed and its errors on `test`. Returns `None` as [`Self::decoder`] does.
    ///
    /// # Errors
    /// As [`Self::decoder`], or if a reading cannot be decoded.
    pub fn measure(
        &self,
        kind: DecoderKind,
        precision: Precision,
        test: &Dataset,
    ) -> Result<Option<DecoderReport>, RunError> {
        let begun = Instant::now();
        let Some(mut decoder) = self.decoder(kind, precision)? else {
            return Ok(None);
        };
        let fit_seconds = begun.elapsed().as_secs_f64();
        let answers = decode_set(&mut *decoder, test)?;
        let solved = decoder.take_solved_rows();
        let frame_us = frame_us(&mut *decoder, test)?;
        let mean = self.decoder(DecoderKind::Mean, Precision::Double)?;
        let mut mean = mean.expect("the mean needs neither networks nor a sensor");
        let mean = TestErrors::measure(&self.problem, test, &decode_set(&mut *mean, test)?);
        let errors = TestErrors::measure(&self.problem, test, &answers);
        let sensor = self.problem.sensor.as_ref();
        let residual = sensor.map(|simulation| rms_residual(&simulation.sensor, test, &answers));
        let size = TrainingSize::of(&self.settings, &self.training);
        let mut remarks = worse_than_mean(&errors, &mean, &cause(kind, &self.settings, size, None));
        remarks.extend(missing_figures(precision, &errors, residual).map(str::to_owned));
        remarks.extend((!solved.are_reliable()).then(|| solved.to_string()));
        Ok(Some(DecoderReport {
            kind,
            precision,
            errors,
            remarks,
            residual,
            solved,
            cost: DecoderCost { frame_us, fit_seconds },
        }))
    }
}

/// Returns the root mean square of m/R − 1 over all readings m of `test`, where R are the resistances of `answers`
/// (samples × 3·M2, mm).
fn rms_residual(sensor: &SensorModel, test: &Dataset, answers: &Array2<f64>) -> f64 {
    let mut squares = 0.0;
    for (sample, answer) in answers.rows().into_iter().enumerate() {
        let answer = answer.to_slice().expect("a row of a standard array is contiguous");
        squares += resistance_residual(sensor, test.sample_readings(sample), answer).powi(2);
    }
    (squares / test.samples() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoders_are_found_by_name() {
        for kind in DecoderKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        let message = "knn".parse::<DecoderKind>().unwrap_err().to_string();
        assert!(message.contains("rbf"), "{message}");
    }
}
