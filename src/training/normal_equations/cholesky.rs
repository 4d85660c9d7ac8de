use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt,
        matmul::triangular::{self, BlockStructure},
        triangular_solve::solve_lower_triangular_in_place,
    },
};

use crate::training::parallel::{add_product, is_large};

/// Columns that are factored together. Smaller matrices are factored whole.
const PANEL: usize = 256;

/// Room for the Cholesky factorisation of a symmetric matrix, in place, on all threads if it is large.
///
/// Panel by panel: the panel's own block is factored, the rows below are solved against it, and the rest is reduced by
/// their product, divided by columns (Golub and Van Loan, Matrix Computations, section 4.2.9).
pub(super) struct Cholesky {
    memory: MemBuffer,
}

impl Cholesky {
    /// Room for matrices of up to `order` rows.
    pub(super) fn new(order: usize) -> Self {
        let order = order.min(2 * PANEL);
        let memory = llt::factor::cholesky_in_place_scratch::<f64>(order, Par::Seq, Default::default());
        Self {
            memory: MemBuffer::new(memory),
        }
    }

    /// Replaces the lower triangle of `matrix` by its Cholesky factor; false if it is not positive definite.
    pub(super) fn factor(&mut self, matrix: MatMut<'_, f64>) -> bool {
        let mut rest = matrix;
        while rest.nrows() > 2 * PANEL {
            let (mut block, _, mut below, mut corner) = rest.split_at_mut(PANEL, PANEL);
            if !self.factor_block(block.as_mut()) {
                return false;
            }
            solve_rows(block.as_ref(), below.as_mut());
            subtract_square(corner.as_mut(), below.as_ref());
            rest = corner;
        }
        self.factor_block(rest)
    }

    fn factor_block(&mut self, block: MatMut<'_, f64>) -> bool {
        let memory = MemStack::new(&mut self.memory);
        llt::factor::cholesky_in_place(block, Default::default(), Par::Seq, memory, Default::default()).is_ok()
    }
}

/// Replaces `right` by the solution for a matrix given by its Cholesky factor.
pub(super) fn substitute(factor: MatRef<'_, f64>, right: MatMut<'_, f64>) {
    // It needs no memory of its own.
    llt::solve::solve_in_place(factor, right, Par::Seq, MemStack::new(&mut []));
}

/// Replaces each row r of `rows` by r L⁻ᵀ.
fn solve_rows(factor: MatRef<'_, f64>, rows: MatMut<'_, f64>) {
    let count = rows.nrows();
    if count <= PANEL || !is_large(count * factor.nrows() * factor.nrows()) {
        solve_lower_triangular_in_place(factor, rows.transpose_mut(), Par::Seq);
        return;
    }
    let (first, second) = rows.split_at_row_mut(count / 2);
    rayon::join(|| solve_rows(factor, first), || solve_rows(factor, second));
}

/// Subtracts F Fᵀ from the lower triangle of `matrix`.
fn subtract_square(matrix: MatMut<'_, f64>, f: MatRef<'_, f64>) {
    let order = matrix.nrows();
    if order <= PANEL {
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular::matmul(matrix, lower, Accum::Add, f, full, f.transpose(), full, -1.0, Par::Seq);
        return;
    }
    let half = order / 2;
    let (above, _, below, corner) = matrix.split_at_mut(half, half);
    let (first, second) = f.split_at_row(half);
    rayon::join(
        || subtract_square(above, first),
        || {
            rayon::join(
                || add_product(below, second, first.transpose(), -1.0),
                || subtract_square(corner, second),
            )
        },
    );
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;

    #[test]
    fn panels_give_the_factor() {
        let order = 3 * PANEL + 7;
        let entry = |row: usize, column: usize| ((row * 31 + column * 17 + row * column) as f64).sin();
        let root = Mat::from_fn(order, order, entry);
        let matrix = &root * root.transpose() + Mat::<f64>::identity(order, order);
        let mut factor = matrix.clone();
        assert!(Cholesky::new(order).factor(factor.as_mut()));
        for (row, column) in (0..order).flat_map(|row| (row + 1..order).map(move |column| (row, column))) {
            factor[(row, column)] = 0.0;
        }
        let error = (&factor * factor.transpose() - &matrix).norm_max();
        assert!(error < 1e-10 * matrix.norm_max(), "{error}");
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        let order = 2 * PANEL + 50;
        let mut matrix = Mat::<f64>::identity(order, order);
        matrix[(order - 3, order - 3)] = -1.0;
        assert!(!Cholesky::new(order).factor(matrix.as_mut()));
    }
}
