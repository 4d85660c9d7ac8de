use super::upper;

/// QR decomposition of a small least-squares problem: by the normal equations if they are well conditioned, otherwise by
/// Householder reflections, which take four times as long (Golub and Van Loan, Matrix Computations, sections 5.2 and 5.3).
/// Row by row, so that all columns are transformed at once in vector registers.
#[derive(Clone, Debug, Default)]
pub(super) struct Triangle {
    /// [R, Qᵀb] above the diagonal; the entries below it are scratch. Rows × width.
    matrix: Vec<f64>,
    /// Number of unknowns plus 1.
    width: usize,
    sums: Vec<f64>,
    column: Vec<f64>,
}

impl Triangle {
    /// Decomposes `system` = [A, b] (rows × `width`, row by row), with [`root` · I, 0] appended below unless `root`
    /// is 0 and A has at least as many rows as unknowns.
    pub(super) fn factor(&mut self, system: &[f64], width: usize, root: f64) {
        let unknowns = width - 1;
        if self.factor_normal_equations(system, width, root) {
            return;
        }
        let equations = system.len() / width;
        let below = if root > 0.0 || equations < unknowns {
            unknowns
        } else {
            0
        };
        self.width = width;
        self.matrix.clear();
        self.matrix.extend_from_slice(system);
        self.matrix.resize((equations + below) * width, 0.0);
        for unknown in 0..below {
            self.matrix[(equations + unknown) * width + unknown] = root;
        }
        for pivot in 0..unknowns {
            self.reflect(pivot);
        }
    }

    /// As [`Self::factor`], by Cholesky factorisation of AᵀA; `false` if rounding would affect the solution.
    fn factor_normal_equations(&mut self, system: &[f64], width: usize, root: f64) -> bool {
        /// Fraction of a diagonal entry that must remain after eliminating the columns before it.
        const MIN_LEFT: f64 = 1e-8;
        let unknowns = width - 1;
        self.width = width;
        self.matrix.clear();
        self.matrix.resize(unknowns * width, 0.0);
        for row in system.chunks_exact(width) {
            for (place, products) in self.matrix.chunks_exact_mut(width).enumerate() {
                let value = row[place];
                // Half the entries of a prior, or nearly all.
                if value == 0.0 {
                    continue;
                }
                for (product, entry) in products[place..].iter_mut().zip(&row[place..]) {
                    *product += value * entry;
                }
            }
        }
        for place in 0..unknowns {
            self.matrix[place * width + place] += root * root;
        }
        self.column.clear();
        self.column.resize(unknowns, 0.0);
        let (rows, diagonal) = (self.matrix.as_chunks_mut::<1>().0, self.column.as_chunks_mut().0);
        let [min_left] = upper::factor(rows, width, diagonal, MIN_LEFT);
        min_left > MIN_LEFT
    }

    /// Zeroes the entries of column `pivot` below the diagonal.
    fn reflect(&mut self, pivot: usize) {
        let Self {
            matrix,
            width,
            sums,
            column,
        } = self;
        let width = *width;
        let below = &mut matrix[pivot * width..];
        column.clear();
        column.extend(below.iter().skip(pivot).step_by(width));
        let norm = column.iter().map(|value| value * value).sum::<f64>().sqrt();
        if norm == 0.0 {
            return;
        }
        let diagonal = -norm.copysign(column[0]);
        column[0] -= diagonal;
        let factor = 1.0 / (norm * column[0].abs());
        sums.clear();
        sums.resize(width - pivot - 1, 0.0);
        for (row, &value) in below.chunks_exact(width).zip(&*column) {
            for (sum, entry) in sums.iter_mut().zip(&row[pivot + 1..]) {
                *sum += value * entry;
            }
        }
        for (row, &value) in below.chunks_exact_mut(width).zip(&*column) {
            let share = factor * value;
            for (sum, entry) in sums.iter().zip(&mut row[pivot + 1..]) {
                *entry -= share * sum;
            }
        }
        below[pivot] = diagonal;
    }

    /// Number of unknowns.
    pub(super) fn unknowns(&self) -> usize {
        self.width - 1
    }

    /// Row of [R, Qᵀb]; entries below the diagonal are scratch.
    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.matrix[row * self.width..(row + 1) * self.width]
    }

    /// Solves R x = Qᵀb, which minimises `‖A x − b‖² + root² ‖x‖²`. Entries are not finite if the columns of A are
    /// linearly dependent.
    pub(super) fn solve(&self, solution: &mut Vec<f64>) {
        solution.clear();
        solution.resize(self.unknowns(), 0.0);
        upper::solve::<1>(self.matrix.as_chunks().0, self.width, solution.as_chunks_mut().0);
    }

    /// Returns the largest norm of the first `count` rows of R⁻¹, which equals that of A⁺; infinite if the columns of A are
    /// linearly dependent.
    pub(super) fn largest_inverse_row(&mut self, count: usize) -> f64 {
        self.column.clear();
        self.column.resize(self.width - 1, 0.0);
        self.sums.clear();
        self.sums.resize(count, 0.0);
        let (squares, column) = (self.sums.as_chunks_mut().0, self.column.as_chunks_mut().0);
        upper::largest_inverse_rows::<1>(self.matrix.as_chunks().0, self.width, squares, column)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A = [[3, 1], [4, 2], [0, 2]], b = A (2, −1) + 5 (8, −6, 2)/…: the last term is orthogonal to both columns.
    #[test]
    fn least_squares_and_the_pseudo_inverse_match_the_normal_equations() {
        // (8, −6, 2): 3·8 − 4·6 + 0 = 0 and 8 − 12 + 4 = 0.
        let system = [3.0, 1.0, 5.0 + 8.0, 4.0, 2.0, 6.0 - 6.0, 0.0, 2.0, -2.0 + 2.0];
        let mut triangle = Triangle::default();
        triangle.factor(&system, 3, 0.0);
        let mut solution = Vec::new();
        triangle.solve(&mut solution);
        assert!(
            (solution[0] - 2.0).abs() < 1e-14 && (solution[1] + 1.0).abs() < 1e-14,
            "{solution:?}"
        );
        // AᵀA = [[25, 11], [11, 9]] has the inverse [[9, −11], [−11, 25]] / 104, whose diagonal holds the squares.
        assert!((triangle.largest_inverse_row(2) - (25.0_f64 / 104.0).sqrt()).abs() < 1e-14);
        // With damping 2: (AᵀA + 4 I) x = Aᵀb = (39, 13); determinant 29·13 − 121 = 256.
        triangle.factor(&system, 3, 2.0);
        triangle.solve(&mut solution);
        let expected = [(13.0 * 39.0 - 11.0 * 13.0) / 256.0, (29.0 * 13.0 - 11.0 * 39.0) / 256.0];
        for (ours, expected) in solution.iter().zip(expected) {
            assert!((ours - expected).abs() < 1e-14, "{solution:?}");
        }
    }

    #[test]
    fn dependent_columns_have_no_inverse() {
        let mut triangle = Triangle::default();
        triangle.factor(&[1.0, 0.0, 1.0, 2.0, 0.0, 1.0], 3, 0.0);
        assert_eq!(triangle.largest_inverse_row(2), f64::INFINITY);
        triangle.factor(&[1.0, 2.0, 1.0], 3, 0.0);
        assert_eq!(triangle.largest_inverse_row(2), f64::INFINITY);
    }
}
