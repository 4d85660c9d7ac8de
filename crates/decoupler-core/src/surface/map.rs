use std::sync::{Arc, Mutex, PoisonError, Weak};

use glam::DVec2;

use super::{
    SurfaceError,
    grid::{Grid, GridAxis, SortedAxis},
    spline::{Point, Weights},
};

/// Maximum number of nodes for a spline; for more nodes, the cost of factorisation and matrix outweighs the benefit.
pub(super) const MAX_SPLINE_NODES: usize = 1000;

/// Maximum number of weights (grid points × nodes): about a millisecond per frame, limited by memory bandwidth.
const MAX_WEIGHTS: usize = 1_100_000;

/// Number of grid points per side, as far as [`MAX_WEIGHTS`] allows.
const GRID_POINTS: usize = 110;

/// Interpolation through nodes, factored once, so that each frame takes one matrix-vector product.
#[derive(Clone, Debug)]
pub struct SurfaceMap {
    pub(super) grid: Grid,
    pub(super) nodes: usize,
    /// Weights of the spline; `None` if it is not used.
    pub(super) weights: Option<Weights>,
    /// Row of the weights at each grid point; `None` where there is no surface.
    pub(super) rows: Vec<Option<usize>>,
    /// See [`Self::beyond`].
    pub(super) beyond: Vec<f64>,
    /// Coordinates x and y of the nodes of a lattice.
    pub(super) lattice: Option<[SortedAxis; 2]>,
}

/// A map in use, with its coordinates x and y.
type Shared = ([Vec<f64>; 2], Weak<SurfaceMap>);

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
        shared.retain(|(_, map)| map.strong_count() > 0);
        let same = shared.iter().find(|(places_mm, _)| *places_mm == [x_mm, y_mm]);
        if let Some(map) = same.and_then(|(_, map)| map.upgrade()) {
            return Ok(map);
        }
        let map = Arc::new(Self::new(x_mm, y_mm)?);
        shared.push(([x_mm, y_mm].map(<[f64]>::to_owned), Arc::downgrade(&map)));
        Ok(map)
    }

    /// Prepares the surface of the lattice `x_mm × y_mm`: one x per row-wire and one y per node of a row, in
    /// millimetres, in any order.
    ///
    /// # Errors
    /// [`SurfaceError`] if an axis is empty, a coordinate is not finite, or two coordinates coincide.
    pub fn new(x_mm: &[f64], y_mm: &[f64]) -> Result<Self, SurfaceError> {
        let lattice = [SortedAxis::new("x", x_mm)?, SortedAxis::new("y", y_mm)?];
        let nodes = x_mm.len() * y_mm.len();
        let is_line = x_mm.len() == 1 || y_mm.len() == 1;
        let mut grid = self::grid(&lattice, if is_line { GRID_POINTS } else { affordable(nodes) });
        let (mut points, mut rows) = (Vec::new(), Vec::with_capacity(grid.len()));
        for (index, place_mm) in grid.places_mm().enumerate() {
            let (ix, iy) = (index / grid.y_mm().len(), index % grid.y_mm().len());
            // A curve along a line of nodes is constant across it.
            let row = match (x_mm, y_mm) {
                ([_], _) => iy,
                (_, [_]) => ix,
                _ => index,
            };
            rows.push(Some(row));
            if row == points.len() {
                let x = if let [only_mm] = x_mm { *only_mm } else { place_mm.x };
                let y = if let [only_mm] = y_mm { *only_mm } else { place_mm.y };
                let node_at =
                    |nodes_mm: &[f64], point_mm: f64| nodes_mm.iter().position(|node_mm| *node_mm == point_mm);
                let (row, node) = (node_at(x_mm, x), node_at(y_mm, y));
                points.push(Point {
                    place_mm: DVec2::new(x, y),
                    is_inside: grid.is_inside(ix, iy),
                    node: row.zip(node).map(|(row, node)| row * y_mm.len() + node),
                });
            }
        }
        let places_mm = x_mm.iter().flat_map(|&x| y_mm.iter().map(move |&y| DVec2::new(x, y)));
        let weights = (nodes <= MAX_SPLINE_NODES).then(|| Weights::new(&Vec::from_iter(places_mm), &points));
        let weights = weights.flatten();
        if weights.is_none() {
            grid = self::grid(&lattice, GRID_POINTS);
        }
        Ok(Self {
            beyond: grid.beyond(),
            grid,
            nodes,
            weights,
            rows,
            lattice: Some(lattice),
        })
    }

    /// Returns the grid on which the surface is evaluated.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Returns the distance of a grid point from the nodes as a fraction of the margin: 0 within their bounding rectangle
    /// or, for scattered nodes, their convex hull; 1 where the surface ends, and where scattered nodes have none.
    pub fn beyond(&self, ix: usize, iy: usize) -> f64 {
        self.beyond[self.grid.index(ix, iy)]
    }

    /// Describes the interpolation between the nodes, which reproduces constants and planes:
    ///
    /// - a thin-plate spline, the biharmonic spline with a plane (Duchon 1977). MATLAB's `griddata(…, 'v4')`, used for the
    ///   paper's figures, has no plane, so that its surfaces sag between nodes of equal height and depend on the unit of
    ///   length.
    /// - a natural cubic spline along a single row or column of nodes, constant across it; level for a single node.
    /// - bilinear between neighbours, continued with the same slope beyond the outermost nodes: for more than a thousand
    ///   nodes, and for nodes so unevenly spaced that a spline would overshoot a thousandfold or be lost in rounding errors.
    pub fn interpolation(&self) -> &'static str {
        let is_line = self.lattice.iter().flatten().any(|axis| axis.nodes_mm.len() == 1);
        match &self.weights {
            None => "bilinear",
            Some(_) if is_line => "natural cubic spline",
            Some(_) => "thin-plate spline (the biharmonic spline with a plane)",
        }
    }

    /// Returns the surface through `node_values` (for a lattice `rows × nodes_per_row`, row by row; in any unit): `x points
    /// × y points`, see [`Grid`].
    ///
    /// On a lattice, a missing value (NaN) leaves a gap around its node, and the rest of that frame is bilinear; with
    /// scattered nodes there is no surface.
    ///
    /// # Panics
    /// If there is not one value for each node.
    pub fn evaluate(&self, node_values: &[f64]) -> Vec<f64> {
        assert_eq!(node_values.len(), self.nodes, "one value per node");
        // A missing value would affect the whole spline.
        let is_whole = node_values.iter().all(|value| value.is_finite());
        match (&self.weights, &self.lattice) {
            (Some(weights), _) if is_whole => {
                let values = weights.evaluate(node_values);
                self.rows
                    .iter()
                    .map(|row| row.map_or(f64::NAN, |row| values[row]))
                    .collect()
            }
            (_, Some(lattice)) => bilinear(lattice, &self.grid, node_values),
            (_, None) => vec![f64::NAN; self.grid.len()],
        }
    }
}

/// Number of grid points per side for a spline through this many nodes.
pub(super) fn affordable(nodes: usize) -> usize {
    ((MAX_WEIGHTS as f64 / nodes.max(1) as f64).sqrt() as usize).min(GRID_POINTS)
}

fn grid([x, y]: &[SortedAxis; 2], target: usize) -> Grid {
    // A single coordinate gets the pitch of the other axis; a single node gets a millimetre.
    let lone_margin_mm = 0.5 * x.pitch_mm().or(y.pitch_mm()).unwrap_or(1.0);
    let [x, y] = [x, y].map(|axis| GridAxis::through(&axis.nodes_mm, target, lone_margin_mm));
    Grid { x, y }
}

/// Bilinear interpolation on a lattice, defined for every array. Beyond the outermost nodes the surface keeps its slope.
fn bilinear([x, y]: &[SortedAxis; 2], grid: &Grid, node_values: &[f64]) -> Vec<f64> {
    let along_y = Vec::from_iter(grid.y_mm().iter().map(|&y_mm| y.between(y_mm)));
    let values = grid.x_mm().iter().flat_map(|&x_mm| {
        let (rows, share) = x.between(x_mm);
        let rows = rows.map(|row| &node_values[row * y.nodes_mm.len()..][..y.nodes_mm.len()]);
        along_y.iter().map(move |&([lower, upper], along)| {
            let [one, other] = rows.map(|row| mix(row[lower], row[upper], along));
            mix(one, other, share)
        })
    });
    values.collect()
}

/// Interpolates linearly; exact at both ends, and unaffected by a missing value (NaN) of zero weight.
fn mix(lower: f64, upper: f64, share: f64) -> f64 {
    match share {
        0.0 => lower,
        1.0 => upper,
        _ => lower + (upper - lower) * share,
    }
}
