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
    /// negative for worse. `None` if the target is constant.
    pub r2: Option<f64>,
    /// Largest absolute error.
    pub worst: f64,
    /// [`Self::mae`] in percent of the range of the target. `None` if the target is constant.
    pub percent_of_range: Option<f64>,
}

/// A row of an error table for targets of any meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetRow {
    /// Name of the decoder or baseline.
    pub name: &'static str,
    /// Errors, target by target.
    pub targets: Vec<TargetErrors>,
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

    fn of_one(targets: ArrayView1<'_, f64>, answers: ArrayView1<'_, f64>) -> Self {
        let count = targets.len() as f64;
        let mean = targets.sum() / count;
        let (lowest, highest) = targets
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| {
                (low.min(value), high.max(value))
            });
        let (mut squares, mut sum, mut worst, mut variation) = (0.0, 0.0, 0.0_f64, 0.0);
        for (target, answer) in targets.iter().zip(answers) {
            let error = (answer - target).abs();
            squares += error * error;
            sum += error;
            worst = worst.max(error);
            variation += (target - mean) * (target - mean);
        }
        let varies = highest > lowest;
        Self {
            rmse: (squares / count).sqrt(),
            mae: sum / count,
            r2: varies.then(|| 1.0 - squares / variation),
            worst,
            percent_of_range: varies.then(|| 100.0 * sum / count / (highest - lowest)),
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
        assert_eq!(varying.worst, 1.0);
        assert!((varying.percent_of_range.unwrap() - 100.0 * 0.5 / 7.5).abs() < 1e-13);
        assert_eq!(
            (constant.r2, constant.percent_of_range, constant.mae),
            (None, None, 0.375)
        );
    }

    #[test]
    fn the_mean_scores_an_r2_of_zero() {
        let targets = array![[1.0], [2.0], [6.0]];
        let answers = array![[3.0], [3.0], [3.0]];
        assert_eq!(TargetErrors::measure(targets.view(), answers.view())[0].r2, Some(0.0));
    }
}
