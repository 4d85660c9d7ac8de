//! Division of work among the threads of the current rayon pool.
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
    linalg::matmul::{
        matmul,
        triangular::{self, BlockStructure},
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
pub(super) fn for_each_part<P: Send>(parts: &mut [P], work: impl Fn(&mut P) + Sync + Send) {
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
pub(super) fn pieces(multiplications: usize) -> usize {
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
pub(super) fn half(length: usize) -> usize {
    (length / 2).next_multiple_of(MIN_WIDTH)
}
