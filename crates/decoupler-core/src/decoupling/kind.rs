use std::{fmt, str::FromStr};

use rand::rngs::ChaCha8Rng;
use thiserror::Error;

use super::{
    AffineMap, CompiledNetworks, Decoder, NewtonDecoder, PolishedDecoder, RadialBasisNetwork, TakagiSugeno,
    TrainingMean,
};
use crate::{
    dataset::{Dataset, PerRow, Seed, Stream},
    network::{InputChoice, NetworkError, Networks},
    scene::{NoiseSource, RowModel, Scene},
    sensor::{SensorError, SensorModel},
    text::{Named, UnknownName},
};

/// Method of decoding the readings of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DecoderKind {
    /// Mean of the training set, independent of the readings.
    Mean,
    /// Affine map fitted by ridge regression.
    Ridge,
    /// Network trained on the samples.
    Network,
    /// Radial-basis network: Gaussians around centres.
    RadialBasis,
    /// Fuzzy rules with affine consequents: a Takagi-Sugeno system.
    Fuzzy,
    /// Gauss-Newton method on Eq. (2), with noise and prior if the scene has noise or the equations do not determine
    /// the answer.
    Newton,
    /// Network followed by at most [`DecoderKind::POLISH_STEPS`] Gauss-Newton steps.
    Polish,
}

/// Floating-point precision in which a network computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// 64 bits.
    #[default]
    Double,
    /// 32 bits.
    Single,
}

/// Properties of a decoder.
struct Entry {
    word: &'static str,
    name: &'static str,
    meaning: &'static str,
    needs: Needs,
    fit: fn(&FitProblem<'_>) -> Fit,
}

/// Requirements of a decoder beyond training samples.
#[derive(Clone, Copy, PartialEq)]
enum Needs {
    Nothing,
    Network,
    Sensor,
    NetworkAndSensor,
}

impl DecoderKind {
    /// All decoders, in the order offered to the user.
    pub const ALL: [Self; 7] = [
        Self::Mean,
        Self::Ridge,
        Self::Network,
        Self::RadialBasis,
        Self::Fuzzy,
        Self::Newton,
        Self::Polish,
    ];

    /// Largest number of steps of [`DecoderKind::Polish`].
    pub const POLISH_STEPS: usize = 3;

    const fn entry(self) -> Entry {
        match self {
            Self::Mean => Entry {
                word: "mean",
                name: "Training mean",
                meaning: "Always answers the mean of the training set",
                needs: Needs::Nothing,
                fit: fit_mean,
            },
            Self::Ridge => Entry {
                word: "ridge",
                name: "Ridge",
                meaning: "The best affine map of the chosen inputs: ridge regression, with the penalty of each target chosen by cross-validation",
                needs: Needs::Nothing,
                fit: fit_ridge,
            },
            Self::Network => Entry {
                word: "network",
                name: "Network",
                meaning: "The trained network, in 64 or in 32 bits",
                needs: Needs::Network,
                fit: fit_network,
            },
            Self::RadialBasis => Entry {
                word: "rbf",
                name: "Radial basis",
                meaning: "A radial-basis network by kernel ridge regression: Gaussians around all training samples, or around 1000 of more than 4000, their width and penalties chosen by cross-validation",
                needs: Needs::Nothing,
                fit: fit_radial_basis,
            },
            Self::Fuzzy => Entry {
                word: "fuzzy",
                name: "Fuzzy rules",
                meaning: "A Takagi-Sugeno system: fuzzy rules with affine consequents, their number chosen by cross-validation",
                needs: Needs::Nothing,
                fit: fit_fuzzy,
            },
            Self::Newton => Entry {
                word: "newton",
                name: "Newton",
                meaning: "Newton's method on Eq. (2) from mid-stroke, with restarts if that fails; with noise and prior if the scene has noise or the readings do not determine the answer",
                needs: Needs::Sensor,
                fit: fit_newton,
            },
            Self::Polish => Entry {
                word: "polish",
                name: "Network + Newton",
                meaning: "The network's answer, improved by at most three Newton steps",
                needs: Needs::NetworkAndSensor,
                fit: fit_polish,
            },
        }
    }

    /// Returns the name in tables, charts and forms; a network in single precision is named as such.
    pub fn name(self, precision: Precision) -> &'static str {
        match (self, precision) {
            (Self::Network, Precision::Single) => "Network f32",
            _ => self.entry().name,
        }
    }

    /// Returns a sentence that describes the method of decoding.
    pub fn meaning(self) -> &'static str {
        self.entry().meaning
    }

    /// Returns `true` if the decoder uses the trained network.
    pub fn needs_network(self) -> bool {
        matches!(self.entry().needs, Needs::Network | Needs::NetworkAndSensor)
    }

    /// Returns `true` if the decoder solves the equations of the sensor, so that measured samples alone are not enough.
    pub fn needs_sensor(self) -> bool {
        matches!(self.entry().needs, Needs::Sensor | Needs::NetworkAndSensor)
    }

    /// Returns the precisions in which the decoder computes.
    pub fn precisions(self) -> &'static [Precision] {
        match self {
            Self::Network => &[Precision::Double, Precision::Single],
            _ => &[Precision::Double],
        }
    }
}

impl Named for DecoderKind {
    const WHAT: &'static str = "a decoder";
    const ALL: &'static [Self] = &DecoderKind::ALL;

    fn name(self) -> &'static str {
        self.entry().word
    }
}

impl fmt::Display for DecoderKind {
    /// Writes the name used in the terminal and in files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.entry().word)
    }
}

impl FromStr for DecoderKind {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        Self::parse(text)
    }
}

/// Training samples and settings from which a decoder is fitted.
#[derive(Clone, Copy)]
pub struct FitProblem<'a> {
    /// Training samples.
    pub training: &'a Dataset,
    /// Whether all row-wires share a decoder or each has its own.
    pub row_model: RowModel,
    /// Quantity and scaling of the inputs.
    pub inputs: InputChoice,
    /// Noise of the readings that the training samples lack.
    pub unseen: NoiseSource,
    /// The sensor and its scene, if they are known.
    pub sensor: Option<(&'a SensorModel, &'a Scene)>,
    /// Trained networks, if there are any.
    pub networks: Option<&'a Networks>,
    /// Precision in which networks compute.
    pub precision: Precision,
    /// Seed of random choices.
    pub seed: Seed,
}

/// Error in fitting a decoder.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FitError {
    /// The samples cannot be scaled.
    #[error(transparent)]
    Scaling(#[from] NetworkError),
    /// The sensor has no resistances at rest.
    #[error(transparent)]
    Sensor(#[from] SensorError),
}

/// A fitted decoder, or `None` if the problem lacks the networks or the sensor that it needs.
pub type Fit = Result<Option<Box<dyn Decoder>>, FitError>;

impl DecoderKind {
    /// Fits a decoder of this kind.
    ///
    /// # Errors
    /// If samples cannot be scaled, or the sensor has no resistances at rest.
    pub fn fit(self, problem: &FitProblem<'_>) -> Fit {
        (self.entry().fit)(problem)
    }
}

impl FitProblem<'_> {
    fn rng(&self) -> ChaCha8Rng {
        self.seed.rng(Stream::Expectation)
    }

    /// Fits one decoder to the samples of all row-wires, or one for each.
    fn of_samples<D>(&self, fit: impl FnMut(&Dataset) -> Result<D, NetworkError>) -> Fit
    where
        PerRow<D>: Decoder + 'static,
    {
        Ok(Some(Box::new(PerRow::fit(self.training, self.row_model, fit)?)))
    }
}

fn fit_mean(problem: &FitProblem<'_>) -> Fit {
    problem.of_samples(|set| Ok(TrainingMean::fit(set)))
}

fn fit_ridge(problem: &FitProblem<'_>) -> Fit {
    problem.of_samples(|set| AffineMap::ridge(set, problem.inputs.quantity, problem.unseen))
}

fn fit_radial_basis(problem: &FitProblem<'_>) -> Fit {
    let mut rng = problem.rng();
    problem.of_samples(|set| RadialBasisNetwork::fit(set, problem.inputs, problem.unseen, &mut rng))
}

fn fit_fuzzy(problem: &FitProblem<'_>) -> Fit {
    let mut rng = problem.rng();
    problem.of_samples(|set| TakagiSugeno::fit(set, problem.inputs.quantity, problem.unseen, &mut rng))
}

fn fit_network(problem: &FitProblem<'_>) -> Fit {
    let rows = problem.training.row_count();
    Ok(problem.networks.map(|networks| match problem.precision {
        Precision::Double => Box::new(CompiledNetworks::<f64>::new(networks, rows)) as Box<dyn Decoder>,
        Precision::Single => Box::new(CompiledNetworks::<f32>::new(networks, rows)),
    }))
}

fn fit_newton(problem: &FitProblem<'_>) -> Fit {
    let Some(((sensor, scene), rows)) = problem.sensor.zip(problem.training.row_wires_read()) else {
        return Ok(None);
    };
    Ok(Some(Box::new(NewtonDecoder::new(sensor, scene, rows)?)))
}

fn fit_polish(problem: &FitProblem<'_>) -> Fit {
    let double = FitProblem {
        precision: Precision::Double,
        ..*problem
    };
    let sensor = problem.sensor.zip(problem.training.row_wires_read());
    let Some((((sensor, scene), rows), first)) = sensor.zip(fit_network(&double)?) else {
        return Ok(None);
    };
    let steps = DecoderKind::POLISH_STEPS;
    let polished = PolishedDecoder::new(first, sensor, scene, rows, steps)?;
    Ok(Some(Box::new(polished)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse_and_errors_list_the_choices() {
        for kind in DecoderKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        let message = "neural".parse::<DecoderKind>().unwrap_err().to_string();
        assert!(message.ends_with("newton or polish"), "{message}");
    }
}
