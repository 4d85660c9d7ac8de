//! Products of two input channels, which the factored equations need of every sample.

use faer::{Mat, MatMut, MatRef};

use super::{
    Examples,
    elementwise::scale_into,
    examples::{BLOCK, Block, column_mut},
};

/// Most memory for keeping the pairs of all blocks; above it the pairs are recomputed block by block, which costs a few
/// percent of the product they enter.
const LARGEST_KEPT_BYTES: usize = 32 << 20;

/// Products Aₐ∘A_b of two columns of A = [inputs, 1], a ≥ b: n1(n1+1)/2 × block, so that the pairs of a sample are
/// contiguous and enter the product as they are. They do not change during training.
#[derive(Debug)]
pub(super) enum InputPairs {
    /// One matrix per block, shared by all trainings on these examples.
    Kept(Examples),
    /// Recomputed for each block.
    Recomputed,
}

/// Buffer for the pairs of one block; empty if they are kept.
#[derive(Debug)]
pub(super) struct PairsBuffer {
    pairs: Mat<f64>,
    sample: Vec<f64>,
}

impl Default for PairsBuffer {
    fn default() -> Self {
        Self {
            pairs: Mat::new(),
            sample: Vec::new(),
        }
    }
}

impl InputPairs {
    /// Number of bytes that are kept for this many samples; 0 if their pairs are recomputed.
    pub(super) fn kept_bytes(inputs: usize, samples: usize) -> usize {
        let bytes = samples.saturating_mul(pairs(inputs + 1) * size_of::<f64>());
        if bytes > LARGEST_KEPT_BYTES { 0 } else { bytes }
    }

    pub(super) fn new(examples: &Examples) -> Self {
        if Self::kept_bytes(examples.inputs(), examples.samples()) == 0 {
            return Self::Recomputed;
        }
        kept(examples);
        Self::Kept(examples.clone())
    }

    /// Allocates the buffer for [`Self::of`].
    pub(super) fn buffer(&self, n1: usize) -> PairsBuffer {
        let samples = match self {
            Self::Kept(_) => 0,
            Self::Recomputed => BLOCK,
        };
        PairsBuffer {
            pairs: Mat::zeros(pairs(n1), samples),
            sample: vec![0.0; n1],
        }
    }

    /// Returns the pairs of block number `index`.
    pub(super) fn of<'a>(&'a self, index: usize, block: &Block, buffer: &'a mut PairsBuffer) -> MatRef<'a, f64> {
        match self {
            Self::Kept(examples) => kept(examples)[index].as_ref(),
            Self::Recomputed => {
                let mut pairs = buffer.pairs.as_mut().subcols_mut(0, block.samples());
                fill(block.inputs.as_ref(), &mut buffer.sample, pairs.as_mut());
                buffer.pairs.as_ref().subcols(0, block.samples())
            }
        }
    }

    /// Unpacks the symmetric n1 × n1 matrix whose lower triangle is packed column by column.
    #[inline(always)]
    pub(super) fn unpack(packed: &[f64], n1: usize, square: &mut [f64]) {
        let mut rest = packed;
        for b in 0..n1 {
            let (lower, below) = rest.split_at(n1 - b);
            rest = below;
            square[b * n1 + b..(b + 1) * n1].copy_from_slice(lower);
            for (a, &value) in (b..n1).zip(lower) {
                square[a * n1 + b] = value;
            }
        }
    }
}

/// Number of pairs.
pub(super) fn pairs(n1: usize) -> usize {
    n1 * (n1 + 1) / 2
}

/// Returns the pairs of all blocks, computed on the first call.
fn kept(examples: &Examples) -> &[Mat<f64>] {
    examples.input_pairs(|block| {
        let n1 = block.inputs.ncols();
        let mut sample = vec![0.0; n1];
        let mut kept = Mat::zeros(pairs(n1), block.samples());
        fill(block.inputs.as_ref(), &mut sample, kept.as_mut());
        kept
    })
}

fn fill(inputs: MatRef<'_, f64>, sample: &mut [f64], mut pairs: MatMut<'_, f64>) {
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
