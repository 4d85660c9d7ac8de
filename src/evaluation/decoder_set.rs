use std::time::Instant;

use ndarray::Array2;

use super::{
    Errors, RunError, RunSettings, SimulatedSettings, Source, TargetErrors, frame_time::frame_us, task::unseen_noise,
};
use crate::{
    dataset::{Dataset, PerRow, Stream},
    decoupling::{
        AffineMap, CompiledNetworks, Decoder, DecoderKind, NewtonDecoder, NewtonRules, PolishedDecoder, Posterior,
        PosteriorDecoder, Precision, RadialBasisNetwork, RadialBasisSettings, TakagiSugeno, TrainingMean, decode_set,
        resistance_residual,
    },
    network::Networks,
    sensor::SensorModel,
};

/// What a decoder is worth on the nodes of a test set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecoderReport {
    /// Which.
    pub kind: DecoderKind,
    /// Of the network; everything else computes in double precision.
    pub precision: Precision,
    /// On the test set.
    pub errors: Errors,
    /// Root mean square over the test set's readings of m/R − 1, with R the resistances of the answer; it needs no
    /// ground truth.
    pub residual: f64,
    /// What it takes.
    pub cost: DecoderCost,
}

/// What a decoder is worth on targets of any meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetReport {
    /// Which.
    pub kind: DecoderKind,
    /// Of the network; everything else computes in double precision.
    pub precision: Precision,
    /// On the test set, target by target.
    pub targets: Vec<TargetErrors>,
    /// What it takes.
    pub cost: DecoderCost,
}

/// The time a decoder takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecoderCost {
    /// Time to decode a frame on one thread, in microseconds: the median of many.
    pub frame_us: f64,
    /// Time to fit it to the training set in seconds, the network's own training not counted.
    pub fit_seconds: f64,
}

impl DecoderReport {
    /// Its name in files, such as `network_f32`.
    pub fn name(&self) -> String {
        match self.precision {
            Precision::Double => self.kind.to_string(),
            Precision::Single => format!("{}_f32", self.kind),
        }
    }
}

/// Builds decoders for the source of a run and measures them.
pub struct DecoderSet {
    settings: RunSettings,
    training: Dataset,
    networks: Option<Networks>,
}

impl DecoderSet {
    /// Draws the training set of `settings`; `networks` are those trained with them.
    ///
    /// # Errors
    /// Settings that are impossible, with the reason.
    pub fn new(settings: &SimulatedSettings, networks: Option<Networks>) -> Result<Self, RunError> {
        let training = settings.draw()?.0.training;
        Ok(Self::on_set((*settings).into(), training, networks))
    }

    /// As [`Self::new`], with a training set that comes from elsewhere.
    pub fn on_set(settings: RunSettings, training: Dataset, networks: Option<Networks>) -> Self {
        Self {
            settings,
            training,
            networks,
        }
    }

    /// The same set with other networks, or none.
    pub fn set_networks(&mut self, networks: Option<Networks>) {
        self.networks = networks;
    }

    /// Fits a decoder; only networks know another precision than double. `None` if it needs networks or a sensor, and
    /// there are none.
    ///
    /// # Errors
    /// Samples that cannot be scaled, or a sensor without resistances at rest.
    pub fn decoder(&self, kind: DecoderKind, precision: Precision) -> Result<Option<Box<dyn Decoder>>, RunError> {
        let Self { settings, training, .. } = self;
        let (row_model, noise) = (settings.source.row_model(), unseen_noise(&settings.source)?);
        let mut rng = settings.seed.rng(Stream::Expectation);
        Ok(Some(match kind {
            DecoderKind::Mean => {
                let fit = |set: &Dataset| Ok::<_, RunError>(TrainingMean::fit(set));
                Box::new(PerRow::fit(training, row_model, fit)?)
            }
            DecoderKind::Ridge => {
                let fit = |set: &Dataset| AffineMap::ridge(set, settings.inputs, noise);
                Box::new(PerRow::fit(training, row_model, fit)?)
            }
            DecoderKind::RadialBasis => {
                let basis = RadialBasisSettings::default();
                let fit = |set: &Dataset| RadialBasisNetwork::fit(set, settings.inputs, noise, basis, &mut rng);
                Box::new(PerRow::fit(training, row_model, fit)?) as Box<dyn Decoder>
            }
            DecoderKind::Fuzzy => {
                let quantity = settings.inputs.quantity;
                let fit = |set: &Dataset| TakagiSugeno::fit(set, quantity, noise, &mut rng);
                Box::new(PerRow::fit(training, row_model, fit)?)
            }
            DecoderKind::Network => return Ok(self.network(precision)),
            DecoderKind::Newton | DecoderKind::Polish => {
                let (Source::Simulated(simulation), Some(rows)) = (&settings.source, training.row_wires_read()) else {
                    return Ok(None);
                };
                let (sensor, scene) = (&simulation.sensor, &simulation.scene);
                let mut posterior = || Posterior::new(sensor, scene, rows, &mut rng);
                if kind == DecoderKind::Polish {
                    let Some(first) = self.network(Precision::Double) else {
                        return Ok(None);
                    };
                    let steps = DecoderKind::POLISH_STEPS;
                    Box::new(PolishedDecoder::new(first, posterior()?, sensor, scene, rows, steps))
                } else if scene.noise.in_test().is_none() {
                    Box::new(NewtonDecoder::new(sensor, scene, rows, NewtonRules::default())?)
                } else {
                    Box::new(PosteriorDecoder::new(posterior()?, sensor, scene, rows)?)
                }
            }
        }))
    }

    /// The networks, ready to decode.
    fn network(&self, precision: Precision) -> Option<Box<dyn Decoder>> {
        let networks = self.networks.as_ref()?;
        let rows = self.training.row_count();
        Some(match precision {
            Precision::Double => Box::new(CompiledNetworks::<f64>::new(networks, rows)),
            Precision::Single => Box::new(CompiledNetworks::<f32>::new(networks, rows)),
        })
    }

    /// Fits a decoder, and measures its errors on the nodes of `test` and its speed. `None` as in [`Self::decoder`], and
    /// for a measured source: see [`Self::measure_targets`].
    ///
    /// # Errors
    /// As [`Self::decoder`], or a reading that cannot be decoded.
    pub fn measure(
        &self,
        kind: DecoderKind,
        precision: Precision,
        test: &Dataset,
    ) -> Result<Option<DecoderReport>, RunError> {
        let Some(simulation) = self.settings.source.simulation() else {
            return Ok(None);
        };
        let Some((answers, cost)) = self.answer(kind, precision, test)? else {
            return Ok(None);
        };
        Ok(Some(DecoderReport {
            kind,
            precision,
            errors: Errors::measure(test, &answers, simulation.stroke_mm()),
            residual: rms_residual(&simulation.sensor, test, &answers),
            cost,
        }))
    }

    /// Fits a decoder, and measures its errors on each target of `test` and its speed. `None` as in [`Self::decoder`].
    ///
    /// # Errors
    /// As [`Self::decoder`], or a reading that cannot be decoded.
    pub fn measure_targets(
        &self,
        kind: DecoderKind,
        precision: Precision,
        test: &Dataset,
    ) -> Result<Option<TargetReport>, RunError> {
        let report = |(answers, cost): (Array2<f64>, _)| TargetReport {
            kind,
            precision,
            targets: TargetErrors::measure(test.targets(), answers.view()),
            cost,
        };
        Ok(self.answer(kind, precision, test)?.map(report))
    }

    /// What a decoder makes of `test`, and what it takes.
    fn answer(
        &self,
        kind: DecoderKind,
        precision: Precision,
        test: &Dataset,
    ) -> Result<Option<(Array2<f64>, DecoderCost)>, RunError> {
        let begun = Instant::now();
        let Some(mut decoder) = self.decoder(kind, precision)? else {
            return Ok(None);
        };
        let fit_seconds = begun.elapsed().as_secs_f64();
        let answers = decode_set(&mut *decoder, test)?;
        let frame_us = frame_us(&mut *decoder, test)?;
        Ok(Some((answers, DecoderCost { frame_us, fit_seconds })))
    }
}

/// Root mean square over all readings of `test` of m/R − 1, with R the resistances of `answers` (samples × 3·M2, mm).
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
    fn decoders_are_named_and_found() {
        for kind in DecoderKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        let message = "knn".parse::<DecoderKind>().unwrap_err().to_string();
        assert!(message.contains("rbf"), "{message}");
    }
}
