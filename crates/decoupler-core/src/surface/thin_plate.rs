//! The thin-plate spline (J. Duchon, "Splines minimizing rotation-invariant semi-norms in Sobolev spaces", 1977): of all
//! surfaces through the nodes the one of least bending energy.
//!
//! It is a plane and a sum of Green's functions of the biharmonic operator, one at each node,
//!
//! ```text
//! z(p) = a + b·p + Σ_n w_n φ(|p − p_n|)        φ(r) = r² ln r,  φ(0) = 0,  Σ w_n = 0,  Σ w_n p_n = 0
//! ```
//!
//! MATLAB's `griddata(…, 'v4')`, with which the paper draws its figures, is the biharmonic spline without the plane (D. T.
//! Sandwell, "Biharmonic spline interpolation of GEOS-3 and SEASAT altimeter data", Geophysical Research Letters 14(2),
//! 1987, 139-142; φ(r) = r² (ln r − 1)). That sags between nodes of equal height, bends towards 0 beyond them, and changes
//! with the unit of length. With the plane, constants and planes are reproduced; and since a multiple of r² in φ adds only
//! a constant under the two conditions on w, neither Sandwell's −1 nor the unit makes a difference.
//!
//! Only z varies from frame to frame, and it enters linearly: z(points) = W z. With P an orthonormal basis of the affine
//! functions on the nodes and Π = I − PPᵀ, the columns of Wᵀ are `P q + Π (ΠAΠ + τPPᵀ)⁻¹ Π (φ − AP q)`, where q are the
//! basis functions and φ the Green's functions at a point, and A_mn = φ(|p_m − p_n|). ΠAΠ is positive definite on the
//! complement of P, hence the Cholesky factor; any τ > 0 gives the same W.

use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Scale, Side};
use ndarray::Array2;

/// A place in the plane.
pub(super) type Place = (f64, f64);

/// Returns W (`points × nodes`) for nodes that are not on one line; `None` if the equations are singular in the arithmetic.
pub(super) fn weights(nodes_mm: &[Place], points_mm: &[Place]) -> Option<Array2<f64>> {
    let local = LocalCoordinates::of(nodes_mm);
    let nodes = local.places(nodes_mm);
    let points = local.places(points_mm);
    let affine = AffineBasis::of(&nodes);
    let on_nodes = affine.at(&nodes);
    let (basis, at_points) = (on_nodes.as_ref(), affine.at(&points));

    let greens = |others: &[Place]| {
        Mat::from_fn(nodes.len(), others.len(), |n, p| {
            green(distance_squared(nodes[n], others[p]))
        })
    };
    let mut system = greens(&nodes);
    let mut solution = greens(&points);
    solution -= (&system * basis) * at_points.transpose();
    remove_affine(basis, &mut solution);

    // Before the projection, which leaves only rounding of three nodes.
    let tau = system.norm_max();
    // Twice, once from each side: A is symmetric.
    remove_affine(basis, &mut system);
    system = system.transpose().to_owned();
    remove_affine(basis, &mut system);
    system += (Scale(tau) * basis) * basis.transpose();
    system.llt(Side::Lower).ok()?.solve_in_place(&mut solution);

    remove_affine(basis, &mut solution);
    solution += basis * at_points.transpose();
    Some(Array2::from_shape_fn((points.len(), nodes.len()), |(p, n)| {
        solution[(n, p)]
    }))
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

/// Subtracts from each column its part in the span of `basis`: `matrix = (I − PPᵀ) matrix`.
fn remove_affine(basis: MatRef<'_, f64>, matrix: &mut Mat<f64>) {
    let parts = basis.transpose() * &*matrix;
    *matrix -= basis * parts;
}

/// Coordinates from the middle of the nodes, as fractions of half their extent: neither the origin nor the unit of the
/// places given costs digits.
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

/// Affine functions that are orthonormal on the nodes: a constant, the distance from the mean of x, and that of y as far as
/// it does not follow from the distance of x, which on a lattice is all of it.
struct AffineBasis {
    constant: f64,
    mean: Place,
    /// Change of y with x along the nodes.
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

    /// Values of the three functions, `places × 3`.
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
