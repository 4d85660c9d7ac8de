use ndarray::Array2;

use crate::dataset::Dataset;

/// The most nodes looked at in a chart; of a larger test set, evenly spaced ones.
const MOST_PAIRS: usize = 20_000;

/// Actual and decoupled z of the nodes of a test set, in millimetres.
pub fn z_pairs_mm(test: &Dataset, decoupled_mm: &Array2<f64>) -> Vec<(f64, f64)> {
    let actual = test.targets();
    let every_z = actual.iter().zip(decoupled_mm).skip(2).step_by(3);
    let stride = (actual.len() / 3).div_ceil(MOST_PAIRS).max(1);
    every_z
        .step_by(stride)
        .map(|(actual, decoupled)| (*actual, *decoupled))
        .collect()
}
