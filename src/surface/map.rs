//! Interpolation from the values at the nodes to a surface.

use ndarray::Array2;

use super::biharmonic;
use super::bilinear::Bilinear;
use super::error::{Axis, SurfaceError};
use super::grid::{Grid, GridAxis, SortedAxis};

/// Largest number of nodes for the spline; beyond it, factorisation and matrix cost more than they show.
const MOST_SPLINE_NODES: usize = 1000;

/// Largest number of weights (grid points × nodes): about a millisecond per frame, limited by memory bandwidth.
const MOST_WEIGHTS: usize = 1_100_000;

/// Number of grid points per side, as far as [`MOST_WEIGHTS`] allows.
const GRID_POINTS: usize = 110;

/// Interpolation between the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Sandwell's biharmonic spline, `griddata(…, 'v4')`.
    BiharmonicSpline,
    /// Bilinear between neighbours, constant beyond the outermost nodes. Used for a single row or column of nodes, for
    /// more than a thousand nodes, and where the spline's equations are singular (for example, two nodes e millimetres
    /// apart).
    Bilinear,
}

/// Interpolation through a lattice of nodes, factored once, so that each frame is one matrix-vector product.
#[derive(Clone, Debug)]
pub struct SurfaceMap {
    grid: Grid,
    nodes: usize,
    spline_weights: Option<Array2<f64>>,
    bilinear: Bilinear,
}

impl SurfaceMap {
    /// Prepares the surface of the lattice `x_mm × y_mm`: one x per row-wire and one y per node of a row, in
    /// millimetres, in any order.
    ///
    /// # Errors
    /// [`SurfaceError`] if an axis is empty, a coordinate is not finite, or two coordinates coincide.
    pub fn new(x_mm: &[f64], y_mm: &[f64]) -> Result<Self, SurfaceError> {
        let x = SortedAxis::new(Axis::X, x_mm)?;
        let y = SortedAxis::new(Axis::Y, y_mm)?;
        let nodes = x_mm.len() * y_mm.len();
        // A polynomial-free spline sags between collinear nodes, and with one node it has no solution.
        let spline = if x_mm.len() > 1 && y_mm.len() > 1 && nodes <= MOST_SPLINE_NODES {
            let affordable = (MOST_WEIGHTS as f64 / nodes as f64).sqrt() as usize;
            let grid = grid(&x, &y, affordable.min(GRID_POINTS));
            spline_weights(x_mm, y_mm, &grid).map(|weights| (grid, weights))
        } else {
            None
        };
        let (grid, spline_weights) = match spline {
            Some((grid, weights)) => (grid, Some(weights)),
            None => (grid(&x, &y, GRID_POINTS), None),
        };
        let bilinear = Bilinear::new(
            (&x.nodes_mm, &x.order, grid.x_mm()),
            (&y.nodes_mm, &y.order, grid.y_mm()),
        );
        Ok(Self {
            grid,
            nodes,
            spline_weights,
            bilinear,
        })
    }

    /// Grid on which the surface is evaluated.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Number of nodes: rows × nodes per row.
    pub fn node_count(&self) -> usize {
        self.nodes
    }

    /// Returns the interpolation used between the nodes.
    pub fn interpolation(&self) -> Interpolation {
        match self.spline_weights {
            Some(_) => Interpolation::BiharmonicSpline,
            None => Interpolation::Bilinear,
        }
    }

    /// Writes the surface through `node_values` (`rows × nodes_per_row`, row by row, in any unit) to `out`
    /// (`x points × y points`, see [`Grid`]).
    ///
    /// A missing value (NaN) leaves a gap around its node, and the rest of that frame is bilinear.
    ///
    /// # Panics
    /// If `node_values` does not have [`Self::node_count`] entries, or `out` not [`Grid::len`].
    pub fn evaluate_into(&self, node_values: &[f64], out: &mut [f64]) {
        assert_eq!(node_values.len(), self.nodes, "one value per node");
        assert_eq!(out.len(), self.grid.len(), "one value per grid point");
        match &self.spline_weights {
            // A missing value would spread over the whole spline.
            Some(weights) if node_values.iter().all(|value| value.is_finite()) => {
                biharmonic::evaluate_into(weights, node_values, out);
            }
            _ => self.bilinear.evaluate_into(node_values, out),
        }
    }

    /// Returns the surface through `node_values`; see [`Self::evaluate_into`].
    ///
    /// # Panics
    /// If `node_values` does not have [`Self::node_count`] entries.
    pub fn evaluate(&self, node_values: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.grid.len()];
        self.evaluate_into(node_values, &mut out);
        out
    }
}

fn grid(x: &SortedAxis, y: &SortedAxis, target: usize) -> Grid {
    // A single coordinate gets the pitch of the other axis; a single node gets a millimetre.
    let lone_margin_mm = 0.5 * x.pitch_mm().or(y.pitch_mm()).unwrap_or(1.0);
    Grid::new(
        GridAxis::through(&x.nodes_mm, target, lone_margin_mm),
        GridAxis::through(&y.nodes_mm, target, lone_margin_mm),
    )
}

fn spline_weights(x_mm: &[f64], y_mm: &[f64], grid: &Grid) -> Option<Array2<f64>> {
    let nodes_mm: Vec<_> = x_mm.iter().flat_map(|&x| y_mm.iter().map(move |&y| (x, y))).collect();
    let points_mm: Vec<_> = (0..grid.x_mm().len())
        .flat_map(|ix| (0..grid.y_mm().len()).map(move |iy| (ix, iy)))
        .map(|(ix, iy)| ((grid.x_mm()[ix], grid.y_mm()[iy]), grid.is_inside(ix, iy)))
        .collect();
    biharmonic::weights(&nodes_mm, &points_mm)
}
