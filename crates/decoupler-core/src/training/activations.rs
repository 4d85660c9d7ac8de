//! Outputs and errors of the layers, block by block of samples; elementwise products of columns, dispatched to the
//! machine's SIMD instructions; and the gradient of the mean squared error.

use std::ops::Range;

use faer::{Mat, MatMut, MatRef};

use super::{
    Evaluation, Examples,
    examples::{BLOCK, Block, column, column_mut},
    parallel::{accumulate, for_each_part, parts, product},
};
use crate::network::{Mlp, Shape, tanh_in_place};

/// Maximum memory for keeping the activations of all blocks; above it they are recomputed for each use.
const MAX_KEPT_BYTES: usize = 32 << 20;

/// Hidden outputs and errors of one block, in memory that is reused for every block.
#[derive(Clone, Debug)]
pub(super) struct Activations {
    /// H̃ = [H, 1]: block × (hidden + 1).
    hidden: Mat<f64>,
    /// E = H̃V − T: block × outputs.
    errors: Mat<f64>,
}

impl Activations {
    /// Allocates for a network of this shape.
    pub(super) fn new(shape: Shape) -> Self {
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
        product(hidden.as_mut().subcols_mut(0, shape.hidden), block.inputs.as_ref(), w);
        for node in 0..shape.hidden {
            tanh_in_place(column_mut(hidden.as_mut(), node));
        }
        let mut errors = self.errors.as_mut().subrows_mut(0, samples);
        product(errors.as_mut(), hidden.as_ref(), v);
        let mut squares = 0.0;
        for output in 0..shape.outputs {
            let targets = column(block.targets.as_ref(), output);
            squares += subtract(column_mut(errors.as_mut(), output), targets);
        }
        squares
    }

    /// H̃ of `block`, on which the network was run last: samples × (hidden + 1).
    pub(super) fn hidden(&self, block: &Block) -> MatRef<'_, f64> {
        self.hidden.as_ref().subrows(0, block.samples())
    }

    /// E of `block`, on which the network was run last: samples × outputs.
    pub(super) fn errors(&self, block: &Block) -> MatRef<'_, f64> {
        self.errors.as_ref().subrows(0, block.samples())
    }

    /// Returns the mean squared error of `mlp` over samples and outputs.
    pub(super) fn mse(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        let squares = examples.blocks().iter().map(|block| self.forward(mlp, block));
        squares.sum::<f64>() / examples.errors()
    }
}

/// Activations of every block at the weights last evaluated, so that the network is not run a second time when a step
/// is accepted. If they would take too much memory, only one buffer of a block is kept for each part of the samples.
#[derive(Debug)]
pub(super) struct KeptActivations {
    /// One for each block, or one for each part.
    buffers: Vec<Activations>,
    recomputed: bool,
    parts: usize,
    /// Weights evaluated last; empty before the first evaluation.
    weights: Vec<f64>,
    squares: f64,
}

impl KeptActivations {
    /// Approximate number of bytes kept for this many samples; 0 if they would be too many.
    pub(super) fn bytes(shape: Shape, samples: usize) -> usize {
        let bytes = samples.saturating_mul((shape.hidden + 1 + shape.outputs) * size_of::<f64>());
        if bytes > MAX_KEPT_BYTES { 0 } else { bytes }
    }

    /// Allocates for samples processed in up to `parts` parts.
    pub(super) fn new(shape: Shape, examples: &Examples, parts: usize) -> Self {
        let recomputed = Self::bytes(shape, examples.samples()) == 0;
        let count = if recomputed { parts } else { examples.blocks().len() };
        Self {
            buffers: vec![Activations::new(shape); count],
            recomputed,
            parts,
            weights: Vec::new(),
            squares: 0.0,
        }
    }

    /// Runs the network on all examples; returns the sum of squared errors.
    pub(super) fn evaluate(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        if self.weights != mlp.weights() {
            let mut squares = vec![0.0; self.parts];
            self.for_each_part(examples, &mut squares, |squares, block, activations| {
                *squares += activations.forward(mlp, block);
            });
            self.squares = squares.iter().sum();
            mlp.weights().clone_into(&mut self.weights);
        }
        self.squares
    }

    /// Runs the network on all examples; returns the sum of squared errors of each output.
    pub(super) fn squares_of_outputs(&mut self, mlp: &Mlp, examples: &Examples) -> Vec<f64> {
        self.evaluate(mlp, examples);
        let mut parts = vec![vec![0.0; examples.outputs()]; self.parts];
        self.for_each_block(mlp, examples, &mut parts, |sums, block, now| {
            for (sum, errors) in sums.iter_mut().zip(now.errors(block).col_iter()) {
                *sum += errors.squared_norm_l2();
            }
        });
        let of_output = |output: usize| parts.iter().map(|sums| sums[output]).sum();
        (0..examples.outputs()).map(of_output).collect()
    }

    /// Calls `work` for every block at the weights last evaluated, which are those of `mlp`. The samples are divided
    /// into as many parts as there are `sums`; `work` gets the blocks of each part in order, together with its sums.
    pub(super) fn for_each_block<S: Send>(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        sums: &mut [S],
        work: impl Fn(&mut S, &Block, &Activations) + Sync + Send,
    ) {
        let recomputed = self.recomputed;
        self.for_each_part(examples, sums, |sums, block, activations| {
            if recomputed {
                activations.forward(mlp, block);
            }
            work(sums, block, activations);
        });
    }

    /// Divides the blocks into as many parts as there are `sums`; calls `work` with the sums of the part, each block, and
    /// its buffer.
    fn for_each_part<S: Send>(
        &mut self,
        examples: &Examples,
        sums: &mut [S],
        work: impl Fn(&mut S, &Block, &mut Activations) + Sync + Send,
    ) {
        let mut buffers = self.buffers.as_mut_slice();
        let part = |(blocks, sums): (Range<usize>, _)| {
            let count = if self.recomputed { 1 } else { blocks.len() };
            let (own, others) = std::mem::take(&mut buffers).split_at_mut(count);
            buffers = others;
            (&examples.blocks()[blocks], own, sums)
        };
        let divided = parts(examples.blocks().len(), sums.len()).zip(sums);
        let mut parts: Vec<_> = divided.map(part).collect();
        for_each_part(&mut parts, |(blocks, own, sums)| {
            for (index, block) in blocks.iter().enumerate() {
                work(sums, block, &mut own[index % own.len()]);
            }
        });
    }
}

/// Writes `a ∘ b`.
pub(super) fn multiply_into(product: &mut [f64], a: &[f64], b: &[f64]) {
    pulp::Arch::new().dispatch(|| {
        for ((product, a), b) in product.iter_mut().zip(a).zip(b) {
            *product = a * b;
        }
    });
}

/// Calls `change` with each value and its partner in `others`.
pub(super) fn change_each(values: &mut [f64], others: &[f64], change: impl Fn(&mut f64, f64)) {
    pulp::Arch::new().dispatch(|| {
        for (value, other) in values.iter_mut().zip(others) {
            change(value, *other);
        }
    });
}

/// Multiplies `values` (samples × hidden) by the derivatives of tanh where its values are `hidden`: 1 − h².
pub(super) fn multiply_by_tanh_slopes(mut values: MatMut<'_, f64>, hidden: MatRef<'_, f64>) {
    for node in 0..values.ncols() {
        let values = column_mut(values.as_mut(), node);
        change_each(values, column(hidden, node), |value, h| *value *= 1.0 - h * h);
    }
}

/// Subtracts `targets` from `outputs`; returns the sum of squares, in eight partial sums of fixed order.
fn subtract(outputs: &mut [f64], targets: &[f64]) -> f64 {
    const LANES: usize = 8;
    change_each(outputs, targets, |output, target| *output -= target);
    let (chunks, rest) = outputs.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for errors in chunks {
        for lane in 0..LANES {
            sums[lane] += errors[lane] * errors[lane];
        }
    }
    for (sum, error) in sums.iter_mut().zip(rest) {
        *sum += error * error;
    }
    sums.iter().sum()
}

/// Adds `factor`·Jᵀe of a block of samples to `gradient`, in the order of [`Mlp::weights`], by back-propagation (section 3.1
/// of the paper) through the weights `v` of the output layer. `add` adds a product; `delta` is a buffer for the errors at the
/// hidden nodes' net input: block × hidden.
pub(super) fn add_gradient(
    gradient: &mut [f64],
    factor: f64,
    (shape, v): (Shape, &[f64]),
    (block, now): (&Block, &Activations),
    delta: MatMut<'_, f64>,
    add: impl Fn(MatMut<'_, f64>, MatRef<'_, f64>, MatRef<'_, f64>, f64),
) {
    let (gradient_w, gradient_v) = gradient.split_at_mut(shape.hidden_weights());
    let gradient_w = MatMut::from_row_major_slice_mut(gradient_w, shape.inputs + 1, shape.hidden);
    let gradient_v = MatMut::from_row_major_slice_mut(gradient_v, shape.hidden + 1, shape.outputs);
    let v = MatRef::from_row_major_slice(v, shape.hidden + 1, shape.outputs);
    let (hidden, errors) = (now.hidden(block), now.errors(block));
    add(gradient_v, hidden.transpose(), errors, factor);
    let mut delta = delta.subrows_mut(0, block.samples());
    product(delta.as_mut(), errors, v.subrows(0, shape.hidden).transpose());
    multiply_by_tanh_slopes(delta.as_mut(), hidden);
    add(gradient_w, block.inputs.transpose(), delta.as_ref(), factor);
}

/// Computes the gradient of the mean squared error.
#[derive(Clone, Debug)]
pub(super) struct Backpropagation {
    activations: Activations,
    /// Error at the hidden nodes' net input: block × hidden.
    delta: Mat<f64>,
    /// ∂mse/∂weights, in the order of [`Mlp::weights`].
    pub(super) gradient: Vec<f64>,
}

impl Backpropagation {
    pub(super) fn new(mlp: &Mlp) -> Self {
        Self {
            activations: Activations::new(mlp.shape()),
            delta: Mat::zeros(BLOCK, mlp.shape().hidden),
            gradient: vec![0.0; mlp.shape().weights()],
        }
    }

    /// Returns the error at the weights of `mlp` and computes its gradient.
    pub(super) fn evaluate(&mut self, mlp: &Mlp, examples: &Examples) -> Evaluation {
        self.gradient.fill(0.0);
        let (output_layer, per_error) = ((mlp.shape(), mlp.layers().1), 2.0 / examples.errors());
        let mut squares = 0.0;
        for block in examples.blocks() {
            squares += self.activations.forward(mlp, block);
            let (now, delta) = ((block, &self.activations), self.delta.as_mut());
            add_gradient(&mut self.gradient, per_error, output_layer, now, delta, accumulate);
        }
        Evaluation {
            mse: squares / examples.errors(),
            gradient_norm: self.gradient.iter().map(|g| g * g).sum::<f64>().sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::training::examples::tests::random_mlp;

    #[test]
    fn the_error_agrees_with_the_network() {
        let mlp = random_mlp(3, 5, 2, 1);
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut draw = |columns| Array2::from_shape_simple_fn((BLOCK * 2 + 7, columns), || rng.random_range(-1.0..1.0));
        let (inputs, targets) = (draw(3), draw(2));
        let expected = (mlp.forward(inputs.view()) - &targets).mapv(|e| e * e).mean().unwrap();
        let mse = Activations::new(mlp.shape()).mse(&mlp, &Examples::new(inputs.view(), targets.view()));
        assert!((mse - expected).abs() < 1e-14);
    }
}
