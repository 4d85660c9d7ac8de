//! The biharmonic spline (D. T. Sandwell, "Biharmonic spline interpolation of GEOS-3 and SEASAT altimeter data",
//! Geophysical Research Letters 14(2), 1987, 139-142), known as `griddata(…, 'v4')`.
//!
//! A surface is a sum of Green's functions of the biharmonic operator, one at each node,
//!
//! ```text
//! z(p) = Σ_n w_n φ(|p − p_n|)        φ(r) = r² (ln r − 1),  φ(0) = 0,  r in millimetres
//! ```
//!
//! with weights from G w = z, G_mn = φ(|p_m − p_n|). Only z varies, hence z(grid) = (Φ G⁻¹) z. As in `griddata`, there
//! is no polynomial part: the result depends on the unit of length and does not reproduce constants exactly between the
//! nodes.

use faer::Mat;
use faer::linalg::solvers::Solve;
use ndarray::{Array2, ArrayView1, ArrayViewMut1, linalg::general_mat_vec_mul};

/// Largest accepted sum of absolute weights at a point within the nodes. Well-conditioned lattices stay below 10;
/// beyond this bound the weights are rounding errors of a nearly singular G.
const LARGEST_AMPLIFICATION: f64 = 1e3;

/// Largest accepted residual of G X = Φᵀ, relative to the largest entry of G and Φ.
const LARGEST_RESIDUAL: f64 = 1e-9;

/// φ(r) = r² (ln r − 1) from r².
fn green(distance_squared_mm2: f64) -> f64 {
    if distance_squared_mm2 > 0.0 {
        distance_squared_mm2 * (0.5 * distance_squared_mm2.ln() - 1.0)
    } else {
        0.0
    }
}

fn distance_squared(a: (f64, f64), b: (f64, f64)) -> f64 {
    (a.0 - b.0).powi(2) + (a.1 - b.1).powi(2)
}

/// Returns Φ G⁻¹ (`points × nodes`), or `None` if G is too ill-conditioned. Each point comes with a flag for lying
/// within the nodes.
pub(super) fn weights(nodes_mm: &[(f64, f64)], points_mm: &[((f64, f64), bool)]) -> Option<Array2<f64>> {
    let (nodes, points) = (nodes_mm.len(), points_mm.len());
    let gram = Mat::from_fn(nodes, nodes, |m, n| green(distance_squared(nodes_mm[m], nodes_mm[n])));
    let basis = Mat::from_fn(nodes, points, |n, p| {
        green(distance_squared(nodes_mm[n], points_mm[p].0))
    });
    // G is symmetric but indefinite, hence the pivoted factorisation; Φ G⁻¹ = (G⁻¹ Φᵀ)ᵀ.
    let solution = gram.partial_piv_lu().solve(&basis);

    let scale = gram.norm_max().max(basis.norm_max());
    let residual = (&gram * &solution - &basis).norm_max();
    let healthy = |p: usize| {
        let amplification: f64 = solution.col(p).iter().map(|weight| weight.abs()).sum();
        amplification.is_finite() && (!points_mm[p].1 || amplification <= LARGEST_AMPLIFICATION)
    };
    if !(residual <= LARGEST_RESIDUAL * scale && (0..points).all(healthy)) {
        return None;
    }
    let mut weights = Array2::from_shape_fn((points, nodes), |(p, n)| solution[(n, p)]);
    // At a node the surface is exactly the node's value, which the solution gives only up to rounding.
    for (mut row, (place, _)) in weights.outer_iter_mut().zip(points_mm) {
        if let Some(node) = nodes_mm.iter().position(|node| node == place) {
            row.fill(0.0);
            row[node] = 1.0;
        }
    }
    Some(weights)
}

/// Evaluates one frame: `out = weights · node_values`.
pub(super) fn evaluate_into(weights: &Array2<f64>, node_values: &[f64], out: &mut [f64]) {
    general_mat_vec_mul(
        1.0,
        weights,
        &ArrayView1::from(node_values),
        0.0,
        &mut ArrayViewMut1::from(out),
    );
}
