//! Figures of samples.

use ndarray::ArrayView1;

use super::student_quantile;

/// Median of values, which must not be empty.
pub(crate) fn median(values: Vec<f64>) -> f64 {
    quantile(&values, 0.5)
}

/// Returns the quantile of `values` at `level`: the kth smallest of n values has the level (k − ½)/n, and values in between
/// are interpolated linearly (Hazen 1914; definition 5 of Hyndman and Fan 1996, doi:10.2307/2684934).
pub(crate) fn quantile(values: &[f64], level: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    interpolated(&sorted, level * sorted.len() as f64 - 0.5)
}

/// Returns the value at this place among sorted values, counted from 0, linear between them and the nearest beyond them.
pub(crate) fn interpolated(sorted: &[f64], place: f64) -> f64 {
    let place = place.clamp(0.0, (sorted.len() - 1) as f64);
    let (below, share) = (place as usize, place.fract());
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + share * (sorted[above] - sorted[below])
}

/// Returns the mean as that of the deviations from the first value, so that a large offset does not hide small
/// differences; NaN without values.
pub(crate) fn mean(values: ArrayView1<'_, f64>) -> f64 {
    let first = values.first().copied().unwrap_or(f64::NAN);
    first
        + values
            .iter()
            .map(|value| (value - first) / values.len() as f64)
            .sum::<f64>()
}

/// Returns the root mean square of finite nonnegative values, without overflow.
pub(crate) fn root_mean_square(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let count = values.len().max(1) as f64;
    let largest = values.clone().fold(0.0, f64::max);
    let relative: f64 = values.map(|value| (value / largest).powi(2)).sum();
    if largest > 0.0 {
        largest * (relative / count).sqrt()
    } else {
        0.0
    }
}

/// Autocorrelation of a series at this lag; `None` if all values are equal.
pub(crate) fn autocorrelation(values: ArrayView1<'_, f64>, lag: usize) -> Option<f64> {
    let mean = mean(values);
    let variance: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let pairs = values.iter().zip(values.iter().skip(lag));
    let products: f64 = pairs.map(|(one, next)| (one - mean) * (next - mean)).sum();
    (variance > 0.0).then(|| products / variance)
}

/// Returns the number of consecutive values of `series` that carry as much information as one independent value, at least
/// 1: the largest ratio of the variance of means of 2, 4, 8, … values to that of independent values (Flyvbjerg and Petersen
/// 1989, doi:10.1063/1.457480).
pub(crate) fn correlation_time(mut series: Vec<f64>) -> f64 {
    /// Minimum number of means whose variance is known well enough.
    const MIN_MEANS: usize = 16;
    let count = series.len() as f64;
    let mean = series.iter().sum::<f64>() / count;
    series.iter_mut().for_each(|value| *value -= mean);
    let mean_square = |series: &[f64]| series.iter().map(|value| value * value).sum::<f64>() / series.len() as f64;
    let variance = mean_square(&series);
    let (mut time, mut length) = (1.0_f64, 1.0);
    while variance > 0.0 && series.len() >= 2 * MIN_MEANS {
        series = series.chunks_exact(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        length *= 2.0;
        time = time.max(length * mean_square(&series) / variance);
    }
    time
}

/// Standard error of the mean of a few values.
pub(crate) fn standard_error(values: &[f64]) -> f64 {
    let freedom = (values.len() as f64 - 1.0).max(1.0);
    (ArrayView1::from(values).var(0.0) / freedom).sqrt()
}

/// Returns `true` if the mean of the values is significantly above 0 (Student's t, one-sided, with this probability of an
/// error).
pub(crate) fn is_positive_mean(values: &[f64], error: f64) -> bool {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    mean > student_quantile(2.0 * error, values.len() as f64 - 1.0) * standard_error(values)
}

/// Returns `true` if the means of two sets of values differ significantly (Student's t, 95 %).
pub(crate) fn means_differ(sets: [Vec<f64>; 2]) -> bool {
    let [one, other] = sets.each_ref().map(|values| values.len() as f64);
    if one.min(other) < 2.0 {
        return false;
    }
    let freedom = one + other - 2.0;
    let views = sets.each_ref().map(ArrayView1::from);
    let squares = one * views[0].var(0.0) + other * views[1].var(0.0);
    let standard_error = (squares / freedom * (1.0 / one + 1.0 / other)).sqrt();
    let [one, other] = views.map(|values| values.mean().unwrap_or(0.0));
    (one - other).abs() > student_quantile(0.05, freedom) * standard_error
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R: acf(c(1, 2, 4, 3))$acf
    #[test]
    fn autocorrelations_agree_with_r() {
        for offset in [0.0, 1e9] {
            let series = [1.0, 2.0, 4.0, 3.0].map(|value| value + offset);
            for (lag, expected) in [(0, 1.0), (1, 0.15), (2, -0.5), (3, -0.15)] {
                let found = autocorrelation(ArrayView1::from(&series), lag);
                assert!((found.unwrap_or(f64::NAN) - expected).abs() < 1e-12, "{lag}: {found:?}");
            }
        }
        assert_eq!(autocorrelation(ArrayView1::from(&[2.0; 5]), 1), None);
    }

    #[test]
    fn medians_and_quantiles_of_few_values() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0]), 2.5);
        // R: quantile(c(1, 2, 4, 8), c(0, 0.25, 0.5, 0.9, 1), type = 5)
        for (level, expected) in [(0.0, 1.0), (0.25, 1.5), (0.5, 3.0), (0.9, 8.0), (1.0, 8.0)] {
            assert_eq!(quantile(&[8.0, 1.0, 4.0, 2.0], level), expected, "{level}");
        }
        assert_eq!(quantile(&[7.0], 0.3), 7.0);
    }
}
