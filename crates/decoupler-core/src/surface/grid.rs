//! The grid on which a surface is evaluated.
//!
//! Linear interpolation by a matrix of weights.
//!
//! Detection of a lattice among points in the plane.

use std::ops::RangeInclusive;

use ndarray::{Array2, ArrayView1, ArrayViewMut1, linalg::general_mat_vec_mul};

use super::error::{Axis, SurfaceError};

/// A rectangular grid through the nodes of a lattice that extends half a pitch beyond them; for scattered nodes, a grid
/// through the outermost of them.
///
/// Values on it are `x points × y points`, x-major: point `(ix, iy)` has the index `ix · y_mm().len() + iy`.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    x: GridAxis,
    y: GridAxis,
}

impl Grid {
    pub(super) fn new(x: GridAxis, y: GridAxis) -> Self {
        Self { x, y }
    }

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
        self.x.first_inside..=self.x.last_inside
    }

    /// Returns the indices along y within the bounding rectangle of the nodes.
    pub fn inside_y(&self) -> RangeInclusive<usize> {
        self.y.first_inside..=self.y.last_inside
    }

    /// 0 within the bounding rectangle of the nodes, 1 at the ends of the grid, linear between.
    pub(super) fn beyond(&self, ix: usize, iy: usize) -> f64 {
        self.x.beyond(ix).max(self.y.beyond(iy))
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
    first_inside: usize,
    last_inside: usize,
}

impl GridAxis {
    fn beyond(&self, index: usize) -> f64 {
        if index < self.first_inside {
            (self.first_inside - index) as f64 / self.first_inside as f64
        } else {
            let margin = self.points_mm.len() - 1 - self.last_inside;
            index.saturating_sub(self.last_inside) as f64 / margin.max(1) as f64
        }
    }

    /// Divides every interval of the ascending `nodes_mm` into equal steps, for about `target` points in all.
    ///
    /// `lone_margin_mm` is the margin around a single coordinate, which has no pitch; it is increased if it would be lost
    /// in the rounding of the coordinate.
    pub(super) fn through(nodes_mm: &[f64], target: usize, lone_margin_mm: f64) -> Self {
        // Very long axes are thinned: more lines than pixels are not visible.
        let stride = nodes_mm.len().div_ceil(target.max(2));
        let last = nodes_mm.len() - 1;
        let mut kept_mm: Vec<f64> = nodes_mm.iter().copied().step_by(stride).collect();
        if !last.is_multiple_of(stride) {
            kept_mm.push(nodes_mm[last]);
        }
        let intervals = kept_mm.len() - 1;
        let steps = (target.saturating_sub(1) / (intervals + 1)).max(1);
        let margin_steps = if intervals == 0 { 8 } else { steps.div_ceil(2) };

        let (before_mm, after_mm) = match kept_mm[..] {
            [first, second, ..] if stride == 1 => (0.5 * (second - first), 0.5 * (nodes_mm[last] - nodes_mm[last - 1])),
            [_, _, ..] => (
                0.5 * (nodes_mm[1] - nodes_mm[0]),
                0.5 * (nodes_mm[last] - nodes_mm[last - 1]),
            ),
            _ => {
                let margin_mm = lone_margin_mm.max(1e3 * CLOSEST_RELATIVE * nodes_mm[0].abs());
                (margin_mm, margin_mm)
            }
        };
        let (first_mm, last_mm) = (nodes_mm[0], nodes_mm[last]);
        let mut points_mm: Vec<f64> = (0..margin_steps)
            .map(|step| along(first_mm - before_mm, first_mm, step, margin_steps))
            .collect();
        for pair in kept_mm.windows(2) {
            points_mm.extend((0..steps).map(|step| along(pair[0], pair[1], step, steps)));
        }
        let last_inside = points_mm.len();
        points_mm.push(last_mm);
        points_mm.extend((1..=margin_steps).map(|step| along(last_mm, last_mm + after_mm, step, margin_steps)));
        if intervals == 0 {
            return Self {
                first_inside: 0,
                last_inside: points_mm.len() - 1,
                points_mm,
            };
        }
        Self {
            points_mm,
            first_inside: margin_steps,
            last_inside,
        }
    }

    /// Divides the interval between the outermost nodes into equal steps, and extends it by `margin_mm` at both ends,
    /// with about `target` steps in all.
    pub(super) fn spanning(first_mm: f64, last_mm: f64, target: usize, margin_mm: f64) -> Self {
        let extent_mm = last_mm - first_mm;
        let share = extent_mm / (extent_mm + 2.0 * margin_mm);
        let steps = ((target as f64 * share) as usize).max(2);
        let margin_steps = (target.saturating_sub(steps) / 2).max(1);
        let before = (0..margin_steps).map(|step| along(first_mm - margin_mm, first_mm, step, margin_steps));
        let between = (0..=steps).map(|step| along(first_mm, last_mm, step, steps));
        let after = (1..=margin_steps).map(|step| along(last_mm, last_mm + margin_mm, step, margin_steps));
        Self {
            points_mm: before.chain(between).chain(after).collect(),
            first_inside: margin_steps,
            last_inside: margin_steps + steps,
        }
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
pub(super) fn check_coordinates(axis: Axis, given_mm: &[f64]) -> Result<(), SurfaceError> {
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
    pub(super) fn new(axis: Axis, given_mm: &[f64]) -> Result<Self, SurfaceError> {
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

    /// Minimum distance between neighbours; `None` for a single coordinate.
    pub(super) fn pitch_mm(&self) -> Option<f64> {
        self.nodes_mm.windows(2).map(|pair| pair[1] - pair[0]).reduce(f64::min)
    }
}

/// Largest accepted sum of absolute weights at a point within the nodes. On regular lattices the sum is below 3; a smooth
/// surface through nodes that nearly coincide overshoots by the size of this sum.
const LARGEST_AMPLIFICATION: f64 = 1e3;

/// Largest accepted deviation of the computed weights at a node from 1 there and 0 elsewhere.
const LARGEST_ROUNDING: f64 = 1e-9;

/// Weights of the nodes' values at each point, `points × nodes`; those at each point sum to 1.
#[derive(Clone, Debug)]
pub(super) struct Weights(Array2<f64>);

/// Known properties of a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// True within the nodes, where the surface is not extrapolated.
    pub(super) is_inside: bool,
    /// Node at this point.
    pub(super) node: Option<usize>,
}

impl Weights {
    /// Returns `weights` computed for `points`, or `None` if they are dominated by rounding errors or amplify too much.
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
        // Relative to one of the values, so that the surface through level nodes is exactly level.
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

/// Points that are the nodes of a lattice: every x with every y, in any order.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    x_mm: Vec<f64>,
    y_mm: Vec<f64>,
    places: Vec<usize>,
}

/// Largest difference of the coordinates along a line of the lattice, relative to the distance of the nearest neighbours.
const SPREAD: f64 = 0.1;

impl Lattice {
    /// Finds the lattice whose nodes are these points (x, y), in millimetres. Coordinates along a line may differ by up
    /// to a tenth of the distance of the nearest neighbours; their mean is used. `None` if the points do not form a
    /// lattice: scattered, rotated, or with gaps.
    pub fn of(places_mm: &[[f64; 2]]) -> Option<Self> {
        if places_mm
            .iter()
            .flatten()
            .any(|coordinate_mm| !coordinate_mm.is_finite())
        {
            return None;
        }
        let nearest_mm = nearest_distance_mm(places_mm);
        let [x, y] =
            [0, 1].map(|axis| Lines::of(&Vec::from_iter(places_mm.iter().map(|place| place[axis])), nearest_mm));
        let (x, y) = (x?, y?);
        if x.means_mm.len() * y.means_mm.len() != places_mm.len() {
            return None;
        }
        let mut places = vec![None; places_mm.len()];
        for (place, (ix, iy)) in x.line_of.iter().zip(&y.line_of).enumerate() {
            // There are as many points as nodes: if a node has none, another has two.
            let node = &mut places[ix * y.means_mm.len() + iy];
            if node.replace(place).is_some() {
                return None;
            }
        }
        Some(Self {
            x_mm: x.means_mm,
            y_mm: y.means_mm,
            places: places.into_iter().collect::<Option<_>>()?,
        })
    }

    /// Returns the coordinates of the lines along x in millimetres, ascending.
    pub fn x_mm(&self) -> &[f64] {
        &self.x_mm
    }

    /// Returns the coordinates of the lines along y in millimetres, ascending.
    pub fn y_mm(&self) -> &[f64] {
        &self.y_mm
    }

    /// Returns the index of the point at each node, in the order of the values of a [`SurfaceMap`](super::SurfaceMap):
    /// all y of the first x, then those of the next.
    pub fn places(&self) -> &[usize] {
        &self.places
    }
}

/// Coordinates along one axis, grouped into lines.
struct Lines {
    /// Mean of each line, ascending.
    means_mm: Vec<f64>,
    /// Line of each coordinate.
    line_of: Vec<usize>,
}

impl Lines {
    fn of(coordinates_mm: &[f64], nearest_mm: f64) -> Option<Self> {
        let mut order = Vec::from_iter(0..coordinates_mm.len());
        order.sort_by(|&one, &other| coordinates_mm[one].total_cmp(&coordinates_mm[other]));
        let lines = order.chunk_by(|&one, &next| coordinates_mm[next] - coordinates_mm[one] <= 0.5 * nearest_mm);
        let (mut means_mm, mut line_of) = (Vec::new(), vec![0; coordinates_mm.len()]);
        for (number, line) in lines.enumerate() {
            let (first_mm, last_mm) = (coordinates_mm[line[0]], coordinates_mm[line[line.len() - 1]]);
            if last_mm - first_mm > SPREAD * nearest_mm {
                return None;
            }
            line.iter().for_each(|&place| line_of[place] = number);
            let sum_mm = line.iter().map(|&place| coordinates_mm[place] - first_mm).sum::<f64>();
            means_mm.push(first_mm + sum_mm / line.len() as f64);
        }
        (!means_mm.is_empty()).then_some(Self { means_mm, line_of })
    }
}

/// Distance of the nearest two points; 0 for fewer.
fn nearest_distance_mm(places_mm: &[[f64; 2]]) -> f64 {
    let pairs = places_mm
        .iter()
        .enumerate()
        .flat_map(|(index, one)| places_mm[..index].iter().map(move |other| (one, other)));
    let distances = pairs.map(|(one, other)| (one[0] - other[0]).hypot(one[1] - other[1]));
    distances.reduce(f64::min).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 × 4 points in shuffled order, each moved by up to `jitter`.
    fn places(jitter: f64) -> Vec<[f64; 2]> {
        let nodes = (0..12).map(|index| (7 * index + 3) % 12);
        let moved = nodes.enumerate().map(|(number, node)| {
            let [dx, dy] = [number % 3, number % 2].map(|part| jitter * (part as f64 - 0.5));
            [
                10.0 + 2.0 * f64::from(node / 4) + dx,
                -1.0 + 5.0 * f64::from(node % 4) + dy,
            ]
        });
        moved.collect()
    }

    #[test]
    fn a_lattice_is_found_in_any_order_and_within_the_tolerance() {
        for jitter in [0.0, 0.05] {
            let places = places(jitter);
            let lattice = Lattice::of(&places).unwrap();
            assert_eq!((lattice.x_mm().len(), lattice.y_mm().len()), (3, 4));
            let nodes = lattice
                .x_mm()
                .iter()
                .flat_map(|x| lattice.y_mm().iter().map(move |y| [*x, *y]));
            for (node, &place) in nodes.zip(lattice.places()) {
                let off = (node[0] - places[place][0]).hypot(node[1] - places[place][1]);
                assert!(off <= 2.0 * jitter, "{node:?} {:?}", places[place]);
            }
        }
        let line = Lattice::of(&[[0.0, 3.0], [0.0, 1.0], [0.0, 2.0]]).unwrap();
        assert_eq!(
            (line.x_mm(), line.y_mm(), line.places()),
            (&[0.0][..], &[1.0, 2.0, 3.0][..], &[1, 2, 0][..])
        );
        assert_eq!(Lattice::of(&[[4.0, 2.0]]).unwrap().places(), [0]);
    }

    #[test]
    fn other_points_are_not_a_lattice() {
        let whole = places(0.0);
        assert_eq!(Lattice::of(&[]), None);
        assert_eq!(Lattice::of(&whole[1..]), None, "a gap");
        assert_eq!(Lattice::of(&places(0.2)), None, "beyond the tolerance");
        let turned = whole.iter().map(|[x, y]| [0.9 * x - 0.4 * y, 0.4 * x + 0.9 * y]);
        assert_eq!(Lattice::of(&Vec::from_iter(turned)), None, "turned");
        let offset = (0..12).map(|node| {
            [
                f64::from(node / 4) * 2.0,
                f64::from(node % 4) * 2.0 + f64::from(node / 4 % 2),
            ]
        });
        assert_eq!(
            Lattice::of(&Vec::from_iter(offset)),
            None,
            "every second line is offset"
        );
        let mut twice = whole.clone();
        twice[3] = twice[4];
        assert_eq!(Lattice::of(&twice), None, "a node with two points");
        let mut none = whole;
        none[5][0] = f64::NAN;
        assert_eq!(Lattice::of(&none), None, "a NaN coordinate");
    }
}
