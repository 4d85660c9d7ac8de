use ndarray::Array2;
use rayon::prelude::*;

use super::{
    super::{
        Run, RunError, RunSets, RunSettings,
        cross_validation::{nth_seed, scatter},
    },
    features::Features,
    judge::Judge,
};
use crate::{
    dataset::{Dataset, Split},
    decoupling::{Program, ProgramDecoder},
    job::Job,
    machine::MemoryBudget,
    scene::NoiseSource,
    training::StoppingRules,
};

/// Committees trained on all folds but one, for each fold, which advance together epoch by epoch: the epoch at which to
/// stop is that with the lowest error over all folds.
pub(super) struct FoldedTraining<'a> {
    judge: &'a Judge,
    parts: Vec<Part>,
    /// Epoch of the latest weights.
    pub(super) epoch: usize,
    /// Epoch with the lowest error so far, the error, and the held-out answers; `None` if no epoch had finite answers.
    pub(super) best: Option<(usize, f64, Array2<f64>)>,
    /// Last epoch that lowered the error noticeably, and the error then.
    gain: (usize, f64),
}

/// Trainings without one fold.
struct Part {
    /// The training and the scaled inputs of the held-out samples; `None` if every target is constant without the fold: the
    /// constant is then the answer.
    run: Option<(Run, Array2<f64>)>,
    /// Answers to which those of the networks are added: of ridge regression, if they learn what it leaves.
    base: Array2<f64>,
    answers: Array2<f64>,
    /// Rows of the answers among all held-out answers.
    rows: Vec<usize>,
}

/// Returns ridge regression fitted to a set, and the set with what it leaves of the targets.
pub(super) fn residual(set: &Dataset, settings: &RunSettings) -> Result<(Program, Dataset), RunError> {
    let ridge = Program::ridge(set, settings.inputs.quantity, NoiseSource::default())?;
    let answers = ProgramDecoder::new(ridge.clone()).answers_to(set);
    let left = &set.targets() - &answers;
    let residual = Dataset::new(set.readings().to_owned(), left, None, set.groups().to_vec());
    Ok((ridge, residual?))
}

/// Returns the sets of a run on all samples of `training`.
pub(super) fn all_for_training(training: Dataset, memory: MemoryBudget) -> RunSets {
    let validation = None;
    RunSets {
        memory,
        ..RunSets::without_test(Split { training, validation })
    }
}

impl<'a> FoldedTraining<'a> {
    /// Prepares trainings with `settings` on every `stride`th sample outside each fold; of what ridge regression leaves, with
    /// `is_on_residual`.
    pub(super) fn new(
        settings: &RunSettings,
        features: &Features,
        judge: &'a Judge,
        (stride, is_on_residual): (usize, bool),
        memory: MemoryBudget,
    ) -> Result<Self, RunError> {
        let divisions = Vec::from_iter(judge.divisions().enumerate());
        let parts = divisions.into_par_iter().map(|(part, (outside, inside, rows))| {
            let mut settings = *settings;
            settings.seed = nth_seed(settings.seed, part);
            settings.training.stopping.epochs = StoppingRules::MAX_EPOCHS;
            let readings = features.held_out(&outside, inside, settings.inputs.quantity);
            let thinned = Vec::from_iter(outside.into_iter().step_by(stride));
            let mut training = features.set.select(&thinned);
            let mut base = Array2::zeros((inside.len(), training.outputs()));
            if is_on_residual {
                let ridge;
                (ridge, training) = residual(&training, &settings)?;
                base = ProgramDecoder::new(ridge).answers(&vec![0; inside.len()], readings.view());
            }
            let constant = |(row, target)| base[[row, target]] + training.targets()[[0, target]];
            let answers = Array2::from_shape_fn(base.dim(), constant);
            let mut run = None;
            if training.has_varying_target() {
                let begun = Run::new(settings, all_for_training(training, memory), None, &Job::UNINTERRUPTED)?;
                let inputs = begun.scalings.at(0).0.of(readings.view());
                run = Some((begun, inputs));
            }
            Ok(Part {
                run,
                base,
                answers,
                rows,
            })
        });
        let parts: Vec<Part> = parts.collect::<Result<_, RunError>>()?;
        Ok(Self {
            judge,
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
        let mut answers = Array2::zeros(self.judge.truth.dim());
        for part in &self.parts {
            scatter(&mut answers, &part.rows, &part.answers);
        }
        let (error, _) = self.judge.error(&answers);
        if error < Self::NOTICEABLE * self.gain.1 {
            self.gain = (self.epoch, error);
        }
        if error.is_finite() && self.best.as_ref().is_none_or(|(_, best, _)| error < *best) {
            self.best = Some((self.epoch, error, answers));
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
    fn step(&mut self) {
        let Some((run, inputs)) = &mut self.run else { return };
        run.step();
        let present = run.trainers().iter().map(|start| start.rows()[0].present());
        let scaled = present.map(|network| network.forward(inputs.view()));
        let sum = scaled.reduce(|sum, scaled| sum + scaled).expect("a run has a start");
        let mean = sum / run.trainers().len() as f64;
        self.answers = run.scalings.at(0).1.restore(mean.view()) + &self.base;
    }
}
