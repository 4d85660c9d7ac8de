use std::ops::RangeInclusive;

use glam::DVec2;

use super::SurfaceError;

/// A rectangular grid through the nodes of a lattice that extends half a pitch beyond them; for scattered nodes, a grid
/// through the outermost of them.
///
/// Values on it are `x points × y points`, x-major: point `(ix, iy)` has the index `ix · y_mm().len() + iy`.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    pub(super) x: GridAxis,
    pub(super) y: GridAxis,
}

impl Grid {
    /// Returns the coordinates along x in millimetres, ascending.
    pub fn x_mm(&self) -> &[f64] {
        &self.x.points_mm
    }

    /// Returns the coordinates along y in millimetres, ascending.
    pub fn y_mm(&self) -> &[f64] {
        &self.y.points_mm
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.x.points_mm.len() * self.y.points_mm.len()
    }

    /// Always returns `false`: a grid has at least three points per side.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the index of point `(ix, iy)` in an array of values on the grid.
    pub fn index(&self, ix: usize, iy: usize) -> usize {
        ix * self.y.points_mm.len() + iy
    }

    /// Returns the indices along x within the bounding rectangle of the nodes.
    pub fn inside_x(&self) -> RangeInclusive<usize> {
        self.x.inside.clone()
    }

    /// Returns the indices along y within the bounding rectangle of the nodes.
    pub fn inside_y(&self) -> RangeInclusive<usize> {
        self.y.inside.clone()
    }

    /// Places of all points.
    pub(super) fn places_mm(&self) -> impl Iterator<Item = DVec2> {
        let lines = self.x.points_mm.iter();
        lines.flat_map(|&x| self.y.points_mm.iter().map(move |&y| DVec2::new(x, y)))
    }

    /// For each point, 0 within the bounding rectangle of the nodes, 1 at the ends of the grid, linear between.
    pub(super) fn beyond(&self) -> Vec<f64> {
        let of_y = Vec::from_iter((0..self.y.points_mm.len()).map(|iy| self.y.beyond(iy)));
        let of_x = (0..self.x.points_mm.len()).map(|ix| self.x.beyond(ix));
        of_x.flat_map(|x| of_y.iter().map(move |&y| x.max(y))).collect()
    }

    /// Returns `true` if a point is within the bounding rectangle of the nodes; outside, the surface is extrapolated. For
    /// a single row or column, which has no extent, the strip that represents it counts as inside.
    pub fn is_inside(&self, ix: usize, iy: usize) -> bool {
        self.inside_x().contains(&ix) && self.inside_y().contains(&iy)
    }
}

/// One axis of a [`Grid`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GridAxis {
    pub(super) points_mm: Vec<f64>,
    inside: RangeInclusive<usize>,
}

impl GridAxis {
    /// Divides the intervals between ascending coordinates into `steps` each, and the margins before and after into
    /// `margin_steps`. The margins of a single coordinate count as inside.
    fn new(inner_mm: &[f64], steps: usize, [before_mm, after_mm]: [f64; 2], margin_steps: usize) -> Self {
        let (first_mm, last_mm) = (inner_mm[0], inner_mm[inner_mm.len() - 1]);
        let before = (0..margin_steps).map(|step| along(first_mm - before_mm, first_mm, step, margin_steps));
        let between = inner_mm
            .windows(2)
            .flat_map(|pair| (0..steps).map(|step| along(pair[0], pair[1], step, steps)));
        let after = (0..=margin_steps).map(|step| along(last_mm, last_mm + after_mm, step, margin_steps));
        let points_mm = Vec::from_iter(before.chain(between).chain(after));
        let outside = if inner_mm.len() == 1 { 0 } else { margin_steps };
        Self {
            inside: outside..=points_mm.len() - 1 - outside,
            points_mm,
        }
    }

    fn beyond(&self, index: usize) -> f64 {
        let (first, last) = (*self.inside.start(), *self.inside.end());
        if index < first {
            (first - index) as f64 / first as f64
        } else {
            let margin = self.points_mm.len() - 1 - last;
            index.saturating_sub(last) as f64 / margin.max(1) as f64
        }
    }

    /// Divides every interval of the ascending `nodes_mm` into equal steps, for about `target` points in all.
    ///
    /// `lone_margin_mm` is the margin around a single coordinate, which has no pitch; it is increased if it would be lost
    /// in the rounding of the coordinate.
    pub(super) fn through(nodes_mm: &[f64], target: usize, lone_margin_mm: f64) -> Self {
        let [.., before_last_mm, last_mm] = *nodes_mm else {
            let margin_mm = lone_margin_mm.max(1e3 * CLOSEST_RELATIVE * nodes_mm[0].abs());
            return Self::new(nodes_mm, 1, [margin_mm; 2], 8);
        };
        // Very long axes are thinned: more lines than pixels are not visible.
        let stride = nodes_mm.len().div_ceil(target.max(2));
        let mut kept_mm: Vec<f64> = nodes_mm.iter().copied().step_by(stride).collect();
        if !(nodes_mm.len() - 1).is_multiple_of(stride) {
            kept_mm.push(last_mm);
        }
        let steps = (target.saturating_sub(1) / kept_mm.len()).max(1);
        let margins_mm = [0.5 * (nodes_mm[1] - nodes_mm[0]), 0.5 * (last_mm - before_last_mm)];
        Self::new(&kept_mm, steps, margins_mm, steps.div_ceil(2))
    }

    /// Divides the interval between the outermost nodes into equal steps, and extends it by `margin_mm` at both ends,
    /// with about `target` steps in all.
    pub(super) fn spanning(first_mm: f64, last_mm: f64, target: usize, margin_mm: f64) -> Self {
        let extent_mm = last_mm - first_mm;
        let share = extent_mm / (extent_mm + 2.0 * margin_mm);
        let steps = ((target as f64 * share) as usize).max(2);
        let margin_steps = (target.saturating_sub(steps) / 2).max(1);
        Self::new(&[first_mm, last_mm], steps, [margin_mm; 2], margin_steps)
    }
}

/// Coordinate after `step` of `steps` equal steps.
fn along(from: f64, to: f64, step: usize, steps: usize) -> f64 {
    from + (to - from) * step as f64 / steps as f64
}

/// Largest coordinate for which differences and products with the number of points do not overflow.
const LARGEST_MM: f64 = 1e300;

/// Minimum distance between nodes relative to their largest coordinate: about a thousand roundings, so that points
/// between them are distinct in double precision.
pub(super) const CLOSEST_RELATIVE: f64 = 1e-12;

/// Checks that there are coordinates, all of them finite.
pub(super) fn check_coordinates(axis: &'static str, given_mm: &[f64]) -> Result<(), SurfaceError> {
    if given_mm.is_empty() {
        return Err(SurfaceError::NoNodes { axis });
    }
    let is_usable = |value_mm: &f64| value_mm.abs() <= LARGEST_MM;
    match given_mm.iter().position(|value_mm| !is_usable(value_mm)) {
        Some(index) => Err(SurfaceError::NotFinite {
            axis,
            index,
            value_mm: given_mm[index],
        }),
        None => Ok(()),
    }
}

/// Coordinates in ascending order, with the index of each in the order given.
#[derive(Clone, Debug)]
pub(super) struct SortedAxis {
    pub(super) nodes_mm: Vec<f64>,
    pub(super) order: Vec<usize>,
}

impl SortedAxis {
    pub(super) fn new(axis: &'static str, given_mm: &[f64]) -> Result<Self, SurfaceError> {
        check_coordinates(axis, given_mm)?;
        let mut order: Vec<usize> = (0..given_mm.len()).collect();
        order.sort_by(|&a, &b| given_mm[a].total_cmp(&given_mm[b]));
        let nodes_mm: Vec<f64> = order.iter().map(|&index| given_mm[index]).collect();
        let largest_mm = nodes_mm.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let closest_mm = CLOSEST_RELATIVE * largest_mm.max(1.0 / LARGEST_MM);
        if let Some(at) = nodes_mm.windows(2).position(|pair| pair[1] - pair[0] <= closest_mm) {
            return Err(SurfaceError::Duplicate {
                axis,
                first: order[at].min(order[at + 1]),
                second: order[at].max(order[at + 1]),
                value_mm: nodes_mm[at],
            });
        }
        Ok(Self { nodes_mm, order })
    }

    /// Indices in the order given of the two nodes between which `point_mm` is, or of the outermost two, with its distance
    /// from the first as a fraction of theirs; below 0 or above 1 beyond the outermost.
    pub(super) fn between(&self, point_mm: f64) -> ([usize; 2], f64) {
        let last = self.nodes_mm.len() - 1;
        let upper = self.nodes_mm.partition_point(|&node_mm| node_mm < point_mm);
        let upper = upper.clamp(last.min(1), last);
        let lower = upper.saturating_sub(1);
        let (lower_mm, upper_mm) = (self.nodes_mm[lower], self.nodes_mm[upper]);
        let share = if upper > lower {
            (point_mm - lower_mm) / (upper_mm - lower_mm)
        } else {
            0.0
        };
        ([self.order[lower], self.order[upper]], share)
    }

    /// Minimum distance between neighbours; `None` for a single coordinate.
    pub(super) fn pitch_mm(&self) -> Option<f64> {
        self.nodes_mm.windows(2).map(|pair| pair[1] - pair[0]).reduce(f64::min)
    }
}
