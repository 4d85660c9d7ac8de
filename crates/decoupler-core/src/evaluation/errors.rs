use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::dataset::Dataset;

/// Errors of decoupled coordinates on the nodes of a test set.
///
/// The paper's errors (AveZerr, AveXerr and AveYerr) are the mean over samples and nodes of |decoupled − true| / |true|
/// in percent of the **coordinate**. That denominator is optimistic, because a node is never lower than 80 % of the height,
/// so the error is also given in millimetres and in percent of full scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// AveZerr, in percent of the coordinate. `None` if a true z is 0, where it is undefined; likewise below.
    pub z_percent: Option<f64>,
    /// AveXerr, in percent of the coordinate.
    pub x_percent: Option<f64>,
    /// AveYerr, in percent of the coordinate.
    pub y_percent: Option<f64>,
    /// Mean |decoupled z − z|, in millimetres.
    pub z_mm: f64,
    /// [`Self::z_mm`] in percent of the stroke, the distance a node can travel.
    pub z_full_scale_percent: f64,
    /// Largest |decoupled z − z|, in millimetres; NaN if an answer is NaN.
    pub worst_mm: f64,
    /// Node with the largest error.
    pub worst_node: NodeAddress,
}

/// A node of one snapshot; all indices are from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeAddress {
    /// Group of its sample; in a simulated set, the index of the snapshot.
    pub snapshot: usize,
    /// Row-wire of the array.
    pub row: usize,
    /// Node on the row-wire.
    pub node: usize,
}

impl Errors {
    /// Measures `decoupled_mm` (samples × 3·M2) against the coordinates of `truth`, whose nodes can travel `stroke_mm`.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn measure(truth: &Dataset, decoupled_mm: &Array2<f64>, stroke_mm: f64) -> Self {
        assert_eq!(truth.targets().dim(), decoupled_mm.dim());
        let mut relative = [0.0; 3];
        let mut total_z_mm = 0.0;
        let mut worst_mm = 0.0_f64;
        let mut worst_node = NodeAddress::default();
        let pairs = decoupled_mm.indexed_iter().zip(truth.targets());
        for (((sample, channel), decoupled), true_value) in pairs {
            let error_mm = (decoupled - true_value).abs();
            let (node, axis) = (channel / 3, channel % 3);
            relative[axis] += error_mm / true_value.abs();
            if axis == 2 {
                total_z_mm += error_mm;
                if error_mm > worst_mm || (error_mm.is_nan() && !worst_mm.is_nan()) {
                    worst_mm = error_mm;
                    worst_node = NodeAddress {
                        snapshot: truth.groups()[sample],
                        row: truth.row_wire(sample).unwrap_or(0),
                        node,
                    };
                }
            }
        }
        let per_axis = (decoupled_mm.len() / 3) as f64;
        let percent = |sum: f64| Some(100.0 * sum / per_axis).filter(|percent| percent.is_finite());
        let z_mm = total_z_mm / per_axis;
        Self {
            z_percent: percent(relative[2]),
            x_percent: percent(relative[0]),
            y_percent: percent(relative[1]),
            z_mm,
            z_full_scale_percent: 100.0 * z_mm / stroke_mm,
            worst_mm,
            worst_node,
        }
    }

    /// Returns the mean |decoupled z − z| in proportion to that of the Bayesian `reference`; `None` where that is nothing
    /// but [rounding](Self::is_rounding).
    pub fn times(&self, reference: &Self) -> Option<f64> {
        (!reference.is_rounding()).then(|| self.z_mm / reference.z_mm)
    }

    /// Returns `true` if errors of z are at most 1e-9 of the stroke, a hundredth of an atom for a stroke of a millimetre: a
    /// Bayesian reference that small says that the readings determine the deformation to their rounding, and other errors
    /// in proportion to it say nothing.
    pub fn is_rounding(&self) -> bool {
        self.z_full_scale_percent <= 1e-7
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Scene,
        sensor::SensorModel,
    };

    fn truth(model: &SensorModel) -> Dataset {
        Dataset::simulate(model, &Scene::default(), 20, &mut Seed(0).rng(Stream::Test)).unwrap()
    }

    #[test]
    fn one_wrong_node_counts_as_the_definitions_say() {
        let truth = truth(&SensorModel::new("10x6_3x18".parse().unwrap()));
        let mut decoupled = truth.targets().to_owned();
        decoupled[[13, 2 * 3 + 2]] += 0.3;
        decoupled[[4, 0]] -= 0.6;
        let errors = Errors::measure(&truth, &decoupled, 1.0);
        let nodes = 20.0 * 6.0;
        let z = truth.targets()[[13, 8]];
        assert!((errors.z_percent.unwrap() - 100.0 * 0.3 / z / nodes).abs() < 1e-12);
        assert!((errors.x_percent.unwrap() - 100.0 * 0.6 / 12.0 / nodes).abs() < 1e-12);
        assert_eq!(errors.y_percent, Some(0.0));
        assert!((errors.z_mm - 0.3 / nodes).abs() < 1e-12);
        assert!((errors.z_full_scale_percent - 100.0 * errors.z_mm).abs() < 1e-12);
        assert!((errors.worst_mm - 0.3).abs() < 1e-12);
        assert_eq!(
            errors.worst_node,
            NodeAddress {
                snapshot: 1,
                row: 3,
                node: 2
            }
        );
    }

    #[test]
    fn an_answer_of_nan_is_the_worst() {
        let truth = truth(&SensorModel::new("10x6_3x18".parse().unwrap()));
        let mut decoupled = truth.targets().mapv(|value| value + 0.1);
        decoupled[[13, 8]] = f64::NAN;
        decoupled[[15, 2]] += 1.0;
        let errors = Errors::measure(&truth, &decoupled, 1.0);
        assert!(errors.worst_mm.is_nan() && errors.z_mm.is_nan());
        assert_eq!((errors.worst_node.snapshot, errors.worst_node.row), (1, 3));
    }

    #[test]
    fn nothing_is_measured_in_units_of_rounding() {
        let truth = truth(&SensorModel::new("10x6_3x18".parse().unwrap()));
        let off = |by_mm: f64| Errors::measure(&truth, &truth.targets().mapv(|value| value + by_mm), 1.0);
        for rounding_mm in [0.0, 1e-13, 1e-10] {
            assert_eq!(off(0.1).times(&off(rounding_mm)), None, "{rounding_mm}");
        }
        let times = off(0.1).times(&off(1e-4)).unwrap();
        assert!((times - 1000.0).abs() < 1e-6, "{times}");
    }

    #[test]
    fn a_coordinate_of_zero_leaves_no_percentage() {
        let mut model = SensorModel::new("10x6_3x18".parse().unwrap());
        model.geometry.row_x0_mm = 0.0;
        let truth = truth(&model);
        let errors = Errors::measure(&truth, &truth.targets().mapv(|value| value + 0.1), 1.0);
        assert_eq!(errors.x_percent, None);
        assert!(errors.z_percent.is_some());
    }
}
