use rand::rngs::ChaCha8Rng;
use thiserror::Error;

use super::{
    AffineMap, CompiledNetworks, Decoder, DecoderKind, NewtonDecoder, PolishedDecoder, Posterior, PosteriorDecoder,
    Precision, RadialBasisNetwork, RadialBasisSettings, TakagiSugeno, TrainingMean,
};
use crate::{
    dataset::{Dataset, PerRow, Seed, Stream},
    network::{InputChoice, Networks, ScalingError},
    scene::{NoiseSource, RowModel, Scene},
    sensor::{SensorError, SensorModel},
};

/// What a decoder is fitted to.
#[derive(Clone, Copy)]
pub struct FitProblem<'a> {
    /// Training samples.
    pub training: &'a Dataset,
    /// Whether all row-wires share a decoder, or each has its own.
    pub row_model: RowModel,
    /// Quantity and scaling of the inputs.
    pub inputs: InputChoice,
    /// Noise that readings have and the training samples lack.
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

/// Error of fitting a decoder.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FitError {
    /// Samples cannot be scaled.
    #[error(transparent)]
    Scaling(#[from] ScalingError),
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
        (self.fit_function())(problem)
    }
}

impl FitProblem<'_> {
    fn rng(&self) -> ChaCha8Rng {
        self.seed.rng(Stream::Expectation)
    }

    /// Fits one decoder to the samples of all row-wires, or one for each.
    fn of_samples<D>(&self, fit: impl FnMut(&Dataset) -> Result<D, ScalingError>) -> Fit
    where
        PerRow<D>: Decoder + 'static,
    {
        Ok(Some(Box::new(PerRow::fit(self.training, self.row_model, fit)?)))
    }
}

pub(super) fn mean(problem: &FitProblem<'_>) -> Fit {
    problem.of_samples(|set| Ok(TrainingMean::fit(set)))
}

pub(super) fn ridge(problem: &FitProblem<'_>) -> Fit {
    problem.of_samples(|set| AffineMap::ridge(set, problem.inputs, problem.unseen))
}

pub(super) fn radial_basis(problem: &FitProblem<'_>) -> Fit {
    let (settings, mut rng) = (RadialBasisSettings::default(), problem.rng());
    problem.of_samples(|set| RadialBasisNetwork::fit(set, problem.inputs, problem.unseen, settings, &mut rng))
}

pub(super) fn fuzzy(problem: &FitProblem<'_>) -> Fit {
    let mut rng = problem.rng();
    problem.of_samples(|set| TakagiSugeno::fit(set, problem.inputs.quantity, problem.unseen, &mut rng))
}

pub(super) fn network(problem: &FitProblem<'_>) -> Fit {
    let rows = problem.training.row_count();
    Ok(problem.networks.map(|networks| match problem.precision {
        Precision::Double => Box::new(CompiledNetworks::<f64>::new(networks, rows)) as Box<dyn Decoder>,
        Precision::Single => Box::new(CompiledNetworks::<f32>::new(networks, rows)),
    }))
}

pub(super) fn newton(problem: &FitProblem<'_>) -> Fit {
    let Some(((sensor, scene), rows)) = problem.sensor.zip(problem.training.row_wires_read()) else {
        return Ok(None);
    };
    let posterior = Posterior::new(sensor, scene, rows, &mut problem.rng())?;
    Ok(Some(if scene.noise.in_test().is_none() {
        Box::new(NewtonDecoder::with_posterior(posterior, sensor, scene, rows)?)
    } else {
        Box::new(PosteriorDecoder::new(posterior, sensor, scene, rows)?)
    }))
}

pub(super) fn polish(problem: &FitProblem<'_>) -> Fit {
    let double = FitProblem {
        precision: Precision::Double,
        ..*problem
    };
    let sensor = problem.sensor.zip(problem.training.row_wires_read());
    let Some((((sensor, scene), rows), first)) = sensor.zip(network(&double)?) else {
        return Ok(None);
    };
    let steps = DecoderKind::POLISH_STEPS;
    let polished = PolishedDecoder::new(first, sensor, scene, rows, steps, &mut problem.rng())?;
    Ok(Some(Box::new(polished)))
}
