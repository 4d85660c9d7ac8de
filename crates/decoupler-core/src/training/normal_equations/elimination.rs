//! Elimination of the output layer from the equations.

use faer::{Mat, MatMut, MatRef};

use super::{
    Classes,
    cholesky::{Cholesky, solve_rows, substitute},
    classes::{OUTPUT_BIASES, OUTPUT_WEIGHTS},
    products::Sums,
};
use crate::{
    network::{Mlp, Shape},
    training::parallel::{accumulate, product},
};

/// Elimination of the output layer: reduces the right-hand side of the hidden layer, and computes the step of the
/// output layer once the step of the hidden layer is known. The memory is reused for every damping.
pub(super) struct Elimination {
    shape: Shape,
    /// Cholesky factor of G.
    pub(super) g_factor: Mat<f64>,
    /// F = C L⁻ᵀ, with L the factor of G, so that C G⁻¹ Cᵀ = F Fᵀ.
    pub(super) f: Mat<f64>,
    /// G⁻¹ Jvᵀe, later the step of V: (h+1) × outputs.
    output: Mat<f64>,
    /// Buffer of (h+1) × h.
    small: Mat<f64>,
    cholesky: Cholesky,
}

impl Elimination {
    pub(super) fn new(shape: Shape) -> Self {
        let h1 = shape.hidden + 1;
        Self {
            shape,
            g_factor: Mat::zeros(h1, h1),
            f: Mat::zeros(shape.hidden_weights(), h1),
            output: Mat::zeros(h1, shape.outputs),
            small: Mat::zeros(h1, shape.hidden),
            cholesky: Cholesky::new(h1),
        }
    }

    /// Factors G = H̃ᵀH̃ + `damping` on the diagonal; `None` if it is not numerically positive definite.
    pub(super) fn factor(&mut self, sums: &Sums, damping: Classes) -> Option<()> {
        let hidden = self.shape.hidden;
        self.g_factor.copy_from(&sums.g);
        for node in 0..hidden {
            self.g_factor[(node, node)] += damping[OUTPUT_WEIGHTS];
        }
        self.g_factor[(hidden, hidden)] += damping[OUTPUT_BIASES];
        self.cholesky.factor(self.g_factor.as_mut())?;
        self.f.copy_from(sums.c());
        solve_rows(self.g_factor.as_ref(), self.f.as_mut());
        Some(())
    }

    /// Writes the negative right-hand side of the hidden layer, r_W − Σₜ diag(V̄ₜ ⊗ 1) C G⁻¹ r_Vₜ, node by node; r is
    /// `right` in the order of [`Mlp::weights`].
    pub(super) fn reduce(&mut self, sums: &Sums, mlp: &Mlp, right: &[f64], reduced: &mut [f64]) {
        let n1 = self.shape.inputs + 1;
        let (right_w, right_v) = layers(self.shape, right);
        self.output.copy_from(right_v);
        substitute(self.g_factor.as_ref(), self.output.as_mut());
        product(
            self.small.as_mut(),
            self.output.as_ref(),
            output_weights(mlp).transpose(),
        );
        let mut reduced = MatMut::from_column_major_slice_mut(reduced, n1, self.shape.hidden);
        reduced.copy_from(right_w);
        for node in 0..self.shape.hidden {
            let (c, small) = (sums.c().subrows(node * n1, n1), self.small.as_ref().subcols(node, 1));
            accumulate(reduced.as_mut().subcols_mut(node, 1), c, small, -1.0);
        }
    }

    /// Writes the whole step in the order of [`Mlp::weights`], given the hidden layer's negative step `d`:
    /// δV = −G⁻¹ (r_V − K V̄), column i of K being Cᵢᵀ dᵢ.
    pub(super) fn complete(&mut self, sums: &Sums, mlp: &Mlp, right: &[f64], d: &[f64], step: &mut [f64]) {
        let (n1, Shape { hidden, outputs, .. }) = (self.shape.inputs + 1, self.shape);
        let d = MatRef::from_column_major_slice(d, n1, hidden);
        for node in 0..hidden {
            let c = sums.c().subrows(node * n1, n1).transpose();
            product(self.small.as_mut().subcols_mut(node, 1), c, d.subcols(node, 1));
        }
        self.output.copy_from(layers(self.shape, right).1);
        accumulate(self.output.as_mut(), self.small.as_ref(), output_weights(mlp), -1.0);
        substitute(self.g_factor.as_ref(), self.output.as_mut());
        let (step_w, step_v) = step.split_at_mut(self.shape.hidden_weights());
        let output = &self.output;
        fill(MatMut::from_row_major_slice_mut(step_w, n1, hidden), |a, i| -d[(a, i)]);
        fill(MatMut::from_row_major_slice_mut(step_v, hidden + 1, outputs), |q, t| {
            -output[(q, t)]
        });
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
    let Shape { hidden, outputs, .. } = mlp.shape();
    MatRef::from_row_major_slice(mlp.layers().1, hidden + 1, outputs).subrows(0, hidden)
}

pub(super) fn fill(matrix: MatMut<'_, f64>, value: impl Fn(usize, usize) -> f64) {
    for (index, column) in matrix.col_iter_mut().enumerate() {
        for (row, entry) in column.iter_mut().enumerate() {
            *entry = value(row, index);
        }
    }
}
