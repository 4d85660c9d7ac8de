//! The Schur complement S on W, formed and factored.

use faer::{
    Mat, MatMut, MatRef, Par,
    linalg::{
        triangular_inverse::invert_lower_triangular,
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::{
    Classes,
    cholesky::{Cholesky, substitute},
    classes::{HIDDEN_BIASES, HIDDEN_WEIGHTS},
    elimination::{Elimination, fill, output_weights},
    products::Sums,
};
use crate::{
    network::{Mlp, Shape},
    training::{
        examples::{column, column_mut},
        parallel::{is_large, product},
    },
};

/// Solver with the Cholesky factor of S, in memory that is reused for every damping.
pub(super) struct SchurComplement {
    shape: Shape,
    /// S, then its Cholesky factor; the lower triangle.
    s: Mat<f64>,
    /// Unpacked n1 × n1 block of BᵀB for each hidden node.
    squares: Vec<f64>,
    cholesky: Cholesky,
    /// L⁻¹ and L⁻¹ Rₜ, allocated on first use.
    inverse: Option<(Mat<f64>, Mat<f64>)>,
}

impl SchurComplement {
    pub(super) fn new(shape: Shape) -> Self {
        let order = shape.hidden_weights();
        Self {
            shape,
            s: Mat::zeros(order, order),
            squares: vec![0.0; order * (shape.inputs + 1)],
            cholesky: Cholesky::new(order),
            inverse: None,
        }
    }

    /// Factors S for a damping of W; `None` if it is not numerically positive definite.
    pub(super) fn factor(&mut self, sums: &Sums, elimination: &Elimination, mlp: &Mlp, damping: Classes) -> Option<()> {
        let (n1, order) = (self.shape.inputs + 1, self.s.nrows());
        let (mut panels, mut rest) = (Vec::new(), self.s.as_mut());
        for (node, square) in self.squares.chunks_exact_mut(n1 * n1).enumerate() {
            let (columns, others) = rest.split_at_col_mut(n1);
            rest = others;
            panels.push(Panel {
                gram: sums.gram.as_ref(),
                v: output_weights(mlp),
                f: elimination.f.as_ref().subrows(node * n1, order - node * n1),
                node,
                s: columns.subrows_mut(node * n1, order - node * n1),
                square,
            });
        }
        if is_large(order * order * n1) {
            panels.into_par_iter().for_each(Panel::fill);
        } else {
            panels.into_iter().for_each(Panel::fill);
        }
        for index in 0..order {
            let is_bias = index % n1 == self.shape.inputs;
            self.s[(index, index)] += damping[if is_bias { HIDDEN_BIASES } else { HIDDEN_WEIGHTS }];
        }
        self.cholesky.factor(self.s.as_mut())
    }

    /// Replaces the right-hand side of the hidden layer by its solution.
    pub(super) fn solve(&self, right: &mut [f64]) {
        let order = right.len();
        substitute(self.s.as_ref(), MatMut::from_column_major_slice_mut(right, order, 1));
    }

    /// Returns the trace of the inverse of the whole matrix last factored. From the blocks of the inverse it is `tr S⁻¹
    /// + m tr G⁻¹ + Σₜ tr S⁻¹ Rₜ Rₜᵀ` with Rₜ = diag(V̄ₜ ⊗ 1) C G⁻¹; with the factors S = L Lᵀ and G = Lg Lgᵀ this is
    /// `‖L⁻¹‖² + m ‖Lg⁻¹‖² + Σₜ ‖L⁻¹ Rₜ‖²` (Frobenius norms).
    pub(super) fn trace_of_inverse(&mut self, elimination: &mut Elimination, mlp: &Mlp) -> f64 {
        let squares = |matrix: &Mat<f64>| -> f64 {
            let columns = (0..matrix.ncols()).flat_map(|index| &column(matrix.as_ref(), index)[index..]);
            columns.map(|value| value * value).sum()
        };
        let of_g = squares(&inverse(elimination.g_factor.as_ref()));
        let mut trace = squares(self.inverse()) + self.shape.outputs as f64 * of_g;
        self.for_each_output(elimination, mlp, |r| trace += r.squared_norm_l2());
        trace
    }

    /// As [`Self::trace_of_inverse`], class by class: diagonal entry k is the squared norm of column k of L⁻¹, or of
    /// Lg⁻¹ and L⁻¹ Rₜ.
    pub(super) fn traces_of_inverse(&mut self, elimination: &mut Elimination, mlp: &Mlp) -> Traces {
        let Shape { inputs, hidden, .. } = self.shape;
        let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        let (s, g) = (self.inverse(), inverse(elimination.g_factor.as_ref()));
        let mut traces = Traces::default();
        for index in 0..s.ncols() {
            let is_bias = index % (inputs + 1) == inputs;
            let class = if is_bias {
                &mut traces.hidden_biases
            } else {
                &mut traces.hidden_weights
            };
            *class += square(&column(s.as_ref(), index)[index..]);
        }
        let of_node = Vec::from_iter((0..=hidden).map(|node| square(&column(g.as_ref(), node)[node..])));
        self.for_each_output(elimination, mlp, |r| {
            let of_node = |node| of_node[node] + square(column(r, node));
            traces.outputs.push(OutputTraces {
                weights: (0..hidden).map(of_node).sum(),
                bias: of_node(hidden),
            });
        });
        traces
    }

    /// Returns L⁻¹.
    fn inverse(&mut self) -> &Mat<f64> {
        let (order, h1) = (self.s.nrows(), self.shape.hidden + 1);
        let allocate = || (Mat::zeros(order, order), Mat::zeros(order, h1));
        let (inverse, _) = self.inverse.get_or_insert_with(allocate);
        invert_lower_triangular(inverse.as_mut(), self.s.as_ref(), Par::Seq);
        inverse
    }

    /// Calls `add` with L⁻¹ Rₜ for every output, after [`Self::inverse`]; turns F into C G⁻¹.
    fn for_each_output(&mut self, elimination: &mut Elimination, mlp: &Mlp, mut add: impl FnMut(MatRef<'_, f64>)) {
        let (v, n1) = (output_weights(mlp), self.shape.inputs + 1);
        let Elimination { g_factor, f, .. } = elimination;
        solve_upper_triangular_in_place(g_factor.as_ref().transpose(), f.as_mut().transpose_mut(), Par::Seq);
        let Some((_, r)) = &mut self.inverse else {
            return;
        };
        for output in 0..self.shape.outputs {
            fill(r.as_mut(), |index, column| v[(index / n1, output)] * f[(index, column)]);
            solve_lower_triangular_in_place(self.s.as_ref(), r.as_mut(), Par::Seq);
            add(r.as_ref());
        }
    }
}

/// Returns the inverse of a lower triangular matrix.
fn inverse(lower: MatRef<'_, f64>) -> Mat<f64> {
    let mut inverse = Mat::zeros(lower.nrows(), lower.ncols());
    invert_lower_triangular(inverse.as_mut(), lower, Par::Seq);
    inverse
}

/// Contributions of weights to the trace of an inverse.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::training) struct Traces {
    pub(in crate::training) hidden_weights: f64,
    pub(in crate::training) hidden_biases: f64,
    /// Of the weights of each output.
    pub(in crate::training) outputs: Vec<OutputTraces>,
}

/// Contributions of the weights of one output to the trace of an inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::training) struct OutputTraces {
    pub(in crate::training) weights: f64,
    pub(in crate::training) bias: f64,
}

impl Traces {
    /// Sums over the weights of each class.
    pub(in crate::training) fn classes(&self) -> Classes {
        let of_outputs = |of: fn(&OutputTraces) -> f64| self.outputs.iter().map(of).sum();
        [
            self.hidden_weights,
            self.hidden_biases,
            of_outputs(|output| output.weights),
            of_outputs(|output| output.bias),
        ]
    }
}

/// Columns of S of one hidden node, from the diagonal block down, except for the damping: (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − F Fᵀ).
struct Panel<'a> {
    /// BᵀB, packed: [`Plan::gram`](super::Plan).
    gram: MatRef<'a, f64>,
    /// V̄.
    v: MatRef<'a, f64>,
    /// Rows of F from `node` on.
    f: MatRef<'a, f64>,
    node: usize,
    s: MatMut<'a, f64>,
    /// Buffer of n1 × n1.
    square: &'a mut [f64],
}

impl Panel<'_> {
    fn fill(mut self) {
        let right = self.f.subrows(0, self.s.ncols()).transpose();
        product(self.s.as_mut(), self.f, right);
        pulp::Arch::new().dispatch(self);
    }
}

/// Turns F Fᵀ in `s` into S. A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
impl WithSimd for Panel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            gram,
            v,
            node: first,
            mut s,
            square,
            ..
        } = self;
        let n1 = s.ncols();
        for node in first..v.nrows() {
            unpack(column(gram, node * (node + 1) / 2 + first), n1, square);
            let products = v.row(node).iter().zip(v.row(first).iter());
            let weight: f64 = products.map(|(a, b)| a * b).sum();
            let top = (node - first) * n1;
            for b in 0..n1 {
                let start = if node == first { b } else { 0 };
                let values = &mut column_mut(s.as_mut(), b)[top + start..top + n1];
                for (value, product) in values.iter_mut().zip(&square[b * n1 + start..(b + 1) * n1]) {
                    *value = weight * (product - *value);
                }
            }
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
