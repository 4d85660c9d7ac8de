use faer::{Mat, Side};
use rand::Rng;

use crate::{
    scene::normal::{normal_cdf, standard_normal},
    sensor::{ArrayScale, Geometry},
};

/// A stationary Gaussian random field on the nodes with covariance exp(−distance² / (2 length²)), turned into a field
/// that is uniform on [0, 1] at every node by its distribution function (a Gaussian copula).
///
/// On a grid the covariance is a Kronecker product of one along x and one along y, so Rx Z Ryᵀ has it, with Z white and
/// R a square root of each factor.
#[derive(Clone, Debug)]
pub(super) struct SmoothField {
    /// Row-wires × row-wires.
    along_x: Mat<f64>,
    /// Nodes × nodes.
    along_y: Mat<f64>,
}

impl SmoothField {
    pub(super) fn new(scale: ArrayScale, geometry: &Geometry, length_mm: f64) -> Self {
        let row_step = geometry.row_pitch_mm / length_mm;
        let node_step = geometry.node_pitch_mm / length_mm;
        Self {
            along_x: root(scale.rows(), row_step),
            along_y: root(scale.nodes_per_row(), node_step),
        }
    }

    /// Returns a square root of the covariance of the nodes of one row-wire, row by row, and its number of columns. Patterns
    /// whose standard deviation is below 1e-9 are left out.
    pub(super) fn root_of_row(&self) -> (Vec<f64>, usize) {
        const SMALLEST_DEVIATION: f64 = 1e-9;
        let root = &self.along_y;
        let seen = |&column: &usize| root.col(column).norm_max() >= SMALLEST_DEVIATION;
        let columns: Vec<usize> = (0..root.ncols()).filter(seen).collect();
        let entries = (0..root.nrows()).flat_map(|node| columns.iter().map(move |&column| root[(node, column)]));
        (entries.collect(), columns.len())
    }

    /// Draws the field: row-wires × nodes, in [0, 1].
    pub(super) fn draw(&self, rng: &mut impl Rng) -> Mat<f64> {
        let mut white = Mat::zeros(self.along_x.ncols(), self.along_y.ncols());
        for row in 0..white.nrows() {
            for node in 0..white.ncols() {
                white[(row, node)] = standard_normal(rng);
            }
        }
        let field = &self.along_x * white * self.along_y.transpose();
        Mat::from_fn(field.nrows(), field.ncols(), |row, node| normal_cdf(field[(row, node)]))
    }
}

/// Returns a square root of the covariance of `count` points `step` correlation lengths apart. The matrix is positive
/// definite, but nearly singular for small steps: eigenvalues that rounding turned negative count as zero.
fn root(count: usize, step: f64) -> Mat<f64> {
    // A step that overflowed would make 0 · ∞ of the diagonal.
    let step = step.min(f64::MAX);
    let covariance = Mat::from_fn(count, count, |i, j| {
        (-0.5 * (step * (i as f64 - j as f64)).powi(2)).exp()
    });
    let eigen = covariance.self_adjoint_eigen(Side::Lower);
    let eigen = eigen.expect("QR iterations with Wilkinson's shift converge for every finite symmetric matrix");
    let values = eigen.S().column_vector();
    Mat::from_fn(count, count, |i, k| eigen.U()[(i, k)] * values[k].max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Seed, Stream};

    #[test]
    fn roots_square_to_the_covariance() {
        for step in [0.0, 1e-300, 1e-9, 0.1, 1.0, 30.0, f64::MAX, f64::INFINITY] {
            let root = root(12, step);
            let square = &root * root.transpose();
            for (i, j) in [(0, 0), (3, 4), (0, 11), (7, 5)] {
                let apart: f64 = if i == j { 0.0 } else { step * (i as f64 - j as f64) };
                let expected = (-0.5 * apart.powi(2)).exp();
                assert!((square[(i, j)] - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn nodes_are_uniform_and_correlated_as_the_copula_says() {
        let scale = "4x3_1x9".parse().unwrap();
        let field = SmoothField::new(scale, &Geometry::default(), 2.0);
        let mut rng = Seed(1).rng(Stream::Training);
        let draws: Vec<Mat<f64>> = (0..20_000).map(|_| field.draw(&mut rng)).collect();
        let mean = |f: &dyn Fn(&Mat<f64>) -> f64| draws.iter().map(f).sum::<f64>() / draws.len() as f64;
        assert!((mean(&|d| d[(1, 2)]) - 0.5).abs() < 0.01);
        let variance = mean(&|d| (d[(1, 2)] - 0.5).powi(2));
        assert!((variance * 12.0 - 1.0).abs() < 0.03);
        // Nodes one row pitch (1 mm) apart: Gaussian correlation exp(−1/8), rank correlation (6/π) asin(ρ/2).
        let covariance = mean(&|d| (d[(1, 2)] - 0.5) * (d[(2, 2)] - 0.5));
        let expected = 6.0 / std::f64::consts::PI * (0.5 * (-0.125_f64).exp()).asin();
        assert!((covariance / variance - expected).abs() < 0.02);
    }
}
