//! Elimination of the output layer from the equations.

use faer::{Accum, Mat, MatMut, MatRef, Par, linalg::matmul::matmul};

use super::{
    cholesky::{Cholesky, solve_rows, substitute},
    sums::Sums,
    weight_classes::{Decay, PerClass},
};
use crate::network::{Mlp, Shape};

/// Eliminates the output layer: reduces the right-hand side of the hidden layer, and finds the step of the output layer
/// once that of the hidden layer is known. The memory is used again for every damping.
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

    /// Factors G = H̃ᵀH̃ + `damping` on the diagonal; `None` if it is not positive definite in the arithmetic.
    pub(super) fn factor(&mut self, sums: &Sums, damping: PerClass) -> Option<()> {
        self.g_factor.copy_from(&sums.g);
        for node in 0..self.g_factor.nrows() {
            self.g_factor[(node, node)] += damping.of_node(node, self.shape.hidden);
        }
        self.cholesky.factor(self.g_factor.as_mut())?;
        self.f.copy_from(sums.c());
        solve_rows(self.g_factor.as_ref(), self.f.as_mut());
        Some(())
    }

    /// Writes the negative right-hand side of the hidden layer, (Jwᵀe + decay·w) − Σₜ diag(V̄ₜ ⊗ 1) C G⁻¹ (Jvᵀe +
    /// decay·v)ₜ.
    pub(super) fn reduce(&mut self, sums: &Sums, mlp: &Mlp, decay: Decay<'_>, right: &mut [f64]) {
        let Shape { inputs, hidden, .. } = self.shape;
        let n1 = inputs + 1;
        let mut right = MatMut::from_column_major_slice_mut(right, n1, self.shape.hidden);
        let (w, v) = layers(mlp);
        fill(self.output.as_mut(), |row, column| {
            sums.gradient_v[(row, column)] + decay.pull_in_output((row, hidden), column, v[(row, column)])
        });
        substitute(self.g_factor.as_ref(), self.output.as_mut());
        let v = v.subrows(0, self.shape.hidden);
        let (replace, alone) = (Accum::Replace, Par::Seq);
        matmul(
            self.small.as_mut(),
            replace,
            self.output.as_ref(),
            v.transpose(),
            1.0,
            alone,
        );
        fill(right.as_mut(), |input, node| {
            sums.gradient_w[(input, node)] + decay.pull_in_hidden((input, inputs), w[(input, node)])
        });
        for node in 0..self.shape.hidden {
            let (c, small) = (sums.c().subrows(node * n1, n1), self.small.as_ref().subcols(node, 1));
            matmul(right.as_mut().subcols_mut(node, 1), Accum::Add, c, small, -1.0, alone);
        }
    }

    /// Writes the whole step in the order of [`Mlp::weights`], given the hidden layer's negative step `d`:
    /// δV = −G⁻¹ (Jvᵀe + decay·v − K V̄), column i of K being Cᵢᵀ dᵢ.
    pub(super) fn complete(&mut self, sums: &Sums, mlp: &Mlp, decay: Decay<'_>, d: &[f64], step: &mut [f64]) {
        let n1 = self.shape.inputs + 1;
        let d = MatRef::from_column_major_slice(d, n1, self.shape.hidden);
        for node in 0..self.shape.hidden {
            let c = sums.c().subrows(node * n1, n1).transpose();
            let k = self.small.as_mut().subcols_mut(node, 1);
            matmul(k, Accum::Replace, c, d.subcols(node, 1), -1.0, Par::Seq);
        }
        let (_, v) = layers(mlp);
        let hidden = self.shape.hidden;
        fill(self.output.as_mut(), |row, column| {
            sums.gradient_v[(row, column)] + decay.pull_in_output((row, hidden), column, v[(row, column)])
        });
        let v = v.subrows(0, self.shape.hidden);
        matmul(self.output.as_mut(), Accum::Add, self.small.as_ref(), v, 1.0, Par::Seq);
        substitute(self.g_factor.as_ref(), self.output.as_mut());
        let (step_w, step_v) = step.split_at_mut(self.shape.hidden_weights());
        write_negative(d, step_w);
        write_negative(self.output.as_ref(), step_v);
    }
}

/// W and V as matrices.
fn layers(mlp: &Mlp) -> (MatRef<'_, f64>, MatRef<'_, f64>) {
    let (w, v) = mlp.layers();
    let Shape {
        inputs,
        hidden,
        outputs,
    } = mlp.shape();
    (
        MatRef::from_row_major_slice(w, inputs + 1, hidden),
        MatRef::from_row_major_slice(v, hidden + 1, outputs),
    )
}

/// V̄: h × outputs.
pub(super) fn output_weights(mlp: &Mlp) -> MatRef<'_, f64> {
    layers(mlp).1.subrows(0, mlp.shape().hidden)
}

/// Writes −`matrix` row by row.
pub(super) fn write_negative(matrix: MatRef<'_, f64>, values: &mut [f64]) {
    let columns = matrix.ncols();
    for (index, value) in values.iter_mut().enumerate() {
        *value = -matrix[(index / columns, index % columns)];
    }
}

pub(super) fn fill(matrix: MatMut<'_, f64>, value: impl Fn(usize, usize) -> f64) {
    for (index, column) in matrix.col_iter_mut().enumerate() {
        for (row, entry) in column.iter_mut().enumerate() {
            *entry = value(row, index);
        }
    }
}
