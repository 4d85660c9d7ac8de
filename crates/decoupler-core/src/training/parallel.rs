//! Products, Cholesky factors and triangular solves, divided among the threads of the current rayon pool.
//!
//! One large product is split by rows and columns of its result; many small products, one for each block of samples,
//! are split by samples. The splits depend on sizes alone, so every entry is summed in the same order and the bits are
//! the same on any number of threads.
//!
//! faer's own `Par::rayon(n)` with a fixed n is bit-identical too, on pools of 1, 2 and 4 threads, but on two busy
//! cores it took 1.1 to 1.4 times as long for Cholesky factors of order 744 to 6208, and equally long for large
//! products.

use std::ops::Range;

use faer::{
    Accum, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt,
        matmul::{
            matmul,
            triangular::{self, BlockStructure},
        },
        triangular_solve::solve_lower_triangular_in_place,
    },
};
use rayon::prelude::*;

/// Multiplications (rows × depth × columns) below which a product is not worth splitting: about a millisecond of work,
/// many times the cost of waking another thread.
pub(super) const LARGE: usize = 1 << 25;
/// Maximum number of pieces of a result; each piece reads its factors again.
const MAX_PIECES: usize = 16;
/// Minimum number of rows or columns of a piece; narrower ones waste SIMD lanes.
const MIN_WIDTH: usize = 16;

/// Number of parts to split the samples into, each with at least `smallest` multiplications and `bytes` of memory of
/// its own.
pub(super) fn number_of_parts(blocks: usize, multiplications_per_block: usize, smallest: usize, bytes: usize) -> usize {
    const MAX_PARTS: usize = 8;
    const MAX_BYTES: usize = 32 << 20;
    let worth = blocks.saturating_mul(multiplications_per_block) / smallest;
    let affordable = MAX_BYTES / bytes.max(1);
    worth.min(blocks).min(affordable).clamp(1, MAX_PARTS)
}

/// Returns the blocks of each part.
pub(super) fn parts(blocks: usize, parts: usize) -> impl Iterator<Item = Range<usize>> {
    (0..parts).map(move |part| part * blocks / parts..(part + 1) * blocks / parts)
}

/// Calls `work` for each part, on any thread.
pub(crate) fn for_each_part<P: Send>(parts: &mut [P], work: impl Fn(&mut P) + Sync + Send) {
    match parts {
        // Bypasses the thread pool.
        [part] => work(part),
        parts => parts.par_iter_mut().for_each(work),
    }
}

/// Returns `true` if a product of this many multiplications is split.
pub(super) fn is_large(multiplications: usize) -> bool {
    multiplications >= 2 * LARGE
}

/// Number of pieces to split a product of this many multiplications into: a power of two.
fn pieces(multiplications: usize) -> usize {
    let pieces = (multiplications / LARGE).clamp(1, MAX_PIECES);
    1 << pieces.ilog2()
}

/// Computes `result = left · right` on this thread.
pub(super) fn product(result: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>) {
    matmul(result, Accum::Replace, left, right, 1.0, Par::Seq);
}

/// Computes `sum += factor · left · right` on this thread.
pub(super) fn accumulate(sum: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>, factor: f64) {
    matmul(sum, Accum::Add, left, right, factor, Par::Seq);
}

/// Computes the lower triangle of `sum += factor · left · right` on this thread.
pub(super) fn accumulate_lower(sum: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>, factor: f64) {
    let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular::matmul(sum, lower, Accum::Add, left, full, right, full, factor, Par::Seq);
}

/// Computes `sum += factor · left · right`, on all threads if it is large.
pub(super) fn add_product(sum: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>, factor: f64) {
    let pieces = pieces(sum.nrows() * left.ncols() * sum.ncols());
    add_in_pieces(sum, left, right, factor, pieces);
}

/// Recursively halves the longer side until there are `pieces` pieces.
fn add_in_pieces(sum: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>, factor: f64, pieces: usize) {
    let (rows, columns) = (sum.nrows(), sum.ncols());
    if pieces == 1 || rows.max(columns) < 2 * MIN_WIDTH {
        accumulate(sum, left, right, factor);
    } else if rows > columns {
        let (above, below) = sum.split_at_row_mut(half(rows));
        let (left_above, left_below) = left.split_at_row(half(rows));
        rayon::join(
            || add_in_pieces(above, left_above, right, factor, pieces / 2),
            || add_in_pieces(below, left_below, right, factor, pieces / 2),
        );
    } else {
        let (first, second) = sum.split_at_col_mut(half(columns));
        let (right_first, right_second) = right.split_at_col(half(columns));
        rayon::join(
            || add_in_pieces(first, left, right_first, factor, pieces / 2),
            || add_in_pieces(second, left, right_second, factor, pieces / 2),
        );
    }
}

/// Returns half of `length`, rounded up to whole SIMD registers.
fn half(length: usize) -> usize {
    (length / 2).next_multiple_of(MIN_WIDTH)
}

/// Maximum order of a matrix that is factored in one piece.
const MAX_UNSPLIT_FACTOR: usize = 512;
/// Maximum order of a triangular system that is solved in one piece.
const MAX_UNSPLIT_SOLVE: usize = 128;

/// Replaces the lower triangle of a symmetric matrix by its Cholesky factor, on all threads if it is large; `None` if it is
/// not positive definite.
///
/// The algorithm is recursive: it factors the first half, solves the rows below against it, subtracts their square from
/// the remaining block and factors that in turn. Nearly all of the work is then in a few large products (Gustavson
/// 1997, IBM Journal of Research and Development 41).
pub(super) fn cholesky(matrix: MatMut<'_, f64>) -> Option<()> {
    let order = matrix.nrows();
    if order <= MAX_UNSPLIT_FACTOR {
        let scratch = llt::factor::cholesky_in_place_scratch::<f64>(order, Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        let factored = llt::factor::cholesky_in_place(matrix, Default::default(), Par::Seq, stack, Default::default());
        return factored.ok().map(drop);
    }
    let (mut first, _, mut below, mut corner) = matrix.split_at_mut(half(order), half(order));
    cholesky(first.as_mut())?;
    solve_rows(first.as_ref(), below.as_mut());
    subtract_square(corner.as_mut(), below.as_ref());
    cholesky(corner)
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
        // Large enough that the product subtracted from the corner is split, too.
        let order = 7 * MAX_UNSPLIT_FACTOR / 4 + 7;
        let entry = |row: usize, column: usize| ((row * 31 + column * 17 + row * column) as f64).sin();
        let root = Mat::from_fn(order, order, entry);
        let matrix = &root * root.transpose() + Mat::<f64>::identity(order, order);
        let mut factor = matrix.clone();
        assert!(cholesky(factor.as_mut()).is_some());
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
        assert!(cholesky(matrix.as_mut()).is_none());
    }
}
