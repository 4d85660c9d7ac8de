use ndarray::{Array2, ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

use super::table::{ErrorMeasure, Figures};
pub(crate) use crate::numerics::mean;
use crate::{dataset::Dataset, numerics::interpolated, problem::Problem};

/// Errors of decoupled coordinates of the nodes in a test set.
///
/// The paper's errors (AveZerr, AveXerr and AveYerr) are the mean over samples and nodes of |decoupled − true| / |true|
/// in percent of the **coordinate**. That denominator is optimistic, because a node is never lower than 80 % of the
/// height, so the error is also given in millimetres and in percent of full scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// AveZerr, in percent of the coordinate. `None` if a true z is 0, where it is undefined; the same holds for x and
    /// y.
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

    /// Returns the ratio of the mean |decoupled z − z| to that of `other` answers; `None` if that is
    /// only [rounding](Self::is_rounding).
    pub fn times(&self, other: &Self) -> Option<f64> {
        (!other.is_rounding()).then(|| self.z_mm / other.z_mm)
    }

    /// Returns `true` if errors of z are at most 1e-9 of the stroke, a hundredth of an atom for a stroke of a
    /// millimetre. A model-based error that small means that the readings determine the deformation up to rounding;
    /// ratios to it are meaningless.
    pub fn is_rounding(&self) -> bool {
        self.z_full_scale_percent <= 1e-7
    }
}

/// Errors of answers to a test set: on the nodes of an array, or target by target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TestErrors {
    /// Errors on the nodes of an array.
    Nodes(Errors),
    /// Errors of each target.
    Targets(Vec<TargetErrors>),
}

impl TestErrors {
    /// Measures the errors of `answers` (samples × targets, in the units of the targets) on `test`, which `problem`
    /// describes.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn measure(problem: &Problem, test: &Dataset, answers: &Array2<f64>) -> Self {
        match problem.stroke_mm() {
            Some(stroke_mm) => Self::Nodes(Errors::measure(test, answers, stroke_mm)),
            None => Self::of_targets(test, answers.view()),
        }
    }

    /// Measures the errors of `answers` (samples × targets) on `test`, target by target.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn of_targets(test: &Dataset, answers: ArrayView2<'_, f64>) -> Self {
        Self::Targets(TargetErrors::measure(test.targets(), answers))
    }

    /// Returns the errors on the nodes, if the targets are nodes of an array.
    pub fn nodes(&self) -> Option<&Errors> {
        match self {
            Self::Nodes(errors) => Some(errors),
            Self::Targets(_) => None,
        }
    }

    /// Returns the errors of each target; empty if the targets are nodes of an array.
    pub fn targets(&self) -> &[TargetErrors] {
        match self {
            Self::Nodes(_) => &[],
            Self::Targets(targets) => targets,
        }
    }

    /// Returns the error in percent by which decoders are ranked: AveZerr for nodes, otherwise the mean absolute error
    /// in percent of the range, averaged over the targets that vary. `None` if an error is not finite or no target
    /// varies.
    pub fn percent(&self) -> Option<f64> {
        match self {
            Self::Nodes(errors) => errors.z_percent,
            Self::Targets(targets) => {
                if targets.iter().any(|target| !target.mae.is_finite()) {
                    return None;
                }
                let percents = Vec::from_iter(targets.iter().filter_map(|target| target.percent_of_range));
                (!percents.is_empty()).then(|| percents.iter().sum::<f64>() / percents.len() as f64)
            }
        }
    }

    /// Returns this measure of the errors; over all targets of a recording, with the [error in percent](Self::percent).
    pub fn figure(&self, measure: ErrorMeasure) -> Option<f64> {
        match self {
            Self::Nodes(errors) => measure.of(Figures::Nodes(errors)),
            Self::Targets(_) if measure == ErrorMeasure::RangePercent => self.percent(),
            Self::Targets(targets) => measure.of_target(&TargetErrors::over_all(targets)?),
        }
    }

    /// Returns the name of the first figure that is not a finite number.
    pub fn infinite_figure(&self) -> Option<String> {
        let first = |measures: &[ErrorMeasure], figures: Figures<'_>| {
            let is_infinite = |measure: &&ErrorMeasure| measure.of(figures).is_some_and(|figure| !figure.is_finite());
            measures.iter().find(is_infinite).map(|measure| measure.field())
        };
        match self {
            Self::Nodes(errors) => first(ErrorMeasure::OF_NODES, Figures::Nodes(errors)).map(str::to_owned),
            Self::Targets(targets) => targets.iter().enumerate().find_map(|(index, errors)| {
                let name = first(ErrorMeasure::OF_TARGETS, Figures::Target(errors))?;
                Some(format!("{index}.{name}"))
            }),
        }
    }
}

/// Errors of answers for one target, in the unit of the target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetErrors {
    /// Root mean squared error.
    pub rmse: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Coefficient of determination R²: 1 for exact answers, 0 for always answering the mean of these targets, negative
    /// for worse answers. `None` if the target is constant, where R² is undefined.
    pub r2: Option<f64>,
    /// Largest absolute error; NaN if an answer is NaN.
    pub worst: f64,
    /// Index of the sample with the largest error.
    pub worst_sample: usize,
    /// [`Self::mae`] in percent of the range of the target. `None` if the target is constant.
    pub percent_of_range: Option<f64>,
}

impl TargetErrors {
    /// Measures `answers` against `targets` (both samples × outputs), target by target.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn measure(targets: ArrayView2<'_, f64>, answers: ArrayView2<'_, f64>) -> Vec<Self> {
        assert_eq!(targets.dim(), answers.dim());
        let pairs = targets.columns().into_iter().zip(answers.columns());
        pairs.map(|(targets, answers)| Self::of_one(targets, answers)).collect()
    }

    /// Returns the errors over all targets, which must share a unit: the root of the mean squared error, the mean
    /// absolute error, the mean R² (uniform average), the largest error and the mean of the errors in percent of the
    /// range. R² and percent are averages over the targets that vary. `None` without targets.
    pub fn over_all(targets: &[Self]) -> Option<Self> {
        let worst = targets.iter().max_by(|one, other| one.worst.total_cmp(&other.worst))?;
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
            (count > 0).then(|| sum / f64::from(count))
        };
        Some(Self {
            rmse: mean(&mut targets.iter().map(|errors| errors.rmse * errors.rmse))?.sqrt(),
            mae: mean(&mut targets.iter().map(|errors| errors.mae))?,
            r2: mean(&mut targets.iter().filter_map(|errors| errors.r2)),
            worst: worst.worst,
            worst_sample: worst.worst_sample,
            percent_of_range: mean(&mut targets.iter().filter_map(|errors| errors.percent_of_range)),
        })
    }

    fn of_one(targets: ArrayView1<'_, f64>, answers: ArrayView1<'_, f64>) -> Self {
        let count = targets.len() as f64;
        let mean = mean(targets);
        let (lowest, highest) = extremes(targets);
        let (mut squares, mut sum, mut worst, mut worst_sample, mut variation) = (0.0, 0.0, 0.0_f64, 0, 0.0);
        for (sample, (target, answer)) in targets.iter().zip(answers).enumerate() {
            let error = (answer - target).abs();
            squares += error * error;
            sum += error;
            if error > worst || (error.is_nan() && !worst.is_nan()) {
                (worst, worst_sample) = (error, sample);
            }
            variation += (target - mean) * (target - mean);
        }
        let varies = varies(targets);
        Self {
            rmse: (squares / count).sqrt(),
            mae: sum / count,
            r2: Some(1.0 - squares / variation).filter(|r2| varies && r2.is_finite()),
            worst,
            worst_sample,
            percent_of_range: Some(100.0 * sum / count / (highest - lowest))
                .filter(|percent| varies && percent.is_finite()),
        }
    }
}

/// Returns the smallest and the largest value.
pub(crate) fn extremes(values: ArrayView1<'_, f64>) -> (f64, f64) {
    let none = (f64::INFINITY, f64::NEG_INFINITY);
    let widen = |(low, high): (f64, f64), &value: &f64| (low.min(value), high.max(value));
    values.iter().fold(none, widen)
}

/// Returns `true` if the values differ by more than rounding.
pub(crate) fn varies(values: ArrayView1<'_, f64>) -> bool {
    let (low, high) = extremes(values);
    high - low > 4.0 * f64::EPSILON * high.abs().max(low.abs())
}

/// Minimum, median and maximum of a set of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Minimum of the numbers.
    pub smallest: f64,
    /// Value below which half of the numbers lie.
    pub median: f64,
    /// Maximum of the numbers.
    pub largest: f64,
}

impl Spread {
    /// Summarises the finite numbers among `values`; returns `None` if there are none. The median is interpolated
    /// linearly (Hyndman and Fan 1996, definition 7).
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        Some(Self {
            smallest: sorted[0],
            median: interpolated(&sorted, 0.5 * last as f64),
            largest: sorted[last],
        })
    }
}

/// Returns the root mean square of decoupled z − z for each node over the snapshots of `truth`, in millimetres, row by
/// row (M1·M2 values). `decoupled_mm` has the shape of the targets of `truth`.
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
    use ndarray::array;

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
    fn errors_of_one_wrong_node_follow_the_definitions() {
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
    fn a_nan_answer_has_the_largest_error() {
        let truth = truth(&SensorModel::new("10x6_3x18".parse().unwrap()));
        let mut decoupled = truth.targets().mapv(|value| value + 0.1);
        decoupled[[13, 8]] = f64::NAN;
        decoupled[[15, 2]] += 1.0;
        let errors = Errors::measure(&truth, &decoupled, 1.0);
        assert!(errors.worst_mm.is_nan() && errors.z_mm.is_nan());
        assert_eq!((errors.worst_node.snapshot, errors.worst_node.row), (1, 3));
    }

    #[test]
    fn there_is_no_ratio_to_a_reference_of_rounding() {
        let truth = truth(&SensorModel::new("10x6_3x18".parse().unwrap()));
        let off = |by_mm: f64| Errors::measure(&truth, &truth.targets().mapv(|value| value + by_mm), 1.0);
        for rounding_mm in [0.0, 1e-13, 1e-10] {
            assert_eq!(off(0.1).times(&off(rounding_mm)), None, "{rounding_mm}");
        }
        let times = off(0.1).times(&off(1e-4)).unwrap();
        assert!((times - 1000.0).abs() < 1e-6, "{times}");
    }

    #[test]
    fn a_coordinate_of_zero_has_no_percentage() {
        let mut model = SensorModel::new("10x6_3x18".parse().unwrap());
        model.geometry.row_x0_mm = 0.0;
        let truth = truth(&model);
        let errors = Errors::measure(&truth, &truth.targets().mapv(|value| value + 0.1), 1.0);
        assert_eq!(errors.x_percent, None);
        assert!(errors.z_percent.is_some());
    }

    #[test]
    fn errors_agree_with_scikit_learn() {
        // sklearn.metrics: mean_squared_error, mean_absolute_error, r2_score, max_error of these columns.
        let targets = array![[3.0, 1.0], [-0.5, 1.0], [2.0, 1.0], [7.0, 1.0]];
        let answers = array![[2.5, 1.5], [0.0, 1.0], [2.0, 1.0], [8.0, 0.0]];
        let [varying, constant] = TargetErrors::measure(targets.view(), answers.view())[..] else {
            panic!("there must be one entry for each target")
        };
        assert!((varying.rmse - 0.375_f64.sqrt()).abs() < 1e-15);
        assert!((varying.mae - 0.5).abs() < 1e-15);
        assert!((varying.r2.unwrap() - 0.948_608_137_044_967_8).abs() < 1e-15);
        assert_eq!((varying.worst, varying.worst_sample), (1.0, 3));
        assert!((varying.percent_of_range.unwrap() - 100.0 * 0.5 / 7.5).abs() < 1e-13);
        assert_eq!(
            (constant.r2, constant.percent_of_range, constant.mae),
            (None, None, 0.375)
        );
    }

    #[test]
    fn a_nan_answer_to_a_target_has_the_largest_error() {
        let targets = array![[1.0], [2.0], [6.0]];
        let answers = array![[0.0], [f64::NAN], [9.0]];
        let errors = TargetErrors::measure(targets.view(), answers.view())[0];
        assert!(errors.worst.is_nan() && errors.rmse.is_nan());
        assert_eq!((errors.worst_sample, errors.r2), (1, None));
    }

    #[test]
    fn the_mean_scores_an_r2_of_zero() {
        let targets = array![[1.0], [2.0], [6.0]];
        let answers = array![[3.0], [3.0], [3.0]];
        assert_eq!(TargetErrors::measure(targets.view(), answers.view())[0].r2, Some(0.0));
    }

    #[test]
    fn figures_are_finite_or_missing_for_targets_of_any_size() {
        for size in [0.0, 1e-300, 1e-160, 1e160, 1e308] {
            let targets = array![[size], [-size], [0.0]];
            for answer in [0.0, size] {
                let answers = array![[answer], [answer], [answer]];
                let errors = &TargetErrors::measure(targets.view(), answers.view())[0];
                let figures = [errors.r2, errors.percent_of_range];
                assert!(figures.into_iter().flatten().all(f64::is_finite), "{errors:?}");
            }
        }
    }

    #[test]
    fn the_median_follows_definition_7() {
        // R: quantile(c(1, 2, 4, 8, 16, 32), type = 7)
        let spread = Spread::of([32.0, 1.0, f64::NAN, 4.0, 16.0, 8.0, 2.0]).unwrap();
        let expected = Spread {
            smallest: 1.0,
            median: 6.0,
            largest: 32.0,
        };
        assert_eq!(spread, expected);
    }

    #[test]
    fn a_single_value_is_its_own_spread_and_no_values_have_none() {
        let spread = Spread::of([3.0]).unwrap();
        assert_eq!((spread.smallest, spread.median, spread.largest), (3.0, 3.0, 3.0));
        assert_eq!(Spread::of([f64::INFINITY]), None);
    }

    #[test]
    fn the_rms_of_each_node_is_over_its_own_errors() {
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
