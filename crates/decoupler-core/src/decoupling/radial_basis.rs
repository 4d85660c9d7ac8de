//! Radial-basis networks, fitted and compiled for fast decoding.

use ndarray::{Array1, Array2, Axis};
use pulp::{Simd, WithSimd};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::{
    AffineLayer, DecodeError, Decoder, Description, Layer, LayeredMap, NotDescribed,
    compiled::PaddedLayer,
    kernel_ridge::KernelRidge,
    units::{Units, with_noise},
};
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, Quantity, ScalingChoice, ScalingError, exp},
    scene::NoiseSource,
};

/// A radial-basis network (Broomhead and Lowe 1988): Gaussians around centres in the scaled inputs, and a linear
/// output layer with a constant, fitted by kernel ridge regression.
///
/// Up to 4000 training samples are all centres, of more there are 1000 centres. The width of the Gaussians and the
/// penalty of each target are chosen by the error on blocks of training samples that are left out. Inputs that are
/// scaled to [−1, 1] are divided by their standard deviation.
///
/// The scalings are folded into the layers, and decoding does not allocate.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RadialBasisNetwork {
    quantity: Quantity,
    /// Centre of each channel, subtracted from its values.
    channel_centres: Vec<f64>,
    /// Maps centred channels to scaled inputs.
    input_layer: PaddedLayer,
    centres: usize,
    gaussians: Gaussians,
    /// Maps Gaussians to the offsets of the varying targets.
    output_layer: PaddedLayer,
    /// Targets to which the output layer adds its offsets.
    middles: Vec<f64>,
    /// Indices of the varying targets.
    varying: Vec<usize>,
    buffers: Buffers,
}

/// Buffers for one row.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Buffers {
    channels: Vec<f64>,
    inputs: Vec<f64>,
    gaussians: Vec<f64>,
    changes: Vec<f64>,
}

impl RadialBasisNetwork {
    /// Fits to a training set; `unseen` is as in [`Inputs::fit`]; `rng` draws the noise.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn fit(
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
        Ok(Self::folded(&inputs, &scales, &kernel, &outputs))
    }

    /// Folds the scalings into the layers; the inputs are multiplied by `scales`.
    fn folded(inputs: &Inputs, scales: &Array1<f64>, kernel: &KernelRidge, outputs: &MinMax) -> Self {
        let KernelRidge {
            centres,
            sharpness,
            coefficients,
        } = kernel;
        let (channel_centres, to_inputs) = inputs.affine();
        let ranges = outputs.middles_and_half_widths();
        let varying = outputs.varying();
        let gaussians = Gaussians::new(centres, *sharpness);
        let (channels, count, width) = (channel_centres.len(), centres.nrows(), gaussians.width());
        let input_layer = PaddedLayer::new((channels, inputs.count()), |channel, input| {
            channel.map_or(0.0, |channel| scales[input] * to_inputs[[input, channel]])
        });
        let output_layer = PaddedLayer::new((width, varying.len()), |centre, output| {
            let half_width = ranges[varying[output]].1;
            match centre {
                None => coefficients[[count, output]] * half_width,
                Some(centre) if centre < count => coefficients[[centre, output]] * half_width,
                Some(_) => 0.0,
            }
        });
        Self {
            quantity: inputs.quantity(),
            buffers: Buffers {
                channels: vec![0.0; channels],
                inputs: vec![0.0; input_layer.padded_outputs()],
                gaussians: vec![0.0; width],
                changes: vec![0.0; output_layer.padded_outputs()],
            },
            channel_centres,
            input_layer,
            centres: count,
            gaussians,
            output_layer,
            middles: ranges.iter().map(|range| range.0).collect(),
            varying,
        }
    }

    /// Number of Gaussians.
    pub fn centres(&self) -> usize {
        self.centres
    }
}

impl Decoder for RadialBasisNetwork {
    fn channels(&self) -> usize {
        self.channel_centres.len()
    }

    fn outputs(&self) -> usize {
        self.middles.len()
    }

    fn decode_row(&mut self, _row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        assert_eq!((readings.len(), targets.len()), (self.channels(), self.outputs()));
        DecodeError::check_for(self.quantity, readings)?;
        pulp::Arch::new().dispatch(Decoding {
            network: self,
            readings,
            targets,
        });
        Ok(())
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        let (root, centres) = self.gaussians.in_units_of_width(self.centres);
        let inputs = self.input_layer.weights(self.channels()) * root;
        let changes = self.output_layer.weights(self.centres);
        let mut constants = self.middles.clone();
        let of_varying = self.output_layer.constants().iter().zip(&self.varying);
        of_varying.for_each(|(constant, &target)| constants[target] += constant);
        Ok(Description::of_maps(vec![LayeredMap {
            quantity: self.quantity,
            centre: self.channel_centres.clone(),
            layers: vec![
                Layer::Affine(AffineLayer::linear(inputs)),
                Layer::Gaussians { centres },
                Layer::Affine(AffineLayer::of_varying(&changes, &self.varying, &constants)),
            ],
        }]))
    }
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Decoding<'a> {
    network: &'a mut RadialBasisNetwork,
    readings: &'a [f64],
    targets: &'a mut [f64],
}

impl WithSimd for Decoding<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let RadialBasisNetwork {
            quantity,
            channel_centres,
            input_layer,
            gaussians,
            output_layer,
            middles,
            varying,
            buffers,
            ..
        } = self.network;
        let values = buffers.channels.iter_mut().zip(self.readings).zip(&*channel_centres);
        values.for_each(|((value, &reading), centre)| *value = quantity.of(reading) - centre);
        input_layer.apply(&buffers.channels, &mut buffers.inputs);
        gaussians.evaluate(&buffers.inputs[..input_layer.outputs()], &mut buffers.gaussians);
        output_layer.apply(&buffers.gaussians, &mut buffers.changes);
        self.targets.copy_from_slice(middles);
        for (&target, change) in varying.iter().zip(&buffers.changes) {
            self.targets[target] += change;
        }
    }
}

/// Gaussians of equal width around centres, laid out with centres side by side in vector registers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Gaussians {
    /// Number of centres, padded to a multiple of [`LANES`].
    width: usize,
    /// Inputs × padded centres.
    centres: Vec<f64>,
    /// 1 / (2 · width²).
    sharpness: f64,
}

/// The number of centres is padded to a multiple of this.
const LANES: usize = 8;

impl Gaussians {
    /// Lays out `centres` (centres × inputs).
    pub(super) fn new(centres: &Array2<f64>, sharpness: f64) -> Self {
        let (count, inputs) = centres.dim();
        let width = count.next_multiple_of(LANES);
        let mut laid_out = vec![0.0; inputs * width];
        for ((centre, input), &value) in centres.indexed_iter() {
            laid_out[input * width + centre] = value;
        }
        Self {
            width,
            centres: laid_out,
            sharpness,
        }
    }

    /// Number of centres with padding.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Root of the sharpness, and centres (inputs × `count`) multiplied by it.
    pub(super) fn in_units_of_width(&self, count: usize) -> (f64, Array2<f64>) {
        let root = self.sharpness.sqrt();
        let inputs = self.centres.len() / self.width.max(1);
        let centre = |(input, centre): (usize, usize)| root * self.centres[input * self.width + centre];
        (root, Array2::from_shape_fn((inputs, count), centre))
    }

    /// Writes the Gaussians at `x`, one for each centre; padding lanes are unspecified.
    #[inline(always)]
    pub(super) fn evaluate(&self, x: &[f64], values: &mut [f64]) {
        let mut first = 0;
        while first < self.width {
            first += match self.width - first {
                32.. => self.block::<32>(x, first, values),
                16.. => self.block::<16>(x, first, values),
                _ => self.block::<LANES>(x, first, values),
            };
        }
    }

    /// Writes the Gaussians `first..first + B` and returns B. Several registers are filled at once to hide the
    /// latency of additions.
    #[inline(always)]
    fn block<const B: usize>(&self, x: &[f64], first: usize, values: &mut [f64]) -> usize {
        let mut squares = [0.0; B];
        for (&x, centres) in x.iter().zip(self.centres.chunks_exact(self.width)) {
            let centres: &[f64; B] = centres[first..first + B].try_into().expect("B long");
            for lane in 0..B {
                let apart = x - centres[lane];
                squares[lane] += apart * apart;
            }
        }
        for lane in 0..B {
            values[first + lane] = exp(-self.sharpness * squares[lane]);
        }
        B
    }
}

#[cfg(test)]
mod tests {
    use dashu_float::{FBig, round::mode::HalfEven};
    use ndarray::ArrayView1;

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        decoupling::clusters::distance2,
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
        let mut network = RadialBasisNetwork::folded(&inputs, &Array1::ones(x.ncols()), &kernel, &outputs);
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

    #[test]
    fn centres_side_by_side_match_single_ones() {
        for (count, inputs) in [(1, 1), (7, 3), (100, 30), (33, 0)] {
            let centres = Array2::from_shape_fn((count, inputs), |(c, i)| (1.7 * c as f64 + 0.3 * i as f64).sin());
            let x = Array2::from_shape_fn((1, inputs), |(_, i)| (0.9 * i as f64).cos());
            let gaussians = Gaussians::new(&centres, 0.4);
            let mut values = vec![0.0; gaussians.width()];
            gaussians.evaluate(x.as_slice().unwrap(), &mut values);
            for (centre, value) in centres.rows().into_iter().zip(&values) {
                assert!(
                    (value / gaussian(x.row(0), centre, 0.4) - 1.0).abs() < 1e-14,
                    "{count} {inputs}"
                );
            }
        }
    }
}
