use super::modified_bessel::scaled_k0_k1;

/// The surface around a round body on a sheet under tension on an elastic foundation (Pasternak 1954).
///
/// Outside the contact the deflection w obeys w″ + w′/r = w/λ², λ being the decay length, so it is
/// w(a) K₀(r/λ)/K₀(a/λ) at a distance r from the axis, with a the contact radius.
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
    /// A contact of this radius.
    pub(super) fn new(radius_mm: f64, decay_length_mm: f64) -> Self {
        Self {
            radius_mm,
            decay_length_mm,
            scaled_at_edge: scaled_k0_k1(radius_mm / decay_length_mm).0,
        }
    }

    /// The contact of a ball of radius `ball_mm` pressed `depth_mm` deep, whose face is depth − r²/(2·ball): it ends
    /// where the slopes of face and free surface agree, a/ball = w(a)/λ · K₁(a/λ)/K₀(a/λ), so that there is no kink.
    pub(super) fn of_ball(ball_mm: f64, depth_mm: f64, decay_length_mm: f64) -> Self {
        Self::new(contact_radius_mm(ball_mm, depth_mm, decay_length_mm), decay_length_mm)
    }

    /// Deflection at `distance_mm` from the axis as a share of that at the edge of the contact; 1 inside.
    pub(super) fn share_at(&self, distance_mm: f64) -> f64 {
        let beyond = distance_mm - self.radius_mm;
        if beyond <= 0.0 {
            return 1.0;
        }
        let scaled = scaled_k0_k1(distance_mm / self.decay_length_mm).0;
        (-beyond / self.decay_length_mm).exp() * scaled / self.scaled_at_edge
    }
}

/// Solves the condition of [`RoundContact::of_ball`] in the unit of r₀ = √(2 ball·depth), where the face would meet the
/// undeformed surface: with y = a/r₀, L = λ/r₀ and q(x) = K₀(x)/K₁(x), it is
///
/// `y² + 2 L y q(y/L) = 1`, whose left side grows with y from 0.
///
/// As q lies between 0 and 1, y lies between √(1 + L²) − L (the solution for a cylinder) and 1. Newton's method with
/// q′ = q² + q/x − 1; where it would leave the bracket, that is halved instead.
fn contact_radius_mm(ball_mm: f64, depth_mm: f64, decay_length_mm: f64) -> f64 {
    /// Newton's method converges in 3 to 6 rounds; halving alone would in 60.
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
                    let contact = RoundContact::of_ball(ball, depth, decay_length);
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
