//! Bilinear interpolation on a lattice: fast, and defined for every array.
//!
//! The natural cubic spline through nodes on a line, the curve of least bending energy.
//!
//! Between neighbours at a distance h it is `s = a z_i + b z_{i+1} + h²/6 ((a³ − a) m_i + (b³ − b) m_{i+1})` with b the
//! part of the way from i to i + 1 and a = 1 − b. Its second derivatives m vanish at both ends and, for the slope to be
//! continuous, satisfy
//!
//! ```text
//! h_{i−1} m_{i−1} + 2 (h_{i−1} + h_i) m_i + h_i m_{i+1} = 6 ((z_{i+1} − z_i)/h_i − (z_i − z_{i−1})/h_{i−1})
//! ```
//!
//! Beyond both ends the curve is straight. Through two nodes it is a line, through one a constant.

use ndarray::{Array2, ArrayView1, Zip};

/// Position of a grid line among two lattice lines: `(1 − weight) · lower + weight · upper`. Beyond the outermost line the
/// weight is below 0 or above 1.
#[derive(Clone, Copy, Debug)]
struct Between {
    lower: usize,
    upper: usize,
    weight: f64,
}

/// Bilinear weights along both axes; beyond the outermost nodes the surface keeps its slope.
#[derive(Clone, Debug)]
pub(super) struct Bilinear {
    x: Vec<Between>,
    y: Vec<Between>,
    nodes_per_row: usize,
}

impl Bilinear {
    /// Takes for each axis the ascending node coordinates, their indices in the caller's order, and the grid
    /// coordinates.
    pub(super) fn new(x: (&[f64], &[usize], &[f64]), y: (&[f64], &[usize], &[f64])) -> Self {
        Self {
            x: betweens(x.0, x.1, x.2),
            y: betweens(y.0, y.1, y.2),
            nodes_per_row: y.0.len(),
        }
    }

    pub(super) fn evaluate_into(&self, node_values: &[f64], out: &mut [f64]) {
        for (x, line) in self.x.iter().zip(out.chunks_exact_mut(self.y.len())) {
            let lower = &node_values[x.lower * self.nodes_per_row..][..self.nodes_per_row];
            let upper = &node_values[x.upper * self.nodes_per_row..][..self.nodes_per_row];
            for (y, value) in self.y.iter().zip(line) {
                let along = |row: &[f64]| mix(row[y.lower], row[y.upper], y.weight);
                *value = mix(along(lower), along(upper), x.weight);
            }
        }
    }
}

/// Interpolates linearly; exact at both ends, and unaffected by a missing value (NaN) of zero weight.
fn mix(lower: f64, upper: f64, weight: f64) -> f64 {
    if weight == 0.0 {
        lower
    } else if weight == 1.0 {
        upper
    } else {
        lower + (upper - lower) * weight
    }
}

fn betweens(nodes_mm: &[f64], order: &[usize], points_mm: &[f64]) -> Vec<Between> {
    points_mm
        .iter()
        .map(|&point_mm| {
            let last = nodes_mm.len() - 1;
            let upper = nodes_mm
                .partition_point(|&node_mm| node_mm < point_mm)
                .clamp(last.min(1), last);
            let lower = upper.saturating_sub(1);
            let weight = if upper > lower {
                (point_mm - nodes_mm[lower]) / (nodes_mm[upper] - nodes_mm[lower])
            } else {
                0.0
            };
            Between {
                lower: order[lower],
                upper: order[upper],
                weight,
            }
        })
        .collect()
}

/// Returns the matrix (`points × nodes`) from the values at the ascending `nodes_mm` to those at `points_mm`.
pub(super) fn weights(nodes_mm: &[f64], points_mm: &[f64]) -> Array2<f64> {
    let last = nodes_mm.len() - 1;
    if last == 0 {
        return Array2::ones((points_mm.len(), 1));
    }
    // In units of the extent, so that no length overflows when squared or divided by.
    let extent_mm = nodes_mm[last] - nodes_mm[0];
    let widths: Vec<f64> = nodes_mm
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / extent_mm)
        .collect();
    let bends = second_derivatives(&widths);
    let mut weights = Array2::zeros((points_mm.len(), nodes_mm.len()));
    for (mut row, &point_mm) in weights.outer_iter_mut().zip(points_mm) {
        let upper = nodes_mm.partition_point(|&node_mm| node_mm <= point_mm).clamp(1, last);
        let lower = upper - 1;
        let width = widths[lower];
        let b = (point_mm - nodes_mm[lower]) / extent_mm / width;
        let a = 1.0 - b;
        row[lower] = a;
        row[upper] = b;
        // Beyond an end the cubic is continued by its slope there, of which m is 0.
        let (lower_part, upper_part) = if b < 0.0 {
            (0.0, -b)
        } else if b > 1.0 {
            (-a, 0.0)
        } else {
            (a.powi(3) - a, b.powi(3) - b)
        };
        let mut add = |part: f64, bends: ArrayView1<'_, f64>| {
            let factor = width * width / 6.0 * part;
            Zip::from(&mut row)
                .and(bends)
                .for_each(|weight, bend| *weight += factor * bend);
        };
        add(lower_part, bends.row(lower));
        add(upper_part, bends.row(upper));
    }
    weights
}

/// Returns the matrix (`nodes × nodes`) from values to second derivatives, by elimination of the tridiagonal equations:
/// diagonally dominant, hence without pivots.
fn second_derivatives(widths: &[f64]) -> Array2<f64> {
    let last = widths.len();
    let mut right = Array2::zeros((last + 1, last + 1));
    let mut above = vec![0.0; last + 1];
    for i in 1..last {
        let (before, after) = (widths[i - 1], widths[i]);
        right[[i, i - 1]] += 6.0 / before;
        right[[i, i]] -= 6.0 / before + 6.0 / after;
        right[[i, i + 1]] += 6.0 / after;
        let pivot = 2.0 * (before + after) - before * above[i - 1];
        above[i] = after / pivot;
        let (done, mut rest) = right.view_mut().split_at(ndarray::Axis(0), i);
        Zip::from(rest.row_mut(0))
            .and(done.row(i - 1))
            .for_each(|value, eliminated| *value = (*value - before * eliminated) / pivot);
    }
    for i in (1..last).rev() {
        let (mut rest, done) = right.view_mut().split_at(ndarray::Axis(0), i + 1);
        Zip::from(rest.row_mut(i))
            .and(done.row(0))
            .for_each(|value, next| *value -= above[i] * next);
    }
    right
}
