use ndarray::Array2;
use rayon::prelude::*;

use super::{
    super::{
        Run, RunError, RunSets, RunSettings,
        cross_validation::{nth_seed, scatter},
    },
    FoldErrors,
    fold_errors::variances,
};
use crate::{
    dataset::{Dataset, Folds, Split},
    job::Job,
    machine::MemoryBudget,
    network::Shape,
    training::{StoppingRules, TrainingError},
};

/// Committees trained on all folds but one, for each fold, which advance together epoch by epoch: the epoch at which to
/// stop is that with the lowest error over all folds.
pub(super) struct FoldedTraining<'a> {
    folds: &'a Folds,
    variances: Vec<f64>,
    parts: Vec<Part>,
    /// Epoch of the latest weights.
    pub(super) epoch: usize,
    /// Number of multiplications of one epoch of all trainings, from the shapes alone.
    pub(super) epoch_multiplications: f64,
    /// Best epoch so far; `None` if no epoch had finite answers.
    pub(super) best: Option<BestEpoch>,
    /// Last epoch that lowered the error noticeably, and the error then.
    gain: (usize, f64),
}

/// Errors and answers at the epoch with the lowest error so far.
#[derive(Clone, Debug)]
pub(super) struct BestEpoch {
    pub(super) epoch: usize,
    pub(super) errors: FoldErrors,
    /// Held-out answers to all samples: samples × targets.
    pub(super) answers: Array2<f64>,
}

/// Trainings without one fold.
struct Part {
    /// The training and the scaled inputs of the held-out samples; `None` if every target is constant without the fold: the
    /// constant is then the answer.
    run: Option<(Run, Array2<f64>)>,
    targets: Array2<f64>,
    answers: Array2<f64>,
}

/// Returns the number of multiplications of an epoch of all starts on this many samples, and of their answers to `answered`
/// others.
pub(super) fn training_multiplications(settings: &RunSettings, shape: Shape, samples: usize, answered: usize) -> f64 {
    /// Cost of the tanh of a hidden node, in multiplications.
    const TANH: usize = 12;
    let training = settings.training.method.epoch_multiplications(shape, samples);
    let answers = answered * (shape.weights() + TANH * shape.hidden);
    settings.starts as f64 * (training + answers as f64)
}

impl<'a> FoldedTraining<'a> {
    /// Prepares trainings with `settings` on every `stride`th sample of `set` outside each fold.
    pub(super) fn new(
        settings: &RunSettings,
        set: &Dataset,
        folds: &'a Folds,
        stride: usize,
        memory: MemoryBudget,
    ) -> Result<Self, RunError> {
        let mut endless = *settings;
        endless.training.stopping.epochs = StoppingRules::MAX_EPOCHS;
        let parts = (0..folds.count()).into_par_iter().map(|fold| {
            let thinned: Vec<usize> = folds.without(&[fold]).into_iter().step_by(stride).collect();
            let seed = nth_seed(settings.seed, fold);
            let settings = RunSettings { seed, ..endless };
            Part::new(settings, set.select(&thinned), &set.select(folds.test(fold)), memory)
        });
        let parts: Vec<Part> = parts.collect::<Result<_, _>>()?;
        if parts.iter().all(|part| part.run.is_none()) {
            return Err(TrainingError::NothingVaries.into());
        }
        let of_part = |part: &Part| {
            let Some((run, _)) = &part.run else { return 0.0 };
            let first = &run.leader().rows()[0];
            training_multiplications(settings, first.present().shape(), first.samples(), part.targets.nrows())
        };
        Ok(Self {
            folds,
            variances: variances(set.targets()),
            epoch_multiplications: parts.iter().map(of_part).sum(),
            parts,
            epoch: 0,
            best: None,
            gain: (0, f64::INFINITY),
        })
    }

    /// Runs one epoch of all trainings.
    pub(super) fn step(&mut self) {
        self.parts.par_iter_mut().for_each(Part::step);
        self.epoch += 1;
        let squares = Vec::from_iter(self.parts.iter().map(Part::squared_errors));
        let errors = FoldErrors::new(&squares, &self.variances, self.folds);
        if errors.upper() < Self::NOTICEABLE * self.gain.1 {
            self.gain = (self.epoch, errors.upper());
        }
        let is_best = |best: &BestEpoch| errors.upper() < best.errors.upper();
        if errors.relative().is_finite() && self.best.as_ref().is_none_or(is_best) {
            let samples = self.parts.iter().map(|part| part.targets.nrows()).sum();
            let mut answers = Array2::zeros((samples, self.variances.len()));
            for (fold, part) in self.parts.iter().enumerate() {
                scatter(&mut answers, self.folds.test(fold), &part.answers);
            }
            self.best = Some(BestEpoch {
                epoch: self.epoch,
                errors,
                answers,
            });
        }
    }

    /// Factor by which an error must fall for the epochs since the last such fall to count as worth their time.
    const NOTICEABLE: f64 = 0.99;

    /// Returns `true` if further epochs are unlikely to be noticeably better: half as many epochs as the last noticeable
    /// gain took, and `patience` more, have passed since, or all trainings have ended.
    pub(super) fn has_passed_its_best(&self, patience: usize) -> bool {
        let (gain, _) = self.gain;
        let mut runs = self.parts.iter().filter_map(|part| part.run.as_ref());
        self.epoch >= gain + gain / 2 + patience || runs.all(|(run, _)| run.stop_reason().is_some())
    }
}

impl Part {
    fn new(settings: RunSettings, training: Dataset, test: &Dataset, memory: MemoryBudget) -> Result<Self, RunError> {
        let constant = |(_, target)| training.targets()[[0, target]];
        let mut part = Self {
            run: None,
            targets: test.targets().to_owned(),
            answers: Array2::from_shape_fn(test.targets().dim(), constant),
        };
        if training.has_varying_target() {
            let validation = None;
            let sets = RunSets {
                memory,
                ..RunSets::without_test(Split { training, validation })
            };
            let run = Run::new(settings, sets, None, &Job::UNINTERRUPTED)?;
            let inputs = run.scalings.at(0).0.of(test.readings());
            part.run = Some((run, inputs));
        }
        Ok(part)
    }

    fn step(&mut self) {
        let Some((run, inputs)) = &mut self.run else { return };
        run.step();
        let present = run.trainers().iter().map(|start| start.rows()[0].present());
        let scaled = present.map(|network| network.forward(inputs.view()));
        let sum = scaled.reduce(|sum, scaled| sum + scaled).expect("a run has a start");
        let mean = sum / run.trainers().len() as f64;
        self.answers = run.scalings.at(0).1.restore(mean.view());
    }

    /// Returns the sum of the squared errors of each target.
    fn squared_errors(&self) -> Vec<f64> {
        let squares = (&self.answers - &self.targets).powi(2);
        let sums = squares.columns().into_iter().map(|of_target| of_target.iter().sum());
        sums.collect()
    }
}
