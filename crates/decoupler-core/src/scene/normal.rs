use std::f64::consts::TAU;

use rand::{Rng, RngExt};

/// A standard normal value, by Box and Muller (1958).
pub(crate) fn standard_normal(rng: &mut impl Rng) -> f64 {
    // 1 − u lies in (0, 1], where the logarithm is finite.
    let length = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    length * (TAU * rng.random::<f64>()).cos()
}

/// The distribution function of the standard normal.
pub(crate) fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}
