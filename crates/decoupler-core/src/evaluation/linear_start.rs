use faer::Mat;
use ndarray::{Array2, ArrayView2};

use crate::{dataset::Folds, decoupling::ridge, network::Mlp};

/// Weights of hidden nodes in the linear range of tanh that make a network answer like ridge regression.
///
/// With the singular value decomposition U S Vᵀ of the gains of the map, node k is u_k·(x − x̄), scaled to a standard
/// deviation of [`DEVIATION`], and its output weights are s_k v_k over that scale. All other hidden nodes keep their
/// random weights, and begin with output weights of zero. Training then starts from the regression and adds what it
/// lacks, so that early stopping returns to it where there is nothing to add.
#[derive(Clone, Debug)]
pub(super) struct LinearStart {
    /// Inputs + 1 × nodes.
    hidden: Array2<f64>,
    /// Nodes × outputs.
    output: Array2<f64>,
    /// Answer to the mean input.
    constant: Vec<f64>,
}

/// Standard deviation of the net input of a linear node: tanh deviates from its argument by 1 % at most there.
const DEVIATION: f64 = 0.15;

/// Number of blocks of consecutive samples that select the penalties.
const BLOCKS: usize = 4;

impl LinearStart {
    /// Fits the regression of scaled `targets` (samples × outputs) on scaled `inputs` (samples × inputs) with up to `nodes`
    /// nodes; `None` if there are too few samples or no solution.
    pub(super) fn fit(inputs: ArrayView2<'_, f64>, targets: ArrayView2<'_, f64>, nodes: usize) -> Option<Self> {
        let samples = inputs.nrows();
        if samples < 2 * BLOCKS || inputs.ncols() == 0 {
            return None;
        }
        let map = ridge(inputs, targets, &Folds::consecutive(samples, BLOCKS)).ok()?.map;
        let (n, m) = (inputs.ncols(), targets.ncols());
        let mean: Vec<f64> = inputs
            .columns()
            .into_iter()
            .map(|column| column.sum() / samples as f64)
            .collect();
        let gains = Mat::from_fn(n, m, |i, t| map[[i, t]]);
        let svd = gains.thin_svd().ok()?;
        let rank = n.min(m).min(nodes);
        let (mut hidden, mut output) = (Array2::zeros((n + 1, rank)), Array2::zeros((rank, m)));
        for node in 0..rank {
            let direction = svd.U().col(node);
            let project = |row: ndarray::ArrayView1<'_, f64>| {
                let products = row.iter().zip(&mean).zip(direction.iter());
                products.map(|((value, mean), u)| (value - mean) * u).sum::<f64>()
            };
            let square: f64 = inputs.rows().into_iter().map(|row| project(row).powi(2)).sum();
            let deviation = (square / samples as f64).sqrt();
            if deviation.is_nan() || deviation <= 1e-12 {
                continue;
            }
            let scale = DEVIATION / deviation;
            for (i, u) in direction.iter().enumerate() {
                hidden[[i, node]] = scale * u;
                hidden[[n, node]] -= scale * u * mean[i];
            }
            let singular = svd.S().column_vector()[node];
            for t in 0..m {
                output[[node, t]] = singular * svd.V()[(t, node)] / scale;
            }
        }
        let constant =
            |t: usize| map[[n, t]] + mean.iter().enumerate().map(|(i, mean)| mean * map[[i, t]]).sum::<f64>();
        Some(Self {
            hidden,
            output,
            constant: (0..m).map(constant).collect(),
        })
    }

    /// Number of linear nodes in a network with this many hidden nodes; one stays random if there are several.
    pub(super) fn nodes(hidden: usize) -> usize {
        hidden.saturating_sub(1).max(1)
    }

    /// Replaces the first hidden nodes and all output weights of `mlp`, which has random weights.
    pub(super) fn apply(&self, mlp: &mut Mlp) {
        let shape = mlp.shape();
        let (w, v) = mlp.weights_mut().split_at_mut(shape.hidden_weights());
        for ((i, node), weight) in self.hidden.indexed_iter() {
            w[i * shape.hidden + node] = *weight;
        }
        v.fill(0.0);
        for ((node, t), weight) in self.output.indexed_iter() {
            v[node * shape.outputs + t] = *weight;
        }
        v[shape.hidden * shape.outputs..].copy_from_slice(&self.constant);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        network::{Shape, nguyen_widrow},
    };

    #[test]
    fn the_network_answers_like_the_regression() {
        let inputs = Array2::from_shape_fn((100, 4), |(s, i)| ((3 * s + 17 * i * s + i) as f64).sin());
        let targets = Array2::from_shape_fn((100, 3), |(s, t)| {
            0.5 * inputs[[s, t]] - 0.2 * inputs[[s, 3]] + 0.1 * t as f64
        });
        let shape = Shape {
            inputs: 4,
            hidden: 6,
            outputs: 3,
        };
        let mut mlp = nguyen_widrow(shape, &mut Seed(1).rng(Stream::Start));
        let start = LinearStart::fit(inputs.view(), targets.view(), LinearStart::nodes(6)).unwrap();
        start.apply(&mut mlp);
        let worst = (&mlp.forward(inputs.view()) - &targets)
            .iter()
            .fold(0.0_f64, |worst, error| worst.max(error.abs()));
        assert!(worst < 0.02, "{worst}");
    }
}
