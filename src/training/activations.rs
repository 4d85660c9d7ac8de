use std::ops::Range;

use faer::{Accum, Mat, MatRef, Par, linalg::matmul::matmul};

use super::{
    Examples,
    elementwise::subtract,
    examples::{BLOCK, Block, column, column_mut},
    parallel::{for_each_part, parts},
};
use crate::network::{Mlp, Shape, tanh_in_place};

/// The most memory for keeping the activations of all blocks; above it they are made anew for each use.
const LARGEST_KEPT_BYTES: usize = 32 << 20;

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
/// network a second time. Where they would take too much memory, room for one block of each part of the samples.
#[derive(Debug)]
pub(super) struct KeptActivations {
    /// One for each block, or one for each part.
    rooms: Vec<Activations>,
    made_anew: bool,
    parts: usize,
    /// The weights evaluated last; empty before the first.
    weights: Vec<f64>,
    squares: f64,
}

impl KeptActivations {
    /// Room for samples that are worked on in up to `parts` parts.
    pub(super) fn new(shape: Shape, examples: &Examples, parts: usize) -> Self {
        let bytes = examples.samples() * (shape.hidden + 1 + shape.outputs) * size_of::<f64>();
        let made_anew = bytes > LARGEST_KEPT_BYTES;
        let rooms = if made_anew { parts } else { examples.blocks().len() };
        Self {
            rooms: vec![Activations::new(shape); rooms],
            made_anew,
            parts,
            weights: Vec::new(),
            squares: 0.0,
        }
    }

    /// Runs the network on all examples; returns the sum of squared errors.
    pub(super) fn evaluate(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        if self.weights != mlp.weights() {
            self.squares = self.run(mlp, examples);
            self.weights.clear();
            self.weights.extend_from_slice(mlp.weights());
        }
        self.squares
    }

    fn run(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        let blocks = examples.blocks();
        let mut rooms = self.rooms.as_mut_slice();
        let part = |blocks: Range<usize>| {
            let count = if self.made_anew { 1 } else { blocks.len() };
            let (own, others) = std::mem::take(&mut rooms).split_at_mut(count);
            rooms = others;
            (blocks, own, 0.0)
        };
        let mut parts: Vec<_> = parts(blocks.len(), self.parts).map(part).collect();
        for_each_part(&mut parts, |(numbers, rooms, squares)| {
            for (index, block) in blocks[numbers.clone()].iter().enumerate() {
                *squares += rooms[index % rooms.len()].forward(mlp, block);
            }
        });
        parts.iter().map(|(.., squares)| squares).sum()
    }

    /// Does `work` for every block at the weights last evaluated, which are those of `mlp`. The samples are divided into
    /// as many parts as there are `sums`, and the blocks of each part, in order, come with that part's own.
    pub(super) fn for_each_block<S: Send>(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        sums: &mut [S],
        work: impl Fn(&mut S, &BlockNow<'_>) + Sync + Send,
    ) {
        let numbers = parts(examples.blocks().len(), sums.len());
        if self.made_anew {
            let mut parts: Vec<_> = numbers.zip(sums).zip(&mut self.rooms).collect();
            for_each_part(&mut parts, |((numbers, sums), activations)| {
                for number in numbers.clone() {
                    activations.forward(mlp, &examples.blocks()[number]);
                    work(sums, &BlockNow::new(examples, number, activations));
                }
            });
        } else {
            let mut parts: Vec<_> = numbers.zip(sums).collect();
            for_each_part(&mut parts, |(numbers, sums)| {
                for number in numbers.clone() {
                    work(sums, &BlockNow::new(examples, number, &self.rooms[number]));
                }
            });
        }
    }
}

/// A block of samples with what the network makes of it.
pub(super) struct BlockNow<'a> {
    /// Which block, from 0.
    pub(super) number: usize,
    pub(super) block: &'a Block,
    activations: &'a Activations,
}

impl<'a> BlockNow<'a> {
    fn new(examples: &'a Examples, number: usize, activations: &'a Activations) -> Self {
        Self {
            number,
            block: &examples.blocks()[number],
            activations,
        }
    }

    /// H̃: samples × (hidden + 1).
    pub(super) fn hidden(&self) -> MatRef<'_, f64> {
        self.activations.hidden.as_ref().subrows(0, self.block.samples())
    }

    /// E: samples × outputs.
    pub(super) fn errors(&self) -> MatRef<'_, f64> {
        self.activations.errors.as_ref().subrows(0, self.block.samples())
    }
}
