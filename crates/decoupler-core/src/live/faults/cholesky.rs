/// Cholesky factor L Lᵀ of a small symmetric positive definite matrix, kept between uses so that none allocates.
#[derive(Clone, Debug)]
pub(super) struct Cholesky {
    order: usize,
    /// L, row by row; entries above the diagonal are not used.
    lower: Vec<f64>,
}

impl Cholesky {
    pub(super) fn new(order: usize) -> Self {
        Self {
            order,
            lower: vec![0.0; order * order],
        }
    }

    /// Factors `matrix` (order × order), of which the lower triangle is read. Returns `false` if it is not positive
    /// definite.
    pub(super) fn factor(&mut self, matrix: &[f64]) -> bool {
        let n = self.order;
        for i in 0..n {
            for j in 0..=i {
                let (row_i, row_j) = (&self.lower[i * n..i * n + j], &self.lower[j * n..j * n + j]);
                let product: f64 = row_i.iter().zip(row_j).map(|(a, b)| a * b).sum();
                let rest = matrix[i * n + j] - product;
                self.lower[i * n + j] = if i == j {
                    if !(rest > 0.0 && rest.is_finite()) {
                        return false;
                    }
                    rest.sqrt()
                } else {
                    rest / self.lower[j * n + j]
                };
            }
        }
        true
    }

    /// ln det of the matrix.
    pub(super) fn log_determinant(&self) -> f64 {
        let diagonal = (0..self.order).map(|i| self.lower[i * self.order + i].ln());
        2.0 * diagonal.sum::<f64>()
    }

    /// Replaces b by L⁻¹ b, whose squared norm is bᵀ A⁻¹ b.
    pub(super) fn solve_lower(&self, b: &mut [f64]) {
        let n = self.order;
        for i in 0..n {
            let product: f64 = self.lower[i * n..i * n + i].iter().zip(&*b).map(|(l, x)| l * x).sum();
            b[i] = (b[i] - product) / self.lower[i * n + i];
        }
    }

    /// Replaces b by A⁻¹ b.
    pub(super) fn solve(&self, b: &mut [f64]) {
        self.solve_lower(b);
        self.solve_upper(b);
    }

    /// Replaces b by L⁻ᵀ b.
    pub(super) fn solve_upper(&self, b: &mut [f64]) {
        let n = self.order;
        for i in (0..n).rev() {
            let product: f64 = (i + 1..n).map(|j| self.lower[j * n + i] * b[j]).sum();
            b[i] = (b[i] - product) / self.lower[i * n + i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factored_matrix_gives_back_its_solution_and_determinant() {
        let matrix = [4.0, 0.0, 0.0, 2.0, 5.0, 0.0, -1.0, 1.5, 3.0];
        let mut cholesky = Cholesky::new(3);
        assert!(cholesky.factor(&matrix));
        // A x for x = (1, −2, 3), with the upper triangle that mirrors the lower one.
        let mut b = [-3.0, -3.5, 5.0];
        cholesky.solve(&mut b);
        for (found, expected) in b.iter().zip([1.0, -2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
        // 4·(15 − 2.25) − 2·(6 + 1.5) − 1·(3 + 5).
        assert!((cholesky.log_determinant() - 28.0_f64.ln()).abs() < 1e-14);
        assert!(!cholesky.factor(&[1.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
        assert!(!cholesky.factor(&[f64::NAN; 9]));
    }
}
