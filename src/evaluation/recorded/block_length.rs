/// Length of blocks for a block bootstrap of the mean of `series`, from its autocorrelation: 1 for independent values.
///
/// The rule of Politis and White (2004, corrected by Patton, Politis and White 2009, doi:10.1080/07474930802459016), for
/// blocks in a circle: b = (2 ĝ² / D̂)^⅓ n^⅓ with ĝ = Σ λ(k/M) |k| R(k), D̂ = 4/3 (Σ λ(k/M) R(k))², autocovariances R, the
/// flat-top window λ(t) = min(1, 2 (1 − |t|)), and M twice the lag from which on correlations stay insignificant.
pub(super) fn block_length(series: &[f64]) -> usize {
    let n = series.len();
    if n < 8 {
        return 1;
    }
    let count = n as f64;
    let mean = series.iter().sum::<f64>() / count;
    let covariance = |lag: usize| {
        let pairs = series[lag..].iter().zip(series);
        pairs
            .map(|(later, earlier)| (later - mean) * (earlier - mean))
            .sum::<f64>()
            / count
    };
    let variance = covariance(0);
    if !(variance > 0.0 && variance.is_finite()) {
        return 1;
    }
    let longest = (3.0 * count.sqrt()).min(count / 3.0).ceil() as usize;
    let run = (count.log10().sqrt().ceil() as usize).max(5);
    let significant = 2.0 * (count.log10() / count).sqrt() * variance;
    let most_lags = (count.sqrt().ceil() as usize + run).min(n - 1);
    let (mut last_significant, mut covariances) = (0, vec![variance]);
    for lag in 1..=most_lags {
        covariances.push(covariance(lag));
        if covariances[lag].abs() > significant {
            last_significant = lag;
        } else if lag - last_significant >= run {
            break;
        }
    }
    if last_significant == 0 {
        return 1;
    }
    let width = (2 * last_significant).min(most_lags);
    while covariances.len() <= width {
        covariances.push(covariance(covariances.len()));
    }
    let (mut spread, mut total) = (0.0, variance);
    for (lag, value) in covariances.iter().enumerate().take(width + 1).skip(1) {
        let window = (2.0 * (1.0 - lag as f64 / width as f64)).min(1.0);
        spread += 2.0 * window * lag as f64 * value;
        total += 2.0 * window * value;
    }
    let length = (1.5 * (spread / total).powi(2)).cbrt() * count.cbrt();
    if length.is_finite() {
        (length.round() as usize).clamp(1, longest)
    } else {
        longest
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::normal::standard_normal;

    fn autoregressive(memory: f64, n: usize) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut value = 0.0;
        let mut next = || {
            value = memory * value + standard_normal(&mut rng);
            value
        };
        (0..n).map(|_| next()).collect()
    }

    /// For an autoregressive series of order 1, ĝ²/D̂ has the closed form (2ρ/(1−ρ²))²·3/4 …: b = (1.5 (2ρ/(1−ρ²))²)^⅓ n^⅓.
    #[test]
    fn blocks_are_as_long_as_theory_says_for_an_autoregressive_series() {
        for memory in [0.5, 0.8, 0.9_f64] {
            let n = 20_000;
            let expected = (1.5 * (2.0 * memory / (1.0 - memory * memory)).powi(2)).cbrt() * (n as f64).cbrt();
            let found = block_length(&autoregressive(memory, n)) as f64;
            assert!(
                (0.6..1.6).contains(&(found / expected)),
                "{memory}: {found}, {expected}"
            );
        }
        assert!(block_length(&autoregressive(0.0, 20_000)) <= 3);
    }

    #[test]
    fn short_or_constant_series_have_blocks_of_one() {
        for series in [vec![], vec![1.0], vec![2.0; 100], vec![f64::NAN; 50]] {
            assert_eq!(block_length(&series), 1);
        }
    }
}
