//! Cholesky factorisation and triangular solves on all threads.

use faer::{
    MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{cholesky::llt, triangular_solve::solve_lower_triangular_in_place},
};

use crate::training::parallel::{accumulate, accumulate_lower, add_product, half, is_large, pieces};

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
        let (mut first, _, mut below, mut corner) = matrix.split_at_mut(half(order), half(order));
        self.factor(first.as_mut())?;
        solve_rows(first.as_ref(), below.as_mut());
        subtract_square(corner.as_mut(), below.as_ref());
        self.factor(corner)
    }
}

/// Subtracts F Fᵀ from the lower triangle of `matrix`.
fn subtract_square(matrix: MatMut<'_, f64>, f: MatRef<'_, f64>) {
    let order = matrix.nrows();
    if !is_large(order * order * f.ncols()) {
        return accumulate_lower(matrix, f, f.transpose(), -1.0);
    }
    let (above, _, below, corner) = matrix.split_at_mut(half(order), half(order));
    let (first, second) = f.split_at_row(half(order));
    rayon::join(
        || add_product(below, second, first.transpose(), -1.0),
        || rayon::join(|| subtract_square(above, first), || subtract_square(corner, second)),
    );
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
    let (above, _, below, corner) = factor.split_at(half(order), half(order));
    let (mut first, mut second) = rows.split_at_col_mut(half(order));
    solve_by_halves(above, first.as_mut());
    accumulate(second.as_mut(), first.as_ref(), below.transpose(), -1.0);
    solve_by_halves(corner, second);
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
