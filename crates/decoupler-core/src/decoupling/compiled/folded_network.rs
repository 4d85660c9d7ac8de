use std::ops::{Add, Div, Mul};

use ndarray::{Array2, Axis, Slice};
use serde::{Deserialize, Serialize};

use crate::network::{DecouplingNetwork, Quantity, tanh_in_place, tanh_in_place_single};

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

/// The number of nodes of a layer is padded to a multiple of this.
pub(super) const LANES: usize = 4;

/// An affine layer in double precision.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::decoupling) struct PaddedLayer {
    outputs: usize,
    padded_outputs: usize,
    /// (inputs + 1) × padded outputs, the constants last.
    weights: Vec<f64>,
}

impl PaddedLayer {
    /// Lays out the weight of each input and the constant (no input) for each output.
    pub(in crate::decoupling) fn new(
        (inputs, outputs): (usize, usize),
        weight: impl Fn(Option<usize>, usize) -> f64,
    ) -> Self {
        let padded_outputs = outputs.next_multiple_of(LANES);
        let mut weights = vec![0.0; (inputs + 1) * padded_outputs];
        for (input, weights) in weights.chunks_exact_mut(padded_outputs.max(1)).enumerate() {
            for (output, to) in weights[..outputs].iter_mut().enumerate() {
                *to = weight((input < inputs).then_some(input), output);
            }
        }
        Self {
            outputs,
            padded_outputs,
            weights,
        }
    }

    /// Number of outputs.
    pub(in crate::decoupling) fn outputs(&self) -> usize {
        self.outputs
    }

    /// Number of outputs with padding.
    pub(in crate::decoupling) fn padded_outputs(&self) -> usize {
        self.padded_outputs
    }

    /// Weights of the first inputs (inputs × outputs).
    pub(in crate::decoupling) fn weights(&self, inputs: usize) -> Array2<f64> {
        let weight = |(input, output): (usize, usize)| self.weights[input * self.padded_outputs + output];
        Array2::from_shape_fn((inputs, self.outputs), weight)
    }

    /// Constant of each output.
    pub(in crate::decoupling) fn constants(&self) -> &[f64] {
        let first = self.weights.len() - self.padded_outputs;
        &self.weights[first..first + self.outputs]
    }

    /// Computes the outputs, with padding.
    #[inline(always)]
    pub(in crate::decoupling) fn apply(&self, input: &[f64], output: &mut [f64]) {
        affine(input, &self.weights, output);
    }
}

/// Computes `output = [input, 1] · layer`. The layer is stored row by row with its biases last; its number of columns
/// is the number of outputs, a multiple of [`LANES`]. Blocks of columns stay in registers.
#[inline(always)]
pub(super) fn affine<T: Real>(input: &[T], layer: &[T], output: &mut [T]) {
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

/// Computes the outputs `first..first + B` and returns B. Even and odd inputs are summed separately to hide the
/// latency of additions.
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

/// Floating-point type in which networks decode.
pub trait Real: Copy + Send + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// Zero.
    const ZERO: Self;
    /// Machine epsilon, the relative spacing of numbers.
    const EPSILON: f64;

    /// Rounds a double to the nearest value.
    fn of(value: f64) -> Self;

    /// Converts to a double.
    fn to_f64(self) -> f64;

    /// Replaces each value by its hyperbolic tangent.
    fn tanh_in_place(values: &mut [Self]);
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const EPSILON: f64 = f64::EPSILON;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn tanh_in_place(values: &mut [Self]) {
        tanh_in_place(values);
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const EPSILON: f64 = f32::EPSILON as f64;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn tanh_in_place(values: &mut [Self]) {
        tanh_in_place_single(values);
    }
}
