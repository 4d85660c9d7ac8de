use pulp::{Simd, WithSimd};

use super::upper;

/// Cholesky factors of several small least-squares problems side by side, with reused memory: each is in one lane of vector
/// registers.
#[derive(Clone, Debug)]
pub(super) struct SideBySide {
    width: usize,
    /// [AᵀA, Aᵀb] of every lane, then their factors.
    rows: Vec<[f64; LANES]>,
    solution: Vec<[f64; LANES]>,
    min_left: [f64; LANES],
    scratch: [Vec<[f64; LANES]>; 2],
}

/// Number of problems side by side.
pub(super) const LANES: usize = 8;
/// Fraction of a diagonal entry below which rounding affects the solution.
const MIN_LEFT: f64 = 1e-11;

impl SideBySide {
    pub(super) fn new(unknowns: usize) -> Self {
        let zeros = |count: usize| vec![[0.0; LANES]; count];
        Self {
            width: unknowns + 1,
            rows: zeros(unknowns * (unknowns + 1)),
            solution: zeros(unknowns),
            min_left: [0.0; LANES],
            scratch: [zeros(unknowns), zeros(unknowns)],
        }
    }

    /// Sets the equations of the problem in `lane`: the lower triangle of [A, b]ᵀ[A, b], row by row.
    pub(super) fn set(&mut self, lane: usize, equations: &[f64]) {
        let mut equations = equations.iter();
        for column in 0..self.width {
            for (row, &value) in (0..=column).zip(&mut equations) {
                if row + 1 < self.width {
                    self.rows[row * self.width + column][lane] = value;
                }
            }
        }
    }

    /// Factors and solves the problems in all lanes.
    pub(super) fn solve(&mut self) {
        pulp::Arch::new().dispatch(Solving(self));
    }

    /// Returns `true` if the problem in `lane` is well conditioned enough for its normal equations.
    pub(super) fn is_well_conditioned(&self, lane: usize) -> bool {
        self.min_left[lane] > MIN_LEFT
    }

    /// Returns one unknown of the solution in `lane`.
    pub(super) fn solution(&self, lane: usize, unknown: usize) -> f64 {
        self.solution[unknown][lane]
    }

    /// Returns the largest norm of a row of A⁺ in each lane.
    pub(super) fn largest_inverse_rows(&mut self) -> [f64; LANES] {
        pulp::Arch::new().dispatch(Inverting(self))
    }
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Solving<'a>(&'a mut SideBySide);

impl WithSimd for Solving<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(all) = self;
        all.min_left = upper::factor(&mut all.rows, all.width, &mut all.scratch[0], 0.0);
        upper::solve(&all.rows, all.width, &mut all.solution);
    }
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Inverting<'a>(&'a mut SideBySide);

impl WithSimd for Inverting<'_> {
    type Output = [f64; LANES];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let [squares, column] = &mut self.0.scratch;
        upper::largest_inverse_rows(&self.0.rows, self.0.width, squares, column)
    }
}

/// Writes the lower triangle of [A, b]ᵀ[A, b], row by row, into `entries`. `system` holds A column by column, then b, each
/// padded with zeros to `length`, a multiple of 8.
pub(super) fn write_normal_equations(system: &[f64], length: usize, entries: &mut [f64]) {
    pulp::Arch::new().dispatch(Products {
        system,
        length,
        entries,
    });
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Products<'a> {
    system: &'a [f64],
    length: usize,
    entries: &'a mut [f64],
}

impl WithSimd for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            system,
            length,
            entries,
        } = self;
        let columns = system.len() / length;
        let column = |index: usize| &system[index * length..(index + 1) * length];
        let mut begin = 0;
        for i in 0..columns {
            let row = &mut entries[begin..=begin + i];
            let mut j = 0;
            // Four at a time, to read column i once.
            while j + 4 <= i + 1 {
                let sums = products([column(j), column(j + 1), column(j + 2), column(j + 3)], column(i));
                row[j..j + 4].copy_from_slice(&sums);
                j += 4;
            }
            while j <= i {
                row[j] = products([column(j)], column(i))[0];
                j += 1;
            }
            begin += i + 1;
        }
    }
}

/// Returns the products of several columns with another one, each as eight partial sums in fixed order.
#[inline(always)]
fn products<const N: usize>(columns: [&[f64]; N], other: &[f64]) -> [f64; N] {
    let mut sums = [[0.0; LANES]; N];
    for (block, other) in other.as_chunks::<LANES>().0.iter().enumerate() {
        for (sums, column) in sums.iter_mut().zip(&columns) {
            let column: &[f64; LANES] = column[block * LANES..(block + 1) * LANES]
                .try_into()
                .expect("whole registers");
            for lane in 0..LANES {
                sums[lane] += column[lane] * other[lane];
            }
        }
    }
    let mut products = [0.0; N];
    for (product, [a, b, c, d, e, f, g, h]) in products.iter_mut().zip(sums) {
        *product = ((a + e) + (c + g)) + ((b + f) + (d + h));
    }
    products
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [A, b]ᵀ[A, b], the lower triangle row by row.
    fn equations(system: &[[f64; 3]]) -> Vec<f64> {
        let entry = |i: usize, j: usize| system.iter().map(|row| row[i] * row[j]).sum();
        (0..3)
            .flat_map(|i| (0..=i).map(move |j| (i, j)))
            .map(|(i, j)| entry(i, j))
            .collect()
    }

    /// A = [[3, 1], [4, 2], [0, 2]] with b = A (2, −1) + (8, −6, 2), whose last term is orthogonal to both columns;
    /// the same with the columns of A doubled and halved; dependent columns; an empty lane.
    #[test]
    fn each_lane_has_the_solution_of_its_own_problem() {
        let b = [5.0 + 8.0, 6.0 - 6.0, -2.0 + 2.0];
        let plain = [[3.0, 1.0, b[0]], [4.0, 2.0, b[1]], [0.0, 2.0, b[2]]];
        let scaled = plain.map(|[x, y, b]| [2.0 * x, 0.5 * y, b]);
        let dependent = plain.map(|[x, _, b]| [x, 3.0 * x, b]);
        let mut problems = SideBySide::new(2);
        problems.set(0, &equations(&plain));
        problems.set(3, &equations(&scaled));
        problems.set(7, &equations(&dependent));
        problems.solve();
        for (lane, expected) in [(0, [2.0, -1.0]), (3, [1.0, -2.0])] {
            assert!(problems.is_well_conditioned(lane));
            for (unknown, expected) in expected.into_iter().enumerate() {
                let found = problems.solution(lane, unknown);
                assert!((found - expected).abs() < 1e-13, "{lane}: {found}");
            }
        }
        assert!(!problems.is_well_conditioned(7) && !problems.is_well_conditioned(1));
        // (AᵀA)⁻¹ = [[9, −11], [−11, 25]] / 104, in lane 3 divided by 4 and times 4.
        let norms = problems.largest_inverse_rows();
        assert!((norms[0] - (25.0_f64 / 104.0).sqrt()).abs() < 1e-13, "{norms:?}");
        assert!((norms[3] - (100.0_f64 / 104.0).sqrt()).abs() < 1e-13, "{norms:?}");
    }

    /// Integers, whose products and sums are exact in any order.
    #[test]
    fn products_of_all_columns_are_written() {
        for (columns, rows) in [(1, 3), (6, 9), (11, 30)] {
            let length = usize::next_multiple_of(rows, LANES);
            let value = |column: usize, row: usize| ((7 * column + 3 * row) % 11) as f64 - 5.0;
            let mut system = vec![0.0; columns * length];
            for column in 0..columns {
                for row in 0..rows {
                    system[column * length + row] = value(column, row);
                }
            }
            let mut entries = vec![f64::NAN; columns * (columns + 1) / 2];
            write_normal_equations(&system, length, &mut entries);
            let mut entries = entries.into_iter();
            for i in 0..columns {
                for j in 0..=i {
                    let expected: f64 = (0..rows).map(|row| value(i, row) * value(j, row)).sum();
                    assert_eq!(entries.next(), Some(expected), "{i} {j}");
                }
            }
        }
    }
}
