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
}

impl SchurComplement {
    pub(super) fn new(shape: Shape) -> Self {
        let order = shape.hidden_weights();
        Self {
            shape,
            s: Mat::zeros(order, order),
            squares: vec![0.0; order * (shape.inputs + 1)],
            cholesky: Cholesky::new(order),
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

    /// Returns the diagonal of the inverse of the whole matrix last factored, summed over classes of weights; turns F
    /// into C G⁻¹. From the blocks of the inverse its trace is `tr S⁻¹ + m tr G⁻¹ + Σₜ tr S⁻¹ Rₜ Rₜᵀ` with
    /// Rₜ = diag(V̄ₜ ⊗ 1) C G⁻¹; with the factors S = L Lᵀ and G = Lg Lgᵀ this is `‖L⁻¹‖² + m ‖Lg⁻¹‖² + Σₜ ‖L⁻¹ Rₜ‖²`
    /// (Frobenius norms), column by column.
    pub(super) fn traces_of_inverse(&self, elimination: &mut Elimination, mlp: &Mlp) -> Traces {
        let (Shape { hidden, outputs, .. }, n1) = (self.shape, self.shape.inputs + 1);
        let Elimination { g_factor, f, .. } = elimination;
        let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        let lower = |matrix: &Mat<f64>, index: usize| square(&column(matrix.as_ref(), index)[index..]);
        let (s, g) = (inverse(self.s.as_ref()), inverse(g_factor.as_ref()));
        let mut of_hidden = [0.0; 2];
        for index in 0..s.ncols() {
            of_hidden[usize::from(index % n1 + 1 == n1)] += lower(&s, index);
        }
        let of_node = Vec::from_iter((0..=hidden).map(|node| lower(&g, node)));
        solve_upper_triangular_in_place(g_factor.as_ref().transpose(), f.as_mut().transpose_mut(), Par::Seq);
        let (v, mut r) = (output_weights(mlp), Mat::zeros(s.nrows(), hidden + 1));
        let of_output = |output| {
            fill(r.as_mut(), |index, column| v[(index / n1, output)] * f[(index, column)]);
            solve_lower_triangular_in_place(self.s.as_ref(), r.as_mut(), Par::Seq);
            let of_node = |node| of_node[node] + square(column(r.as_ref(), node));
            [(0..hidden).map(of_node).sum(), of_node(hidden)]
        };
        Traces {
            hidden: of_hidden,
            outputs: (0..outputs).map(of_output).collect(),
        }
    }
}

/// Returns the inverse of a lower triangular matrix.
fn inverse(lower: MatRef<'_, f64>) -> Mat<f64> {
    let mut inverse = Mat::zeros(lower.nrows(), lower.ncols());
    invert_lower_triangular(inverse.as_mut(), lower, Par::Seq);
    inverse
}

/// Contributions of weights and of biases to the trace of an inverse.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::training) struct Traces {
    pub(in crate::training) hidden: [f64; 2],
    /// Of each output.
    pub(in crate::training) outputs: Vec<[f64; 2]>,
}

impl Traces {
    /// Sums over the weights of each class.
    pub(in crate::training) fn classes(&self) -> Classes {
        let of_outputs = |class: usize| self.outputs.iter().map(|output| output[class]).sum();
        [self.hidden[0], self.hidden[1], of_outputs(0), of_outputs(1)]
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
