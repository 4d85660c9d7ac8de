use faer::{Mat, Side};
use glam::DVec3;
use rand::{Rng, RngExt};

use super::{Indenter, Loading, press::Press};
use crate::{
    numerics::normal_cdf,
    scene::{Deformation, Movement, Scene, standard_normal},
    sensor::{ArrayScale, Geometry, SensorModel},
};

/// Draws deformations of one array in one scene; common quantities are computed once.
#[derive(Clone, Debug)]
pub struct DeformationSampler {
    model: SensorModel,
    movement: Movement,
    stroke_mm: f64,
    loading: Prepared,
}

#[derive(Clone, Debug)]
enum Prepared {
    RandomNodes,
    SmoothField(SmoothField),
    Indenter(Indenter),
}

impl DeformationSampler {
    pub(in crate::scene) fn new(scene: &Scene, model: &SensorModel) -> Self {
        let loading = match scene.loading {
            Loading::RandomNodes => Prepared::RandomNodes,
            Loading::SmoothField { correlation_length_mm } => {
                Prepared::SmoothField(SmoothField::new(model.scale, &model.geometry, correlation_length_mm))
            }
            Loading::Indenter(indenter) => Prepared::Indenter(indenter),
        };
        Self {
            model: *model,
            movement: scene.movement,
            stroke_mm: scene.stroke_mm(&model.geometry),
            loading,
        }
    }

    /// Draws the deformation of the whole array at one moment.
    pub fn draw(&self, rng: &mut impl Rng) -> Deformation {
        let scale = self.model.scale;
        let shift_mm = self.movement.largest_shift_mm();
        match &self.loading {
            Prepared::RandomNodes => {
                let mut uniform = || rng.random::<f64>();
                Deformation::from_fn(scale, |_, _| random_mm(self.movement, self.stroke_mm, &mut uniform))
            }
            Prepared::SmoothField(field) => {
                let z = field.draw(rng);
                let sideways = match self.movement {
                    Movement::Z => None,
                    Movement::Xyz { .. } => Some((field.draw(rng), field.draw(rng))),
                };
                Deformation::from_fn(scale, |row, node| {
                    let at = (row, node);
                    let sideways = sideways.as_ref().map(|(x, y)| (x[at], y[at]));
                    field_mm(z[at], sideways, self.stroke_mm, shift_mm)
                })
            }
            Prepared::Indenter(indenter) => {
                let press = indenter.draw(&self.model, self.stroke_mm, rng);
                let mut sideways = || match self.movement {
                    Movement::Z => 0.0,
                    Movement::Xyz { .. } => shift_mm * (2.0 * rng.random::<f64>() - 1.0),
                };
                let sideways_mm = (sideways(), sideways());
                Deformation::from_fn(scale, |row, node| {
                    let rest_mm = self.model.geometry.row_node_mm(scale, row, node);
                    dragged_mm(&press, rest_mm, sideways_mm, self.stroke_mm)
                })
            }
        }
    }
}

/// Displacement of a random node from uniform values in [0, 1).
pub(super) fn random_mm(movement: Movement, stroke_mm: f64, uniform: &mut impl FnMut() -> f64) -> DVec3 {
    let z = stroke_mm * uniform();
    match movement {
        Movement::Z => DVec3::new(0.0, 0.0, z),
        Movement::Xyz { largest_shift_mm } => {
            let mut sideways = || largest_shift_mm * (2.0 * uniform() - 1.0);
            DVec3::new(sideways(), sideways(), z)
        }
    }
}

/// Displacement of a node from the values of smooth fields, which are uniform in [0, 1].
pub(super) fn field_mm(z: f64, sideways: Option<(f64, f64)>, stroke_mm: f64, shift_mm: f64) -> DVec3 {
    let (x, y) = sideways.map_or((0.0, 0.0), |(x, y)| (2.0 * x - 1.0, 2.0 * y - 1.0));
    DVec3::new(shift_mm * x, shift_mm * y, stroke_mm * z)
}

/// Displacement of the node at `rest_mm` under a press. Friction drags the surface along with the body by up to
/// `sideways_mm`, in proportion to the depth.
pub(super) fn dragged_mm(press: &Press, rest_mm: DVec3, sideways_mm: (f64, f64), stroke_mm: f64) -> DVec3 {
    let z = press.depth_at_mm(rest_mm.x, rest_mm.y).clamp(0.0, stroke_mm);
    let dragged = z / stroke_mm;
    DVec3::new(sideways_mm.0 * dragged, sideways_mm.1 * dragged, z)
}

/// The displacements of one row-wire as a function of independent standard normal variables: the prior of the row in a
/// scene, exactly as [`DeformationSampler`](super::DeformationSampler) draws it.
#[derive(Clone, Debug)]
pub(crate) struct LatentRow {
    model: SensorModel,
    movement: Movement,
    stroke_mm: f64,
    row: usize,
    loading: Latent,
}

#[derive(Clone, Debug)]
enum Latent {
    RandomNodes,
    /// Square root of the covariance of a field, row by row: nodes × variables of each axis.
    SmoothField {
        root: Vec<f64>,
        variables: usize,
    },
    Indenter(Indenter),
}

impl LatentRow {
    /// Prepares the prior of row-wire `row`.
    pub(crate) fn new(model: &SensorModel, scene: &Scene, row: usize) -> Self {
        let loading = match scene.loading {
            Loading::RandomNodes => Latent::RandomNodes,
            Loading::SmoothField { correlation_length_mm } => {
                let field = SmoothField::new(model.scale, &model.geometry, correlation_length_mm);
                let (root, variables) = field.root_of_row();
                Latent::SmoothField { root, variables }
            }
            Loading::Indenter(indenter) => Latent::Indenter(indenter),
        };
        Self {
            model: *model,
            movement: scene.movement,
            stroke_mm: scene.stroke_mm(&model.geometry),
            row,
            loading,
        }
    }

    /// Number of standard normal variables.
    pub(crate) fn variables(&self) -> usize {
        let axes = self.movement.axes().count();
        match &self.loading {
            Latent::RandomNodes => axes * self.model.scale.nodes_per_row(),
            Latent::SmoothField { variables, .. } => axes * variables,
            // A direction takes two variables, so that it has no discontinuity.
            Latent::Indenter(indenter) => indenter.uniforms() + 1 + (axes - 1),
        }
    }

    /// Writes the displacements in mm (M2) for these values of the variables.
    pub(crate) fn displacements(&self, variables: &[f64], displacements_mm: &mut [DVec3]) {
        let shift_mm = self.movement.largest_shift_mm();
        match &self.loading {
            Latent::RandomNodes => {
                let mut variables = variables.iter();
                let mut uniform = || variables.next().map_or(0.5, |&value| normal_cdf(value));
                for displacement in displacements_mm {
                    *displacement = random_mm(self.movement, self.stroke_mm, &mut uniform);
                }
            }
            Latent::SmoothField { root, variables: count } => {
                for (node, displacement) in displacements_mm.iter_mut().enumerate() {
                    let root = &root[node * count..(node + 1) * count];
                    let field = |axis: usize| {
                        let white = &variables[axis * count..(axis + 1) * count];
                        normal_cdf(root.iter().zip(white).map(|(root, white)| root * white).sum())
                    };
                    let sideways = (self.movement != Movement::Z).then(|| (field(1), field(2)));
                    *displacement = field_mm(field(0), sideways, self.stroke_mm, shift_mm);
                }
            }
            Latent::Indenter(indenter) => {
                let (of_press, sideways) = variables.split_at(indenter.uniforms() + 1);
                let mut at = 0;
                let press = indenter.press_of(&self.model, self.stroke_mm, || {
                    let uniform = if at == Indenter::DIRECTION {
                        at += 1;
                        let turn = of_press[at].atan2(of_press[at - 1]) / std::f64::consts::TAU;
                        turn - turn.floor()
                    } else {
                        normal_cdf(of_press[at])
                    };
                    at += 1;
                    uniform
                });
                let shift = |value: &f64| shift_mm * (2.0 * normal_cdf(*value) - 1.0);
                let (x_mm, y_mm) = match sideways {
                    [x, y] => (shift(x), shift(y)),
                    _ => (0.0, 0.0),
                };
                for (node, displacement) in displacements_mm.iter_mut().enumerate() {
                    let rest_mm = self.model.geometry.row_node_mm(self.model.scale, self.row, node);
                    *displacement = dragged_mm(&press, rest_mm, (x_mm, y_mm), self.stroke_mm);
                }
            }
        }
    }
}

/// A stationary Gaussian random field on the nodes with covariance exp(−distance² / (2 length²)), turned into a field
/// that is uniform on [0, 1] at every node by its distribution function (a Gaussian copula).
///
/// On a grid the covariance is a Kronecker product of a factor along x and one along y. The field is therefore Rx Z Ryᵀ,
/// where Z is white noise and Rx and Ry are square roots of the factors.
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

    /// Returns a square root of the covariance of the nodes of one row-wire, row by row, and its number of columns.
    /// Patterns whose standard deviation is below 1e-9 are left out.
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
    use crate::{
        dataset::{Seed, Stream},
        scene::standard_normal,
    };

    /// In every scene, means and second moments of all unknowns of a row agree with those of the sampler.
    #[test]
    fn rows_are_distributed_as_the_sampler_draws_them() {
        const DRAWS: usize = 20_000;
        let model = SensorModel::new("5x3_2x9".parse().unwrap());
        let loadings = ["random", "smooth:3"].map(|text| text.parse().unwrap());
        for loading in loadings.into_iter().chain(Indenter::all().map(Loading::Indenter)) {
            for movement in [Movement::Z, Movement::SIDEWAYS] {
                let scene = Scene {
                    movement,
                    loading,
                    ..Scene::default()
                };
                let row = LatentRow::new(&model, &scene, 1);
                let sampler = scene.sampler(&model);
                let mut rng = Seed(3).rng(Stream::Expectation);
                let moments = |draw: &mut dyn FnMut() -> Vec<f64>| {
                    let mut sums = vec![0.0; 9 + 81];
                    for _ in 0..DRAWS {
                        let values = draw();
                        for (i, one) in values.iter().enumerate() {
                            sums[i] += one / DRAWS as f64;
                            for (j, other) in values.iter().enumerate() {
                                sums[9 + 9 * i + j] += one * other / DRAWS as f64;
                            }
                        }
                    }
                    sums
                };
                let flat = |nodes: &[DVec3]| nodes.iter().flat_map(|node| node.to_array()).collect::<Vec<f64>>();
                let drawn = moments(&mut || flat(sampler.draw(&mut rng).row_mm(1)));
                let mut rng = Seed(4).rng(Stream::Expectation);
                let latent = moments(&mut || {
                    let variables: Vec<f64> = (0..row.variables()).map(|_| standard_normal(&mut rng)).collect();
                    let mut nodes = vec![DVec3::ZERO; 3];
                    row.displacements(&variables, &mut nodes);
                    flat(&nodes)
                });
                // Values reach 1 mm, so that each mean has a standard error of at most 0.004.
                for (one, other) in drawn.iter().zip(&latent) {
                    assert!(
                        (one - other).abs() < 0.016,
                        "{loading} {movement}: {drawn:?} {latent:?}"
                    );
                }
            }
        }
    }

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
