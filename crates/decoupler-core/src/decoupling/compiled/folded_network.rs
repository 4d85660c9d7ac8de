use ndarray::{Axis, Slice};

use super::{Real, padded_layer::LANES};
use crate::network::{DecouplingNetwork, Quantity};

/// A network with its scalings folded into the weights and its layers padded.
#[derive(Clone, Debug)]
pub(super) struct FoldedNetwork<T> {
    pub(super) quantity: Quantity,
    /// Reference resistance R₀ of each channel.
    pub(super) centre_ohm: Vec<f64>,
    /// (channels + 1) × padded hidden nodes, the bias last.
    pub(super) hidden_layer: Vec<T>,
    /// Hidden layer in double precision, if its sums need it.
    pub(super) wide_hidden_layer: Option<Vec<f64>>,
    /// (padded hidden nodes + 1) × padded outputs, the bias last.
    pub(super) output_layer: Vec<T>,
    /// Middle of the range of every target; constant targets stay there.
    pub(super) middles: Vec<f64>,
    /// Index of the target that each output changes.
    pub(super) varying: Vec<usize>,
    pub(super) padded_hidden: usize,
    pub(super) padded_outputs: usize,
}

/// Rounding error of the hidden sums above which they are computed in double precision.
const LARGEST_ROUNDING: f64 = 1e-5;
/// Typical relative deviation of readings from R₀, for the estimate of rounding errors.
const USUAL_CHANGE: f64 = 0.1;

impl<T: Real> FoldedNetwork<T> {
    /// Folds the scalings of `network` into its weights.
    pub(super) fn new(network: &DecouplingNetwork) -> Self {
        let (mlp, quantity) = (network.mlp(), network.inputs().quantity());
        let shape = mlp.shape();
        let (centre, matrix) = network.inputs().affine();
        let centre_ohm: Vec<f64> = centre.iter().map(|&value| quantity.resistance_ohm(value)).collect();
        let (padded_hidden, padded_outputs) = (
            shape.hidden.next_multiple_of(LANES),
            shape.outputs.next_multiple_of(LANES),
        );
        let channels = centre_ohm.len();
        // For a conductance, (R − R₀)/R is computed from the reading; the rest is folded into the weights.
        let per_computed = |channel: usize| match quantity {
            Quantity::Conductance => -1.0 / centre_ohm[channel],
            Quantity::Resistance | Quantity::LogResistance | Quantity::Raw => 1.0,
        };
        let folded = matrix
            .t()
            .dot(&mlp.hidden_layer().slice_axis(Axis(0), Slice::from(..shape.inputs)));
        let usual_input = |channel: usize| match quantity {
            Quantity::Conductance | Quantity::LogResistance => USUAL_CHANGE,
            Quantity::Resistance | Quantity::Raw => USUAL_CHANGE * centre_ohm[channel],
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
        for (output, &target) in varying.iter().enumerate() {
            let half_width = ranges[target].1;
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
            middles: ranges.iter().map(|range| range.0).collect(),
            varying,
            padded_hidden,
            padded_outputs,
        }
    }

    /// Computes the inputs of one row from its readings.
    #[inline(always)]
    pub(super) fn read<U: Real>(&self, readings_ohm: &[f64], inputs: &mut [U]) {
        let pairs = inputs.iter_mut().zip(readings_ohm).zip(&self.centre_ohm);
        match self.quantity {
            Quantity::Resistance | Quantity::Raw => {
                pairs.for_each(|((input, &ohm), &centre)| *input = U::of(ohm - centre));
            }
            Quantity::Conductance => {
                pairs.for_each(|((input, &ohm), &centre)| *input = U::of(ohm - centre) / U::of(ohm));
            }
            Quantity::LogResistance => {
                pairs.for_each(|((input, &ohm), &centre)| *input = U::of(((ohm - centre) / centre).ln_1p()));
            }
        }
    }
}
