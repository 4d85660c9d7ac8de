//! Training samples, cut into blocks.

use std::sync::{Arc, OnceLock};

use faer::{Mat, MatMut, MatRef};
use ndarray::ArrayView2;

/// Number of samples in a block. Products run block by block, so that their operands stay in the cache and memory does
/// not grow with the number of samples.
pub(super) const BLOCK: usize = 512;

/// Scaled inputs and targets, cut into blocks of samples for the products of training. A clone shares the samples.
#[derive(Clone, Debug)]
pub struct Examples {
    data: Arc<Data>,
    samples: usize,
    inputs: usize,
    outputs: usize,
}

/// The samples, which all trainings on them have in common.
#[derive(Debug)]
struct Data {
    blocks: Vec<Block>,
    /// Products of two input columns, block by block, once a method has asked for them.
    input_pairs: OnceLock<Vec<Mat<f64>>>,
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
        assert_eq!(inputs.nrows(), targets.nrows());
        let (samples, n) = inputs.dim();
        let cut = |first: usize| {
            let count = BLOCK.min(samples - first);
            Block {
                inputs: Mat::from_fn(count, n + 1, |s, i| if i < n { inputs[[first + s, i]] } else { 1.0 }),
                targets: Mat::from_fn(count, targets.ncols(), |s, t| targets[[first + s, t]]),
            }
        };
        Self {
            data: Arc::new(Data {
                blocks: (0..samples).step_by(BLOCK).map(cut).collect(),
                input_pairs: OnceLock::new(),
            }),
            samples,
            inputs: n,
            outputs: targets.ncols(),
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

    /// Mean of each target.
    pub(super) fn target_means(&self) -> Vec<f64> {
        let sum = |index| -> f64 {
            let blocks = self.blocks().iter();
            blocks.flat_map(|block| column(block.targets.as_ref(), index)).sum()
        };
        (0..self.outputs)
            .map(|index| sum(index) / self.samples.max(1) as f64)
            .collect()
    }

    pub(super) fn blocks(&self) -> &[Block] {
        &self.data.blocks
    }

    /// Returns the products of two input columns of each block, computed by `make` on the first call. `make` must not
    /// wait for other threads, which may be waiting here.
    pub(super) fn input_pairs(&self, make: impl FnMut(&Block) -> Mat<f64>) -> &[Mat<f64>] {
        let all = || self.blocks().iter().map(make).collect();
        self.data.input_pairs.get_or_init(all)
    }
}

/// A column of a matrix whose columns are contiguous.
pub(super) fn column(matrix: MatRef<'_, f64>, index: usize) -> &[f64] {
    let column = matrix
        .col(index)
        .try_as_col_major()
        .expect("columns of a column-major matrix are contiguous");
    column.as_slice()
}

/// A column of a matrix whose columns are contiguous.
pub(super) fn column_mut(matrix: MatMut<'_, f64>, index: usize) -> &mut [f64] {
    let column = matrix.col_mut(index).try_as_col_major_mut();
    column
        .expect("columns of a column-major matrix are contiguous")
        .as_slice_mut()
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
