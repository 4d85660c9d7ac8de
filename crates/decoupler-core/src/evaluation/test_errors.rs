use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::{Errors, Source, TargetErrors};
use crate::dataset::Dataset;

/// Errors of answers to a test set: on the nodes of an array, or target by target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TestErrors {
    /// Errors on the nodes of a simulated array.
    Nodes(Errors),
    /// Errors of each target of a recording.
    Targets(Vec<TargetErrors>),
}

impl TestErrors {
    /// Measures `answers` (samples × targets, in the units of the targets) to `test`, whose samples are of `source`.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn measure(source: &Source, test: &Dataset, answers: &Array2<f64>) -> Self {
        match source {
            Source::Simulated(simulation) => Self::Nodes(Errors::measure(test, answers, simulation.stroke_mm())),
            Source::Measured(_) => Self::of_targets(test, answers.view()),
        }
    }

    /// Measures `answers` (samples × targets) to `test` target by target.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn of_targets(test: &Dataset, answers: ArrayView2<'_, f64>) -> Self {
        Self::Targets(TargetErrors::measure(test.targets(), answers))
    }

    /// Errors on the nodes, if the targets are nodes of an array.
    pub fn nodes(&self) -> Option<&Errors> {
        match self {
            Self::Nodes(errors) => Some(errors),
            Self::Targets(_) => None,
        }
    }

    /// Errors of each target; empty if the targets are nodes of an array.
    pub fn targets(&self) -> &[TargetErrors] {
        match self {
            Self::Nodes(_) => &[],
            Self::Targets(targets) => targets,
        }
    }

    /// Error in percent, by which decoders are ranked: AveZerr for nodes, else the mean absolute error in percent of
    /// the range, averaged over the targets that vary. `None` if an error is not finite or no target varies.
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

    /// Returns the error in proportion to that of the Bayesian `reference`: [`Errors::times`].
    pub fn times(&self, reference: &Self) -> Option<f64> {
        self.nodes()?.times(reference.nodes()?)
    }

    /// Returns the name of the first figure that is not a finite number.
    pub fn infinite_figure(&self) -> Option<String> {
        let figures: Vec<(String, Option<f64>)> = match self {
            Self::Nodes(errors) => [
                ("z_percent", errors.z_percent),
                ("x_percent", errors.x_percent),
                ("y_percent", errors.y_percent),
                ("z_mm", Some(errors.z_mm)),
                ("z_full_scale_percent", Some(errors.z_full_scale_percent)),
                ("worst_mm", Some(errors.worst_mm)),
            ]
            .map(|(name, figure)| (name.to_owned(), figure))
            .into(),
            Self::Targets(targets) => {
                let of_target = |(index, errors): (usize, &TargetErrors)| {
                    [
                        ("rmse", Some(errors.rmse)),
                        ("mae", Some(errors.mae)),
                        ("r2", errors.r2),
                        ("worst", Some(errors.worst)),
                        ("percent_of_range", errors.percent_of_range),
                    ]
                    .map(|(name, figure)| (format!("{index}.{name}"), figure))
                };
                targets.iter().enumerate().flat_map(of_target).collect()
            }
        };
        let is_infinite = |figure: &Option<f64>| figure.is_some_and(|figure| !figure.is_finite());
        let mut infinite = figures.into_iter().filter(|(_, figure)| is_infinite(figure));
        infinite.next().map(|(name, _)| name)
    }
}
