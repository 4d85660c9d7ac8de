use faer::{Mat, MatMut, MatRef};

use super::{
    Examples,
    elementwise::scale_into,
    examples::{BLOCK, Block, column_mut},
};

/// The most memory for keeping the pairs of all blocks; above it each block's pairs are made anew every time, which
/// costs a few percent of the product they enter.
const LARGEST_KEPT_BYTES: usize = 32 << 20;

/// Products Aₐ∘A_b of two columns of A = [inputs, 1], a ≥ b: n1(n1+1)/2 × block, so that the pairs of a
/// sample are contiguous and enter the product as they are. They never change during training.
#[derive(Debug)]
pub(super) enum InputPairs {
    /// One matrix per block, shared by all trainings on these examples.
    Kept(Examples),
    /// Room for one block, and for one sample of it.
    Made(Mat<f64>, Vec<f64>),
}

impl InputPairs {
    pub(super) fn new(examples: &Examples) -> Self {
        let n1 = examples.inputs() + 1;
        let pairs = n1 * (n1 + 1) / 2;
        if examples.samples() * pairs * size_of::<f64>() > LARGEST_KEPT_BYTES {
            return Self::Made(Mat::zeros(pairs, BLOCK), vec![0.0; n1]);
        }
        kept(examples);
        Self::Kept(examples.clone())
    }

    /// The pairs of block number `index`.
    pub(super) fn of(&mut self, index: usize, block: &Block) -> MatRef<'_, f64> {
        match self {
            Self::Kept(examples) => kept(examples)[index].as_ref(),
            Self::Made(room, sample) => {
                fill(
                    block.inputs.as_ref(),
                    sample,
                    room.as_mut().subcols_mut(0, block.samples()),
                );
                room.as_ref().subcols(0, block.samples())
            }
        }
    }

    /// Writes the symmetric n1 × n1 matrix whose lower triangle is packed column by column.
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

/// The pairs of all blocks, made when first asked for.
fn kept(examples: &Examples) -> &[Mat<f64>] {
    examples.input_pairs(|block| {
        let n1 = block.inputs.ncols();
        let mut sample = vec![0.0; n1];
        let mut pairs = Mat::zeros(n1 * (n1 + 1) / 2, block.samples());
        fill(block.inputs.as_ref(), &mut sample, pairs.as_mut());
        pairs
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
