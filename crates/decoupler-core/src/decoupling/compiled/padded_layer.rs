use ndarray::Array2;

use super::Real;

/// Layers are padded to a multiple of this number.
pub(super) const LANES: usize = 4;

/// An affine layer in double precision.
#[derive(Clone, Debug)]
pub(in crate::decoupling) struct PaddedLayer {
    outputs: usize,
    padded_outputs: usize,
    /// (inputs + 1) × padded outputs, the constants last.
    weights: Vec<f64>,
}

impl PaddedLayer {
    /// Lays out the weight of each input, and the constant of no input, for each output.
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
/// is that of the outputs, a multiple of [`LANES`]. Blocks of columns stay in registers.
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

/// Computes the outputs `first..first + B` and returns B. Even and odd inputs are summed separately, so that additions
/// need not wait for each other.
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
