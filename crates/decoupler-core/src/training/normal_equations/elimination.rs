//! Elimination of the output layer from the equations, and the Schur complement S that remains on W.

use faer::{
    Mat, MatMut, MatRef, Par,
    linalg::{
        triangular_inverse::invert_lower_triangular,
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
};
use rayon::prelude::*;

use super::{Classes, HIDDEN_BIASES, HIDDEN_WEIGHTS, OUTPUT_BIASES, OUTPUT_WEIGHTS, products::Sums};
use crate::{
    network::{Mlp, Shape},
    training::{
        activations::change_each,
        examples::{column, column_mut},
        parallel::{accumulate, cholesky, is_large, product, solve_rows, substitute},
    },
};

/// Elimination of the output layer: reduces the right-hand side of the hidden layer, and computes the step of the
/// output layer once the step of the hidden layer is known. The memory is reused for every damping.
pub(super) struct Elimination {
    shape: Shape,
    /// Cholesky factor of G.
    g_factor: Mat<f64>,
    /// F = C L⁻ᵀ, with L the factor of G, so that C G⁻¹ Cᵀ = F Fᵀ.
    pub(super) f: Mat<f64>,
}

impl Elimination {
    pub(super) fn new(shape: Shape) -> Self {
        let h1 = shape.hidden + 1;
        Self {
            shape,
            g_factor: Mat::zeros(h1, h1),
            f: Mat::zeros(shape.hidden_weights(), h1),
        }
    }

    /// Factors G = H̃ᵀH̃ + `damping` on the diagonal; `None` if it is not numerically positive definite.
    pub(super) fn factor(&mut self, sums: &Sums, damping: Classes) -> Option<()> {
        self.g_factor.copy_from(&sums.g);
        for node in 0..=self.shape.hidden {
            let is_bias = node == self.shape.hidden;
            self.g_factor[(node, node)] += damping[if is_bias { OUTPUT_BIASES } else { OUTPUT_WEIGHTS }];
        }
        cholesky(self.g_factor.as_mut())?;
        self.f.copy_from(sums.c());
        solve_rows(self.g_factor.as_ref(), self.f.as_mut());
        Some(())
    }

    /// Returns the negative right-hand side of the hidden layer, r_W − Σₜ diag(V̄ₜ ⊗ 1) C G⁻¹ r_Vₜ, node by node; r is
    /// `right` in the order of [`Mlp::weights`].
    pub(super) fn reduce(&self, sums: &Sums, mlp: &Mlp, right: &[f64]) -> Vec<f64> {
        let (hidden, n1) = (self.shape.hidden, self.shape.inputs + 1);
        let (right_w, right_v) = layers(self.shape, right);
        let (mut output, mut small) = (right_v.to_owned(), Mat::zeros(hidden + 1, hidden));
        substitute(self.g_factor.as_ref(), output.as_mut());
        product(small.as_mut(), output.as_ref(), output_weights(mlp).transpose());
        let mut reduced = vec![0.0; self.shape.hidden_weights()];
        let mut columns = MatMut::from_column_major_slice_mut(&mut reduced, n1, hidden);
        columns.copy_from(right_w);
        for node in 0..hidden {
            let (c, small) = (sums.c().subrows(node * n1, n1), small.as_ref().subcols(node, 1));
            accumulate(columns.as_mut().subcols_mut(node, 1), c, small, -1.0);
        }
        reduced
    }

    /// Writes the whole step in the order of [`Mlp::weights`], given the hidden layer's negative step `d`:
    /// δV = −G⁻¹ (r_V − K V̄), column i of K being Cᵢᵀ dᵢ.
    pub(super) fn complete(&self, sums: &Sums, mlp: &Mlp, right: &[f64], d: &[f64], step: &mut [f64]) {
        let (hidden, n1) = (self.shape.hidden, self.shape.inputs + 1);
        let d = MatRef::from_column_major_slice(d, n1, hidden);
        let (mut output, mut small) = (layers(self.shape, right).1.to_owned(), Mat::zeros(hidden + 1, hidden));
        for node in 0..hidden {
            let c = sums.c().subrows(node * n1, n1).transpose();
            product(small.as_mut().subcols_mut(node, 1), c, d.subcols(node, 1));
        }
        accumulate(output.as_mut(), small.as_ref(), output_weights(mlp), -1.0);
        substitute(self.g_factor.as_ref(), output.as_mut());
        let (step_w, step_v) = step.split_at_mut(self.shape.hidden_weights());
        MatMut::from_row_major_slice_mut(step_w, n1, hidden).copy_from(d);
        MatMut::from_row_major_slice_mut(step_v, hidden + 1, self.shape.outputs).copy_from(&output);
        step.iter_mut().for_each(|value| *value = -*value);
    }

    /// Writes the Cholesky factor of S for a damping of W to the lower triangle of `s`; `None` if S is not numerically
    /// positive definite.
    pub(super) fn factor_schur(&self, s: &mut Mat<f64>, sums: &Sums, mlp: &Mlp, damping: Classes) -> Option<()> {
        let (n1, order) = (self.shape.inputs + 1, s.nrows());
        let (mut panels, mut rest) = (Vec::new(), s.as_mut());
        for node in 0..self.shape.hidden {
            let (columns, others) = rest.split_at_col_mut(n1);
            rest = others;
            panels.push(columns.subrows_mut(node * n1, order - node * n1));
        }
        // All on this thread, unless they are large.
        let at_once = if is_large(order * order * n1) { 1 } else { panels.len() };
        let panels = panels.into_par_iter().enumerate().with_min_len(at_once);
        panels.for_each(|(node, panel)| self.fill_panel(node, panel, sums.gram.as_ref(), output_weights(mlp)));
        for index in 0..order {
            let is_bias = index % n1 == self.shape.inputs;
            s[(index, index)] += damping[if is_bias { HIDDEN_BIASES } else { HIDDEN_WEIGHTS }];
        }
        cholesky(s.as_mut())
    }

    /// Writes the columns of S of hidden node `first`, from the diagonal block down, except for the damping:
    /// (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − F Fᵀ), with BᵀB packed as [`Plan::gram`](super::Plan) describes.
    fn fill_panel(&self, first: usize, mut s: MatMut<'_, f64>, gram: MatRef<'_, f64>, v: MatRef<'_, f64>) {
        let n1 = s.ncols();
        let f = self.f.as_ref().subrows(first * n1, s.nrows());
        product(s.as_mut(), f, f.subrows(0, n1).transpose());
        let mut square = vec![0.0; n1 * n1];
        for node in first..v.nrows() {
            unpack(column(gram, node * (node + 1) / 2 + first), n1, &mut square);
            let products = v.row(node).iter().zip(v.row(first).iter());
            let weight: f64 = products.map(|(a, b)| a * b).sum();
            let top = (node - first) * n1;
            for b in 0..n1 {
                let start = if node == first { b } else { 0 };
                let values = &mut column_mut(s.as_mut(), b)[top + start..top + n1];
                let products = &square[b * n1 + start..(b + 1) * n1];
                change_each(values, products, |value, product| *value = weight * (product - *value));
            }
        }
    }

    /// Returns the diagonal of the inverse of the whole matrix last factored, summed over classes of weights; turns F
    /// into C G⁻¹. From the blocks of the inverse its trace is `tr S⁻¹ + m tr G⁻¹ + Σₜ tr S⁻¹ Rₜ Rₜᵀ` with
    /// Rₜ = diag(V̄ₜ ⊗ 1) C G⁻¹; with the factors S = L Lᵀ and G = Lg Lgᵀ this is `‖L⁻¹‖² + m ‖Lg⁻¹‖² + Σₜ ‖L⁻¹ Rₜ‖²`
    /// (Frobenius norms), column by column.
    pub(super) fn traces_of_inverse(&mut self, s: MatRef<'_, f64>, mlp: &Mlp) -> Traces {
        let (hidden, n1) = (self.shape.hidden, self.shape.inputs + 1);
        let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        let squares_of_inverse = |lower: MatRef<'_, f64>| {
            let mut inverse = Mat::zeros(lower.nrows(), lower.ncols());
            invert_lower_triangular(inverse.as_mut(), lower, Par::Seq);
            Vec::from_iter((0..lower.ncols()).map(|index| square(&column(inverse.as_ref(), index)[index..])))
        };
        let mut of_hidden = [0.0; 2];
        for (index, square) in squares_of_inverse(s).into_iter().enumerate() {
            of_hidden[usize::from(index % n1 + 1 == n1)] += square;
        }
        let of_node = squares_of_inverse(self.g_factor.as_ref());
        let (factor, f) = (self.g_factor.as_ref().transpose(), self.f.as_mut());
        solve_upper_triangular_in_place(factor, f.transpose_mut(), Par::Seq);
        let (v, f) = (output_weights(mlp), self.f.as_ref());
        let of_output = |output| {
            let mut r = Mat::from_fn(s.nrows(), hidden + 1, |index, column| {
                v[(index / n1, output)] * f[(index, column)]
            });
            solve_lower_triangular_in_place(s, r.as_mut(), Par::Seq);
            let of_node = |node| of_node[node] + square(column(r.as_ref(), node));
            [(0..hidden).map(of_node).sum(), of_node(hidden)]
        };
        Traces {
            hidden: of_hidden,
            outputs: (0..self.shape.outputs).map(of_output).collect(),
        }
    }
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

/// Returns the values of both layers' weights: n1 × h and (h+1) × outputs.
fn layers(shape: Shape, values: &[f64]) -> (MatRef<'_, f64>, MatRef<'_, f64>) {
    let (w, v) = values.split_at(shape.hidden_weights());
    (
        MatRef::from_row_major_slice(w, shape.inputs + 1, shape.hidden),
        MatRef::from_row_major_slice(v, shape.hidden + 1, shape.outputs),
    )
}

/// Returns V̄: h × outputs.
pub(super) fn output_weights(mlp: &Mlp) -> MatRef<'_, f64> {
    layers(mlp.shape(), mlp.weights()).1.subrows(0, mlp.shape().hidden)
}

/// Unpacks the symmetric n1 × n1 matrix whose lower triangle is packed column by column.
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
