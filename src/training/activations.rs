use faer::{Accum, Mat, MatRef, Par, linalg::matmul::matmul};

use super::{
    Examples,
    elementwise::subtract,
    examples::{BLOCK, Block, column, column_mut},
};
use crate::network::{Mlp, Shape, tanh_in_place};

/// The most memory for keeping the activations of all blocks; above it they are made anew for each use.
const LARGEST_KEPT_BYTES: usize = 16 << 20;

/// What the layers answer for one block; room that is used again for every block.
#[derive(Clone, Debug)]
pub struct Activations {
    /// H̃ = [H, 1]: block × (hidden + 1).
    pub(super) hidden: Mat<f64>,
    /// E = H̃V − T: block × outputs.
    pub(super) errors: Mat<f64>,
}

impl Activations {
    /// Room for a network of this size.
    pub fn new(shape: Shape) -> Self {
        Self {
            hidden: Mat::from_fn(
                BLOCK,
                shape.hidden + 1,
                |_, node| if node < shape.hidden { 0.0 } else { 1.0 },
            ),
            errors: Mat::zeros(BLOCK, shape.outputs),
        }
    }

    /// Runs the network on `block`; returns the sum of squared errors.
    pub(super) fn forward(&mut self, mlp: &Mlp, block: &Block) -> f64 {
        let (shape, samples) = (mlp.shape(), block.samples());
        let (w, v) = mlp.layers();
        let w = MatRef::from_row_major_slice(w, shape.inputs + 1, shape.hidden);
        let v = MatRef::from_row_major_slice(v, shape.hidden + 1, shape.outputs);
        let mut hidden = self.hidden.as_mut().subrows_mut(0, samples);
        matmul(
            hidden.as_mut().subcols_mut(0, shape.hidden),
            Accum::Replace,
            &block.inputs,
            w,
            1.0,
            Par::Seq,
        );
        for node in 0..shape.hidden {
            tanh_in_place(column_mut(hidden.as_mut(), node));
        }
        let mut errors = self.errors.as_mut().subrows_mut(0, samples);
        matmul(errors.as_mut(), Accum::Replace, hidden.as_ref(), v, 1.0, Par::Seq);
        let mut squares = 0.0;
        for output in 0..shape.outputs {
            let targets = column(block.targets.as_ref(), output);
            squares += subtract(column_mut(errors.as_mut(), output), targets);
        }
        squares
    }
}

/// The activations of every block at the weights last evaluated, so that a step that is accepted need not run the
/// network a second time. Where they would take too much memory, room for one block.
#[derive(Debug)]
pub(super) struct KeptActivations {
    blocks: Vec<Activations>,
    /// Whether there is room for one block only, of several.
    made_anew: bool,
    /// The weights evaluated last; empty before the first.
    weights: Vec<f64>,
    squares: f64,
}

impl KeptActivations {
    pub(super) fn new(shape: Shape, examples: &Examples) -> Self {
        let bytes = examples.samples() * (shape.hidden + 1 + shape.outputs) * size_of::<f64>();
        let made_anew = bytes > LARGEST_KEPT_BYTES;
        let blocks = if made_anew { 1 } else { examples.blocks().len() };
        Self {
            blocks: vec![Activations::new(shape); blocks],
            made_anew,
            weights: Vec::new(),
            squares: 0.0,
        }
    }

    /// Runs the network on all examples; returns the sum of squared errors.
    pub(super) fn evaluate(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        if self.weights != mlp.weights() {
            self.squares = 0.0;
            let last = self.blocks.len().saturating_sub(1);
            for (index, block) in examples.blocks().iter().enumerate() {
                self.squares += self.blocks[index.min(last)].forward(mlp, block);
            }
            self.weights.clear();
            self.weights.extend_from_slice(mlp.weights());
        }
        self.squares
    }

    /// The activations of block number `index` at the weights last evaluated, which are those of `mlp`.
    pub(super) fn of(&mut self, index: usize, mlp: &Mlp, block: &Block) -> &Activations {
        if self.made_anew {
            self.blocks[0].forward(mlp, block);
            return &self.blocks[0];
        }
        &self.blocks[index]
    }
}
