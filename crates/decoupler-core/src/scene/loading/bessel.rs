/// Returns `exp(x) K₀(x)` and `exp(x) K₁(x)`, the modified Bessel functions of the second kind scaled so that large `x`
/// does not underflow, to about 1e-15. `x` is above 0 and is clamped to the range of normal numbers.
///
/// Up to x = 2 by their power series (NIST Digital Library of Mathematical Functions, 10.31.1 and 10.31.2). Beyond, by
/// `K_ν(x) = ∫ exp(−x cosh t) cosh νt dt` over t > 0 (10.32.9), which v² = x (cosh t − 1) turns into
///
/// `exp(x) K₀(x) = ∫ 2 exp(−v²) / √(2x + v²) dv`, and the same with a factor 1 + v²/x for K₁:
///
/// even functions that decay as a Gaussian, for which the trapezoidal rule converges exponentially.
pub(super) fn scaled_k0_k1(x: f64) -> (f64, f64) {
    // A quarter of the largest number leaves room for 2x + v².
    let x = x.clamp(f64::MIN_POSITIVE, 0.25 * f64::MAX);
    if x <= LARGEST_OF_SERIES {
        by_series(x)
    } else {
        by_integral(x)
    }
}

/// Argument at which the method changes from the series, which suffers from cancellation above, to the integral, whose
/// integrand is analytic only up to √(2x) from the real axis.
const LARGEST_OF_SERIES: f64 = 2.0;

/// With y = x²/4, H_k the harmonic numbers and L = ln(x/2) + γ:
/// K₀ = Σ (H_k − L) y^k/(k!)² and K₁ = 1/x + x Σ (L − (H_k + H_{k+1})/2) y^k/(2 k! (k+1)!).
fn by_series(x: f64) -> (f64, f64) {
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

fn by_integral(x: f64) -> (f64, f64) {
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
        let (series, integral) = (by_series(2.0), by_integral(2.0));
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
