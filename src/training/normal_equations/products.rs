use faer::{Accum, Mat, MatMut, MatRef, Par, linalg::matmul::matmul};

use crate::{
    network::{Mlp, Shape},
    training::{
        Evaluation, Examples,
        activations::{Activations, KeptActivations},
        elementwise::{multiply, multiply_into, tanh_slopes_into},
        examples::{BLOCK, Block, column, column_mut},
        input_pairs::InputPairs,
        parallel::add_product,
    },
};

/// The products from which the equations are made, summed over blocks of samples.
///
/// BᵀB is symmetric in the hidden nodes and in the inputs, so it is one product of pairs: (pairs of columns of A)ᵀ ×
/// (pairs of columns of D).
pub(super) struct Products {
    pub(super) shape: Shape,
    /// BᵀB, packed: pairs of inputs × pairs of hidden nodes, pair (i, j ≤ i) at i(i+1)/2 + j.
    pub(super) gram: Mat<f64>,
    /// C: h·n1 × (h+1), column by column without gaps, so that it is also n1 × h(h+1).
    c: Vec<f64>,
    /// H̃ᵀH̃.
    pub(super) g: Mat<f64>,
    /// Jwᵀe: n1 × h.
    pub(super) gradient_w: Mat<f64>,
    /// Jvᵀe: (h+1) × outputs.
    pub(super) gradient_v: Mat<f64>,
    input_pairs: InputPairs,
    room: BlockRoom,
}

/// Room for one block of samples.
struct BlockRoom {
    /// Products of two slopes: block × h(h+1)/2.
    slope_pairs: Mat<f64>,
    /// Dᵢ∘H̃_q: block × h(h+1), column q·h + i; the last h columns are D itself.
    slope_hidden: Mat<f64>,
    /// Error at the hidden nodes' net input: block × h.
    delta: Mat<f64>,
}

impl Products {
    pub(super) fn new(shape: Shape, examples: &Examples) -> Self {
        let (h, n1, h1) = (shape.hidden, shape.inputs + 1, shape.hidden + 1);
        Self {
            shape,
            gram: Mat::zeros(n1 * (n1 + 1) / 2, h * h1 / 2),
            c: vec![0.0; h * n1 * h1],
            g: Mat::zeros(h1, h1),
            gradient_w: Mat::zeros(n1, h),
            gradient_v: Mat::zeros(h1, shape.outputs),
            input_pairs: InputPairs::new(examples),
            room: BlockRoom {
                slope_pairs: Mat::zeros(BLOCK, h * h1 / 2),
                slope_hidden: Mat::zeros(BLOCK, h * h1),
                delta: Mat::zeros(BLOCK, h),
            },
        }
    }

    /// C: h·n1 × (h+1).
    pub(super) fn c(&self) -> MatRef<'_, f64> {
        let h1 = self.shape.hidden + 1;
        MatRef::from_column_major_slice(&self.c, self.shape.hidden_weights(), h1)
    }

    /// Gathers all products at the weights of `mlp`, block by block of samples.
    pub(super) fn gather(&mut self, mlp: &Mlp, examples: &Examples, kept: &mut KeptActivations) -> Evaluation {
        let squares = kept.evaluate(mlp, examples);
        self.gram.fill(0.0);
        self.c.fill(0.0);
        self.g.fill(0.0);
        self.gradient_w.fill(0.0);
        self.gradient_v.fill(0.0);
        for (index, block) in examples.blocks().iter().enumerate() {
            let activations = kept.of(index, mlp, block);
            self.add_second_order(index, block, activations);
            self.add_gradient(mlp, block, activations);
        }
        let length = self.gradient_w.squared_norm_l2() + self.gradient_v.squared_norm_l2();
        Evaluation {
            mse: squares / examples.errors(),
            gradient_norm: 2.0 * length.sqrt() / examples.errors(),
        }
    }

    /// Adds one block to BᵀB, C and H̃ᵀH̃.
    fn add_second_order(&mut self, index: usize, block: &Block, activations: &Activations) {
        let (h, h1, n1) = (self.shape.hidden, self.shape.hidden + 1, self.shape.inputs + 1);
        let samples = block.samples();
        let hidden = activations.hidden.as_ref().subrows(0, samples);
        let mut slope_hidden = self.room.slope_hidden.as_mut().subrows_mut(0, samples);
        fill_slope_products(hidden, slope_hidden.as_mut());
        let slope_hidden = slope_hidden.as_ref();
        let mut slope_pairs = self.room.slope_pairs.as_mut().subrows_mut(0, samples);
        fill_slope_pairs(slope_hidden.subcols(h * h, h), slope_pairs.as_mut());
        let input_pairs = self.input_pairs.of(index, block);
        add_product(self.gram.as_mut(), input_pairs, slope_pairs.as_ref(), 1.0);
        let c = MatMut::from_column_major_slice_mut(&mut self.c, n1, h * h1);
        add_product(c, block.inputs.transpose(), slope_hidden, 1.0);
        add_product(self.g.as_mut(), hidden.transpose(), hidden, 1.0);
    }

    /// Adds one block to Jwᵀe and Jvᵀe; the slopes are still in their room.
    fn add_gradient(&mut self, mlp: &Mlp, block: &Block, activations: &Activations) {
        let Shape { hidden: h, outputs, .. } = self.shape;
        let samples = block.samples();
        let v = MatRef::from_row_major_slice(mlp.layers().1, h + 1, outputs);
        let hidden = activations.hidden.as_ref().subrows(0, samples);
        let errors = activations.errors.as_ref().subrows(0, samples);
        add_product(self.gradient_v.as_mut(), hidden.transpose(), errors, 1.0);
        let mut delta = self.room.delta.as_mut().subrows_mut(0, samples);
        let v_without_bias = v.subrows(0, h).transpose();
        matmul(delta.as_mut(), Accum::Replace, errors, v_without_bias, 1.0, Par::Seq);
        let slopes = self.room.slope_hidden.as_ref().subrows(0, samples).subcols(h * h, h);
        for node in 0..h {
            multiply(column_mut(delta.as_mut(), node), column(slopes, node));
        }
        add_product(self.gradient_w.as_mut(), block.inputs.transpose(), delta.as_ref(), 1.0);
    }
}

/// Fills Dᵢ∘H̃_q = (1 − Hᵢ²)∘H̃_q, column q·h + i, from H̃.
fn fill_slope_products(hidden: MatRef<'_, f64>, products: MatMut<'_, f64>) {
    let h = hidden.ncols() - 1;
    let (mut products, mut slopes) = products.split_at_col_mut(h * h);
    for i in 0..h {
        tanh_slopes_into(column_mut(slopes.as_mut(), i), column(hidden, i));
    }
    for q in 0..h {
        for i in 0..h {
            let product = column_mut(products.as_mut(), q * h + i);
            multiply_into(product, column(slopes.as_ref(), i), column(hidden, q));
        }
    }
}

/// Fills Dᵢ∘Dⱼ, column i(i+1)/2 + j for j ≤ i.
fn fill_slope_pairs(slopes: MatRef<'_, f64>, mut pairs: MatMut<'_, f64>) {
    for i in 0..slopes.ncols() {
        for j in 0..=i {
            let pair = column_mut(pairs.as_mut(), i * (i + 1) / 2 + j);
            multiply_into(pair, column(slopes, i), column(slopes, j));
        }
    }
}
