//! Programs of networks.

use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::{Builder, Combined, Function, NodeId, Program, ProgramDecoder};
use crate::{
    dataset::{Dataset, PerRow},
    decoupling::Precision,
    network::{DecouplingNetwork, MARGIN, Mlp, Quantity},
    problem::Problem,
};

/// Rounding error of the sums of hidden nodes above which they are computed in double precision.
const LARGEST_ROUNDING: f64 = 1e-5;
/// Typical relative change of readings, for the estimate of rounding errors.
const USUAL_CHANGE: f64 = 0.1;

impl PerRow<DecouplingNetwork> {
    /// The program of the networks; its precision is as in [`DecouplingNetwork::program`].
    ///
    /// # Panics
    /// If the networks differ in the quantity that they read.
    pub fn program(&self, precision: Precision) -> Program {
        Program::each(&self.map(|network| network.program(precision)))
    }

    /// Decoder of the networks in double precision.
    ///
    /// # Panics
    /// As [`Self::program`].
    pub fn decoder(&self) -> ProgramDecoder {
        ProgramDecoder::new(self.program(Precision::Double))
    }

    /// Decodes each sample of `set` with the network of its row-wire. Returns samples × outputs, in the units of the
    /// targets; NaN for samples with readings that cannot be decoded.
    ///
    /// # Panics
    /// If the set has a different number of channels, or a row-wire without a network.
    pub fn decouple(&self, set: &Dataset) -> Array2<f64> {
        self.decoder().answers_to(set)
    }

    /// The program that answers to the readings of `problem`: that of a combination with these networks, if there is one,
    /// otherwise that of the networks. For a recording, readings are limited to their range in training, extended by a tenth.
    ///
    /// # Panics
    /// As [`Self::program`], or if the combination has other readings or targets.
    pub fn decoder_program(&self, problem: &Problem, combined: Option<&Combined>) -> Program {
        match combined {
            Some(combined) => combined.program(self),
            None if problem.has_nodes() => self.program(Precision::Double),
            None => self.clipped(MARGIN, |network| network.program(Precision::Double)),
        }
    }

    /// Joins one program for each network, with the readings limited to their range in training, extended by `margin` of
    /// it: outside, networks and maps extrapolate without bound. Those of networks whose range is not known are not limited.
    pub(crate) fn clipped(&self, margin: f64, program: impl Fn(&DecouplingNetwork) -> Program) -> Program {
        let limited = |network: &DecouplingNetwork| {
            let (inputs, program) = (network.inputs(), program(network));
            let Some(range) = inputs.range() else { return program };
            let limits = (0..range.channels()).map(|channel| range.limits_within(inputs.quantity(), channel, margin));
            let (low, high): (Vec<f64>, Vec<f64>) = limits.unzip();
            let mut builder = Builder::new(program.channels());
            let valid = builder.valid(builder.readings(), inputs.quantity().domain());
            let clipped = builder.clip(valid, [&low, &high], Precision::Double);
            let output = builder.include(&program, clipped);
            builder.finish(output)
        };
        Program::each(&self.map(limited))
    }
}

impl DecouplingNetwork {
    /// The program of the network, with the scaling of the inputs folded into the hidden layer.
    ///
    /// Single precision means: the difference of each reading from the middle of its channel and the restored targets are
    /// computed in double precision, everything between in single. Whitening without noise amplifies weak patterns a
    /// million times, and large products nearly cancel; where this would cost digits, the sums of the hidden nodes are
    /// computed in double precision, too.
    pub fn program(&self, precision: Precision) -> Program {
        let (mlp, inputs) = (self.mlp(), self.inputs());
        let (centre, to_inputs) = inputs.affine();
        let (weights, biases) = layer(mlp.hidden_layer());
        let folded = to_inputs.t().dot(&weights);
        let usual = |&value: &f64| match inputs.quantity() {
            Quantity::LogResistance => USUAL_CHANGE,
            Quantity::Resistance | Quantity::Conductance | Quantity::Raw => USUAL_CHANGE * value,
        };
        let usual = Vec::from_iter(centre.iter().map(usual));
        let size = |node: ndarray::ArrayView1<'_, f64>| {
            let squares = node.iter().zip(&usual).map(|(weight, usual)| (weight * usual).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let largest = folded.columns().into_iter().map(size).fold(0.0, f64::max);
        let needs_double = f64::from(f32::EPSILON) * largest > LARGEST_ROUNDING;
        let of_sums = if needs_double { Precision::Double } else { precision };
        let mut builder = Builder::new(centre.len());
        let changes = builder.changes(inputs.quantity(), &centre, of_sums);
        let sums = builder.affine_of(&changes, folded, &biases);
        let scaled = output_layer(&mut builder, mlp, sums, precision);
        let targets = builder.restored(scaled, self.outputs());
        builder.finish(targets)
    }

    /// Returns the coordinates in millimetres (samples × 3·M2) for resistances in ohm (samples × M4); NaN for samples with
    /// readings that cannot be decoded.
    pub fn decouple(&self, resistances_ohm: ArrayView2<'_, f64>) -> Array2<f64> {
        let row_indices = vec![0; resistances_ohm.nrows()];
        ProgramDecoder::new(self.program(Precision::Double)).answers(&row_indices, resistances_ohm)
    }
}

impl Mlp {
    /// Returns the outputs (samples × m) for `inputs` (samples × n).
    pub fn forward(&self, inputs: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut builder = Builder::new(self.shape().inputs);
        let (weights, biases) = layer(self.hidden_layer());
        let sums = builder.affine(builder.readings(), weights, &biases, Precision::Double);
        let outputs = output_layer(&mut builder, self, sums, Precision::Double);
        ProgramDecoder::new(builder.finish(outputs)).answers(&vec![0; inputs.nrows()], inputs)
    }
}

fn output_layer(builder: &mut Builder, mlp: &Mlp, sums: NodeId, precision: Precision) -> NodeId {
    let hidden = builder.map(Function::Tanh, sums, precision);
    let (weights, biases) = layer(mlp.output_layer());
    builder.affine(hidden, weights, &biases, precision)
}

/// Weights and biases of a layer, whose last row are the biases.
fn layer(layer: ArrayView2<'_, f64>) -> (Array2<f64>, Vec<f64>) {
    let inputs = layer.nrows() - 1;
    let weights = layer.slice_axis(Axis(0), Slice::from(..inputs)).to_owned();
    (weights, layer.row(inputs).to_vec())
}
