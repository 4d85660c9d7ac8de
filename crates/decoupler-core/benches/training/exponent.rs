//! Power laws.

/// Returns the exponent of the power law through some points, by least squares on logarithms.
pub(crate) fn exponent(x: &[usize], y: &[f64]) -> f64 {
    let logarithms = || x.iter().zip(y).map(|(&x, y)| ((x as f64).ln(), y.ln()));
    let count = x.len() as f64;
    let (sum_x, sum_y) = logarithms().fold((0.0, 0.0), |(sum_x, sum_y), (x, y)| (sum_x + x, sum_y + y));
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let (above, below) = logarithms().fold((0.0, 0.0), |(above, below), (x, y)| {
        (above + (x - mean_x) * (y - mean_y), below + (x - mean_x).powi(2))
    });
    above / below
}
