//! Interpolation from the values at the nodes to a surface.
//!
//! Errors in the coordinates of the nodes.
//!
//! Bilinear interpolation on a lattice: fast, and defined for every array.
//!
//! The natural cubic spline through nodes on a line, the curve of least bending energy.
//!
//! Between neighbours at a distance h it is `s = a z_i + b z_{i+1} + h²/6 ((a³ − a) m_i + (b³ − b) m_{i+1})`, where b is
//! the fraction of the way from i to i + 1 and a = 1 − b. Its second derivatives m vanish at both ends and, for the slope
//! to be continuous, satisfy
//!
//! ```text
//! h_{i−1} m_{i−1} + 2 (h_{i−1} + h_i) m_i + h_i m_{i+1} = 6 ((z_{i+1} − z_i)/h_i − (z_i − z_{i−1})/h_{i−1})
//! ```
//!
//! Beyond both ends the curve is straight. Through two nodes it is a line, through one a constant.

use std::{
    fmt,
    ops::RangeInclusive,
    sync::{Arc, Mutex, PoisonError, Weak},
};

use ndarray::{Array2, ArrayView1, Zip};

use super::{
    error::{Axis, SurfaceError},
    grid::{Grid, GridAxis, Point, SortedAxis, Weights},
    scattered::{self, Scattered},
};

/// Maximum number of nodes for a spline; for more nodes, the cost of factorisation and matrix outweighs the benefit.
const MAX_SPLINE_NODES: usize = 1000;

/// Maximum number of weights (grid points × nodes): about a millisecond per frame, limited by memory bandwidth.
const MAX_WEIGHTS: usize = 1_100_000;

/// Number of grid points per side, as far as [`MAX_WEIGHTS`] allows.
const GRID_POINTS: usize = 110;

/// Interpolation between the nodes. Each kind reproduces constants and planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The biharmonic spline with a plane (Duchon 1977). MATLAB's `griddata(…, 'v4')`, used for the paper's figures, has
    /// no plane, so that its surfaces sag between nodes of equal height and depend on the unit of length.
    ThinPlateSpline,
    /// A natural cubic spline along a single row or column of nodes, constant across it; level for a single node.
    CubicSpline,
    /// Bilinear between neighbours, continued with the same slope beyond the outermost nodes. Used for more than a
    /// thousand nodes, and for nodes so unevenly spaced that a spline would overshoot a thousandfold or be lost in
    /// rounding errors.
    Bilinear,
}

impl fmt::Display for Interpolation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::ThinPlateSpline => "thin-plate spline (the biharmonic spline with a plane)",
            Self::CubicSpline => "natural cubic spline",
            Self::Bilinear => "bilinear",
        })
    }
}

/// Interpolation through nodes, factored once, so that each frame takes one matrix-vector product.
#[derive(Clone, Debug)]
pub struct SurfaceMap {
    grid: Grid,
    nodes: usize,
    spline: Option<Spline>,
    /// Between the nodes of a lattice.
    bilinear: Option<Bilinear>,
}

#[derive(Clone, Debug)]
enum Spline {
    /// Weights of every grid point.
    Surface(Weights),
    /// Weights of the grid points along x, for nodes with one y.
    AlongX(Weights),
    /// Weights of the grid points along y, for nodes with one x.
    AlongY(Weights),
    /// Weights of the grid points between scattered nodes.
    Scattered(Scattered),
}

/// A map in use, with its coordinates x and y.
struct Shared {
    x_mm: Vec<f64>,
    y_mm: Vec<f64>,
    map: Weak<SurfaceMap>,
}

/// Maps in use; of few lattices at a time.
static SHARED: Mutex<Vec<Shared>> = Mutex::new(Vec::new());

impl SurfaceMap {
    /// Returns the map of a lattice that is already in use, or prepares it as [`Self::new`] does: it takes 9 MB for an array
    /// of 10×10, and all runs of one array have the same.
    ///
    /// # Errors
    /// See [`Self::new`].
    pub fn shared(x_mm: &[f64], y_mm: &[f64]) -> Result<Arc<Self>, SurfaceError> {
        // While it is prepared, others who want the same wait for it. A panic leaves the list as it was.
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        shared.retain(|shared| shared.map.strong_count() > 0);
        let same = shared.iter().find(|shared| shared.x_mm == x_mm && shared.y_mm == y_mm);
        if let Some(map) = same.and_then(|shared| shared.map.upgrade()) {
            return Ok(map);
        }
        let map = Arc::new(Self::new(x_mm, y_mm)?);
        shared.push(Shared {
            x_mm: x_mm.to_owned(),
            y_mm: y_mm.to_owned(),
            map: Arc::downgrade(&map),
        });
        Ok(map)
    }

    /// Prepares the surface of the lattice `x_mm × y_mm`: one x per row-wire and one y per node of a row, in
    /// millimetres, in any order.
    ///
    /// # Errors
    /// [`SurfaceError`] if an axis is empty, a coordinate is not finite, or two coordinates coincide.
    pub fn new(x_mm: &[f64], y_mm: &[f64]) -> Result<Self, SurfaceError> {
        let x = SortedAxis::new(Axis::X, x_mm)?;
        let y = SortedAxis::new(Axis::Y, y_mm)?;
        let nodes = x_mm.len() * y_mm.len();
        let is_line = x_mm.len() == 1 || y_mm.len() == 1;
        let spline_grid = grid(&x, &y, if is_line { GRID_POINTS } else { affordable(nodes) });
        let spline = if nodes > MAX_SPLINE_NODES {
            None
        } else if x_mm.len() == 1 {
            along(y_mm, &y, spline_grid.y_mm(), spline_grid.inside_y()).map(Spline::AlongY)
        } else if y_mm.len() == 1 {
            along(x_mm, &x, spline_grid.x_mm(), spline_grid.inside_x()).map(Spline::AlongX)
        } else {
            surface(x_mm, y_mm, &spline_grid).map(Spline::Surface)
        };
        let grid = match spline {
            Some(_) => spline_grid,
            None => grid(&x, &y, GRID_POINTS),
        };
        let bilinear = Bilinear::new(
            (&x.nodes_mm, &x.order, grid.x_mm()),
            (&y.nodes_mm, &y.order, grid.y_mm()),
        );
        Ok(Self {
            grid,
            nodes,
            spline,
            bilinear: Some(bilinear),
        })
    }

    /// Prepares the thin-plate spline through nodes at these points (x, y), in millimetres, which need not form a
    /// lattice. It has gaps (NaN) outside their convex hull, except for a margin of half the mean distance between
    /// neighbours, and at points far from every node.
    ///
    /// # Errors
    /// [`SurfaceError`] if there are no nodes, or more than a thousand, a coordinate is not finite, two nodes coincide or
    /// nearly so, or all are on one line. A line along x or y is a lattice: see [`Self::new`].
    pub fn scattered(places_mm: &[[f64; 2]]) -> Result<Self, SurfaceError> {
        let nodes = places_mm.len();
        if nodes > MAX_SPLINE_NODES {
            return Err(SurfaceError::TooMany {
                count: nodes,
                most: MAX_SPLINE_NODES,
            });
        }
        let (grid, scattered) = Scattered::new(places_mm, affordable(nodes))?;
        Ok(Self {
            grid,
            nodes,
            spline: Some(Spline::Scattered(scattered)),
            bilinear: None,
        })
    }

    /// Returns the grid on which the surface is evaluated.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Returns the distance of a grid point from the nodes as a fraction of the margin: 0 within their bounding rectangle
    /// or, for scattered nodes, their convex hull; 1 where the surface ends, and where scattered nodes have none.
    pub fn beyond(&self, ix: usize, iy: usize) -> f64 {
        match &self.spline {
            Some(Spline::Scattered(scattered)) => scattered.beyond(self.grid.index(ix, iy)),
            _ => self.grid.beyond(ix, iy),
        }
    }

    /// Returns the number of nodes; for a lattice, rows × nodes per row.
    pub fn node_count(&self) -> usize {
        self.nodes
    }

    /// Returns the interpolation used between the nodes.
    pub fn interpolation(&self) -> Interpolation {
        match self.spline {
            Some(Spline::Surface(_) | Spline::Scattered(_)) => Interpolation::ThinPlateSpline,
            Some(Spline::AlongX(_) | Spline::AlongY(_)) => Interpolation::CubicSpline,
            None => Interpolation::Bilinear,
        }
    }

    /// Writes the surface through `node_values` (for a lattice `rows × nodes_per_row`, row by row; in any unit) to `out`
    /// (`x points × y points`, see [`Grid`]).
    ///
    /// On a lattice, a missing value (NaN) leaves a gap around its node, and the rest of that frame is bilinear; with
    /// scattered nodes there is no surface.
    ///
    /// # Panics
    /// If `node_values` does not have [`Self::node_count`] entries, or `out` not [`Grid::len`].
    pub fn evaluate_into(&self, node_values: &[f64], out: &mut [f64]) {
        assert_eq!(node_values.len(), self.nodes, "one value per node");
        assert_eq!(out.len(), self.grid.len(), "one value per grid point");
        // A missing value would affect the whole spline.
        let spline = self
            .spline
            .as_ref()
            .filter(|_| node_values.iter().all(|value| value.is_finite()));
        let across = self.grid.y_mm().len();
        match spline {
            Some(Spline::Surface(weights)) => weights.evaluate_into(node_values, out),
            Some(Spline::AlongX(weights)) => {
                let curve = weights.evaluate(node_values);
                let lines = out.chunks_exact_mut(across).zip(curve);
                lines.for_each(|(line, value)| line.fill(value));
            }
            Some(Spline::AlongY(weights)) => {
                let curve = weights.evaluate(node_values);
                out.chunks_exact_mut(across)
                    .for_each(|line| line.copy_from_slice(&curve));
            }
            Some(Spline::Scattered(scattered)) => scattered.evaluate_into(node_values, out),
            None => match &self.bilinear {
                Some(bilinear) => bilinear.evaluate_into(node_values, out),
                None => out.fill(f64::NAN),
            },
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

/// Number of grid points per side for a spline through this many nodes.
fn affordable(nodes: usize) -> usize {
    ((MAX_WEIGHTS as f64 / nodes.max(1) as f64).sqrt() as usize).min(GRID_POINTS)
}

fn grid(x: &SortedAxis, y: &SortedAxis, target: usize) -> Grid {
    // A single coordinate gets the pitch of the other axis; a single node gets a millimetre.
    let lone_margin_mm = 0.5 * x.pitch_mm().or(y.pitch_mm()).unwrap_or(1.0);
    Grid::new(
        GridAxis::through(&x.nodes_mm, target, lone_margin_mm),
        GridAxis::through(&y.nodes_mm, target, lone_margin_mm),
    )
}

/// The spline through the nodes on one line, at the grid points along it.
fn along(nodes_mm: &[f64], sorted: &SortedAxis, points_mm: &[f64], inside: RangeInclusive<usize>) -> Option<Weights> {
    let of_sorted = weights(&sorted.nodes_mm, points_mm);
    let mut weights = Array2::zeros(of_sorted.dim());
    for (column, &node) in of_sorted.columns().into_iter().zip(&sorted.order) {
        weights.column_mut(node).assign(&column);
    }
    let points = points_mm.iter().enumerate().map(|(index, &point_mm)| Point {
        is_inside: inside.contains(&index),
        node: node_at(nodes_mm, point_mm),
    });
    Weights::checked(weights, points)
}

/// The spline through the nodes of the lattice, at every grid point.
fn surface(x_mm: &[f64], y_mm: &[f64], grid: &Grid) -> Option<Weights> {
    let places = |x_mm: &[f64], y_mm: &[f64]| -> Vec<_> {
        let lines = x_mm.iter().map(|&x| y_mm.iter().map(move |&y| (x, y)));
        lines.flatten().collect()
    };
    let weights = scattered::weights(&places(x_mm, y_mm), &places(grid.x_mm(), grid.y_mm()))?;
    let points = (0..grid.x_mm().len()).flat_map(|ix| (0..grid.y_mm().len()).map(move |iy| (ix, iy)));
    let points = points.map(|(ix, iy)| {
        let (row, node) = (node_at(x_mm, grid.x_mm()[ix]), node_at(y_mm, grid.y_mm()[iy]));
        Point {
            is_inside: grid.is_inside(ix, iy),
            node: row.zip(node).map(|(row, node)| row * y_mm.len() + node),
        }
    });
    Weights::checked(weights, points)
}

fn node_at(nodes_mm: &[f64], point_mm: f64) -> Option<usize> {
    nodes_mm.iter().position(|&node_mm| node_mm == point_mm)
}

/// Position of a grid line relative to two lattice lines: `(1 − weight) · lower + weight · upper`. Beyond the outermost
/// line the weight is below 0 or above 1.
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
    /// Creates the weights. Each axis has the ascending node coordinates, their indices in the caller's order, and the
    /// grid coordinates.
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
    // In units of the extent, so that squares and quotients of lengths do not overflow.
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
        // Beyond an end the cubic is continued with its slope there, where m is 0.
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

/// Returns the matrix (`nodes × nodes`) from values to second derivatives, by elimination of the tridiagonal equations,
/// which are diagonally dominant and need no pivoting.
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
