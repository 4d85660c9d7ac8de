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
//! Only z varies from frame to frame, and it enters linearly: z(points) = W z. With A_mn = φ(|p_m − p_n|) and the affine
//! functions P on the nodes, the columns of Wᵀ are the first parts of the solutions of `[A P; Pᵀ 0] [w; c] = [φ; q]`,
//! where φ are the Green's functions and q the affine functions at a point.

use faer::{Mat, linalg::solvers::Solve};
use glam::DVec2;
use ndarray::{Array2, ArrayView1, ArrayViewMut1, Axis, linalg::general_mat_vec_mul};

/// Largest accepted sum of absolute weights at a point within the nodes. On regular lattices the sum is below 3; a smooth
/// surface through nodes that nearly coincide overshoots by the size of this sum.
const LARGEST_AMPLIFICATION: f64 = 1e3;

/// Largest accepted deviation of the computed weights at a node from 1 there and 0 elsewhere.
const LARGEST_ROUNDING: f64 = 1e-9;

/// A point at which a spline is evaluated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) place_mm: DVec2,
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
    pub(super) fn new(nodes_mm: &[DVec2], points: &[Point]) -> Option<Self> {
        let mut weights = weights(nodes_mm, points);
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

/// Returns W (`points × nodes`) for nodes that are not on a line, or on one along x or y.
fn weights(nodes_mm: &[DVec2], points: &[Point]) -> Array2<f64> {
    /// Points whose equations are solved together, so that not the whole grid is in memory several times.
    const BLOCK: usize = 1024;
    // Relative to the centre of the nodes, in units of half their extent: no digits are lost to origin or unit of length.
    let low = nodes_mm.iter().copied().fold(DVec2::MAX, DVec2::min);
    let high = nodes_mm.iter().copied().fold(DVec2::MIN, DVec2::max);
    let middle_mm = 0.5 * low + 0.5 * high;
    let half_extent_mm = (0.5 * high - 0.5 * low).max_element();
    let unit_mm = if half_extent_mm > 0.0 { half_extent_mm } else { 1.0 };
    let local = |place_mm: DVec2| (place_mm - middle_mm) / unit_mm;
    let nodes = Vec::from_iter(nodes_mm.iter().copied().map(local));
    let axes = Vec::from_iter((0..2).filter(|&axis| low[axis] < high[axis]));
    let count = nodes.len();
    let at = |function: usize, place: DVec2| match function.checked_sub(count) {
        None => green(nodes[function].distance_squared(place), axes.len() < 2),
        Some(0) => 1.0,
        Some(affine) => place[axes[affine - 1]],
    };
    let size = count + 1 + axes.len();
    let equations = Mat::from_fn(size, size, |row, column| match (nodes.get(row), nodes.get(column)) {
        (_, Some(node)) => at(row, *node),
        (Some(node), None) => at(column, *node),
        (None, None) => 0.0,
    });
    let factors = equations.partial_piv_lu();
    let mut weights = Array2::zeros((points.len(), count));
    let blocks = points.chunks(BLOCK).zip(weights.axis_chunks_iter_mut(Axis(0), BLOCK));
    for (points, mut weights) in blocks {
        let right = Mat::from_fn(size, points.len(), |row, point| at(row, local(points[point].place_mm)));
        let solution = factors.solve(right);
        for ((point, node), weight) in weights.indexed_iter_mut() {
            *weight = solution[(node, point)];
        }
    }
    weights
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
