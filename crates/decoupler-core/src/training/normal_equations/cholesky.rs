//! Cholesky factorisation, triangular solves, and elimination of the output layer from the equations.

use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{cholesky::llt, matmul::matmul, triangular_solve::solve_lower_triangular_in_place},
};

use super::{
    equations::Sums,
    schur::{Decay, PerClass},
};
use crate::{
    network::{Mlp, Shape},
    training::parallel::{pieces, subtract_square},
};

/// Maximum order of a matrix that is factored in one piece.
const MAX_UNSPLIT_FACTOR: usize = 512;
/// Maximum order of a triangular system that is solved in one piece.
const MAX_UNSPLIT_SOLVE: usize = 128;

/// Cholesky factorisation of a symmetric matrix, in place, on all threads if it is large.
///
/// The algorithm is recursive: it factors the first half, solves the rows below against it, subtracts their square from
/// the remaining block and factors that in turn. Nearly all of the work is then in a few large products (Gustavson
/// 1997, IBM Journal of Research and Development 41).
pub(super) struct Cholesky {
    memory: MemBuffer,
}

impl Cholesky {
    /// Allocates for matrices of up to `order` rows.
    pub(super) fn new(order: usize) -> Self {
        let order = order.min(MAX_UNSPLIT_FACTOR);
        let memory = llt::factor::cholesky_in_place_scratch::<f64>(order, Par::Seq, Default::default());
        Self {
            memory: MemBuffer::new(memory),
        }
    }

    /// Replaces the lower triangle of `matrix` by its Cholesky factor; `None` if it is not positive definite.
    pub(super) fn factor(&mut self, matrix: MatMut<'_, f64>) -> Option<()> {
        let order = matrix.nrows();
        if order <= MAX_UNSPLIT_FACTOR {
            let memory = MemStack::new(&mut self.memory);
            return llt::factor::cholesky_in_place(matrix, Default::default(), Par::Seq, memory, Default::default())
                .ok()
                .map(|_| ());
        }
        let half = half(order);
        let (mut first, _, mut below, mut corner) = matrix.split_at_mut(half, half);
        self.factor(first.as_mut())?;
        solve_rows(first.as_ref(), below.as_mut());
        subtract_square(corner.as_mut(), below.as_ref());
        self.factor(corner)
    }
}

/// Replaces `right` by the solution for a matrix given by its Cholesky factor.
pub(super) fn substitute(factor: MatRef<'_, f64>, right: MatMut<'_, f64>) {
    // Needs no scratch memory.
    llt::solve::solve_in_place(factor, right, Par::Seq, MemStack::new(&mut []));
}

/// Replaces each row r of `rows` by r L⁻ᵀ, on all threads if there are many.
pub(super) fn solve_rows(factor: MatRef<'_, f64>, rows: MatMut<'_, f64>) {
    let (count, order) = (rows.nrows(), factor.nrows());
    solve_in_pieces(factor, rows, pieces(count * order * order / 2));
}

fn solve_in_pieces(factor: MatRef<'_, f64>, rows: MatMut<'_, f64>, pieces: usize) {
    let count = rows.nrows();
    if pieces == 1 || count == 1 {
        solve_by_halves(factor, rows);
        return;
    }
    let (first, second) = rows.split_at_row_mut(count / 2);
    rayon::join(
        || solve_in_pieces(factor, first, pieces / 2),
        || solve_in_pieces(factor, second, pieces / 2),
    );
}

fn solve_by_halves(factor: MatRef<'_, f64>, rows: MatMut<'_, f64>) {
    let order = factor.nrows();
    if order <= MAX_UNSPLIT_SOLVE {
        solve_lower_triangular_in_place(factor, rows.transpose_mut(), Par::Seq);
        return;
    }
    let half = half(order);
    let (above, _, below, corner) = factor.split_at(half, half);
    let (mut first, mut second) = rows.split_at_col_mut(half);
    solve_by_halves(above, first.as_mut());
    matmul(
        second.as_mut(),
        Accum::Add,
        first.as_ref(),
        below.transpose(),
        -1.0,
        Par::Seq,
    );
    solve_by_halves(corner, second);
}

/// Returns half of `order`, rounded up to whole SIMD registers.
fn half(order: usize) -> usize {
    (order / 2).next_multiple_of(16)
}

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

/// Returns W and V as matrices.
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

/// Returns V̄: h × outputs.
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

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;

    #[test]
    fn a_matrix_factored_in_pieces_equals_the_product_of_its_factors() {
        let order = 3 * MAX_UNSPLIT_FACTOR / 2 + 7;
        let entry = |row: usize, column: usize| ((row * 31 + column * 17 + row * column) as f64).sin();
        let root = Mat::from_fn(order, order, entry);
        let matrix = &root * root.transpose() + Mat::<f64>::identity(order, order);
        let mut factor = matrix.clone();
        assert!(Cholesky::new(order).factor(factor.as_mut()).is_some());
        for (row, column) in (0..order).flat_map(|row| (row + 1..order).map(move |column| (row, column))) {
            factor[(row, column)] = 0.0;
        }
        let error = (&factor * factor.transpose() - &matrix).norm_max();
        assert!(error < 1e-10 * matrix.norm_max(), "{error}");
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_rejected() {
        let order = MAX_UNSPLIT_FACTOR + 50;
        let mut matrix = Mat::<f64>::identity(order, order);
        matrix[(order - 3, order - 3)] = -1.0;
        assert!(Cholesky::new(order).factor(matrix.as_mut()).is_none());
    }
}
