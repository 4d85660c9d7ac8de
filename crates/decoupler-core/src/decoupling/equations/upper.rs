//! Upper triangular factors of small least-squares problems, one in each lane of vector registers.
//!
//! A factor is [R, Qᵀb] of [A, b], row by row, with `width` values per row, the number of unknowns plus 1; entries below the
//! diagonal are scratch. The result of a lane has the same bits whatever the other lanes contain.

/// Replaces the upper triangles of [AᵀA, Aᵀb] by the factors, by Cholesky factorisation; returns the smallest fraction of a
/// diagonal entry of AᵀA that remains after eliminating the columns before it, in each lane. With a single lane it stops once
/// that is not above `enough`.
#[inline(always)]
pub(super) fn factor<const LANES: usize>(
    rows: &mut [[f64; LANES]],
    width: usize,
    diagonal: &mut [[f64; LANES]],
    enough: f64,
) -> [f64; LANES] {
    let unknowns = width - 1;
    for (place, diagonal) in diagonal.iter_mut().enumerate() {
        *diagonal = rows[place * width + place];
    }
    let mut min_left = [f64::INFINITY; LANES];
    for pivot in 0..unknowns {
        let (done, below) = rows.split_at_mut((pivot + 1) * width);
        let row = &mut done[pivot * width + pivot..];
        let mut reciprocal = [0.0; LANES];
        for lane in 0..LANES {
            let left = row[0][lane] / diagonal[pivot][lane];
            // Written so that NaN counts as the minimum.
            min_left[lane] = if left >= min_left[lane] { min_left[lane] } else { left };
            reciprocal[lane] = 1.0 / row[0][lane].sqrt();
        }
        let is_enough = min_left[0] > enough;
        if LANES == 1 && !is_enough {
            break;
        }
        for entry in row.iter_mut() {
            for lane in 0..LANES {
                entry[lane] *= reciprocal[lane];
            }
        }
        for (products, place) in below.chunks_exact_mut(width).zip(pivot + 1..) {
            let shares = row[place - pivot];
            for (product, entry) in products[place..].iter_mut().zip(&row[place - pivot..]) {
                for lane in 0..LANES {
                    product[lane] -= shares[lane] * entry[lane];
                }
            }
        }
    }
    min_left
}

/// Solves R x = Qᵀb, which minimises ‖A x − b‖². Entries are not finite if the columns of A are linearly dependent.
#[inline(always)]
pub(super) fn solve<const LANES: usize>(rows: &[[f64; LANES]], width: usize, solution: &mut [[f64; LANES]]) {
    let unknowns = width - 1;
    for unknown in (0..unknowns).rev() {
        let row = &rows[unknown * width..(unknown + 1) * width];
        let mut value = row[unknowns];
        for (entry, known) in row[unknown + 1..unknowns].iter().zip(&solution[unknown + 1..]) {
            for lane in 0..LANES {
                value[lane] -= entry[lane] * known[lane];
            }
        }
        for lane in 0..LANES {
            solution[unknown][lane] = value[lane] / row[unknown][lane];
        }
    }
}

/// Returns the largest norm of the first `count` rows of R⁻¹, which equals that of A⁺, in each lane; infinite if the columns
/// of A are linearly dependent. `column` is scratch, one value per unknown.
#[inline(always)]
pub(super) fn largest_inverse_rows<const LANES: usize>(
    rows: &[[f64; LANES]],
    width: usize,
    squares: &mut [[f64; LANES]],
    column: &mut [[f64; LANES]],
) -> [f64; LANES] {
    squares.fill([0.0; LANES]);
    for last in 0..width - 1 {
        // R⁻¹ is upper triangular: its column `last` ends at the diagonal.
        for unknown in (0..=last).rev() {
            let row = &rows[unknown * width..(unknown + 1) * width];
            let mut value = [f64::from(u8::from(unknown == last)); LANES];
            for (entry, known) in row[unknown + 1..=last].iter().zip(&column[unknown + 1..]) {
                for lane in 0..LANES {
                    value[lane] -= entry[lane] * known[lane];
                }
            }
            for lane in 0..LANES {
                column[unknown][lane] = value[lane] / row[unknown][lane];
            }
        }
        for (square, value) in squares.iter_mut().zip(&column[..=last]) {
            for lane in 0..LANES {
                square[lane] += value[lane] * value[lane];
            }
        }
    }
    let mut largest = [0.0; LANES];
    for square in &*squares {
        for lane in 0..LANES {
            let norm = if square[lane].is_nan() {
                f64::INFINITY
            } else {
                square[lane].sqrt()
            };
            largest[lane] = f64::max(largest[lane], norm);
        }
    }
    largest
}
