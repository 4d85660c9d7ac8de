use pulp::{Simd, WithSimd};

/// Cholesky factors of several small least-squares problems side by side, one in each lane of vector registers, with
/// reused memory. The result of a lane has the same bits whatever the other lanes contain.
///
/// The equations are those of [A, b]: the lower triangle of [A, b]ᵀ[A, b], row by row. The last row of their factor
/// is Aᵀb after forward substitution.
#[derive(Clone, Debug)]
pub(super) struct SideBySide {
    unknowns: usize,
    lower: Vec<[f64; LANES]>,
    /// Reciprocals of the diagonal entries.
    reciprocals: Vec<[f64; LANES]>,
    solution: Vec<[f64; LANES]>,
    /// Smallest fraction of a diagonal entry of AᵀA that remains after eliminating the columns before it.
    min_left: [f64; LANES],
}

/// Number of problems side by side.
pub(super) const LANES: usize = 8;
/// Fraction of a diagonal entry below which rounding affects the solution.
const MIN_LEFT: f64 = 1e-11;

impl SideBySide {
    pub(super) fn new(unknowns: usize) -> Self {
        let width = unknowns + 1;
        Self {
            unknowns,
            lower: vec![[0.0; LANES]; width * (width + 1) / 2],
            reciprocals: vec![[0.0; LANES]; unknowns],
            solution: vec![[0.0; LANES]; unknowns],
            min_left: [0.0; LANES],
        }
    }

    /// Sets the equations of the problem in `lane`.
    pub(super) fn set(&mut self, lane: usize, equations: &[f64]) {
        for (to, &value) in self.lower.iter_mut().zip(equations) {
            to[lane] = value;
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

/// Start of a row of the packed triangle.
#[inline(always)]
fn begin(row: usize) -> usize {
    row * (row + 1) / 2
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Solving<'a>(&'a mut SideBySide);

impl WithSimd for Solving<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let SideBySide {
            unknowns,
            lower,
            reciprocals,
            solution,
            min_left,
        } = self.0;
        let n = *unknowns;
        // The remainder of the diagonal entry is compared with its original value.
        for (i, diagonal) in solution.iter_mut().enumerate() {
            *diagonal = lower[begin(i) + i];
        }
        *min_left = [f64::INFINITY; LANES];
        for p in 0..n {
            let pivot = lower[begin(p) + p];
            let mut reciprocal = [0.0; LANES];
            for lane in 0..LANES {
                let left = pivot[lane] / solution[p][lane];
                // Written so that NaN counts as the minimum.
                min_left[lane] = if left >= min_left[lane] { min_left[lane] } else { left };
                reciprocal[lane] = 1.0 / pivot[lane].sqrt();
            }
            reciprocals[p] = reciprocal;
            for i in p + 1..=n {
                let entry = &mut lower[begin(i) + p];
                for lane in 0..LANES {
                    entry[lane] *= reciprocal[lane];
                }
            }
            for i in p + 1..=n {
                let (before, row) = lower.split_at_mut(begin(i));
                let own = row[p];
                for j in p + 1..i {
                    let other = &before[begin(j) + p];
                    let entry = &mut row[j];
                    for lane in 0..LANES {
                        entry[lane] -= own[lane] * other[lane];
                    }
                }
                let entry = &mut row[i];
                for lane in 0..LANES {
                    entry[lane] -= own[lane] * own[lane];
                }
            }
        }
        for p in (0..n).rev() {
            let mut value = lower[begin(n) + p];
            for i in p + 1..n {
                let (entry, known) = (&lower[begin(i) + p], &solution[i]);
                for lane in 0..LANES {
                    value[lane] -= entry[lane] * known[lane];
                }
            }
            for lane in 0..LANES {
                solution[p][lane] = value[lane] * reciprocals[p][lane];
            }
        }
    }
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Inverting<'a>(&'a mut SideBySide);

impl WithSimd for Inverting<'_> {
    type Output = [f64; LANES];

    /// The squared norm of a row of A⁺ is the diagonal entry of (AᵀA)⁻¹ = L⁻ᵀ L⁻¹, hence that of a column of L⁻¹.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let SideBySide {
            unknowns,
            lower,
            reciprocals,
            solution: column,
            ..
        } = self.0;
        let n = *unknowns;
        let mut largest = [0.0; LANES];
        for first in 0..n {
            column[first] = reciprocals[first];
            let mut squares = [0.0; LANES];
            for lane in 0..LANES {
                squares[lane] = column[first][lane] * column[first][lane];
            }
            for i in first + 1..n {
                let mut value = [0.0; LANES];
                for j in first..i {
                    let entry = &lower[begin(i) + j];
                    for lane in 0..LANES {
                        value[lane] -= entry[lane] * column[j][lane];
                    }
                }
                for lane in 0..LANES {
                    value[lane] *= reciprocals[i][lane];
                    squares[lane] += value[lane] * value[lane];
                }
                column[i] = value;
            }
            for lane in 0..LANES {
                let is_larger = squares[lane] > largest[lane] || squares[lane].is_nan();
                largest[lane] = if is_larger { squares[lane] } else { largest[lane] };
            }
        }
        let mut norms = [0.0; LANES];
        for lane in 0..LANES {
            norms[lane] = largest[lane].sqrt();
        }
        norms
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
