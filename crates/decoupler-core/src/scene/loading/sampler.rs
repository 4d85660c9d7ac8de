use faer::{Mat, Side};
use glam::DVec3;
use rand::{Rng, RngExt};

use super::Loading;
use crate::{
    numerics::normal_cdf,
    scene::{Deformation, Scene, standard_normal},
    sensor::{ArrayScale, Axes, Geometry, SensorModel},
};

/// Draws deformations of one array in one scene; common quantities are computed once.
#[derive(Clone, Debug)]
pub(crate) struct DeformationSampler {
    model: SensorModel,
    scene: Scene,
    /// The field of a smooth loading.
    field: Option<SmoothField>,
}

impl DeformationSampler {
    /// Prepares to draw deformations of `model` in `scene`.
    pub(crate) fn new(scene: &Scene, model: &SensorModel) -> Self {
        let field = match scene.loading {
            Loading::SmoothField { correlation_length_mm } => {
                Some(SmoothField::new(model.scale, &model.geometry, correlation_length_mm))
            }
            Loading::RandomNodes | Loading::Indenter(_) => None,
        };
        Self {
            model: *model,
            scene: *scene,
            field,
        }
    }

    /// Draws the deformation of the whole array at one moment.
    pub fn draw(&self, rng: &mut impl Rng) -> Deformation {
        let (scale, stroke_mm) = (self.model.scale, self.scene.stroke_mm(&self.model.geometry));
        let movement = self.scene.movement;
        let (is_sideways, shift_mm) = (movement.axes() == Axes::Xyz, movement.largest_shift_mm());
        let shifted_mm = |uniform: f64| shift_mm * (2.0 * uniform - 1.0);
        match (self.scene.loading, &self.field) {
            (Loading::Indenter(indenter), _) => {
                let press = indenter.draw(&self.model, stroke_mm, rng);
                let mut sideways = || if is_sideways { shifted_mm(rng.random()) } else { 0.0 };
                let (x, y) = (sideways(), sideways());
                Deformation::from_fn(scale, |row, node| {
                    let rest_mm = self.model.geometry.row_node_mm(scale, row, node);
                    let z = press.depth_at_mm(rest_mm.x, rest_mm.y).clamp(0.0, stroke_mm);
                    // Friction drags the surface along with the body, in proportion to the depth.
                    let dragged = z / stroke_mm;
                    DVec3::new(x * dragged, y * dragged, z)
                })
            }
            (_, Some(field)) => {
                let z = field.draw(rng);
                let sideways = is_sideways.then(|| [field.draw(rng), field.draw(rng)]);
                Deformation::from_fn(scale, |row, node| {
                    let at = (row, node);
                    let [x, y] = (sideways.as_ref()).map_or([0.0; 2], |[x, y]| [x[at], y[at]].map(shifted_mm));
                    DVec3::new(x, y, stroke_mm * z[at])
                })
            }
            (_, None) => Deformation::from_fn(scale, |_, _| {
                let z = stroke_mm * rng.random::<f64>();
                let mut sideways = || if is_sideways { shifted_mm(rng.random()) } else { 0.0 };
                DVec3::new(sideways(), sideways(), z)
            }),
        }
    }
}

/// A stationary Gaussian random field on the nodes with covariance exp(−distance² / (2 length²)), turned into a field
/// that is uniform on [0, 1] at every node by its distribution function (a Gaussian copula).
///
/// On a grid the covariance is a Kronecker product of a factor along x and one along y. The field is therefore Rx Z Ryᵀ,
/// where Z is white noise and Rx and Ry are square roots of the factors.
#[derive(Clone, Debug)]
struct SmoothField {
    /// Row-wires × row-wires.
    along_x: Mat<f64>,
    /// Nodes × nodes.
    along_y: Mat<f64>,
}

impl SmoothField {
    fn new(scale: ArrayScale, geometry: &Geometry, length_mm: f64) -> Self {
        Self {
            along_x: root(scale.rows(), geometry.row_pitch_mm / length_mm),
            along_y: root(scale.nodes_per_row(), geometry.node_pitch_mm / length_mm),
        }
    }

    /// Draws the field: row-wires × nodes, in [0, 1].
    fn draw(&self, rng: &mut impl Rng) -> Mat<f64> {
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
/// definite, but nearly singular for small steps: eigenvalues that are negative due to rounding count as zero.
fn root(count: usize, step: f64) -> Mat<f64> {
    // An overflowed step would make the diagonal 0 · ∞.
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
    fn nodes_are_uniform_and_correlated_as_in_the_copula() {
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
