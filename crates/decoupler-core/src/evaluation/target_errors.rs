use ndarray::{ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

/// Errors of answers for one target, in the unit of the target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetErrors {
    /// Root mean squared error.
    pub rmse: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Coefficient of determination R²: 1 for exact answers, 0 for always answering the mean of these very targets,
    /// negative for worse. `None` if the target is constant, where it is undefined.
    pub r2: Option<f64>,
    /// Largest absolute error; NaN if an answer is NaN.
    pub worst: f64,
    /// Index of the sample with the largest error, among those measured.
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

    /// Returns the errors over targets in one unit: the root of the mean squared error, the mean absolute error, the mean R²
    /// (uniform average), the largest error and the mean of the errors in percent of the range. R² and percent are over the
    /// targets that vary. `None` without targets.
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
        let mean = targets.sum() / count;
        let (lowest, highest) = targets
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| {
                (low.min(value), high.max(value))
            });
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
        let varies = highest > lowest;
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

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn errors_are_those_of_scikit_learn() {
        // sklearn.metrics: mean_squared_error, mean_absolute_error, r2_score, max_error of these columns.
        let targets = array![[3.0, 1.0], [-0.5, 1.0], [2.0, 1.0], [7.0, 1.0]];
        let answers = array![[2.5, 1.5], [0.0, 1.0], [2.0, 1.0], [8.0, 0.0]];
        let [varying, constant] = TargetErrors::measure(targets.view(), answers.view())[..] else {
            panic!("one for each target")
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
    fn an_answer_of_nan_is_the_worst() {
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
    fn figures_are_numbers_or_missing_whatever_the_size_of_the_targets() {
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
}
