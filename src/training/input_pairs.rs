use faer::{Mat, MatMut, MatRef};

use super::{
    Examples,
    examples::{BLOCK, Block, column, column_mut},
};

/// The most memory for keeping the pairs of all blocks; above it each block's pairs are made anew every time, which
/// costs a few percent of the product they enter.
const LARGEST_KEPT_BYTES: usize = 32 << 20;

/// Products Aₐ∘A_b of two columns of A = [inputs, 1], a ≥ b: block × n1(n1+1)/2. They never change during training.
#[derive(Debug)]
pub(super) enum InputPairs {
    /// One matrix per block.
    Kept(Vec<Mat<f64>>),
    /// Room for one block.
    Made(Mat<f64>),
}

impl InputPairs {
    pub(super) fn new(examples: &Examples) -> Self {
        let n1 = examples.inputs() + 1;
        let pairs = n1 * (n1 + 1) / 2;
        if examples.samples() * pairs * size_of::<f64>() > LARGEST_KEPT_BYTES {
            return Self::Made(Mat::zeros(BLOCK, pairs));
        }
        let filled = |block: &Block| {
            let mut kept = Mat::zeros(block.samples(), pairs);
            fill(block.inputs.as_ref(), kept.as_mut());
            kept
        };
        Self::Kept(examples.blocks().iter().map(filled).collect())
    }

    /// The pairs of block number `index`.
    pub(super) fn of(&mut self, index: usize, block: &Block) -> MatRef<'_, f64> {
        match self {
            Self::Kept(blocks) => blocks[index].as_ref(),
            Self::Made(room) => {
                fill(block.inputs.as_ref(), room.as_mut().subrows_mut(0, block.samples()));
                room.as_ref().subrows(0, block.samples())
            }
        }
    }

    /// Writes the symmetric n1 × n1 matrix whose lower triangle is packed column by column.
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

fn fill(inputs: MatRef<'_, f64>, mut pairs: MatMut<'_, f64>) {
    let n1 = inputs.ncols();
    let order = (0..n1).flat_map(|b| (b..n1).map(move |a| (a, b)));
    for (pair, (a, b)) in order.enumerate() {
        let factors = column(inputs, a).iter().zip(column(inputs, b));
        for (product, (x, y)) in column_mut(pairs.as_mut(), pair).iter_mut().zip(factors) {
            *product = x * y;
        }
    }
}
