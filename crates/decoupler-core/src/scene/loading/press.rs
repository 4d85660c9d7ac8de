use glam::DVec2;

use super::IndenterShape::{Cylinder, Edge, FlatPunch, Sphere};
use crate::{numerics::scaled_k0_k1, scene::Indenter};

/// One press of an indenter, prepared for evaluation at many nodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Press {
    indenter: Indenter,
    /// Radius of the body, if its shape has one.
    radius_mm: f64,
    /// The contact of a ball or a punch.
    contact: RoundContact,
    place: DVec2,
    /// Depth at the centre of the body.
    depth_mm: f64,
    /// Unit vector along which the body is inclined; the axis of a cylinder, the line of an edge.
    direction: DVec2,
    /// Increase of depth per millimetre along `direction`.
    slope: f64,
}

impl Press {
    /// Presses an indenter of radius `radius_mm`, if it has one, to a depth of `depth_mm` at `at`, inclined by `slope`
    /// along `direction`.
    pub(super) fn new(of: Indenter, radius_mm: f64, at: DVec2, depth_mm: f64, direction: DVec2, slope: f64) -> Self {
        let contact_mm = match of.shape {
            Sphere { .. } => contact_radius_mm(radius_mm, depth_mm, of.spread_mm),
            FlatPunch { .. } => radius_mm,
            Cylinder { .. } | Edge { .. } => 0.0,
        };
        Self {
            indenter: of,
            radius_mm,
            contact: RoundContact::new(contact_mm, of.spread_mm),
            place: at,
            depth_mm,
            direction,
            slope,
        }
    }

    /// Depth of the surface at (x, y), in millimetres; below 0 where a tilted body lifts off.
    pub(super) fn depth_at_mm(&self, x: f64, y: f64) -> f64 {
        let apart = DVec2::new(x, y) - self.place;
        let (along, across) = (apart.dot(self.direction), apart.perp_dot(self.direction));
        let distance = apart.length();
        let contact_mm = self.contact.radius_mm;
        match self.indenter.shape {
            Sphere { .. } => {
                let inside = distance.min(contact_mm);
                let at_body = self.depth_mm - inside * inside / (2.0 * self.radius_mm);
                at_body * self.contact.share_at(distance)
            }
            FlatPunch { .. } => {
                // Outside, the surface starts from the nearest point of the face.
                let inside = (contact_mm / distance).min(1.0);
                (self.depth_mm + self.slope * along * inside) * self.contact.share_at(distance)
            }
            Cylinder { .. } => {
                let depth_mm = self.depth_mm + self.slope * along;
                if depth_mm <= 0.0 {
                    return 0.0;
                }
                // The parabola depth − distance²/(2 radius) up to the distance a where its slope equals that of the free
                // surface, a/radius = depth(a)/spread, and the free surface beyond.
                let inside = across.abs().min(self.half_width_mm(depth_mm));
                let at_body = depth_mm - inside * inside / (2.0 * self.radius_mm);
                at_body * (-(across.abs() - inside) / self.indenter.spread_mm).exp()
            }
            Edge { .. } => (self.depth_mm + self.slope * along) * (-across.max(0.0) / self.indenter.spread_mm).exp(),
        }
    }

    /// Half the width of the contact of the upright body; see [`Indenter::contact_half_width_mm`](super::Indenter).
    pub(super) fn contact_half_width_mm(&self) -> f64 {
        match self.indenter.shape {
            Sphere { .. } | FlatPunch { .. } => self.contact.radius_mm,
            Cylinder { .. } => self.half_width_mm(self.depth_mm),
            Edge { .. } => f64::INFINITY,
        }
    }

    /// Distance from its axis up to which a cylinder touches the surface.
    fn half_width_mm(&self, depth_mm: f64) -> f64 {
        if depth_mm <= 0.0 {
            return 0.0;
        }
        // √(λ² + 2 radius·depth) − λ, in the unit √(2 radius·depth) so that a long λ neither cancels nor overflows.
        let unit_mm = self.radius_mm.sqrt() * (2.0 * depth_mm).sqrt();
        let length = self.indenter.spread_mm / unit_mm;
        unit_mm / (length + (1.0 + length * length).sqrt())
    }
}

/// The surface around a round body on a sheet under tension on an elastic foundation (Pasternak 1954).
///
/// Outside the contact the deflection w obeys w″ + w′/r = w/λ² with decay length λ. At a distance r from the axis it is
/// w(a) K₀(r/λ)/K₀(a/λ), where a is the contact radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct RoundContact {
    /// a.
    pub(super) radius_mm: f64,
    /// λ.
    decay_length_mm: f64,
    /// exp(a/λ) K₀(a/λ).
    scaled_at_edge: f64,
}

impl RoundContact {
    /// Creates a contact of this radius.
    pub(super) fn new(radius_mm: f64, decay_length_mm: f64) -> Self {
        Self {
            radius_mm,
            decay_length_mm,
            scaled_at_edge: scaled_k0_k1(radius_mm / decay_length_mm).0,
        }
    }

    /// Deflection at `distance_mm` from the axis relative to that at the edge of the contact; 1 inside.
    pub(super) fn share_at(&self, distance_mm: f64) -> f64 {
        let beyond = distance_mm - self.radius_mm;
        if beyond <= 0.0 {
            return 1.0;
        }
        let scaled = scaled_k0_k1(distance_mm / self.decay_length_mm).0;
        (-beyond / self.decay_length_mm).exp() * scaled / self.scaled_at_edge
    }
}

/// Radius of the contact of a ball of radius `ball_mm` pressed `depth_mm` deep, whose face is depth − r²/(2·ball). It ends
/// where the slopes of face and free surface are equal, a/ball = w(a)/λ · K₁(a/λ)/K₀(a/λ), so that there is no kink.
///
/// In the unit of r₀ = √(2 ball·depth), where the face would meet the undeformed surface, with y = a/r₀, L = λ/r₀ and q(x) = K₀(x)/K₁(x), it is
///
/// `y² + 2 L y q(y/L) = 1`, whose left side increases with y from 0.
///
/// Because q is between 0 and 1, y is between √(1 + L²) − L (the solution for a cylinder) and 1. Solved by Newton's
/// method with q′ = q² + q/x − 1, and by bisection where a step would leave the bracket.
fn contact_radius_mm(ball_mm: f64, depth_mm: f64, decay_length_mm: f64) -> f64 {
    /// Newton's method converges in 3 to 6 iterations; bisection alone would need 60.
    const ROUNDS: usize = 100;
    let unit_mm = ball_mm.sqrt() * (2.0 * depth_mm).sqrt();
    if unit_mm <= 0.0 {
        return 0.0;
    }
    let length = (decay_length_mm / unit_mm).clamp(1e-150, 1e150);
    let mut low = 1.0 / (length + (1.0 + length * length).sqrt());
    let mut high = 1.0;
    let mut y = low;
    for _ in 0..ROUNDS {
        let (k0, k1) = scaled_k0_k1(y / length);
        let q = k0 / k1;
        let excess = y * y + 2.0 * length * y * q - 1.0;
        if excess > 0.0 {
            high = y;
        } else {
            low = y;
        }
        // 2y + 2Lq + 2y q′(y/L), where 2y q′ = 2y q² + 2Lq − 2y.
        let slope = 4.0 * length * q + 2.0 * y * q * q;
        let newton = y - excess / slope;
        let next = if newton >= low && newton <= high {
            newton
        } else {
            0.5 * (low + high)
        };
        let moved = (next - y).abs();
        y = next;
        if moved <= 1e-15 * y {
            break;
        }
    }
    y * unit_mm
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The indenter of this name, which leaves a decay length of 2 mm, with a radius.
    fn body(name: &str, radius_mm: f64) -> (Indenter, f64) {
        let indenter = Indenter::all().into_iter().find(|indenter| indenter.name() == name);
        (indenter.unwrap(), radius_mm)
    }

    fn press((indenter, radius_mm): (Indenter, f64), slope: f64) -> Press {
        Press::new(indenter, radius_mm, DVec2::new(3.0, -1.0), 0.8, DVec2::X, slope)
    }

    #[test]
    fn the_surface_follows_the_body_and_recovers() {
        let sphere = press(body("sphere", 4.0), 0.0);
        assert!((sphere.depth_at_mm(3.0, -1.0) - 0.8).abs() < 1e-15);
        assert!((sphere.depth_at_mm(3.5, -1.0) - (0.8 - 0.25 / 8.0)).abs() < 1e-15);
        assert!(sphere.depth_at_mm(30.0, -1.0) < 1e-4);
        let punch = press(body("flat punch", 2.0), 0.0);
        assert!((punch.depth_at_mm(3.0, 0.9) - 0.8).abs() < 1e-15);
        let edge = press(body("edge", 0.0), 0.0);
        let (one, other) = (edge.depth_at_mm(3.0, 5.0), edge.depth_at_mm(3.0, -7.0));
        assert_eq!(one.max(other), 0.8);
        assert!((one.min(other) - 0.8 * (-3.0_f64).exp()).abs() < 1e-15);
    }

    /// The solution in the plane, exp(−4/2) = 0.135, holds for bodies that are long in one direction.
    #[test]
    fn around_round_bodies_the_surface_is_axisymmetric() {
        // scipy.special.k0(3.5) / scipy.special.k0(1.5), SciPy 1.17.1.
        let punch = press(body("flat punch", 3.0), 0.0);
        assert!((punch.depth_at_mm(3.0, 6.0) / 0.8 - 0.09166691889433545).abs() < 1e-15);
        // Contact radius by scipy.optimize.brentq, then its depth times k0(3 / 2) / k0(radius / 2).
        let sphere = press(body("sphere", 4.0), 0.0);
        assert!((sphere.depth_at_mm(3.0, 2.0) - 0.18187682811379735).abs() < 1e-14);
    }

    /// w″ + w′/r = w/λ² next to round bodies, w″ = w/λ² next to long ones, by central differences.
    #[test]
    fn the_free_surface_obeys_the_equation_of_its_foundation() {
        let step = 1e-3;
        for (shape, curvature) in [
            (body("sphere", 4.0), 1.0),
            (body("flat punch", 2.0), 1.0),
            (body("cylinder", 4.0), 0.0),
            (body("edge", 0.0), 0.0),
        ] {
            let press = press(shape, 0.0);
            for distance in [2.5, 4.0, 7.0] {
                let side = if press.depth_at_mm(3.0, 5.0) < 0.7 { 1.0 } else { -1.0 };
                let depth = |r: f64| press.depth_at_mm(3.0, -1.0 + side * r);
                let (before, at, after) = (depth(distance - step), depth(distance), depth(distance + step));
                let second = (before - 2.0 * at + after) / (step * step);
                let first = (after - before) / (2.0 * step);
                let residual = second + curvature * first / distance - at / 4.0;
                assert!(residual.abs() < 1e-6 * at, "{shape:?} {distance}: {residual} {at}");
            }
        }
    }

    #[test]
    fn a_round_body_leaves_no_kink() {
        let sphere = press(body("sphere", 4.0), 0.0);
        let slope =
            |at: f64| (sphere.depth_at_mm(3.0 + at + 1e-6, -1.0) - sphere.depth_at_mm(3.0 + at - 1e-6, -1.0)) / 2e-6;
        let mut last = slope(0.01);
        for step in 2..600 {
            let next = slope(0.01 * f64::from(step));
            assert!((next - last).abs() < 0.01, "{step}");
            last = next;
        }
    }

    /// The parabola of a cylinder ends where a/4 = (0.8 − a²/8)/λ, here with λ so long that √(λ² + 6.4) − λ cancels.
    #[test]
    fn extreme_sizes_give_depths_up_to_the_bodys() {
        let long = Indenter {
            spread_mm: 1e9,
            ..body("cylinder", 4.0).0
        };
        let cylinder = Press::new(long, 4.0, DVec2::ZERO, 0.8, DVec2::X, 0.0);
        let bent = 0.8 - cylinder.depth_at_mm(0.0, 1.6e-9);
        assert!((0.0..1e-15).contains(&bent), "{bent}");
        let sizes = [5e-324, 1e-300, 1e-9, 1.0, 1e9, 1e300, f64::MAX];
        for size in sizes {
            for shape in [
                body("sphere", size),
                body("flat punch", size),
                body("cylinder", size),
                body("edge", 0.0),
            ] {
                for spread in sizes {
                    let indenter = Indenter {
                        spread_mm: spread,
                        ..shape.0
                    };
                    for depth in [0.0, 5e-324, 0.8] {
                        let press = Press::new(indenter, shape.1, DVec2::ZERO, depth, DVec2::X, 0.0);
                        for distance in [0.0, 1e-300, 1e-9, 1.0, -7.0, 1e9, 1e150] {
                            let found = press.depth_at_mm(0.0, distance);
                            assert!(
                                (0.0..=depth).contains(&found),
                                "{shape:?} {spread} {depth} {distance}: {found}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_tilted_body_presses_deeper_along_its_tilt() {
        for shape in [body("flat punch", 2.0), body("cylinder", 4.0), body("edge", 0.0)] {
            let press = press(shape, 0.1);
            let rise = press.depth_at_mm(4.0, -1.0) - press.depth_at_mm(2.0, -1.0);
            assert!((rise - 0.2).abs() < 1e-12, "{shape:?} {rise}");
        }
    }

    /// `scipy.optimize.brentq` of a/R − (d − a²/2R)/λ · k1e(a/λ)/k0e(a/λ), tolerance 1e-15, SciPy 1.17.1.
    const SCIPY: [(f64, f64, f64, f64); 5] = [
        (2.0, 4.0, 0.8, 1.545343978351216),
        (2.0, 6.0, 1.0, 2.304550626806748),
        (2.0, 2.0, 0.05, 0.18083240331725334),
        (1e-3, 4.0, 0.8, 2.528822523360786),
        (1e3, 4.0, 0.8, 0.6332224695485295),
    ];

    #[test]
    fn the_contact_radius_is_that_of_an_independent_solver() {
        for (decay_length, ball, depth, expected) in SCIPY {
            let ours = contact_radius_mm(ball, depth, decay_length);
            assert!(
                (ours / expected - 1.0).abs() < 1e-13,
                "{decay_length} {ball} {depth}: {ours}"
            );
        }
    }

    #[test]
    fn the_contact_vanishes_with_the_depth_and_approaches_the_cylinders_without_spread() {
        let radius = |depth, decay_length| contact_radius_mm(4.0, depth, decay_length);
        let radii = [0.0, 1e-300, 1e-9, 1e-3, 1.0].map(|depth| radius(depth, 2.0));
        assert_eq!(radii[0], 0.0);
        assert!(radii.is_sorted() && radii[1] < 1e-149, "{radii:?}");
        // Without spread the surface ends where the ball does.
        assert!((radius(0.5, 1e-9) - 2.0).abs() < 1e-8);
    }

    #[test]
    fn extreme_sizes_give_shares_between_0_and_1_that_fall_with_distance() {
        let sizes = [5e-324, 1e-300, 1e-9, 1.0, 1e9, 1e300, f64::MAX];
        for ball in sizes {
            for depth in [0.0, 5e-324, 1e-9, 1.0, 1e9] {
                for decay_length in sizes {
                    let contact = RoundContact::new(contact_radius_mm(ball, depth, decay_length), decay_length);
                    let radius = contact.radius_mm;
                    assert!(radius >= 0.0 && radius.is_finite(), "{ball} {depth} {decay_length}");
                    let shares = [0.0, 1e-300, 1e-9, 0.5, 1.0, 7.0, 1e9, 1e300].map(|r| contact.share_at(r));
                    assert!(
                        shares.iter().all(|share| (0.0..=1.0).contains(share)),
                        "{contact:?} {shares:?}"
                    );
                    assert!(shares.is_sorted_by(|a, b| a >= b), "{contact:?} {shares:?}");
                }
            }
        }
    }
}
