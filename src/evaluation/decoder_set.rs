use std::{fmt, str::FromStr, time::Instant};

use thiserror::Error;

use super::{
    Errors, Run, RunError, RunSettings,
    frame_time::{compiled, frame_us},
    task::unseen_noise,
};
use crate::{
    dataset::{Dataset, Stream},
    decoupling::{
        FrameDecoder, NewtonDecoder, NewtonRules, PolishedDecoder, Posterior, PosteriorDecoder, RadialBasisNetwork,
        RadialBasisSettings, RidgeMap, TrainingMean, decode_set, fit_rows, resistance_residual,
    },
    network::Networks,
};

/// A way from the resistances of a frame to deformation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DecoderKind {
    /// The mean of the training set.
    Mean,
    /// The best affine map, ridge-regularised.
    Ridge,
    /// The trained network.
    Network,
    /// Gaussians around centres.
    RadialBasis,
    /// Newton's method on Eq. (2); with noise and prior where the scene has noise.
    Newton,
    /// The network, then at most [`DecoderSet::POLISH_STEPS`] of Newton's steps.
    Polish,
}

/// A word that is none of the decoders.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not a decoder: give mean, ridge, network, rbf, newton or polish")]
pub struct DecoderKindError(String);

impl DecoderKind {
    /// All of them, in the order offered.
    pub const ALL: [Self; 6] = [
        Self::Mean,
        Self::Ridge,
        Self::Network,
        Self::RadialBasis,
        Self::Newton,
        Self::Polish,
    ];

    /// Whether it decodes by the trained network.
    pub fn needs_network(self) -> bool {
        matches!(self, Self::Network | Self::Polish)
    }
}

impl fmt::Display for DecoderKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Mean => "mean",
            Self::Ridge => "ridge",
            Self::Network => "network",
            Self::RadialBasis => "rbf",
            Self::Newton => "newton",
            Self::Polish => "polish",
        })
    }
}

impl FromStr for DecoderKind {
    type Err = DecoderKindError;

    fn from_str(text: &str) -> Result<Self, DecoderKindError> {
        let found = Self::ALL.into_iter().find(|kind| kind.to_string() == text.trim());
        found.ok_or_else(|| DecoderKindError(text.to_owned()))
    }
}

/// In what a network computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// 64 bits.
    #[default]
    Double,
    /// 32 bits.
    Single,
}

/// What a decoder is worth.
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
    /// Time to decode a frame on one thread, in microseconds: the median of many.
    pub frame_us: f64,
    /// Time to fit it to the training set in seconds, the network's own training not counted.
    pub fit_seconds: f64,
}

impl DecoderReport {
    /// Its name in tables and files, such as `network_f32`.
    pub fn name(&self) -> String {
        match self.precision {
            Precision::Double => self.kind.to_string(),
            Precision::Single => format!("{}_f32", self.kind),
        }
    }
}

/// Builds decoders of a run's scene and measures them.
pub struct DecoderSet {
    settings: RunSettings,
    rows: Vec<usize>,
    training: Dataset,
    networks: Option<Networks>,
}

impl DecoderSet {
    /// The most steps of [`DecoderKind::Polish`].
    pub const POLISH_STEPS: usize = 3;

    /// Draws the training set of `settings`; `networks` are those trained with them.
    ///
    /// # Errors
    /// Settings that are impossible, with the reason.
    pub fn new(settings: &RunSettings, networks: Option<Networks>) -> Result<Self, RunError> {
        Ok(Self {
            settings: *settings,
            rows: settings.scene.rows.read(settings.sensor.scale.rows())?,
            training: Run::draw(settings)?.0.training,
            networks,
        })
    }

    /// The set for the best networks of a run so far.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn of_run(run: &Run) -> Result<Self, RunError> {
        Self::new(run.settings(), Some(run.network()))
    }

    /// The same set with other networks, or none.
    pub fn set_networks(&mut self, networks: Option<Networks>) {
        self.networks = networks;
    }

    /// Fits a decoder; only networks know another precision than double. `None` if it needs networks and there are
    /// none.
    ///
    /// # Errors
    /// Samples that cannot be scaled, or a sensor without resistances at rest.
    pub fn decoder(&self, kind: DecoderKind, precision: Precision) -> Result<Option<Box<dyn FrameDecoder>>, RunError> {
        let Self {
            settings,
            rows,
            training,
            networks,
        } = self;
        let RunSettings {
            sensor, scene, seed, ..
        } = settings;
        let known = scene.rows.are_known();
        let noise = unseen_noise(settings)?;
        let mut rng = seed.rng(Stream::Expectation);
        let networks = networks.as_ref();
        Ok(match kind {
            DecoderKind::Mean => {
                let fit = |set: &Dataset| Ok::<_, RunError>(TrainingMean::fit(set));
                Some(Box::new(fit_rows(training, known, fit)?))
            }
            DecoderKind::Ridge => {
                let fit = |set: &Dataset| RidgeMap::fit(set, settings.inputs, noise);
                Some(Box::new(fit_rows(training, known, fit)?))
            }
            DecoderKind::RadialBasis => {
                let settings_of_basis = RadialBasisSettings::default();
                let fit =
                    |set: &Dataset| RadialBasisNetwork::fit(set, settings.inputs, noise, settings_of_basis, &mut rng);
                Some(Box::new(fit_rows(training, known, fit)?) as Box<dyn FrameDecoder>)
            }
            DecoderKind::Network => networks.map(|networks| match precision {
                Precision::Double => compiled::<f64>(networks, rows.len()),
                Precision::Single => compiled::<f32>(networks, rows.len()),
            }),
            DecoderKind::Newton if scene.noise.in_test().is_none() => {
                let newton = NewtonDecoder::new(sensor, scene, rows, NewtonRules::default())?;
                Some(Box::new(newton))
            }
            DecoderKind::Newton => {
                let posterior = Posterior::new(sensor, scene, rows, &mut rng)?;
                Some(Box::new(PosteriorDecoder::new(posterior, sensor, scene, rows)?))
            }
            DecoderKind::Polish => match networks {
                None => None,
                Some(networks) => {
                    let first = compiled::<f64>(networks, rows.len());
                    let posterior = Posterior::new(sensor, scene, rows, &mut rng)?;
                    let steps = Self::POLISH_STEPS;
                    let polished = PolishedDecoder::new(first, posterior, sensor, scene, rows, steps);
                    Some(Box::new(polished))
                }
            },
        })
    }

    /// Fits a decoder, and measures its errors on `test` and its speed. `None` as in [`Self::decoder`].
    ///
    /// # Errors
    /// As [`Self::decoder`], or a reading that is no resistance.
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
        let decoded_mm = decode_set(&mut *decoder, test)?;
        let mut squares = 0.0;
        for (readings, coordinates) in test.resistances_ohm.rows().into_iter().zip(decoded_mm.rows()) {
            let contiguous = "a row of a standard array is contiguous";
            let (readings, coordinates) = (readings.as_slice(), coordinates.as_slice());
            let (readings, coordinates) = (readings.expect(contiguous), coordinates.expect(contiguous));
            squares += resistance_residual(&self.settings.sensor, readings, coordinates).powi(2);
        }
        Ok(Some(DecoderReport {
            kind,
            precision,
            errors: Errors::measure(test, &decoded_mm, self.settings.stroke_mm()),
            residual: (squares / test.samples() as f64).sqrt(),
            frame_us: frame_us(&mut *decoder, test)?,
            fit_seconds,
        }))
    }
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
