use std::time::Instant;

use ndarray::Array2;

use super::{
    RunError, RunSettings, TestErrors, TrainingSize,
    baselines::fit_baselines,
    preparation::unseen_noise,
    remark::{cause, missing_figures, worse_than_mean},
    table::frame_us,
};
use crate::{
    dataset::{Dataset, PerRow, Simulation, Stream},
    decoupling::{
        Decoder, DecoderKind, NewtonDecoder, Precision, Program, ProgramDecoder, SolvedRows, decode_set,
        resistance_residual,
    },
    network::{InputChoice, NetworkError, Networks},
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
    /// Median time to decode a frame on one thread, in microseconds.
    pub frame_us: f64,
    /// Time to fit the decoder to the training set in seconds, without training the network.
    pub fit_seconds: f64,
    /// Remarks on the errors, with cause and remedy.
    pub remarks: Vec<String>,
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
    pub(super) networks: Option<Networks>,
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

    /// Fits a decoder; `precision` applies to networks only. Returns `None` if the decoder needs networks or a sensor
    /// and there are none.
    ///
    /// # Errors
    /// If samples cannot be scaled, or the sensor has no resistances at rest.
    pub fn decoder(&self, kind: DecoderKind, precision: Precision) -> Result<Option<Box<dyn Decoder>>, RunError> {
        let InputChoice { quantity, .. } = self.settings.inputs;
        let unseen = unseen_noise(self.problem.sensor.as_ref())?;
        let mut rng = self.settings.seed.rng(Stream::Expectation);
        let network = |precision| {
            let program = self.networks.as_ref()?.program(precision);
            Some(Box::new(ProgramDecoder::new(program)) as Box<dyn Decoder>)
        };
        match kind {
            DecoderKind::Mean => self.of_samples(|set| Ok(Program::mean(set))),
            DecoderKind::Ridge => self.of_samples(|set| Program::ridge(set, quantity, unseen)),
            DecoderKind::RadialBasis => {
                self.of_samples(|set| Program::radial_basis(set, self.settings.inputs, unseen, &mut rng))
            }
            DecoderKind::Fuzzy => self.of_samples(|set| Program::fuzzy(set, quantity, unseen, &mut rng)),
            DecoderKind::Network => Ok(network(precision)),
            DecoderKind::Newton => self.on_equations(|newton| newton),
            DecoderKind::Polish => match network(Precision::Double) {
                Some(network) => self.on_equations(|newton| newton.after(network, DecoderKind::POLISH_STEPS)),
                None => Ok(None),
            },
        }
    }

    /// Fits one program to the samples of all row-wires, or one for each.
    fn of_samples(
        &self,
        fit: impl FnMut(&Dataset) -> Result<Program, NetworkError>,
    ) -> Result<Option<Box<dyn Decoder>>, RunError> {
        let programs = PerRow::fit(&self.training, self.settings.source.row_model(), fit)?;
        Ok(Some(Box::new(ProgramDecoder::new(Program::each(&programs)))))
    }

    /// Creates a decoder for the rows that were read, and changes it; `None` without a sensor.
    fn on_equations(
        &self,
        change: impl FnOnce(NewtonDecoder) -> NewtonDecoder,
    ) -> Result<Option<Box<dyn Decoder>>, RunError> {
        let Some((Simulation { sensor, scene, .. }, rows)) =
            self.problem.sensor.as_ref().zip(self.training.row_wires_read())
        else {
            return Ok(None);
        };
        Ok(Some(Box::new(change(NewtonDecoder::new(sensor, scene, rows)?))))
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
        self.report((kind, precision), &mut *decoder, fit_seconds, test)
            .map(Some)
    }

    /// Measures the speed of a fitted decoder and its errors on `test`.
    ///
    /// # Errors
    /// As [`Self::decoder`], or if a reading cannot be decoded.
    pub fn report(
        &self,
        (kind, precision): (DecoderKind, Precision),
        decoder: &mut dyn Decoder,
        fit_seconds: f64,
        test: &Dataset,
    ) -> Result<DecoderReport, RunError> {
        let answers = decode_set(decoder, test)?;
        let solved = decoder.take_solved_rows();
        let frame_us = frame_us(decoder, test)?;
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
        Ok(DecoderReport {
            kind,
            precision,
            errors,
            remarks,
            residual,
            solved,
            frame_us,
            fit_seconds,
        })
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
    use crate::text::Named;

    #[test]
    fn decoders_are_found_by_name() {
        for kind in DecoderKind::ALL {
            assert_eq!(DecoderKind::parse(Named::name(kind)), Ok(kind));
        }
        let message = DecoderKind::parse("knn").unwrap_err().to_string();
        assert!(message.contains("rbf"), "{message}");
    }
}
