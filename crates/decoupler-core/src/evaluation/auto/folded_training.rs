use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use super::{
    super::{
        Initialization, RunError, RunSettings,
        cross_validation::{nth_seed, scatter},
        linear_start::LinearStart,
    },
    FoldErrors,
    fold_errors::variances,
};
use crate::{
    dataset::{Dataset, Folds},
    machine::MemoryBudget,
    network::{Inputs, MinMax, Shape, nguyen_widrow},
    scene::NoiseSource,
    training::{Examples, Problem, StoppingRules, Trainer, TrainingError, TrainingSettings, check_width},
};

/// Committees trained on all folds but one, for each fold, which advance together epoch by epoch: the epoch at which to
/// stop is that with the lowest error over all folds.
pub(super) struct FoldedTraining<'a> {
    folds: &'a Folds,
    variances: Vec<f64>,
    parts: Vec<Part>,
    /// Epoch of the latest weights.
    epoch: usize,
    /// Number of multiplications of one epoch of all trainings.
    epoch_multiplications: f64,
    best: Option<BestEpoch>,
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
    /// Empty if every target is constant without the fold: the constant is then the answer.
    trainers: Vec<Trainer>,
    /// Scaled inputs of the held-out samples.
    inputs: Array2<f64>,
    outputs: MinMax,
    targets: Array2<f64>,
    answers: Array2<f64>,
    squares: Vec<f64>,
}

/// Factor by which an error must fall for the epochs since the last such fall to count as worth their time.
const NOTICEABLE: f64 = 0.99;
/// Cost of the tanh of a hidden node, in multiplications.
const TANH: usize = 12;

impl<'a> FoldedTraining<'a> {
    /// Prepares trainings with `settings` on every `stride`th sample of `set` outside each fold.
    pub(super) fn new(
        settings: &RunSettings,
        set: &Dataset,
        folds: &'a Folds,
        stride: usize,
        memory: MemoryBudget,
    ) -> Result<Self, RunError> {
        let parts = (0..folds.count()).into_par_iter().map(|fold| {
            let thinned: Vec<usize> = folds.without(&[fold]).into_iter().step_by(stride).collect();
            Part::new(
                settings,
                &set.select(&thinned),
                &set.select(folds.test(fold)),
                fold,
                memory,
            )
        });
        let parts: Vec<Part> = parts.collect::<Result<_, _>>()?;
        if parts.iter().all(|part| part.trainers.is_empty()) {
            return Err(TrainingError::NothingVaries.into());
        }
        let of_part = |part: &Part| {
            let Some(first) = part.trainers.first() else { return 0.0 };
            let shape = first.present().shape();
            let training = settings.training.method.epoch_multiplications(shape, first.samples());
            let answers = part.inputs.nrows() * (shape.weights() + TANH * shape.hidden);
            settings.starts as f64 * (training + answers as f64)
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

    /// Number of multiplications of one epoch of all trainings, from the shapes alone.
    pub(super) fn epoch_multiplications(&self) -> f64 {
        self.epoch_multiplications
    }

    /// Runs one epoch of all trainings.
    pub(super) fn step(&mut self) {
        self.parts.par_iter_mut().for_each(Part::step);
        self.epoch += 1;
        let squares: Vec<Vec<f64>> = self.parts.iter().map(|part| part.squares.clone()).collect();
        let errors = FoldErrors::new(&squares, &self.variances, self.folds);
        if errors.upper() < NOTICEABLE * self.gain.1 {
            self.gain = (self.epoch, errors.upper());
        }
        let is_best = |best: &BestEpoch| errors.upper() < best.errors.upper();
        if errors.relative().is_finite() && self.best.as_ref().is_none_or(is_best) {
            let samples = (0..self.folds.count()).map(|fold| self.folds.test(fold).len()).sum();
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

    /// Returns `true` if further epochs are unlikely to be noticeably better: half as many epochs as the last noticeable
    /// gain took, and `patience` more, have passed since, or all trainings have ended.
    pub(super) fn has_passed_its_best(&self, patience: usize) -> bool {
        let (gain, _) = self.gain;
        let mut trainers = self.parts.iter().flat_map(|part| &part.trainers);
        self.epoch >= gain + gain / 2 + patience || trainers.all(|trainer| trainer.stop_reason().is_some())
    }

    /// Epoch of the latest weights.
    pub(super) fn epoch(&self) -> usize {
        self.epoch
    }

    /// Returns the best epoch; `None` if no epoch had finite answers.
    pub(super) fn best(self) -> Option<BestEpoch> {
        self.best
    }
}

impl Part {
    fn new(
        settings: &RunSettings,
        training: &Dataset,
        test: &Dataset,
        fold: usize,
        memory: MemoryBudget,
    ) -> Result<Self, RunError> {
        let inputs = Inputs::fit(settings.inputs, training.readings(), NoiseSource::default())?;
        let outputs = MinMax::fit(training.targets())?;
        let scaled = |readings: ArrayView2<'_, f64>| inputs.of(readings);
        let (x, y) = (scaled(training.readings()), outputs.scale(training.targets()));
        let linear = match settings.initialization {
            Initialization::Random => None,
            Initialization::Ridge if outputs.varying().is_empty() => None,
            Initialization::Ridge => LinearStart::fit(x.view(), y.view(), LinearStart::nodes(settings.hidden)),
        };
        let examples = Examples::new(x.view(), y.view());
        let shape = Shape {
            inputs: examples.inputs(),
            hidden: settings.hidden,
            outputs: examples.outputs(),
        };
        check_width(&settings.training.method, shape, examples.samples(), 1, memory)?;
        let problem = Problem {
            training: examples,
            validation: None,
            test: None,
        };
        let rules = TrainingSettings {
            method: settings.training.method,
            stopping: StoppingRules {
                epochs: StoppingRules::MAX_EPOCHS,
                ..settings.training.stopping
            },
        };
        let seed = nth_seed(settings.seed, fold);
        let starts = if shape.outputs == 0 { 0 } else { settings.starts };
        let trainers = (0..starts).map(|start| {
            let mut mlp = nguyen_widrow(shape, &mut seed.start_rng(start));
            if let Some(linear) = &linear {
                linear.apply(&mut mlp);
            }
            Trainer::new(mlp, problem.clone(), rules)
        });
        let mut part = Self {
            trainers: trainers.collect::<Result<_, _>>()?,
            inputs: scaled(test.readings()),
            outputs,
            targets: test.targets().to_owned(),
            answers: Array2::zeros(test.targets().dim()),
            squares: vec![f64::INFINITY; test.outputs()],
        };
        if part.trainers.is_empty() {
            part.answer(Array2::zeros((test.samples(), 0)));
        }
        Ok(part)
    }

    fn step(&mut self) {
        let mut sum: Option<Array2<f64>> = None;
        for trainer in &mut self.trainers {
            trainer.step();
            let scaled = trainer.present().forward(self.inputs.view());
            sum = Some(match sum {
                Some(sum) => sum + scaled,
                None => scaled,
            });
        }
        let count = self.trainers.len() as f64;
        if let Some(sum) = sum {
            self.answer(sum / count);
        }
    }

    /// Sets the answers from scaled ones, and their squared errors.
    fn answer(&mut self, scaled: Array2<f64>) {
        self.answers = self.outputs.restore(scaled.view());
        for (target, square) in self.squares.iter_mut().enumerate() {
            let (answers, targets) = (self.answers.column(target), self.targets.column(target));
            let errors = answers
                .iter()
                .zip(targets)
                .map(|(answer, target)| (answer - target).powi(2));
            *square = errors.sum();
        }
    }
}
