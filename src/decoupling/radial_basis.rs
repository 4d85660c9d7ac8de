use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use rand::Rng;

use super::{
    DecodeError, Decoder,
    clusters::{distance2, k_means},
    distinct::{distinct, with_noise},
    ridge::Ridge,
};
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, ScalingError},
    scene::NoiseSource,
};

/// A radial-basis network (Broomhead and Lowe 1988): Gaussians around centres in the scaled inputs, and a linear output
/// layer with a constant, fitted by ridge regression with the penalty of the least leave-one-out error.
#[derive(Clone, Debug)]
pub struct RadialBasisNetwork {
    inputs: Inputs,
    /// Centres × inputs.
    centres: Array2<f64>,
    /// 1 / (2 · width²).
    sharpness: f64,
    /// (centres + 1) × varying outputs, the constant last.
    coefficients: Array2<f64>,
    outputs: MinMax,
}

/// Settings of a radial-basis network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialBasisSettings {
    /// Positions of the Gaussians.
    pub centres: Centres,
    /// Width of the Gaussians in proportion to the root mean square distance between inputs.
    pub relative_width: f64,
}

/// Positions of the Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Centres {
    /// On every training sample.
    Samples,
    /// On this many means of clusters (Lloyd 1982), at most one for each sample.
    KMeans(usize),
}

impl Default for RadialBasisSettings {
    fn default() -> Self {
        Self {
            centres: Centres::KMeans(100),
            relative_width: 2.0,
        }
    }
}

impl RadialBasisNetwork {
    /// Fits to a training set; `unseen` as in [`Inputs::fit`]; `rng` draws it, and where clusters begin.
    ///
    /// # Errors
    /// Values that cannot be scaled.
    pub fn fit(
        training: &Dataset,
        choice: InputChoice,
        unseen: NoiseSource,
        settings: RadialBasisSettings,
        rng: &mut impl Rng,
    ) -> Result<Self, ScalingError> {
        let training = with_noise(training, unseen, rng);
        let inputs = Inputs::fit(choice, training.readings(), NoiseSource::default())?;
        let outputs = MinMax::fit(training.targets())?;
        let x = inputs.of(training.readings());
        let y = outputs.scale(training.targets());
        let centres = match settings.centres {
            Centres::Samples => x.clone(),
            Centres::KMeans(count) => k_means(x.view(), count.clamp(1, x.nrows()), rng),
        };
        // Twice the total variance is the mean squared distance between two samples.
        let spread2 = 2.0 * x.var_axis(Axis(0), 0.0).sum();
        let width2 = settings.relative_width.powi(2) * spread2;
        let sharpness = if width2 > 0.0 { 0.5 / width2 } else { 0.0 };
        let (x, y) = distinct(x.view(), y.view());
        let basis = Array2::from_shape_fn((x.nrows(), centres.nrows()), |(s, c)| {
            gaussian(x.row(s), centres.row(c), sharpness)
        });
        let ridge = Ridge::new(basis.view(), y.view(), Array2::zeros((0, centres.nrows())).view())?;
        let coefficients = ridge.coefficients(ridge.best_penalty());
        Ok(Self {
            inputs,
            centres,
            sharpness,
            coefficients,
            outputs,
        })
    }

    /// Number of Gaussians.
    pub fn centres(&self) -> usize {
        self.centres.nrows()
    }
}

impl Decoder for RadialBasisNetwork {
    fn channels(&self) -> usize {
        self.inputs.channels()
    }

    fn outputs(&self) -> usize {
        self.outputs.channels()
    }

    fn decode_row(&mut self, _row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        DecodeError::check_for(self.inputs.quantity(), readings)?;
        let readings = ArrayView2::from_shape((1, readings.len()), readings).expect("one row");
        let x = self.inputs.of(readings);
        let count = self.centres.nrows();
        let mut answer = self.coefficients.row(count).to_owned();
        for (centre, coefficients) in self.centres.rows().into_iter().zip(self.coefficients.rows()) {
            answer.scaled_add(gaussian(x.row(0), centre, self.sharpness), &coefficients);
        }
        let restored = self.outputs.restore(answer.insert_axis(Axis(0)).view());
        targets
            .iter_mut()
            .zip(&restored)
            .for_each(|(target, value)| *target = *value);
        Ok(())
    }
}

fn gaussian(x: ArrayView1<'_, f64>, centre: ArrayView1<'_, f64>, sharpness: f64) -> f64 {
    (-sharpness * distance2(x, centre)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Scene,
        sensor::SensorModel,
    };

    #[test]
    fn gaussians_on_every_sample_come_close_to_the_samples() {
        let model = SensorModel::new("1x4_2x12".parse().unwrap());
        let mut rng = Seed(0).rng(Stream::Training);
        let set = Dataset::simulate(&model, &Scene::default(), 40, &mut rng).unwrap();
        let settings = RadialBasisSettings {
            centres: Centres::Samples,
            relative_width: 0.5,
        };
        let mut network =
            RadialBasisNetwork::fit(&set, InputChoice::BEST, NoiseSource::default(), settings, &mut rng).unwrap();
        assert_eq!(network.centres(), 40);
        for sample in 0..40 {
            let mut coordinates = [0.0; 12];
            network
                .decode_row(0, set.sample_readings(sample), &mut coordinates)
                .unwrap();
            for (ours, truth) in coordinates.iter().zip(set.sample_targets(sample)) {
                assert!((ours - truth).abs() < 0.01, "{sample}: {ours} {truth}");
            }
        }
    }
}
