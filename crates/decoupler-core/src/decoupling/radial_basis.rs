//! Radial-basis networks, fitted and compiled for fast decoding.

use ndarray::{Array1, Axis};
use rand::Rng;

use super::{
    Precision,
    kernel_ridge::KernelRidge,
    program::{Builder, Function, Program},
    units::{Units, with_noise},
};
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, ScalingChoice, ScalingError},
    scene::NoiseSource,
};

impl Program {
    /// Fits a radial-basis network (Broomhead and Lowe 1988) to a training set: Gaussians around centres in the scaled
    /// inputs, and a linear output layer with a constant, by kernel ridge regression. `unseen` is as in [`Inputs::fit`];
    /// `rng` draws the noise.
    ///
    /// Up to 4000 training samples are all centres, of more there are 1000 centres. The width of the Gaussians and the
    /// penalty of each target are chosen by the error on blocks of training samples that are left out. Inputs that are
    /// scaled to [−1, 1] are divided by their standard deviation.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn radial_basis(
        training: &Dataset,
        choice: InputChoice,
        unseen: NoiseSource,
        rng: &mut impl Rng,
    ) -> Result<Self, ScalingError> {
        let training = with_noise(training, unseen, rng);
        let inputs = Inputs::fit(choice, training.readings(), NoiseSource::default())?;
        let outputs = MinMax::fit(training.targets())?;
        let x = inputs.of(training.readings());
        let y = outputs.scale(training.targets());
        let scales = match choice.scaling {
            ScalingChoice::MinMax => x.std_axis(Axis(0), 0.0).mapv(|deviation| 1.0 / deviation),
            // Components below the noise have less than unit variance on purpose.
            ScalingChoice::Whitening => Array1::ones(x.ncols()),
        };
        let kernel = KernelRidge::fit(&Units::of(&training, x * &scales, y))?;
        Ok(Self::of_kernel(&inputs, &scales, &kernel, &outputs))
    }

    /// The network of a fitted kernel; the inputs are multiplied by `scales`.
    fn of_kernel(inputs: &Inputs, scales: &Array1<f64>, kernel: &KernelRidge, outputs: &MinMax) -> Self {
        let double = Precision::Double;
        let KernelRidge {
            centres,
            sharpness,
            coefficients,
        } = kernel;
        // Distances in units of the width: exp(−sharpness · |x − c|²).
        let root = sharpness.sqrt();
        let (channel_centres, to_inputs) = inputs.affine();
        let to_inputs = &to_inputs.t() * &(scales * root);
        let mut builder = Builder::new(channel_centres.len());
        let zeros = vec![0.0; inputs.count()];
        let changes = builder.changes(inputs.quantity(), &channel_centres, double);
        let scaled = builder.affine_of(&changes, to_inputs, &zeros);
        let distances = builder.squared_distances(scaled, &centres.t() * root, double);
        let gaussians = builder.map(Function::Gaussian, distances, double);
        let (weights, constants) = coefficients.view().split_at(Axis(0), centres.nrows());
        let changes = builder.affine(gaussians, weights.to_owned(), &constants.row(0).to_vec(), double);
        let targets = builder.restored(changes, outputs);
        builder.finish(targets)
    }
}

#[cfg(test)]
mod tests {
    use dashu_float::{FBig, round::mode::HalfEven};
    use ndarray::ArrayView1;

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        decoupling::{Decoder, ProgramDecoder, clusters::distance2},
        scene::{Rows, Scene},
        sensor::SensorModel,
    };

    /// Whitening divides by deviations that are hardly above the rounding of the readings, which is amplified: no
    /// evaluation in double precision can be closer to the network evaluated in 150 bits than the effect of one unit
    /// in the last place of the readings.
    #[test]
    fn rounding_is_that_of_the_readings() {
        type Exact = FBig<HalfEven>;
        let exact = |value: f64| Exact::try_from(value).unwrap().with_precision(150).value();
        let model = SensorModel::new("10x10_5x30".parse().unwrap());
        let scene = Scene {
            rows: Rows::One(3),
            ..Scene::default()
        };
        let mut rng = Seed(0).rng(Stream::Training);
        let set = Dataset::simulate(&model, &scene, 300, &mut rng).unwrap();
        let inputs = Inputs::fit(InputChoice::BEST, set.readings(), NoiseSource::default()).unwrap();
        let outputs = MinMax::fit(set.targets()).unwrap();
        let (x, y) = (inputs.of(set.readings()), outputs.scale(set.targets()));
        let units = Units {
            x: x.clone(),
            y,
            weights: vec![1.0; 300],
        };
        let kernel = KernelRidge::fit(&units).unwrap();
        let program = Program::of_kernel(&inputs, &Array1::ones(x.ncols()), &kernel, &outputs);
        let mut network = ProgramDecoder::new(program);
        let KernelRidge {
            centres,
            sharpness,
            coefficients,
        } = kernel;
        let (channel_centres, to_inputs) = inputs.affine();
        let ranges = outputs.middles_and_half_widths();
        let (mut ours_mm, mut plain_mm, mut moved_mm) = (0.0_f64, 0.0_f64, 0.0_f64);
        for sample in 0..5 {
            let readings = set.sample_readings(sample);
            let mut answer = vec![0.0; network.outputs()];
            network.decode_row(0, readings, &mut answer).unwrap();
            let mut moved = answer.clone();
            let next = |(place, ohm): (usize, &f64)| if place % 2 == 0 { ohm.next_up() } else { ohm.next_down() };
            let nearby = Vec::from_iter(readings.iter().enumerate().map(next));
            network.decode_row(0, &nearby, &mut moved).unwrap();
            let values = readings.iter().zip(&channel_centres);
            let values = Vec::from_iter(values.map(|(&ohm, &centre)| exact(1.0) / exact(ohm) - exact(centre)));
            let dot = |row: ArrayView1<'_, f64>| {
                let terms = row.iter().zip(&values).map(|(&weight, value)| exact(weight) * value);
                terms.fold(exact(0.0), |sum, term| sum + term)
            };
            let scaled = Vec::from_iter(to_inputs.rows().into_iter().map(dot));
            let gaussians = Vec::from_iter(centres.rows().into_iter().map(|centre| {
                let apart = centre.iter().zip(&scaled).map(|(&centre, x)| x - exact(centre));
                let squares = apart.fold(exact(0.0), |sum, apart| sum + &apart * &apart);
                (-exact(sharpness) * squares).exp()
            }));
            let plain = Vec::from_iter(
                centres
                    .rows()
                    .into_iter()
                    .map(|c| gaussian(x.row(sample), c, sharpness)),
            );
            for (output, &target) in outputs.varying().iter().enumerate() {
                let (middle, half_width) = ranges[target];
                let gains = coefficients.column(output);
                let terms = gaussians.iter().zip(gains).map(|(value, &gain)| value * exact(gain));
                let sum = terms.fold(exact(gains[300]), |sum, term| sum + term);
                let truth = (sum * exact(half_width) + exact(middle)).to_f64().value();
                let sum: f64 = plain.iter().zip(gains).map(|(value, gain)| value * gain).sum();
                let one_by_one = (sum + gains[300]) * half_width + middle;
                ours_mm = ours_mm.max((answer[target] - truth).abs());
                plain_mm = plain_mm.max((one_by_one - truth).abs());
                moved_mm = moved_mm.max((answer[target] - moved[target]).abs());
            }
        }
        let message = format!("{ours_mm:e} {plain_mm:e}, a unit in the last place {moved_mm:e}");
        assert!(ours_mm < 2.0 * plain_mm && ours_mm < 4.0 * moved_mm, "{message}");
        assert!(moved_mm > 1e-9 && ours_mm < 1e-5, "{message}");
    }

    fn gaussian(x: ArrayView1<'_, f64>, centre: ArrayView1<'_, f64>, sharpness: f64) -> f64 {
        (-sharpness * distance2(x, centre)).exp()
    }
}
