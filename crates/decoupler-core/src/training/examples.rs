//! Training samples in blocks, and the products of two input channels that the factored equations need for every
//! sample.

use std::{
    fmt::Debug,
    ops::Range,
    sync::{Arc, OnceLock},
};

use faer::{Mat, MatMut, MatRef};
use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::activations::scale_into;

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

/// Samples, shared by all trainings on them.
#[derive(Debug)]
struct Data {
    blocks: Vec<Block>,
    /// Products of two input columns, block by block, computed on demand.
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
    fn new(inputs: ArrayView2<'_, f64>, targets: ArrayView2<'_, f64>) -> Self {
        let (samples, n) = inputs.dim();
        Self {
            inputs: Mat::from_fn(samples, n + 1, |s, i| if i < n { inputs[[s, i]] } else { 1.0 }),
            targets: Mat::from_fn(samples, targets.ncols(), |s, t| targets[[s, t]]),
        }
    }

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
        let shape = (inputs.nrows(), inputs.ncols(), targets.ncols());
        Self::from_blocks(shape, |samples| {
            let chunk = Slice::from(samples);
            Block::new(inputs.slice_axis(Axis(0), chunk), targets.slice_axis(Axis(0), chunk))
        })
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
        assert_eq!(readings.nrows(), values.nrows());
        let scaled = |samples: Range<usize>| {
            let chunk = Slice::from(samples);
            (
                inputs(readings.slice_axis(Axis(0), chunk)),
                targets(values.slice_axis(Axis(0), chunk)),
            )
        };
        let (x, y) = scaled(0..0);
        let shape = (readings.nrows(), x.ncols(), y.ncols());
        Self::from_blocks(shape, |samples| {
            let (x, y) = scaled(samples);
            Block::new(x.view(), y.view())
        })
    }

    /// Collects the blocks of samples × inputs and samples × outputs.
    fn from_blocks(
        (samples, inputs, outputs): (usize, usize, usize),
        mut block: impl FnMut(Range<usize>) -> Block,
    ) -> Self {
        let firsts = (0..samples).step_by(BLOCK);
        Self {
            data: Arc::new(Data {
                blocks: firsts.map(|first| block(first..samples.min(first + BLOCK))).collect(),
                input_pairs: OnceLock::new(),
            }),
            samples,
            inputs,
            outputs,
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
        &self.data.blocks
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

/// Buffer for the pairs of inputs of one block; empty if they are kept.
#[derive(Debug)]
pub(super) struct PairsBuffer {
    pairs: Mat<f64>,
    sample: Vec<f64>,
}

impl PairsBuffer {
    /// Creates a buffer for equations that do not use the pairs.
    pub(super) fn unused() -> Self {
        Self {
            pairs: Mat::new(),
            sample: Vec::new(),
        }
    }
}

/// Products Aₐ∘A_b of two columns of A = [inputs, 1], a ≥ b: n1(n1+1)/2 × block, so that the pairs of a sample are
/// contiguous and can be used in a product directly. They do not change during training, so those of a small set are
/// kept, shared by all trainings on it; recomputing them costs a few percent of the product in which they are used.
impl Examples {
    /// Number of bytes kept for this many samples; 0 if their pairs are recomputed.
    pub(super) fn kept_pairs_bytes(inputs: usize, samples: usize) -> usize {
        const MAX_BYTES: usize = 32 << 20;
        let bytes = samples.saturating_mul(pairs(inputs + 1) * size_of::<f64>());
        if bytes > MAX_BYTES { 0 } else { bytes }
    }

    fn keeps_pairs(&self) -> bool {
        Self::kept_pairs_bytes(self.inputs, self.samples) > 0
    }

    /// Allocates the buffer for [`Self::input_pairs`].
    pub(super) fn pairs_buffer(&self) -> PairsBuffer {
        let samples = if self.keeps_pairs() { 0 } else { BLOCK };
        PairsBuffer {
            pairs: Mat::zeros(pairs(self.inputs + 1), samples),
            sample: vec![0.0; self.inputs + 1],
        }
    }

    /// Returns the pairs of block number `index`.
    pub(super) fn input_pairs<'a>(&'a self, index: usize, buffer: &'a mut PairsBuffer) -> MatRef<'a, f64> {
        let PairsBuffer { pairs: matrix, sample } = buffer;
        if self.keeps_pairs() {
            // Must not wait for other threads, which may be waiting here.
            let kept = self.data.input_pairs.get_or_init(|| {
                let of_block = |block: &Block| {
                    let mut matrix = Mat::zeros(pairs(self.inputs + 1), block.samples());
                    fill_pairs(block.inputs.as_ref(), sample, matrix.as_mut());
                    matrix
                };
                self.blocks().iter().map(of_block).collect()
            });
            return kept[index].as_ref();
        }
        let block = &self.blocks()[index];
        fill_pairs(
            block.inputs.as_ref(),
            sample,
            matrix.as_mut().subcols_mut(0, block.samples()),
        );
        matrix.as_ref().subcols(0, block.samples())
    }
}

/// Number of pairs of `n1` columns.
pub(super) fn pairs(n1: usize) -> usize {
    n1 * (n1 + 1) / 2
}

fn fill_pairs(inputs: MatRef<'_, f64>, sample: &mut [f64], mut pairs: MatMut<'_, f64>) {
    let n1 = inputs.ncols();
    for index in 0..inputs.nrows() {
        for (value, input) in sample.iter_mut().zip(inputs.row(index).iter()) {
            *value = *input;
        }
        let mut rest = column_mut(pairs.as_mut(), index);
        for b in 0..n1 {
            let (products, below) = rest.split_at_mut(n1 - b);
            scale_into(products, sample[b], &sample[b..]);
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
