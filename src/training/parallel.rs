//! Large products on all threads of the present rayon pool.
//!
//! What is divided is the result, by columns, and where it is divided follows from its size alone. So every entry is
//! summed in the same order, and the bits are the same on any number of threads.

use faer::{Accum, MatMut, MatRef, Par, linalg::matmul::matmul};

/// Multiplications (rows × depth × columns) below which a product is not worth dividing: about a
/// millisecond of work, many times what waking another thread costs.
const LARGE: usize = 1 << 25;
/// Narrower products waste the vector registers.
const NARROWEST: usize = 16;

/// Whether a product of this many multiplications is divided.
pub(super) fn is_large(multiplications: usize) -> bool {
    multiplications >= 2 * LARGE
}

/// `sum += factor · left · right`.
pub(super) fn add_product(sum: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>, factor: f64) {
    let columns = sum.ncols();
    if columns < 2 * NARROWEST || !is_large(left.nrows() * left.ncols() * columns) {
        matmul(sum, Accum::Add, left, right, factor, Par::Seq);
        return;
    }
    let half = columns / 2;
    let (first_sum, second_sum) = sum.split_at_col_mut(half);
    let (first, second) = right.split_at_col(half);
    rayon::join(
        || add_product(first_sum, left, first, factor),
        || add_product(second_sum, left, second, factor),
    );
}
