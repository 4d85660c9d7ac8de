//! Training samples in blocks, and the products of two input channels that the factored equations need for every
//! sample.

use std::{ops::Range, sync::Arc};

use faer::{Mat, MatMut, MatRef};
use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::activations::change_each;

/// Number of samples in a block. Products run block by block, so that their operands stay in the cache and memory does
/// not grow with the number of samples.
pub(super) const BLOCK: usize = 512;

/// Scaled inputs and targets, cut into blocks of samples for the products of training. A clone shares the samples.
#[derive(Clone, Debug)]
pub struct Examples {
    blocks: Arc<[Block]>,
    samples: usize,
    inputs: usize,
    outputs: usize,
}

/// Up to [`BLOCK`] samples, each channel contiguous.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// A: samples × (inputs + 1), the last column being ones for the biases.
    pub(super) inputs: Mat<f64>,
    /// T: samples × outputs.
    pub(super) targets: Mat<f64>,
}

impl Block {
    pub(super) fn samples(&self) -> usize {
        self.inputs.nrows()
    }
}

impl Examples {
    /// Copies scaled inputs (samples × n) and targets (samples × m).
    ///
    /// # Panics
    /// If the numbers of samples differ.
    pub fn new(inputs: ArrayView2<'_, f64>, targets: ArrayView2<'_, f64>) -> Self {
        Self::scaled(
            (inputs, |inputs| inputs.to_owned()),
            (targets, |targets| targets.to_owned()),
        )
    }

    /// Scales readings and targets (both with one row for each sample) block by block, so that scaled values of all
    /// samples are never held twice: `inputs` returns samples × n, `targets` samples × m.
    ///
    /// # Panics
    /// If the numbers of samples differ.
    pub fn scaled(
        (readings, inputs): (ArrayView2<'_, f64>, impl Fn(ArrayView2<'_, f64>) -> Array2<f64>),
        (values, targets): (ArrayView2<'_, f64>, impl Fn(ArrayView2<'_, f64>) -> Array2<f64>),
    ) -> Self {
        let samples = readings.nrows();
        assert_eq!(samples, values.nrows());
        let scaled = |samples: Range<usize>| {
            let chunk = Slice::from(samples);
            let (readings, values) = (readings.slice_axis(Axis(0), chunk), values.slice_axis(Axis(0), chunk));
            (inputs(readings), targets(values))
        };
        let (none, no_targets) = scaled(0..0);
        let n = none.ncols();
        let block = |first: usize| {
            let (x, y) = scaled(first..samples.min(first + BLOCK));
            Block {
                inputs: Mat::from_fn(x.nrows(), n + 1, |s, i| if i < n { x[[s, i]] } else { 1.0 }),
                targets: Mat::from_fn(y.nrows(), y.ncols(), |s, t| y[[s, t]]),
            }
        };
        Self {
            blocks: (0..samples).step_by(BLOCK).map(block).collect(),
            samples,
            inputs: n,
            outputs: no_targets.ncols(),
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Number of input channels n.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of output channels m.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Number of errors: samples × outputs.
    pub(super) fn errors(&self) -> f64 {
        (self.samples * self.outputs) as f64
    }

    /// Returns the mean of each target.
    pub(super) fn target_means(&self) -> Vec<f64> {
        let sum = |index| -> f64 {
            let of_block = |block: &Block| column(block.targets.as_ref(), index).iter().sum::<f64>();
            self.blocks().iter().map(of_block).sum()
        };
        (0..self.outputs)
            .map(|index| sum(index) / self.samples.max(1) as f64)
            .collect()
    }

    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }
}

/// Returns a column of a matrix whose columns are contiguous.
pub(super) fn column(matrix: MatRef<'_, f64>, index: usize) -> &[f64] {
    let column = matrix
        .col(index)
        .try_as_col_major()
        .expect("columns of a column-major matrix are contiguous");
    column.as_slice()
}

/// Returns a mutable column of a matrix whose columns are contiguous.
pub(super) fn column_mut(matrix: MatMut<'_, f64>, index: usize) -> &mut [f64] {
    let column = matrix.col_mut(index).try_as_col_major_mut();
    column
        .expect("columns of a column-major matrix are contiguous")
        .as_slice_mut()
}

/// Number of pairs of `n1` columns.
pub(super) fn pairs(n1: usize) -> usize {
    n1 * (n1 + 1) / 2
}

/// Writes the products Aₐ∘A_b of two columns of A = [inputs, 1], a ≥ b: n1(n1+1)/2 × samples, so that the pairs of a
/// sample are contiguous and can be used in a product directly. Computing them costs a few percent of that product.
pub(super) fn fill_pairs(inputs: MatRef<'_, f64>, mut pairs: MatMut<'_, f64>) {
    let n1 = inputs.ncols();
    let mut sample = vec![0.0; n1];
    for index in 0..inputs.nrows() {
        for (value, input) in sample.iter_mut().zip(inputs.row(index).iter()) {
            *value = *input;
        }
        let mut rest = column_mut(pairs.as_mut(), index);
        for (b, factor) in sample.iter().enumerate() {
            let (products, below) = rest.split_at_mut(n1 - b);
            change_each(products, &sample[b..], |product, input| *product = factor * input);
            rest = below;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::network::{Mlp, Shape};

    pub(in crate::training) fn random_examples(samples: usize, inputs: usize, outputs: usize, seed: u64) -> Examples {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |columns| Array2::from_shape_simple_fn((samples, columns), || rng.random_range(-1.0..1.0));
        Examples::new(draw(inputs).view(), draw(outputs).view())
    }

    pub(in crate::training) fn random_mlp(inputs: usize, hidden: usize, outputs: usize, seed: u64) -> Mlp {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let shape = Shape {
            inputs,
            hidden,
            outputs,
        };
        Mlp::from_weights(
            shape,
            (0..shape.weights()).map(|_| rng.random_range(-1.0..1.0)).collect(),
        )
    }
}
