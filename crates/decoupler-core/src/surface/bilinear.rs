//! Bilinear interpolation on a lattice: fast, and defined for every array.

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
