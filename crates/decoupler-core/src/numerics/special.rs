//! Quantiles of distributions.

/// Returns the 97.5 % quantile of Student's t with this many degrees of freedom, at least 2 and not necessarily an
/// integer (Hill 1970, algorithm 396, doi:10.1145/355598.355600), within 3e-4 of the exact value.
pub(crate) fn student_quantile(freedom: f64) -> f64 {
    /// Probability of both tails.
    const TAILS: f64 = 0.05;
    const NORMAL_QUANTILE: f64 = -1.959_963_984_540_054;
    let a = 1.0 / (freedom - 0.5);
    let b = 48.0 / (a * a);
    let mut c = ((20_700.0 * a / b - 98.0) * a - 16.0) * a + 96.36;
    let d = ((94.5 / (b + c) - 3.0) / b + 1.0) * (0.5 * a * std::f64::consts::PI).sqrt() * freedom;
    let mut y = (d * TAILS).powf(2.0 / freedom);
    if y > 0.05 + a {
        let x = NORMAL_QUANTILE;
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
            let found = student_quantile(freedom);
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
}
