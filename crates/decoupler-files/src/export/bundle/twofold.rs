use std::ops::{Add, Div, Mul, Neg, Sub};

/// Number of about 32 decimal digits: the unevaluated sum of two doubles, the second below half a unit in the last place
/// of the first.
///
/// Exported networks are judged against values computed with it, because the double precision of the program itself is
/// no better than what is judged. Algorithms: T. J. Dekker, Numerische Mathematik 18 (1971), 224-242; Y. Hida, X. S. Li
/// and D. H. Bailey, Library for double-double and quad-double arithmetic (2007).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Twofold {
    high: f64,
    low: f64,
}

/// ln 2.
const LN_2: Twofold = Twofold {
    high: std::f64::consts::LN_2,
    low: 2.319_046_813_846_299_6e-17,
};

impl Twofold {
    pub(super) const ZERO: Self = Self { high: 0.0, low: 0.0 };

    /// The nearest double.
    pub(super) fn to_f64(self) -> f64 {
        self.high
    }

    /// a + b where |a| ≥ |b|.
    fn of_ordered(a: f64, b: f64) -> Self {
        let high = a + b;
        Self {
            high,
            low: b - (high - a),
        }
    }

    /// Natural logarithm, by one Newton step on eʸ = x from the logarithm in double precision.
    pub(super) fn ln(self) -> Self {
        let near = libm::log(self.high);
        let excess = self * (-Self::from(near)).exp() - Self::from(1.0);
        // ln(1 + e) = e − e²/2 + …, and |e| is some 1e-16.
        Self::from(near) + excess - excess * excess * Self::from(0.5)
    }

    /// e to this power, up to some 700; 0 where that is below the smallest normal number.
    pub(super) fn exp(self) -> Self {
        /// r is divided by 2⁶ and the power squared as often.
        const HALVINGS: i32 = 6;
        if self.high < -745.0 {
            return Self::ZERO;
        }
        let doublings = (self.high / LN_2.high).round();
        let r = (self - LN_2 * Self::from(doublings)) * Self::from(0.5_f64.powi(HALVINGS));
        let (mut term, mut less_one) = (r, r);
        // |r| < 0.0055: the term after these is below 1e-33.
        for n in 2..=12 {
            term = term * r / Self::from(f64::from(n));
            less_one = less_one + term;
        }
        // (1 + e)² − 1 = 2e + e², which loses fewer digits than squaring 1 + e.
        for _ in 0..HALVINGS {
            less_one = less_one * Self::from(2.0) + less_one * less_one;
        }
        let power = less_one + Self::from(1.0);
        let scale = 2.0_f64.powi(doublings as i32);
        Self {
            high: power.high * scale,
            low: power.low * scale,
        }
    }

    /// Hyperbolic tangent, with the error of one in double precision (some 1e-16).
    pub(super) fn tanh(self) -> Self {
        let near = libm::tanh(self.high);
        let slope = (1.0 - near) * (1.0 + near);
        Self::of_ordered(near, self.low * slope)
    }
}

impl From<f64> for Twofold {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for Twofold {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let high = self.high + other.high;
        let of_other = high - self.high;
        let error = (self.high - (high - of_other)) + (other.high - of_other);
        Self::of_ordered(high, error + self.low + other.low)
    }
}

impl Neg for Twofold {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Sub for Twofold {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Twofold {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let high = self.high * other.high;
        let error = self.high.mul_add(other.high, -high);
        Self::of_ordered(high, error + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Twofold {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::from(first);
        let second = rest.high / other.high;
        let rest = rest - other * Self::from(second);
        Self::of_ordered(first, second) + Self::from(rest.high / other.high)
    }
}

#[cfg(test)]
mod tests {
    use dashu_float::{DBig, FBig, round::mode::HalfEven};
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;

    /// Bits of the reference.
    const BITS: usize = 160;

    fn exact(value: Twofold) -> FBig<HalfEven, 2> {
        let part = |part: f64| {
            FBig::<HalfEven, 2>::try_from(part)
                .unwrap()
                .with_precision(BITS)
                .value()
        };
        part(value.high) + part(value.low)
    }

    fn relative(ours: Twofold, truth: &FBig<HalfEven, 2>) -> f64 {
        ((exact(ours) - truth) / truth).to_f64().value().abs()
    }

    #[test]
    fn every_operation_keeps_thirty_digits() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for _ in 0..200 {
            let mut draw = || Twofold::from(rng.random_range(0.01..900.0)) / Twofold::from(rng.random_range(1.0..7.0));
            let (a, b) = (draw(), draw());
            let (exact_a, exact_b) = (exact(a), exact(b));
            let cases = [
                ("sum", a + b, &exact_a + &exact_b),
                ("product", a * b, &exact_a * &exact_b),
                ("quotient", a / b, &exact_a / &exact_b),
                ("logarithm of a quotient", (a / b).ln(), exact(a / b).ln()),
            ];
            for (name, ours, truth) in cases {
                assert!(
                    relative(ours, &truth) < 1e-29,
                    "{name} of {a:?} and {b:?}: {ours:?} {truth}"
                );
            }
            assert!(((exact(a - b) - (exact_a - exact_b)).to_f64().value() / a.high.max(b.high)).abs() < 1e-30);
        }
    }

    #[test]
    fn the_constant_is_the_logarithm_of_two() {
        let ln_2 = "0.69314718055994530941723212145817656808".parse::<DBig>().unwrap();
        let difference = exact(LN_2).to_decimal().value() - ln_2;
        assert!(difference.to_f64().value().abs() < 1e-32);
    }

    #[test]
    fn the_tangent_is_that_of_double_precision_and_follows_the_second_part() {
        for x in [-30.0, -1.5, -1e-8, 0.0, 0.3, 2.0] {
            assert_eq!(Twofold::from(x).tanh().to_f64(), libm::tanh(x), "{x}");
        }
        let (x, step) = (0.7, 1e-17);
        let moved = (Twofold { high: x, low: step }.tanh() - Twofold::from(x).tanh()).to_f64();
        let slope = 1.0 - f64::tanh(x).powi(2);
        assert!((moved / step - slope).abs() < 1e-9, "{moved}");
    }
}
