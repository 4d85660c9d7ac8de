//! Linear interpolation by a matrix of weights.

use ndarray::{Array2, ArrayView1, ArrayViewMut1, linalg::general_mat_vec_mul};

/// Largest accepted sum of absolute weights at a point within the nodes. On even lattices it stays below 3; a smooth
/// surface through nodes much closer to each other than to the rest overshoots by as much.
const LARGEST_AMPLIFICATION: f64 = 1e3;

/// Largest accepted deviation of the computed weights at a node from 1 there and 0 elsewhere.
const LARGEST_ROUNDING: f64 = 1e-9;

/// Weights of the nodes' values at each point, `points × nodes`; those at each point sum to 1.
#[derive(Clone, Debug)]
pub(super) struct Weights(Array2<f64>);

/// Properties of a point that are known beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Within the nodes, and not extrapolated.
    pub(super) is_inside: bool,
    /// The node at this place.
    pub(super) node: Option<usize>,
}

impl Weights {
    /// Takes `weights` as computed for `points`, or returns `None` if they are rounding errors or amplify too much.
    pub(super) fn checked(mut weights: Array2<f64>, points: impl Iterator<Item = Point>) -> Option<Self> {
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

    /// Evaluates one frame.
    pub(super) fn evaluate(&self, node_values: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.0.nrows()];
        self.evaluate_into(node_values, &mut out);
        out
    }

    /// Evaluates one frame: `out = weights · node_values`.
    pub(super) fn evaluate_into(&self, node_values: &[f64], out: &mut [f64]) {
        // Relative to one of the values, so that level nodes give an exactly level surface.
        let level = node_values[0];
        let relative: Vec<f64> = node_values.iter().map(|value| value - level).collect();
        out.fill(level);
        general_mat_vec_mul(
            1.0,
            &self.0,
            &ArrayView1::from(&relative),
            1.0,
            &mut ArrayViewMut1::from(out),
        );
    }
}
