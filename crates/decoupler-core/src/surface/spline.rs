//! Splines through nodes, as a matrix of weights.
//!
//! The thin-plate spline (J. Duchon, "Splines minimizing rotation-invariant semi-norms in Sobolev spaces", 1977): of all
//! surfaces through the nodes, the one of minimum bending energy.
//!
//! It is the sum of a plane and Green's functions of the biharmonic operator, one at each node,
//!
//! ```text
//! z(p) = a + b·p + Σ_n w_n φ(|p − p_n|)        φ(r) = r² ln r,  φ(0) = 0,  Σ w_n = 0,  Σ w_n p_n = 0
//! ```
//!
//! Through nodes on a line along x or y, the curve of least bending energy is the natural cubic spline: the same sum with
//! the Green's function φ(r) = r³ of one dimension. Beyond both ends it is straight.
//!
//! MATLAB's `griddata(…, 'v4')`, used for the paper's figures, is the biharmonic spline without the plane (D. T.
//! Sandwell, "Biharmonic spline interpolation of GEOS-3 and SEASAT altimeter data", Geophysical Research Letters 14(2),
//! 1987, 139-142; φ(r) = r² (ln r − 1)). It sags between nodes of equal height, bends towards 0 beyond them, and depends
//! on the unit of length. With the plane, constants and planes are reproduced; and since a multiple of r² in φ adds only
//! a constant under the two conditions on w, neither Sandwell's −1 nor the unit makes a difference.
//!
//! Only z varies from frame to frame, and it enters linearly: z(points) = W z. With P an orthonormal basis of the affine
//! functions on the nodes and Π = I − PPᵀ, the columns of Wᵀ are `P q + Π (ΠAΠ + τPPᵀ)⁻¹ Π (φ − AP q)`, where q are the
//! basis functions and φ the Green's functions at a point, and A_mn = φ(|p_m − p_n|). ΠAΠ is positive definite on the
//! complement of P, so the matrix has a Cholesky factor; any τ > 0 gives the same W.

use faer::{Mat, MatRef, Scale, Side, linalg::solvers::Solve};
use ndarray::{Array2, ArrayView1, ArrayViewMut1, linalg::general_mat_vec_mul};

/// Largest accepted sum of absolute weights at a point within the nodes. On regular lattices the sum is below 3; a smooth
/// surface through nodes that nearly coincide overshoots by the size of this sum.
const LARGEST_AMPLIFICATION: f64 = 1e3;

/// Largest accepted deviation of the computed weights at a node from 1 there and 0 elsewhere.
const LARGEST_ROUNDING: f64 = 1e-9;

/// A point in the plane.
pub(super) type Place = (f64, f64);

/// A point at which a spline is evaluated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) place_mm: Place,
    /// True within the nodes, where the surface is not extrapolated.
    pub(super) is_inside: bool,
    /// Node at this point.
    pub(super) node: Option<usize>,
}

/// Weights of the nodes' values at each point, `points × nodes`; those at each point sum to 1.
#[derive(Clone, Debug)]
pub(super) struct Weights(Array2<f64>);

impl Weights {
    /// Computes the weights at `points`; `None` if they are dominated by rounding errors or amplify too much.
    pub(super) fn new(nodes_mm: &[Place], points: &[Point]) -> Option<Self> {
        let places_mm = Vec::from_iter(points.iter().map(|point| point.place_mm));
        let mut weights = weights(nodes_mm, &places_mm)?;
        for (mut row, point) in weights.outer_iter_mut().zip(points) {
            let amplification: f64 = row.iter().map(|weight| weight.abs()).sum();
            if !amplification.is_finite() || point.is_inside && amplification > LARGEST_AMPLIFICATION {
                return None;
            }
            if let Some(node) = point.node {
                row[node] -= 1.0;
                if row.iter().any(|weight| weight.abs() > LARGEST_ROUNDING) {
                    return None;
                }
                // At a node the surface is exactly the node's value.
                row.fill(0.0);
                row[node] = 1.0;
            }
        }
        Some(Self(weights))
    }

    /// Evaluates one frame at every point.
    pub(super) fn evaluate(&self, node_values: &[f64]) -> Vec<f64> {
        // Relative to one of the values, so that the surface through level nodes is exactly level.
        let level = node_values[0];
        let relative: Vec<f64> = node_values.iter().map(|value| value - level).collect();
        let mut values = vec![level; self.0.nrows()];
        let mut out = ArrayViewMut1::from(&mut values);
        general_mat_vec_mul(1.0, &self.0, &ArrayView1::from(&relative), 1.0, &mut out);
        values
    }
}

/// Returns W (`points × nodes`) for nodes that are not on a line, or on one along x or y; `None` if the equations are
/// numerically singular.
fn weights(nodes_mm: &[Place], points_mm: &[Place]) -> Option<Array2<f64>> {
    /// Points whose equations are solved together, so that not the whole grid is in memory several times.
    const BLOCK: usize = 1024;
    let local = LocalCoordinates::of(nodes_mm);
    let nodes = local.places(nodes_mm);
    let affine = AffineBasis::of(&nodes);
    let on_nodes = affine.at(&nodes);
    let basis = on_nodes.as_ref();

    let is_line = affine.dimensions() < 2;
    let greens = |others: &[Place]| {
        Mat::from_fn(nodes.len(), others.len(), |n, p| {
            green(distance_squared(nodes[n], others[p]), is_line)
        })
    };
    let system = greens(&nodes);
    let mut projected = system.clone();
    // Before the projection, which for three nodes leaves only rounding errors.
    let tau = system.norm_max().max(f64::MIN_POSITIVE.sqrt());
    // Twice, once from each side: A is symmetric.
    remove_affine(basis, &mut projected);
    projected = projected.transpose().to_owned();
    remove_affine(basis, &mut projected);
    projected += (Scale(tau) * basis) * basis.transpose();
    let factors = projected.llt(Side::Lower).ok()?;

    let of_affine = &system * basis;
    let mut weights = Array2::zeros((points_mm.len(), nodes.len()));
    let blocks = points_mm
        .chunks(BLOCK)
        .zip(weights.axis_chunks_iter_mut(ndarray::Axis(0), BLOCK));
    for (points_mm, mut weights) in blocks {
        let points = local.places(points_mm);
        let at_points = affine.at(&points);
        let mut solution = greens(&points);
        solution -= &of_affine * at_points.transpose();
        remove_affine(basis, &mut solution);
        factors.solve_in_place(&mut solution);
        remove_affine(basis, &mut solution);
        solution += basis * at_points.transpose();
        for ((point, node), weight) in weights.indexed_iter_mut() {
            *weight = solution[(node, point)];
        }
    }
    Some(weights)
}

/// φ(r) from r²: r³ on a line, and r² ln r in the plane.
fn green(distance_squared: f64, is_line: bool) -> f64 {
    if is_line {
        distance_squared * distance_squared.sqrt()
    } else if distance_squared > 0.0 {
        0.5 * distance_squared * distance_squared.ln()
    } else {
        0.0
    }
}

fn distance_squared(a: Place, b: Place) -> f64 {
    (a.0 - b.0).powi(2) + (a.1 - b.1).powi(2)
}

/// Removes from each column its component in the span of `basis`: `matrix = (I − PPᵀ) matrix`.
fn remove_affine(basis: MatRef<'_, f64>, matrix: &mut Mat<f64>) {
    let parts = basis.transpose() * &*matrix;
    *matrix -= basis * parts;
}

/// Coordinates relative to the centre of the nodes, as fractions of half their extent, so that no digits are lost to the
/// origin or the unit of the given coordinates.
struct LocalCoordinates {
    middle_mm: Place,
    half_extent_mm: f64,
}

impl LocalCoordinates {
    fn of(nodes_mm: &[Place]) -> Self {
        let range = |coordinate: fn(&Place) -> f64| {
            let values = || nodes_mm.iter().map(coordinate);
            let (least, most) = (values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max));
            (0.5 * least + 0.5 * most, 0.5 * most - 0.5 * least)
        };
        let ((x_mm, half_x_mm), (y_mm, half_y_mm)) = (range(|place| place.0), range(|place| place.1));
        let half_extent_mm = half_x_mm.max(half_y_mm);
        Self {
            middle_mm: (x_mm, y_mm),
            half_extent_mm: if half_extent_mm > 0.0 { half_extent_mm } else { 1.0 },
        }
    }

    fn places(&self, places_mm: &[Place]) -> Vec<Place> {
        let local = |place_mm: f64, middle_mm: f64| (place_mm - middle_mm) / self.half_extent_mm;
        let places_mm = places_mm.iter();
        places_mm
            .map(|&(x, y)| (local(x, self.middle_mm.0), local(y, self.middle_mm.1)))
            .collect()
    }
}

/// Affine functions that are orthonormal on the nodes: a constant, the deviation from the mean of x, and the deviation
/// from the mean of y after regression on x; without those that vanish on all nodes.
struct AffineBasis {
    constant: f64,
    mean: Place,
    /// Slope of the regression of y on x over the nodes.
    tilt: f64,
    /// Reciprocal norms of both deviations; `None` for one that vanishes.
    scales: [Option<f64>; 2],
}

impl AffineBasis {
    fn of(nodes: &[Place]) -> Self {
        let count = nodes.len() as f64;
        let mean = |coordinate: fn(&Place) -> f64| nodes.iter().map(coordinate).sum::<f64>() / count;
        let mean = (mean(|place| place.0), mean(|place| place.1));
        let centred = || nodes.iter().map(|node| (node.0 - mean.0, node.1 - mean.1));
        let square = centred().map(|(x, _)| x * x).sum::<f64>();
        let tilt = if square > 0.0 {
            centred().map(|(x, y)| x * y).sum::<f64>() / square
        } else {
            0.0
        };
        let rest = centred().map(|(x, y)| (y - tilt * x).powi(2)).sum::<f64>();
        Self {
            constant: 1.0 / count.sqrt(),
            mean,
            tilt,
            scales: [square, rest].map(|square| (square > 0.0).then(|| 1.0 / square.sqrt())),
        }
    }

    /// Number of dimensions of the nodes: 2, 1 on a line, and 0 for one node.
    fn dimensions(&self) -> usize {
        self.scales.iter().flatten().count()
    }

    /// Values of the functions: `points × functions`.
    fn at(&self, places: &[Place]) -> Mat<f64> {
        Mat::from_fn(places.len(), 1 + self.dimensions(), |p, function| {
            let (x, y) = (places[p].0 - self.mean.0, places[p].1 - self.mean.1);
            match (function, self.scales) {
                (0, _) => self.constant,
                (1, [Some(scale), _]) => x * scale,
                (_, [_, scale]) => (y - self.tilt * x) * scale.unwrap_or_default(),
            }
        })
    }
}
