//! Nodes that do not form a lattice: hexagonal skins, lattices with gaps, irregular taxels.
//!
//! The surface ends slightly beyond the convex hull of the points and excludes regions far from every point, such as the
//! middle of a ring or the notch of an L.

use glam::DVec2;

use super::{
    SurfaceError,
    grid::{CLOSEST_RELATIVE, Grid, GridAxis, check_coordinates},
    map::{MAX_SPLINE_NODES, SurfaceMap, affordable},
    spline::{Point, Weights},
};

/// Maximum distance of collinear points from their line, relative to their extent along it.
const THINNEST: f64 = 1e-6;

/// Maximum distance of the surface from the nearest point, relative to the largest nearest-neighbour distance.
const REACH: f64 = 1.5;

impl SurfaceMap {
    /// Prepares the thin-plate spline through nodes at these points (x, y), in millimetres, which need not form a
    /// lattice. It has gaps (NaN) outside their convex hull, except for a margin of half the mean distance between
    /// neighbours, and at points far from every node.
    ///
    /// # Errors
    /// [`SurfaceError`] if there are no nodes, or more than a thousand, a coordinate is not finite, two nodes coincide or
    /// nearly so, or all are on one line. A line along x or y is a lattice: see [`Self::new`].
    pub fn scattered(places_mm: &[[f64; 2]]) -> Result<Self, SurfaceError> {
        let (nodes, target) = (places_mm.len(), affordable(places_mm.len()));
        if nodes > MAX_SPLINE_NODES {
            return Err(SurfaceError::TooMany {
                count: nodes,
                most: MAX_SPLINE_NODES,
            });
        }
        for (axis, place) in [("x", 0), ("y", 1)] {
            check_coordinates(axis, &Vec::from_iter(places_mm.iter().map(|at| at[place])))?;
        }
        let places = Vec::from_iter(places_mm.iter().copied().map(DVec2::from));
        let neighbours_mm = distances_of_neighbours(&places)?;
        let hull = Hull::of(&places).ok_or(SurfaceError::OnOneLine)?;
        let margin_mm = 0.5 * neighbours_mm.iter().sum::<f64>() / nodes as f64;
        let reach_mm = REACH * neighbours_mm.iter().copied().fold(0.0, f64::max);
        let low = places.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = places.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let grid = Grid {
            x: GridAxis::spanning(low.x, high.x, target, margin_mm),
            y: GridAxis::spanning(low.y, high.y, target, margin_mm),
        };
        let (mut rows, mut beyond) = (vec![None; grid.len()], vec![1.0; grid.len()]);
        let mut points = Vec::new();
        for (index, place_mm) in grid.places_mm().enumerate() {
            let beyond_mm = hull.distance_mm(place_mm);
            if beyond_mm <= margin_mm && places.iter().any(|place| place.distance(place_mm) <= reach_mm) {
                rows[index] = Some(points.len());
                beyond[index] = beyond_mm / margin_mm;
                points.push(Point {
                    place_mm,
                    is_inside: beyond_mm == 0.0,
                    node: None,
                });
            }
        }
        // The spline must reproduce the values at the nodes; otherwise it is dominated by rounding errors.
        points.extend(places.iter().enumerate().map(|(node, &place_mm)| Point {
            place_mm,
            is_inside: true,
            node: Some(node),
        }));
        Ok(Self {
            grid,
            nodes,
            weights: Some(Weights::new(&places, &points).ok_or(SurfaceError::Uneven)?),
            rows,
            beyond,
            lattice: None,
        })
    }
}

/// Distance of each point from its nearest neighbour.
fn distances_of_neighbours(places: &[DVec2]) -> Result<Vec<f64>, SurfaceError> {
    let largest_mm = places
        .iter()
        .fold(0.0_f64, |largest, place| largest.max(place.abs().max_element()));
    let closest_mm = CLOSEST_RELATIVE * largest_mm;
    let mut nearest_mm = vec![f64::INFINITY; places.len()];
    for (second, place) in places.iter().enumerate() {
        for (first, other) in places[..second].iter().enumerate() {
            let apart_mm = place.distance(*other);
            if apart_mm <= closest_mm {
                return Err(SurfaceError::SamePlace { first, second });
            }
            nearest_mm[first] = nearest_mm[first].min(apart_mm);
            nearest_mm[second] = nearest_mm[second].min(apart_mm);
        }
    }
    Ok(nearest_mm)
}

/// Convex hull of points, with its corners anticlockwise.
struct Hull(Vec<DVec2>);

impl Hull {
    /// Computes the hull by monotone chains (A. M. Andrew, "Another efficient algorithm for convex hulls in two
    /// dimensions", 1979); `None` if the points are on one line.
    fn of(places: &[DVec2]) -> Option<Self> {
        let mut sorted = places.to_vec();
        sorted.sort_by(|one, other| one.x.total_cmp(&other.x).then(one.y.total_cmp(&other.y)));
        let chain = |places: &mut dyn Iterator<Item = &DVec2>| {
            let mut chain: Vec<DVec2> = Vec::new();
            for &place in places {
                while let [.., before, last] = chain[..]
                    && (last - before).perp_dot(place - last) <= 0.0
                {
                    chain.pop();
                }
                chain.push(place);
            }
            // It ends where the other chain begins.
            chain.pop();
            chain
        };
        let mut corners = chain(&mut sorted.iter());
        corners.extend(chain(&mut sorted.iter().rev()));
        let pairs = corners
            .iter()
            .flat_map(|one| corners.iter().map(move |other| one.distance(*other)));
        let extent_mm = pairs.fold(0.0, f64::max);
        let first = *corners.first()?;
        let doubled_area = corners
            .windows(2)
            .map(|pair| (pair[0] - first).perp_dot(pair[1] - first))
            .sum::<f64>();
        (doubled_area > THINNEST * extent_mm * extent_mm).then_some(Self(corners))
    }

    /// Distance of a point from the hull; 0 inside.
    fn distance_mm(&self, at: DVec2) -> f64 {
        let ends = self.0.iter().cycle().skip(1);
        let edges = || self.0.iter().zip(ends.clone());
        if edges().all(|(from, to)| (*to - *from).perp_dot(at - *from) >= 0.0) {
            return 0.0;
        }
        let distances = edges().map(|(from, to)| {
            let edge = *to - *from;
            let share = ((at - *from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            at.distance(*from + edge * share)
        });
        distances.fold(f64::INFINITY, f64::min)
    }
}
