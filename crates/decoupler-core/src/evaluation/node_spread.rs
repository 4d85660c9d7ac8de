use ndarray::Array2;

use crate::dataset::Dataset;

/// Root mean square of decoupled z − z for each node over the snapshots of `truth`, in millimetres, row by row (M1·M2
/// values). `decoupled_mm` has the shape of its coordinates.
///
/// # Panics
/// If the shapes differ.
pub fn node_rms_mm(truth: &Dataset, decoupled_mm: &Array2<f64>) -> Vec<f64> {
    assert_eq!(truth.targets().dim(), decoupled_mm.dim());
    let (rows, per_row) = (truth.row_count(), decoupled_mm.ncols() / 3);
    let mut squares = vec![0.0; rows * per_row];
    for (sample, (decoupled, actual)) in decoupled_mm.rows().into_iter().zip(truth.targets().rows()).enumerate() {
        for node in 0..per_row {
            squares[truth.row_index(sample) * per_row + node] +=
                (decoupled[3 * node + 2] - actual[3 * node + 2]).powi(2);
        }
    }
    let snapshots = (truth.samples() / rows).max(1) as f64;
    squares.into_iter().map(|sum: f64| (sum / snapshots).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Scene,
        sensor::SensorModel,
    };

    #[test]
    fn each_node_has_the_spread_of_its_own_errors() {
        let model = SensorModel::new("4x3_2x9".parse().unwrap());
        let truth = Dataset::simulate(&model, &Scene::default(), 8, &mut Seed(0).rng(Stream::Test)).unwrap();
        let mut decoupled = truth.targets().to_owned();
        // Row 2, node 1: off by 0.3 and −0.4 mm in the two snapshots; row 0, node 2: off on x, which does not count.
        decoupled[[2, 5]] += 0.3;
        decoupled[[6, 5]] -= 0.4;
        decoupled[[0, 6]] += 1.0;
        let spread = node_rms_mm(&truth, &decoupled);
        assert_eq!(spread.len(), 12);
        assert!((spread[2 * 3 + 1] - 0.125_f64.sqrt()).abs() < 1e-12);
        assert_eq!(spread.iter().filter(|spread| **spread > 0.0).count(), 1);
    }
}
