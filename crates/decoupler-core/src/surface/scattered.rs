//! The thin-plate spline through places that are no lattice: hexagonal skins, lattices with gaps, taxels put where they fit.
//!
//! The surface ends where the places end, at their convex hull and a little beyond, and leaves out what is far from every
//! place: the middle of a ring, the notch of an L.

use glam::DVec2;

use super::{
    grid::{CLOSEST_RELATIVE, Grid, GridAxis, Point, Weights, check_coordinates},
    map::{Axis, SurfaceError},
    thin_plate,
};

/// Places this near to one line, as a part of their extent along it, are on it.
const THINNEST: f64 = 1e-6;

/// Farthest from the nearest place that the surface goes, in units of the largest distance of a place from its neighbour.
const REACH: f64 = 1.5;

/// A spline at the points of a grid that are between the places.
#[derive(Clone, Debug)]
pub(super) struct Scattered {
    /// Indices of the grid points that have a surface.
    points: Vec<usize>,
    /// Distance of each grid point from the hull, as a part of the margin; 1 where there is no surface.
    beyond: Vec<f64>,
    /// Weights at these points, and after them at the places themselves.
    weights: Weights,
}

impl Scattered {
    /// Prepares the spline, with its grid of about `target` points a side.
    pub(super) fn new(places_mm: &[[f64; 2]], target: usize) -> Result<(Grid, Self), SurfaceError> {
        for (axis, place) in [(Axis::X, 0), (Axis::Y, 1)] {
            check_coordinates(axis, &Vec::from_iter(places_mm.iter().map(|at| at[place])))?;
        }
        let places = Vec::from_iter(places_mm.iter().copied().map(DVec2::from));
        let neighbours_mm = distances_of_neighbours(&places)?;
        let hull = Hull::of(&places).ok_or(SurfaceError::OnOneLine)?;
        let count = places.len() as f64;
        let margin_mm = 0.5 * neighbours_mm.iter().sum::<f64>() / count;
        let reach_mm = REACH * neighbours_mm.iter().copied().fold(0.0, f64::max);

        let low = places.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = places.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let grid = Grid::new(
            GridAxis::spanning(low.x, high.x, target, margin_mm),
            GridAxis::spanning(low.y, high.y, target, margin_mm),
        );
        let at = grid
            .x_mm()
            .iter()
            .flat_map(|&x| grid.y_mm().iter().map(move |&y| DVec2::new(x, y)));
        let drawn = at.enumerate().filter_map(|(index, at)| {
            let beyond_mm = hull.distance_mm(at);
            let is_near = || places.iter().any(|place| place.distance(at) <= reach_mm);
            (beyond_mm <= margin_mm && is_near()).then_some((index, at, beyond_mm))
        });
        let drawn = Vec::from_iter(drawn);
        let evaluated = drawn.iter().map(|(_, at, _)| *at).chain(places.iter().copied());
        let tuples = |places: &[DVec2]| Vec::from_iter(places.iter().map(|at| (at.x, at.y)));
        let weights = thin_plate::weights(&tuples(&places), &tuples(&Vec::from_iter(evaluated)));
        let known = drawn.iter().map(|&(_, _, beyond_mm)| Point {
            is_inside: beyond_mm == 0.0,
            node: None,
        });
        // At the places the spline must give their values, or it is rounding.
        let at_places = (0..places.len()).map(|node| Point {
            is_inside: true,
            node: Some(node),
        });
        let weights = weights.and_then(|weights| Weights::checked(weights, known.chain(at_places)));
        let mut beyond = vec![1.0; grid.len()];
        for &(index, _, beyond_mm) in &drawn {
            beyond[index] = beyond_mm / margin_mm;
        }
        let scattered = Self {
            beyond,
            points: drawn.iter().map(|&(index, ..)| index).collect(),
            weights: weights.ok_or(SurfaceError::Uneven)?,
        };
        Ok((grid, scattered))
    }

    /// Distance of a grid point from the nodes as a part of the margin: see [`super::SurfaceMap::beyond`].
    pub(super) fn beyond(&self, point: usize) -> f64 {
        self.beyond[point]
    }

    /// Writes the surface, with NaN where there is none.
    pub(super) fn evaluate_into(&self, values: &[f64], out: &mut [f64]) {
        out.fill(f64::NAN);
        let surface = self.weights.evaluate(values);
        for (&point, value) in self.points.iter().zip(surface) {
            out[point] = value;
        }
    }
}

/// Distance of each place from its nearest neighbour.
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

/// Convex hull of places, its corners anticlockwise.
struct Hull(Vec<DVec2>);

impl Hull {
    /// The hull by monotone chains (A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions", 1979);
    /// `None` if the places are on one line.
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
            // It ends where the other begins.
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

    /// Distance of a place from the hull; 0 within.
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
