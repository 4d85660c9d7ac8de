//! Distributions and special functions.

/// Returns the value that Student's t exceeds in size with the probability `tails`, with this many degrees of freedom, at
/// least 2 and not necessarily an integer (Hill 1970, algorithm 396, doi:10.1145/355598.355600), for 5 % within 3e-4 of the
/// exact value.
pub(crate) fn student_quantile(tails: f64, freedom: f64) -> f64 {
    let a = 1.0 / (freedom - 0.5);
    let b = 48.0 / (a * a);
    let mut c = ((20_700.0 * a / b - 98.0) * a - 16.0) * a + 96.36;
    let d = ((94.5 / (b + c) - 3.0) / b + 1.0) * (0.5 * a * std::f64::consts::PI).sqrt() * freedom;
    let mut y = (d * tails).powf(2.0 / freedom);
    if y > 0.05 + a {
        let x = -two_sided_normal_quantile(tails);
        y = x * x;
        if freedom < 5.0 {
            c += 0.3 * (freedom - 4.5) * (x + 0.6);
        }
        c += (((0.05 * d * x - 5.0) * x - 7.0) * x - 2.0) * x + b;
        y = (((((0.4 * y + 6.3) * y + 36.0) * y + 94.5) / c - y - 3.0) / b + 1.0) * x;
        y = (a * y * y).exp_m1();
    } else {
        let n = freedom;
        y = ((1.0 / (((n + 6.0) / (n * y) - 0.089 * d - 0.822) * (n + 2.0) * 3.0) + 0.5 / (n + 4.0)) * y - 1.0)
            * (n + 1.0)
            / (n + 2.0)
            + 1.0 / y;
    }
    (freedom * y).sqrt()
}

/// Quantile of the χ² distribution at a normal deviate (Wilson and Hilferty, "The distribution of chi-square", PNAS 17,
/// 1931).
pub(crate) fn chi_squared_quantile(degrees_of_freedom: usize, deviate: f64) -> f64 {
    if degrees_of_freedom == 0 {
        return 0.0;
    }
    let d = degrees_of_freedom as f64;
    let spread = 2.0 / (9.0 * d);
    d * (1.0 - spread + deviate * spread.sqrt()).powi(3)
}

/// Two-sided quantile of the standard normal distribution: the z with P(|Z| > z) = `probability`.
pub(crate) fn two_sided_normal_quantile(probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..80 {
        let middle: f64 = 0.5 * (low + high);
        if libm::erfc(middle * std::f64::consts::FRAC_1_SQRT_2) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Cumulative distribution function of the standard normal distribution.
pub(crate) fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

/// Returns `exp(x) K₀(x)` and `exp(x) K₁(x)`, the modified Bessel functions of the second kind scaled so that large `x`
/// does not underflow, to about 1e-15. `x` is above 0 and is clamped to the range of normal numbers.
///
/// Up to x = 2 by their power series (NIST Digital Library of Mathematical Functions, 10.31.1 and 10.31.2). Beyond, by
/// `K_ν(x) = ∫ exp(−x cosh t) cosh νt dt` over t > 0 (10.32.9), which v² = x (cosh t − 1) turns into
///
/// `exp(x) K₀(x) = ∫ 2 exp(−v²) / √(2x + v²) dv`, and the same with a factor 1 + v²/x for K₁:
///
/// even functions that decay as a Gaussian, for which the trapezoidal rule converges exponentially.
pub(crate) fn scaled_k0_k1(x: f64) -> (f64, f64) {
    // A quarter of the largest number leaves room for 2x + v².
    let x = x.clamp(f64::MIN_POSITIVE, 0.25 * f64::MAX);
    if x <= LARGEST_OF_SERIES {
        bessel_by_series(x)
    } else {
        bessel_by_integral(x)
    }
}

/// Argument at which the method changes from the series, which suffers from cancellation above, to the integral, whose
/// integrand is analytic only up to √(2x) from the real axis.
const LARGEST_OF_SERIES: f64 = 2.0;

/// With y = x²/4, H_k the harmonic numbers and L = ln(x/2) + γ:
/// K₀ = Σ (H_k − L) y^k/(k!)² and K₁ = 1/x + x Σ (L − (H_k + H_{k+1})/2) y^k/(2 k! (k+1)!).
fn bessel_by_series(x: f64) -> (f64, f64) {
    /// y is at most 1: the remaining terms are below 1e-19.
    const TERMS: u32 = 12;
    const EULER: f64 = 0.577_215_664_901_532_9;
    let y = 0.25 * x * x;
    let logarithm = (0.5 * x).ln() + EULER;
    let (mut k0, mut k1) = (0.0, 0.0);
    let (mut term, mut harmonic) = (1.0, 0.0);
    for k in 0..TERMS {
        let next = f64::from(k + 1);
        k0 += term * (harmonic - logarithm);
        k1 += term / next * (logarithm - harmonic - 0.5 / next);
        harmonic += 1.0 / next;
        term *= y / (next * next);
    }
    let scale = x.exp();
    (scale * k0, scale * (1.0 / x + 0.5 * x * k1))
}

fn bessel_by_integral(x: f64) -> (f64, f64) {
    /// exp(−4π/STEP) and exp(−(π/STEP)²), the errors of the trapezoidal rule, are below 1e-17.
    const STEP: f64 = 0.3;
    /// exp(−(POINTS · STEP)²) is below 1e-17.
    const POINTS: u32 = 21;
    let half_first = 0.5 / (2.0 * x).sqrt();
    let (mut k0, mut k1) = (half_first, half_first);
    for point in 1..POINTS {
        let v2 = (STEP * f64::from(point)).powi(2);
        let value = (-v2).exp() / (2.0 * x + v2).sqrt();
        k0 += value;
        k1 += value * (1.0 + v2 / x);
    }
    (2.0 * STEP * k0, 2.0 * STEP * k1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_agree_with_scipy() {
        for (freedom, expected) in [
            (2.0, 4.302_652_729_749_462),
            (2.3, 3.807_163_208_232_131),
            (3.0, 3.182_446_305_283_707_8),
            (5.0, 2.570_581_835_636_314_6),
            (9.0, 2.262_157_162_798_204_4),
            (20.0, 2.085_963_447_265_864),
            (100.0, 1.983_971_518_523_551_8),
            (1e9, 1.959_963_986_912_6),
        ] {
            let found = student_quantile(0.05, freedom);
            assert!((found / expected - 1.0).abs() < 5e-4, "{freedom}: {found}");
        }
    }

    /// Critical values of the NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.4.
    #[test]
    fn quantiles_of_chi_squared_match_published_tables() {
        for (degrees_of_freedom, expected) in [(30, 59.703), (100, 149.449)] {
            let found = chi_squared_quantile(degrees_of_freedom, 3.090_232_306_167_813);
            assert!((found / expected - 1.0).abs() < 3e-3, "{degrees_of_freedom}: {found}");
        }
    }

    #[test]
    fn quantiles_of_the_normal_distribution_agree_with_scipy() {
        for (probability, expected) in [
            (0.05, 1.959_963_984_540_054),
            (0.01, 2.575_829_303_548_901),
            (1e-12, 7.130_506_848_171),
        ] {
            let found = two_sided_normal_quantile(probability);
            assert!((found - expected).abs() < 1e-9, "{probability}: {found}");
        }
    }

    /// `scipy.special.k0e(x)` and `k1e(x)`, SciPy 1.17.1.
    const SCIPY: [(f64, f64, f64); 13] = [
        (1e-300, 690.8914594138721, 9.999999999999999e299),
        (1e-8, 18.536612444976903, 100000000.99999991),
        (0.1, 2.6823261022628944, 10.890182683049698),
        (0.999, 1.1449550968457312, 1.6372990143017032),
        (1.0, 1.1444630798068947, 1.636153486263258),
        (1.001, 1.1439717155411275, 1.6350100860707517),
        (1.5, 0.9582100532948961, 1.2431658735525528),
        (2.0, 0.8415682150707712, 1.0334768470686888),
        (3.5, 0.6490263376886884, 0.7364675480289125),
        (10.0, 0.39163193443659866, 0.4107665705957887),
        (100.0, 0.1251756216591266, 0.12579995047957854),
        (1e8, 0.00012533141357488577, 0.00012533141420154284),
        (1e300, 1.2533141373155004e-150, 1.2533141373155002e-150),
    ];

    #[test]
    fn values_match_scipy() {
        for (x, k0, k1) in SCIPY {
            let ours = scaled_k0_k1(x);
            assert!((ours.0 / k0 - 1.0).abs() < 3e-15, "{x}: {} {k0}", ours.0);
            assert!((ours.1 / k1 - 1.0).abs() < 3e-15, "{x}: {} {k1}", ours.1);
        }
    }

    #[test]
    fn series_and_integral_agree_at_the_boundary() {
        let (series, integral) = (bessel_by_series(2.0), bessel_by_integral(2.0));
        assert!((series.0 / integral.0 - 1.0).abs() < 5e-15);
        assert!((series.1 / integral.1 - 1.0).abs() < 5e-15);
    }

    #[test]
    fn no_argument_gives_nan_or_infinity() {
        for x in [0.0, 5e-324, f64::MIN_POSITIVE, f64::MAX, f64::INFINITY] {
            let (k0, k1) = scaled_k0_k1(x);
            assert!(
                k0 > 0.0 && k0.is_finite() && k1 > 0.0 && k1.is_finite(),
                "{x}: {k0} {k1}"
            );
        }
    }
}
