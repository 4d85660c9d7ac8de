use std::sync::Arc;

use faer::Mat;
use ndarray::{Array1, Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Cell;
use crate::{
    dataset::{Dataset, Division, Seed},
    evaluation::{
        Baselines, CrossValidated, CrossValidation, Effort, Problem, Run, RunError, RunSets, RunSettings,
        SimulatedSettings, TestErrors,
    },
    machine::MemoryBudget,
    network::{MinMax, ScalingError},
    scene::RowModel,
    training::TrainerState,
};

/// Result of one trial of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Seed of the trial.
    pub seed: Seed,
    /// Index of the repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// Errors on the test set; in a cross-validation, on all samples, each decoupled by the network for which it was
    /// held out.
    pub errors: TestErrors,
    /// Errors of the baselines on the same samples.
    pub baselines: Baselines,
    /// Errors, on the same samples, of the best possible answer with this number of hidden nodes: see [`Bottleneck`].
    /// `None` for a recording with a network for each row-wire.
    pub bottleneck: Option<TestErrors>,
    /// Number of networks trained: 1, or one per fold.
    pub networks: usize,
    /// Number of epochs, over all starts and folds.
    pub epochs: usize,
    /// Total time of the epochs.
    pub seconds: f64,
    /// Time of the fastest epoch, which is least affected by other load on the machine.
    pub min_epoch_seconds: f64,
    /// Final state of every training, for [`Run::resume`]; empty for a cross-validation, which has one network per
    /// fold.
    pub states: Vec<TrainerState>,
}

/// Trial that failed.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("seed {seed}: {reason}")]
pub struct TrialFailure {
    /// Seed of the trial.
    pub seed: Seed,
    /// Index of the repeat of a cross-validation, from 0.
    pub repeat: usize,
    /// Reason for the failure.
    pub reason: RunError,
}

impl Trial {
    /// Training time of one network, over all its starts.
    pub(super) fn seconds_per_network(&self) -> f64 {
        self.seconds / self.networks.max(1) as f64
    }

    /// Trains and tests with this seed on the sets of `cell`. Returns `None` if cancelled.
    pub(super) fn on_sets(
        cell: &Cell,
        seed: Seed,
        samples: &TrialSamples,
        is_cancelled: impl Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let settings = RunSettings { seed, ..cell.settings };
        let Some(sets) = samples.sets(cell, seed, &is_cancelled)? else {
            return Ok(None);
        };
        let has_bound = settings.source.simulation().is_some() || settings.source.row_model() == RowModel::Shared;
        let bottleneck = if has_bound {
            let bottleneck = Bottleneck::fit(sets.split.training.targets(), settings.hidden)?;
            let reconstructed = bottleneck.reconstruct(sets.test.targets());
            Some(TestErrors::measure(&settings.source, &sets.test, &reconstructed))
        } else {
            None
        };
        let Some(mut run) = Run::on_unless(settings, sets, &is_cancelled)? else {
            return Ok(None);
        };
        let Some(effort) = Effort::train(&mut run, &is_cancelled) else {
            return Ok(None);
        };
        let scores = run.scores().expect("only runs of folds have no baselines");
        Ok(Some(Self {
            seed,
            repeat: 0,
            errors: scores.network,
            baselines: scores.baselines,
            bottleneck,
            networks: 1,
            epochs: effort.epochs,
            seconds: effort.seconds,
            min_epoch_seconds: effort.min_epoch_seconds,
            states: run.states(),
        }))
    }

    /// Cross-validates on a set drawn with the seed of `settings`. Returns `None` if cancelled.
    pub(super) fn by_cross_validation(
        settings: SimulatedSettings,
        validation: CrossValidation,
        repeat: usize,
        is_cancelled: impl Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let set = settings.draw_training(settings.source.samples)?;
        let tested = settings.draw_tested_folds(&set)?;
        let sets = (&set, tested.as_ref().unwrap_or(&set));
        let Some(validated) = validation.run_with_tested(&settings.into(), sets, repeat, is_cancelled)? else {
            return Ok(None);
        };
        let bottleneck = bottleneck_answers(&set, &validated, settings.hidden)?;
        let source = settings.source.into();
        let errors = |decoupled_mm| TestErrors::measure(&source, &set, decoupled_mm);
        Ok(Some(Self {
            seed: settings.seed,
            repeat,
            errors: errors(&validated.network),
            baselines: Baselines {
                mean: errors(&validated.mean),
                linear: errors(&validated.linear),
                reference: None,
                no_reference: None,
            },
            bottleneck: Some(errors(&bottleneck)),
            networks: validated.folds.count(),
            epochs: validated.effort.epochs,
            seconds: validated.effort.seconds,
            min_epoch_seconds: validated.effort.min_epoch_seconds,
            states: Vec::new(),
        }))
    }
}

/// Returns the best possible answers with this number of hidden nodes, for each sample from the training set of its
/// fold.
fn bottleneck_answers(set: &Dataset, validated: &CrossValidated, hidden: usize) -> Result<Array2<f64>, RunError> {
    let folds = &validated.folds;
    let mut answers = Array2::zeros(set.targets().dim());
    for fold in 0..folds.count() {
        let training = validated.training(set, fold);
        let bottleneck = Bottleneck::fit(training.targets(), hidden)?;
        let reconstructed = bottleneck.reconstruct(set.select(folds.test(fold)).targets());
        for (&sample, answer) in folds.test(fold).iter().zip(reconstructed.rows()) {
            answers.row_mut(sample).assign(&answer);
        }
    }
    Ok(answers)
}

/// Samples of the trials of an experiment.
#[derive(Clone, Debug)]
pub enum TrialSamples {
    /// Samples drawn by each trial from the model of its settings, within this memory.
    Drawn(MemoryBudget),
    /// Recorded samples, divided by each trial.
    Recorded(RecordedSamples),
}

/// Recorded samples, read once for all trials.
#[derive(Clone, Debug)]
pub struct RecordedSamples {
    /// All samples except those of the test files.
    pub set: Arc<Dataset>,
    /// Samples of the test files, if there are any.
    pub test: Option<Arc<Dataset>>,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
    /// Memory that a trial may use.
    pub memory: MemoryBudget,
}

impl RecordedSamples {
    /// Returns the sets of a run with this seed.
    ///
    /// # Errors
    /// If the samples cannot be divided in this way.
    pub fn divided(&self, division: &Division, seed: Seed) -> Result<RunSets, RunError> {
        let (split, test) = division.sets(&self.set, self.test.as_deref(), seed)?;
        Ok(RunSets {
            problem: Arc::clone(&self.problem),
            memory: self.memory,
            ..RunSets::new(split, test)
        })
    }
}

impl TrialSamples {
    /// Returns the sets of a trial of `cell` with this seed; `None` once `is_cancelled`.
    pub(super) fn sets(
        &self,
        cell: &Cell,
        seed: Seed,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<RunSets>, RunError> {
        match self {
            Self::Drawn(memory) => {
                let mut settings = cell
                    .settings
                    .simulated()
                    .expect("the source of drawn samples is simulated");
                settings.seed = seed;
                settings.checked_sets_unless(*memory, is_cancelled)
            }
            Self::Recorded(recorded) => {
                let division = cell.division.expect("recorded samples have a division");
                recorded.divided(&division, seed).map(Some)
            }
        }
    }
}

/// Lower bound on the error of a network with h hidden nodes, for any inputs, weights and training.
///
/// The output is an affine function of h hidden values, so its deviations from their mean span at most h directions.
/// Among all such answers, the projection of the true targets on their first h principal components has the smallest
/// mean squared error (Eckart and Young, 1936). The bound holds for the scaled targets of the training set to which it
/// was fitted; other sets are projected on the same components.
#[derive(Clone, Debug)]
pub struct Bottleneck {
    outputs: MinMax,
    mean: Array1<f64>,
    /// Varying outputs × components kept, orthonormal.
    components: Array2<f64>,
    min_mse: f64,
}

impl Bottleneck {
    /// Fits the principal components of `coordinates_mm` (samples × 3·M2) for `hidden` nodes.
    ///
    /// # Errors
    /// If the coordinates cannot be scaled.
    pub fn fit(coordinates_mm: ArrayView2<'_, f64>, hidden: usize) -> Result<Self, ScalingError> {
        let outputs = MinMax::fit(coordinates_mm)?;
        let targets = outputs.scale(coordinates_mm);
        let (samples, channels) = targets.dim();
        let mean = targets.mean_axis(Axis(0)).ok_or(ScalingError::Empty)?;
        let deviations = Mat::from_fn(samples, channels, |s, t| targets[[s, t]] - mean[t]);
        let kept = hidden.min(samples).min(channels);
        let (components, left_out) = principal_components(&deviations, kept)?;
        Ok(Self {
            outputs,
            mean,
            components,
            min_mse: left_out / (samples * channels).max(1) as f64,
        })
    }

    /// Returns the minimum mean squared error (scaled) of any network with this number of hidden nodes, on the set to
    /// which the bound was fitted.
    pub fn min_mse(&self) -> f64 {
        self.min_mse
    }

    /// Returns the best possible answers, in millimetres, for the true `coordinates_mm` (samples × 3·M2).
    pub(super) fn reconstruct(&self, coordinates_mm: ArrayView2<'_, f64>) -> Array2<f64> {
        let deviations = self.outputs.scale(coordinates_mm) - &self.mean;
        let projected = deviations.dot(&self.components).dot(&self.components.t()) + &self.mean;
        self.outputs.restore(projected.view())
    }
}

/// Returns the first `kept` principal components of `deviations` (samples × channels) as channels × kept, and the sum
/// of squares of the remaining components.
fn principal_components(deviations: &Mat<f64>, kept: usize) -> Result<(Array2<f64>, f64), ScalingError> {
    let svd = deviations.thin_svd().map_err(|_| ScalingError::NotConverged)?;
    let components = Array2::from_shape_fn((deviations.ncols(), kept), |(t, k)| svd.V()[(t, k)]);
    let left_out = svd.S().column_vector().iter().skip(kept).map(|value| value * value);
    Ok((components, left_out.sum()))
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    /// Corners of a cube: every direction varies equally, and min-max scaling does not change them.
    fn cube() -> Array2<f64> {
        Array2::from_shape_fn(
            (8, 3),
            |(corner, axis)| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 },
        )
    }

    #[test]
    fn if_all_directions_vary_equally_each_hidden_node_explains_its_share() {
        for hidden in 0..=4 {
            let bottleneck = Bottleneck::fit(cube().view(), hidden).unwrap();
            let expected = 1.0 - hidden.min(3) as f64 / 3.0;
            assert!((bottleneck.min_mse() - expected).abs() < 1e-12, "{hidden} hidden");
            let reconstructed = bottleneck.reconstruct(cube().view());
            let mse = (reconstructed - cube()).mapv(|error| error * error).mean().unwrap();
            assert!((mse - expected).abs() < 1e-12, "{hidden} hidden");
        }
    }

    #[test]
    fn channels_that_vary_together_need_one_node() {
        let line = array![[0.0, 5.0, 2.0], [1.0, 5.0, 4.0], [3.0, 5.0, 8.0]];
        let bottleneck = Bottleneck::fit(line.view(), 1).unwrap();
        assert!(bottleneck.min_mse() < 1e-30);
        let difference = bottleneck.reconstruct(line.view()) - line;
        assert!(difference.iter().all(|error| error.abs() < 1e-14));
    }

    #[test]
    fn constant_targets_have_no_error() {
        let bottleneck = Bottleneck::fit(array![[1.0, 2.0], [1.0, 2.0]].view(), 3).unwrap();
        assert_eq!(bottleneck.min_mse(), 0.0);
        assert_eq!(bottleneck.reconstruct(array![[1.0, 2.0]].view()), array![[1.0, 2.0]]);
    }

    #[test]
    fn a_failed_decomposition_is_an_error_rather_than_a_bound_of_zero() {
        let deviations = Mat::from_fn(5, 3, |s, t| if (s, t) == (2, 1) { f64::NAN } else { 1.0 });
        assert_eq!(principal_components(&deviations, 2), Err(ScalingError::NotConverged));
    }
}
