//! The thin-plate spline through scattered points: hexagonal skins, lattices with gaps, irregular taxels.
//!
//! The surface ends slightly beyond the convex hull of the points and excludes regions far from every point, such as the
//! middle of a ring or the notch of an L.
//!
//! The thin-plate spline (J. Duchon, "Splines minimizing rotation-invariant semi-norms in Sobolev spaces", 1977): of all
//! surfaces through the nodes, the one of minimum bending energy.
//!
//! It is the sum of a plane and Green's functions of the biharmonic operator, one at each node,
//!
//! ```text
//! z(p) = a + b·p + Σ_n w_n φ(|p − p_n|)        φ(r) = r² ln r,  φ(0) = 0,  Σ w_n = 0,  Σ w_n p_n = 0
//! ```
//!
//! MATLAB's `griddata(…, 'v4')`, used for the paper's figures, is the biharmonic spline without the plane (D. T.
//! Sandwell, "Biharmonic spline interpolation of GEOS-3 and SEASAT altimeter data", Geophysical Research Letters 14(2),
//! 1987, 139-142; φ(r) = r² (ln r − 1)). It sags between nodes of equal height, bends towards 0 beyond them, and depends
//! on the unit of length. With the plane, constants and planes are reproduced; and since a multiple of r² in φ adds only
//! a constant under the two conditions on w, neither Sandwell's −1 nor the unit makes a difference.
//!
//! Only z varies from frame to frame, and it enters linearly: z(points) = W z. With P an orthonormal basis of the affine
//! functions on the nodes and Π = I − PPᵀ, the columns of Wᵀ are `P q + Π (ΠAΠ + τPPᵀ)⁻¹ Π (φ − AP q)`, where q are the
//! basis functions and φ the Green's functions at a point, and A_mn = φ(|p_m − p_n|). ΠAΠ is positive definite on the
//! complement of P, so the matrix has a Cholesky factor; any τ > 0 gives the same W.

use faer::{Mat, MatRef, Scale, Side, linalg::solvers::Solve};
use glam::DVec2;
use ndarray::Array2;

use super::{
    error::{Axis, SurfaceError},
    grid::{CLOSEST_RELATIVE, Grid, GridAxis, Point, Weights, check_coordinates},
};

/// Maximum distance of collinear points from their line, relative to their extent along it.
const THINNEST: f64 = 1e-6;

/// Maximum distance of the surface from the nearest point, relative to the largest nearest-neighbour distance.
const REACH: f64 = 1.5;

/// A spline evaluated at the grid points between scattered nodes.
#[derive(Clone, Debug)]
pub(super) struct Scattered {
    /// Indices of the grid points that have a surface.
    points: Vec<usize>,
    /// Distance of each grid point from the hull as a fraction of the margin; 1 where there is no surface.
    beyond: Vec<f64>,
    /// Weights at these points, followed by those at the nodes.
    weights: Weights,
}

impl Scattered {
    /// Prepares the spline, with a grid of about `target` points per side.
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
        let weights = weights(&tuples(&places), &tuples(&Vec::from_iter(evaluated)));
        let known = drawn.iter().map(|&(_, _, beyond_mm)| Point {
            is_inside: beyond_mm == 0.0,
            node: None,
        });
        // The spline must reproduce the values at the nodes; otherwise it is dominated by rounding errors.
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

    /// Distance of a grid point from the nodes as a fraction of the margin: see [`super::SurfaceMap::beyond`].
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

/// A point in the plane.
pub(super) type Place = (f64, f64);

/// Returns W (`points × nodes`) for nodes that are not on one line; `None` if the equations are numerically singular.
pub(super) fn weights(nodes_mm: &[Place], points_mm: &[Place]) -> Option<Array2<f64>> {
    /// Points whose equations are solved together, so that not the whole grid is in memory several times.
    const BLOCK: usize = 1024;
    let local = LocalCoordinates::of(nodes_mm);
    let nodes = local.places(nodes_mm);
    let affine = AffineBasis::of(&nodes);
    let on_nodes = affine.at(&nodes);
    let basis = on_nodes.as_ref();

    let greens = |others: &[Place]| {
        Mat::from_fn(nodes.len(), others.len(), |n, p| {
            green(distance_squared(nodes[n], others[p]))
        })
    };
    let system = greens(&nodes);
    let mut projected = system.clone();
    // Before the projection, which for three nodes leaves only rounding errors.
    let tau = system.norm_max();
    // Twice, once from each side: A is symmetric.
    remove_affine(basis, &mut projected);
    projected = projected.transpose().to_owned();
    remove_affine(basis, &mut projected);
    projected += (Scale(tau) * basis) * basis.transpose();
    let factors = projected.llt(Side::Lower).ok()?;

    let of_affine = &system * basis;
    let mut weights = Array2::zeros((points_mm.len(), nodes.len()));
    let blocks = points_mm
        .chunks(BLOCK)
        .zip(weights.axis_chunks_iter_mut(ndarray::Axis(0), BLOCK));
    for (points_mm, mut weights) in blocks {
        let points = local.places(points_mm);
        let at_points = affine.at(&points);
        let mut solution = greens(&points);
        solution -= &of_affine * at_points.transpose();
        remove_affine(basis, &mut solution);
        factors.solve_in_place(&mut solution);
        remove_affine(basis, &mut solution);
        solution += basis * at_points.transpose();
        for ((point, node), weight) in weights.indexed_iter_mut() {
            *weight = solution[(node, point)];
        }
    }
    Some(weights)
}

/// φ(r) = r² ln r from r².
fn green(distance_squared: f64) -> f64 {
    if distance_squared > 0.0 {
        0.5 * distance_squared * distance_squared.ln()
    } else {
        0.0
    }
}

fn distance_squared(a: Place, b: Place) -> f64 {
    (a.0 - b.0).powi(2) + (a.1 - b.1).powi(2)
}

/// Removes from each column its component in the span of `basis`: `matrix = (I − PPᵀ) matrix`.
fn remove_affine(basis: MatRef<'_, f64>, matrix: &mut Mat<f64>) {
    let parts = basis.transpose() * &*matrix;
    *matrix -= basis * parts;
}

/// Coordinates relative to the centre of the nodes, as fractions of half their extent, so that no digits are lost to the
/// origin or the unit of the given coordinates.
struct LocalCoordinates {
    middle_mm: Place,
    half_extent_mm: f64,
}

impl LocalCoordinates {
    fn of(nodes_mm: &[Place]) -> Self {
        let range = |coordinate: fn(&Place) -> f64| {
            let values = || nodes_mm.iter().map(coordinate);
            let (least, most) = (values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max));
            (0.5 * least + 0.5 * most, 0.5 * most - 0.5 * least)
        };
        let ((x_mm, half_x_mm), (y_mm, half_y_mm)) = (range(|place| place.0), range(|place| place.1));
        Self {
            middle_mm: (x_mm, y_mm),
            half_extent_mm: half_x_mm.max(half_y_mm),
        }
    }

    fn places(&self, places_mm: &[Place]) -> Vec<Place> {
        let local = |place_mm: f64, middle_mm: f64| (place_mm - middle_mm) / self.half_extent_mm;
        let places_mm = places_mm.iter();
        places_mm
            .map(|&(x, y)| (local(x, self.middle_mm.0), local(y, self.middle_mm.1)))
            .collect()
    }
}

/// Affine functions that are orthonormal on the nodes: a constant, the deviation from the mean of x, and the deviation
/// from the mean of y after regression on x.
struct AffineBasis {
    constant: f64,
    mean: Place,
    /// Slope of the regression of y on x over the nodes.
    tilt: f64,
    scales: Place,
}

impl AffineBasis {
    fn of(nodes: &[Place]) -> Self {
        let count = nodes.len() as f64;
        let mean = |coordinate: fn(&Place) -> f64| nodes.iter().map(coordinate).sum::<f64>() / count;
        let mean = (mean(|place| place.0), mean(|place| place.1));
        let centred = || nodes.iter().map(|node| (node.0 - mean.0, node.1 - mean.1));
        let square = centred().map(|(x, _)| x * x).sum::<f64>();
        let tilt = centred().map(|(x, y)| x * y).sum::<f64>() / square;
        let rest = centred().map(|(x, y)| (y - tilt * x).powi(2)).sum::<f64>();
        Self {
            constant: 1.0 / count.sqrt(),
            mean,
            tilt,
            scales: (1.0 / square.sqrt(), 1.0 / rest.sqrt()),
        }
    }

    /// Values of the three functions: `points × 3`.
    fn at(&self, places: &[Place]) -> Mat<f64> {
        Mat::from_fn(places.len(), 3, |p, function| {
            let (x, y) = (places[p].0 - self.mean.0, places[p].1 - self.mean.1);
            match function {
                0 => self.constant,
                1 => x * self.scales.0,
                _ => (y - self.tilt * x) * self.scales.1,
            }
        })
    }
}
