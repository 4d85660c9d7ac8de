//! Trained networks compiled for fast decoding: scalings folded into the weights, layers padded to vector registers.

mod folded_network;

use ndarray::{Array1, Array2, Axis, Slice};
use pulp::{Simd, WithSimd};

use self::folded_network::FoldedNetwork;
use super::{AffineLayer, DecodeError, Decoder, Description, Layer, LayeredMap, NotDescribed};
use crate::{
    dataset::PerRow,
    network::{DecouplingNetwork, Networks},
};
use folded_network::affine;

pub(super) use folded_network::PaddedLayer;
pub use folded_network::Real;

/// Networks compiled to decode frames fast and without allocation, in double or single precision: the scalings are
/// folded into the weights, and layers are padded to whole vector registers.
///
/// Inputs are relative to a resistance R₀ in the middle of each channel, subtracted in double precision:
/// `1/R − 1/R₀ = −(R − R₀)/R/R₀`. Single precision therefore loses no accuracy where readings differ little.
///
/// Whitening without noise amplifies weak patterns a million times, and large products nearly cancel. Where this
/// would affect single precision, the sums of the hidden layer are computed in double precision, and the rest in
/// single.
#[derive(Clone, Debug)]
pub struct CompiledNetworks<T> {
    rows: usize,
    channels: usize,
    outputs_per_row: usize,
    networks: PerRow<FoldedNetwork<T>>,
    /// The networks as trained, for their description.
    trained: Networks,
    /// Inputs of one row.
    inputs: Vec<T>,
    /// Hidden nodes of all rows, so that hyperbolic tangents fill the vector registers.
    hidden: Vec<T>,
    /// Outputs of one row.
    outputs: Vec<T>,
    /// Inputs and sums of one row in double precision.
    wide_inputs: Vec<f64>,
    wide_sums: Vec<f64>,
}

impl<T: Real> CompiledNetworks<T> {
    /// Prepares `networks` to decode frames of `rows` row-wires.
    ///
    /// # Panics
    /// If the networks differ in channels or outputs.
    pub fn new(trained: &Networks, rows: usize) -> Self {
        let networks = trained.map(FoldedNetwork::new);
        let (channels, outputs) = (networks.at(0).centre_ohm.len(), networks.at(0).middles.len());
        let of_same_size =
            |network: &FoldedNetwork<T>| (network.centre_ohm.len(), network.middles.len()) == (channels, outputs);
        assert!(networks.values().iter().all(of_same_size));
        let widest = |width: fn(&FoldedNetwork<T>) -> usize| networks.values().iter().map(width).max().unwrap_or(0);
        let (hidden, padded_outputs) = (widest(|n| n.padded_hidden), widest(|n| n.padded_outputs));
        Self {
            rows,
            channels,
            outputs_per_row: outputs,
            inputs: vec![T::ZERO; channels],
            hidden: vec![T::ZERO; rows * hidden],
            outputs: vec![T::ZERO; padded_outputs],
            wide_inputs: vec![0.0; channels],
            wide_sums: vec![0.0; hidden],
            networks,
            trained: trained.clone(),
        }
    }
}

impl<T: Real> Decoder for CompiledNetworks<T> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn outputs(&self) -> usize {
        self.outputs_per_row
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        assert_eq!((readings.len(), targets.len()), (self.channels, self.outputs_per_row));
        self.decode_from(row_index, readings, targets)
    }

    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        assert_eq!(readings.len(), self.rows * self.channels);
        assert_eq!(targets.len(), self.rows * self.outputs_per_row);
        self.decode_from(0, readings, targets).map_err(|error| DecodeError {
            row_index: error.channel / self.channels,
            channel: error.channel % self.channels,
            ..error
        })
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        Ok(Description::of_maps(
            self.trained.values().iter().map(layers_of).collect(),
        ))
    }
}

/// Scaling, both layers and output scaling of a network, not folded.
fn layers_of(network: &DecouplingNetwork) -> LayeredMap {
    let (centre, to_inputs) = network.inputs().affine();
    let layer = |layer: ndarray::ArrayView2<'_, f64>| {
        let inputs = layer.nrows() - 1;
        Layer::Affine(AffineLayer {
            weights: layer.slice_axis(Axis(0), Slice::from(..inputs)).to_owned(),
            biases: layer.row(inputs).to_vec(),
        })
    };
    let (middles, half_widths): (Vec<f64>, Vec<f64>) = network.outputs().middles_and_half_widths().into_iter().unzip();
    let varying = network.outputs().varying();
    let of_varying: Vec<f64> = varying.iter().map(|&target| half_widths[target]).collect();
    let restoring = AffineLayer::of_varying(&Array2::from_diag(&Array1::from(of_varying)), &varying, &middles);
    LayeredMap {
        quantity: network.inputs().quantity(),
        centre,
        layers: vec![
            Layer::Affine(AffineLayer::linear(to_inputs.t().as_standard_layout().into_owned())),
            layer(network.mlp().hidden_layer()),
            Layer::Tanh,
            layer(network.mlp().output_layer()),
            Layer::Affine(restoring),
        ],
    }
}

impl<T: Real> CompiledNetworks<T> {
    /// Decodes consecutive rows, beginning with `first_row`.
    fn decode_from(&mut self, first_row: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        pulp::Arch::new().dispatch(Decoding {
            decoder: self,
            first_row,
            readings,
            targets,
        })
    }
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Decoding<'a, T> {
    decoder: &'a mut CompiledNetworks<T>,
    first_row: usize,
    readings: &'a [f64],
    targets: &'a mut [f64],
}

impl<T: Real> WithSimd for Decoding<'_, T> {
    type Output = Result<(), DecodeError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self {
            decoder,
            first_row,
            readings,
            targets,
        } = self;
        DecodeError::check_for(decoder.networks.at(first_row).quantity, readings)?;
        let width = decoder.hidden.len() / decoder.rows;
        let rows = readings.len() / decoder.channels;
        decoder.feed_hidden_nodes(first_row, readings);
        T::tanh_in_place(&mut decoder.hidden[..rows * width]);
        decoder.write_targets(first_row, targets);
        Ok(())
    }
}

impl<T: Real> CompiledNetworks<T> {
    /// Computes the sums of all hidden nodes.
    #[inline(always)]
    fn feed_hidden_nodes(&mut self, first_row: usize, readings: &[f64]) {
        let width = self.hidden.len() / self.rows;
        let rows = readings
            .chunks_exact(self.channels)
            .zip(self.hidden.chunks_exact_mut(width));
        for (row, (readings, hidden)) in rows.enumerate() {
            let network = self.networks.at(first_row + row);
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

    /// Computes the targets from the outputs of the hidden nodes.
    #[inline(always)]
    fn write_targets(&mut self, first_row: usize, targets: &mut [f64]) {
        let width = self.hidden.len() / self.rows;
        let rows = targets
            .chunks_exact_mut(self.outputs_per_row)
            .zip(self.hidden.chunks_exact(width));
        for (row, (targets, hidden)) in rows.enumerate() {
            let network = self.networks.at(first_row + row);
            let outputs = &mut self.outputs[..network.padded_outputs];
            affine(&hidden[..network.padded_hidden], &network.output_layer, outputs);
            targets.copy_from_slice(&network.middles);
            for (&target, output) in network.varying.iter().zip(&*outputs) {
                targets[target] += output.to_f64();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        decoupling::decode_set,
        network::{
            DecouplingNetwork, InputChoice, Inputs, MinMax, NetworkError, Quantity, ScalingChoice, Shape, nguyen_widrow,
        },
        scene::{Noise, RowModel, Scene},
        sensor::SensorModel,
    };

    fn networks(scale: &str, choice: InputChoice, hidden: usize) -> (Dataset, Networks) {
        let model = SensorModel::new(scale.parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 400, &mut Seed(0).rng(Stream::Training)).unwrap();
        let mut rng = Seed(0).rng(Stream::Start);
        let unseen = Noise::relative(1e-3).source(&model).unwrap();
        let network = |set: &Dataset| {
            let inputs = Inputs::fit(choice, set.readings(), unseen)?;
            let outputs = MinMax::fit(set.targets())?;
            let shape = Shape {
                inputs: inputs.count(),
                hidden,
                outputs: outputs.varying().len(),
            };
            let mlp = nguyen_widrow(shape, &mut rng);
            Ok::<_, NetworkError>(DecouplingNetwork::new(inputs, mlp, outputs))
        };
        let networks = PerRow::fit(&set, RowModel::Each, network).unwrap();
        (set, networks)
    }

    #[test]
    fn compiled_networks_match_the_original_for_every_precision_quantity_and_size() {
        for (scale, hidden) in [("10x10_5x30", 12), ("3x4_2x7", 1), ("2x6_3x18", 5), ("2x6_3x18", 29)] {
            for quantity in Quantity::ALL {
                for scaling in [ScalingChoice::MinMax, ScalingChoice::Whitening] {
                    let (set, networks) = networks(scale, InputChoice { quantity, scaling }, hidden);
                    let rows = set.row_count();
                    let double = decode_set(&mut CompiledNetworks::<f64>::new(&networks, rows), &set).unwrap();
                    let single = decode_set(&mut CompiledNetworks::<f32>::new(&networks, rows), &set).unwrap();
                    let expected = networks.decouple(&set);
                    for ((of_double, of_single), expected) in double.iter().zip(&single).zip(&expected) {
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

    #[test]
    fn frames_are_bit_identical_to_rows() {
        for hidden in [1, 5, 12, 29] {
            let (set, networks) = networks("5x6_3x18", InputChoice::BEST, hidden);
            let mut double = CompiledNetworks::<f64>::new(&networks, 5);
            let mut single = CompiledNetworks::<f32>::new(&networks, 5);
            let frames = set.frames().unwrap();
            for decoder in [&mut double as &mut dyn Decoder, &mut single] {
                let by_rows = decode_set(decoder, &set).unwrap();
                let mut whole = vec![0.0; 5 * 18];
                for frame in 0..frames.count() {
                    decoder.decode(frames.frame(frame), &mut whole).unwrap();
                    let rows = frames
                        .samples(frame)
                        .iter()
                        .flat_map(|&sample| by_rows.row(sample).to_vec());
                    assert!(whole.iter().map(|x| x.to_bits()).eq(rows.map(f64::to_bits)));
                }
            }
        }
    }

    #[test]
    fn a_shared_network_decodes_every_row_and_bad_readings_are_named() {
        let (set, networks) = networks("3x4_2x7", InputChoice::PAPER, 4);
        let shared = Networks::shared(networks.at(0).clone());
        let mut compiled = CompiledNetworks::<f64>::new(&shared, 3);
        let decoded = decode_set(&mut compiled, &set).unwrap();
        let expected = networks.at(0).decouple(set.readings());
        assert!((&decoded - &expected).iter().all(|difference| difference.abs() < 1e-10));
        let mut readings = vec![10.0; 21];
        readings[9] = -1.0;
        let error = compiled.decode(&readings, &mut [0.0; 36]).unwrap_err();
        let expected = DecodeError {
            row_index: 1,
            channel: 2,
            value: -1.0,
        };
        assert_eq!(error, expected);
        assert!(error.to_string().starts_with("row 2, reading 3: -1"), "{error}");
    }
}
