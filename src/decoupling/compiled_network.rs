use ndarray::{Axis, Slice};
use pulp::{Simd, WithSimd};

use super::{
    frame::{DecodeError, FrameDecoder},
    real::Real,
};
use crate::network::{DecouplingNetwork, Quantity};

/// Networks made ready to decode frames fast, in double or single precision, without allocating: the scalings are
/// folded into the weights, and layers are padded to whole vector registers.
///
/// Inputs are taken relative to a resistance R₀ in the middle of each channel, subtracted in double precision:
/// `1/R − 1/R₀ = −(R − R₀)/R/R₀`. So single precision loses nothing where readings differ little.
///
/// Whitening without noise amplifies patterns that hardly vary a million times, so large products nearly cancel. Where
/// single precision would show there, the hidden layer's sums are made in double precision; the rest is not.
#[derive(Clone, Debug)]
pub struct CompiledNetworks<T> {
    rows: usize,
    channels: usize,
    coordinates_per_row: usize,
    /// One for all rows, or one for each.
    networks: Vec<Compiled<T>>,
    /// Of one row.
    inputs: Vec<T>,
    /// Of all rows, so that hyperbolic tangents fill the vector registers.
    hidden: Vec<T>,
    /// Of one row.
    outputs: Vec<T>,
    /// Inputs and sums of one row in double precision.
    wide_inputs: Vec<f64>,
    wide_sums: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Compiled<T> {
    quantity: Quantity,
    /// R₀ of each channel.
    centre_ohm: Vec<f64>,
    /// (channels + 1) × padded hidden nodes, the bias last.
    hidden_layer: Vec<T>,
    /// The same in double precision, where sums need it.
    wide_hidden_layer: Option<Vec<f64>>,
    /// (padded hidden nodes + 1) × padded outputs, the bias last.
    output_layer: Vec<T>,
    /// The middle of every coordinate, which constant ones keep.
    middles_mm: Vec<f64>,
    /// Which coordinate each output moves.
    varying: Vec<usize>,
    padded_hidden: usize,
    padded_outputs: usize,
}

/// Rounding of the hidden layer's sums from which they are made in double precision.
const LARGEST_ROUNDING: f64 = 1e-5;
/// How far readings are from R₀, in proportion, for the estimate of rounding.
const USUAL_CHANGE: f64 = 0.1;

/// Layers are padded to a multiple of this.
const LANES: usize = 4;

impl<T: Real> CompiledNetworks<T> {
    /// One network for all of `rows` row-wires.
    pub fn shared(network: &DecouplingNetwork, rows: usize) -> Self {
        Self::new(vec![Compiled::new(network)], rows)
    }

    /// One network for each row-wire.
    ///
    /// # Panics
    /// If there is none, or their channels differ.
    pub fn each(networks: &[DecouplingNetwork]) -> Self {
        Self::new(networks.iter().map(Compiled::new).collect(), networks.len())
    }

    fn new(networks: Vec<Compiled<T>>, rows: usize) -> Self {
        let first = networks.first().expect("at least one network");
        let channels = first.centre_ohm.len();
        let coordinates_per_row = first.middles_mm.len();
        assert!(networks.iter().all(|network| network.centre_ohm.len() == channels));
        let widest = |width: fn(&Compiled<T>) -> usize| networks.iter().map(width).max().unwrap_or(0);
        let (hidden, outputs) = (widest(|n| n.padded_hidden), widest(|n| n.padded_outputs));
        Self {
            rows,
            channels,
            coordinates_per_row,
            inputs: vec![T::ZERO; channels],
            hidden: vec![T::ZERO; rows * hidden],
            outputs: vec![T::ZERO; outputs],
            wide_inputs: vec![0.0; channels],
            wide_sums: vec![0.0; hidden],
            networks,
        }
    }
}

impl<T: Real> Compiled<T> {
    fn new(network: &DecouplingNetwork) -> Self {
        let (mlp, quantity) = (network.mlp(), network.inputs().quantity());
        let shape = mlp.shape();
        let (centre, matrix) = network.inputs().affine();
        let centre_ohm: Vec<f64> = centre.iter().map(|&value| quantity.resistance_ohm(value)).collect();
        let (padded_hidden, padded_outputs) = (
            shape.hidden.next_multiple_of(LANES),
            shape.outputs.next_multiple_of(LANES),
        );
        let channels = centre_ohm.len();
        // What is computed of a reading is (R − R₀)/R for a conductance; the rest is folded into the weights.
        let per_computed = |channel: usize| match quantity {
            Quantity::Conductance => -1.0 / centre_ohm[channel],
            Quantity::Resistance | Quantity::LogResistance => 1.0,
        };
        let folded = matrix
            .t()
            .dot(&mlp.hidden_layer().slice_axis(Axis(0), Slice::from(..shape.inputs)));
        let usual_input = |channel: usize| match quantity {
            Quantity::Conductance | Quantity::LogResistance => USUAL_CHANGE,
            Quantity::Resistance => USUAL_CHANGE * centre_ohm[channel],
        };
        let mut wide = vec![0.0; (channels + 1) * padded_hidden];
        let mut rounding = 0.0_f64;
        for node in 0..shape.hidden {
            let mut squares = 0.0;
            for channel in 0..channels {
                let weight = folded[[channel, node]] * per_computed(channel);
                wide[channel * padded_hidden + node] = weight;
                squares += (weight * usual_input(channel)).powi(2);
            }
            wide[channels * padded_hidden + node] = mlp.hidden_layer()[[shape.inputs, node]];
            rounding = rounding.max(T::EPSILON * squares.sqrt());
        }
        let hidden_layer = wide.iter().map(|&weight| T::of(weight)).collect();
        let is_wide = T::EPSILON > f64::EPSILON && rounding > LARGEST_ROUNDING;
        let ranges = network.outputs().middles_and_half_widths();
        let varying = network.outputs().varying();
        let mut output_layer = vec![T::ZERO; (padded_hidden + 1) * padded_outputs];
        for (output, &coordinate) in varying.iter().enumerate() {
            let half_width = ranges[coordinate].1;
            for node in 0..shape.hidden {
                let weight = mlp.output_layer()[[node, output]] * half_width;
                output_layer[node * padded_outputs + output] = T::of(weight);
            }
            let bias = mlp.output_layer()[[shape.hidden, output]] * half_width;
            output_layer[padded_hidden * padded_outputs + output] = T::of(bias);
        }
        Self {
            quantity,
            centre_ohm,
            hidden_layer,
            wide_hidden_layer: is_wide.then_some(wide),
            output_layer,
            middles_mm: ranges.iter().map(|range| range.0).collect(),
            varying,
            padded_hidden,
            padded_outputs,
        }
    }

    #[inline(always)]
    fn read<U: Real>(&self, readings_ohm: &[f64], inputs: &mut [U]) {
        let pairs = inputs.iter_mut().zip(readings_ohm).zip(&self.centre_ohm);
        match self.quantity {
            Quantity::Resistance => pairs.for_each(|((input, &ohm), &centre)| *input = U::of(ohm - centre)),
            Quantity::Conductance => {
                pairs.for_each(|((input, &ohm), &centre)| *input = U::of(ohm - centre) / U::of(ohm));
            }
            Quantity::LogResistance => {
                pairs.for_each(|((input, &ohm), &centre)| *input = U::of(((ohm - centre) / centre).ln_1p()));
            }
        }
    }
}

impl<T: Real> FrameDecoder for CompiledNetworks<T> {
    fn decode(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Result<(), DecodeError> {
        assert_eq!(readings_ohm.len(), self.rows * self.channels);
        assert_eq!(coordinates_mm.len(), self.rows * self.coordinates_per_row);
        pulp::Arch::new().dispatch(Decoding {
            decoder: self,
            readings_ohm,
            coordinates_mm,
        })
    }
}

/// A type rather than a closure, which would be too long to be moved into the code for vector registers.
struct Decoding<'a, T> {
    decoder: &'a mut CompiledNetworks<T>,
    readings_ohm: &'a [f64],
    coordinates_mm: &'a mut [f64],
}

impl<T: Real> WithSimd for Decoding<'_, T> {
    type Output = Result<(), DecodeError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        DecodeError::check(self.readings_ohm)?;
        self.decoder.feed_hidden_nodes(self.readings_ohm);
        T::tanh_in_place(&mut self.decoder.hidden);
        self.decoder.move_nodes(self.coordinates_mm);
        Ok(())
    }
}

impl<T: Real> CompiledNetworks<T> {
    /// Sums of all hidden nodes.
    #[inline(always)]
    fn feed_hidden_nodes(&mut self, readings_ohm: &[f64]) {
        let last = self.networks.len() - 1;
        let width = self.hidden.len() / self.rows;
        let rows = readings_ohm
            .chunks_exact(self.channels)
            .zip(self.hidden.chunks_exact_mut(width));
        for (row, (readings, hidden)) in rows.enumerate() {
            let network = &self.networks[row.min(last)];
            let hidden = &mut hidden[..network.padded_hidden];
            if let Some(layer) = &network.wide_hidden_layer {
                let sums = &mut self.wide_sums[..network.padded_hidden];
                network.read(readings, &mut self.wide_inputs);
                affine(&self.wide_inputs, layer, sums);
                hidden.iter_mut().zip(sums).for_each(|(to, sum)| *to = T::of(*sum));
            } else {
                network.read(readings, &mut self.inputs);
                affine(&self.inputs, &network.hidden_layer, hidden);
            }
        }
    }

    /// Coordinates from the hidden nodes' outputs.
    #[inline(always)]
    fn move_nodes(&mut self, coordinates_mm: &mut [f64]) {
        let last = self.networks.len() - 1;
        let width = self.hidden.len() / self.rows;
        let rows = coordinates_mm
            .chunks_exact_mut(self.coordinates_per_row)
            .zip(self.hidden.chunks_exact(width));
        for (row, (coordinates, hidden)) in rows.enumerate() {
            let network = &self.networks[row.min(last)];
            let outputs = &mut self.outputs[..network.padded_outputs];
            affine(&hidden[..network.padded_hidden], &network.output_layer, outputs);
            coordinates.copy_from_slice(&network.middles_mm);
            for (&coordinate, output) in network.varying.iter().zip(&*outputs) {
                coordinates[coordinate] += output.to_f64();
            }
        }
    }
}

/// `output = [input, 1] · layer`, the layer row by row with its biases last and as many columns as outputs, a multiple
/// of [`LANES`]. Blocks of columns stay in registers.
#[inline(always)]
fn affine<T: Real>(input: &[T], layer: &[T], output: &mut [T]) {
    let width = output.len();
    let mut first = 0;
    while first < width {
        first += match width - first {
            16.. => block::<T, 16>(input, layer, width, first, output),
            12.. => block::<T, 12>(input, layer, width, first, output),
            8.. => block::<T, 8>(input, layer, width, first, output),
            _ => block::<T, LANES>(input, layer, width, first, output),
        };
    }
}

/// The outputs `first..first + B`. Even and odd inputs are summed apart, so that additions need not wait for each other.
#[inline(always)]
fn block<T: Real, const B: usize>(input: &[T], layer: &[T], width: usize, first: usize, output: &mut [T]) -> usize {
    let weights = |row: usize| -> &[T; B] {
        let begin = row * width + first;
        layer[begin..begin + B].try_into().expect("B long")
    };
    let mut even = *weights(input.len());
    let mut odd = [T::ZERO; B];
    let mut pairs = input.chunks_exact(2);
    let mut row = 0;
    for pair in &mut pairs {
        let (of_even, of_odd) = (weights(row), weights(row + 1));
        for lane in 0..B {
            even[lane] = even[lane] + pair[0] * of_even[lane];
            odd[lane] = odd[lane] + pair[1] * of_odd[lane];
        }
        row += 2;
    }
    if let [value] = *pairs.remainder() {
        let of_even = weights(row);
        for lane in 0..B {
            even[lane] = even[lane] + value * of_even[lane];
        }
    }
    for lane in 0..B {
        output[first + lane] = even[lane] + odd[lane];
    }
    B
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        decoupling::decode_set,
        network::{InputChoice, Inputs, MinMax, ScalingChoice, Shape, nguyen_widrow},
        scene::Scene,
        sensor::SensorModel,
    };

    fn networks(scale: &str, choice: InputChoice, hidden: usize) -> (Dataset, Vec<DecouplingNetwork>) {
        let model = SensorModel::new(scale.parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 400, &mut Seed(0).rng(Stream::Training)).unwrap();
        let mut rng = Seed(0).rng(Stream::Start);
        let network = |row: usize| {
            let set = set.of_row(row);
            let inputs = Inputs::fit(choice, set.resistances_ohm.view(), 1e-3).unwrap();
            let outputs = MinMax::fit(set.coordinates_mm.view()).unwrap();
            let shape = Shape {
                inputs: inputs.count(),
                hidden,
                outputs: outputs.varying().len(),
            };
            let mlp = nguyen_widrow(shape, &mut rng);
            DecouplingNetwork::new(inputs, mlp, outputs)
        };
        let networks = (0..model.scale.rows()).map(network).collect();
        (set, networks)
    }

    #[test]
    fn every_precision_quantity_and_size_answers_as_the_network_itself() {
        for (scale, hidden) in [("10x10_5x30", 12), ("3x4_2x7", 1), ("2x6_3x18", 5), ("2x6_3x18", 29)] {
            for quantity in Quantity::ALL {
                for scaling in [ScalingChoice::MinMax, ScalingChoice::Whitening] {
                    let (set, networks) = networks(scale, InputChoice { quantity, scaling }, hidden);
                    let double = decode_set(&mut CompiledNetworks::<f64>::each(&networks), &set).unwrap();
                    let single = decode_set(&mut CompiledNetworks::<f32>::each(&networks), &set).unwrap();
                    for (row, network) in networks.iter().enumerate() {
                        let expected = network.decouple(set.of_row(row).resistances_ohm.view());
                        for (snapshot, expected) in expected.rows().into_iter().enumerate() {
                            let sample = snapshot * networks.len() + row;
                            for (coordinate, expected) in expected.iter().enumerate() {
                                let of_double = double[[sample, coordinate]];
                                let of_single = single[[sample, coordinate]];
                                assert!(
                                    (of_double - expected).abs() < 1e-9,
                                    "{scale} {quantity}: {of_double} {expected}"
                                );
                                assert!(
                                    (of_single - expected).abs() < 1e-3,
                                    "{scale} {quantity}: {of_single} {expected}"
                                );
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_shared_network_decodes_every_row_and_bad_readings_are_named() {
        let (set, networks) = networks("3x4_2x7", InputChoice::PAPER, 4);
        let mut compiled = CompiledNetworks::<f64>::shared(&networks[0], 3);
        let decoded = decode_set(&mut compiled, &set).unwrap();
        let expected = networks[0].decouple(set.resistances_ohm.view());
        assert!((&decoded - &expected).iter().all(|difference| difference.abs() < 1e-10));
        let mut readings = vec![10.0; 21];
        readings[9] = -1.0;
        let error = compiled.decode(&readings, &mut [0.0; 36]).unwrap_err();
        assert_eq!(error, DecodeError { index: 9, value: -1.0 });
    }
}
