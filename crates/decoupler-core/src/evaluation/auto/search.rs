use super::{
    super::{Combination, Initialization, RunError, RunSettings},
    AutoChoice, AutoFixed, AutoProgress, AutoRecord, AutoSamples, MULTIPLICATIONS_PER_SECOND, Tried, TriedModel,
    describe_features, describe_network,
    fold_errors::{FoldErrors, variances},
    folded_training::{BestEpoch, FoldedTraining},
};
use crate::{
    dataset::{Dataset, Folds, Memory, Seed, SplitBy, Stream},
    job::Job,
    machine::MemoryBudget,
    network::{InputChoice, InputScaling, Inputs, LARGEST_HIDDEN, ScalingChoice, Shape},
    training::{Method, TrainingError},
};

/// Number of blocks or sets of groups in the cross-validation.
const FOLDS: usize = 4;
/// Networks of a committee.
pub(super) const COMMITTEE: usize = 5;
/// Networks of a committee while settings are compared.
pub(super) const SCREENED: usize = 2;
/// Maximum number of epochs.
const MAX_EPOCHS: usize = 400;
/// Maximum number of epochs of the scaled conjugate gradient, which are short.
const MAX_SHORT_EPOCHS: usize = 3000;
/// Epochs to wait for a noticeable gain in any case.
const PATIENCE: usize = 15;
/// As [`PATIENCE`], for the scaled conjugate gradient.
const SHORT_PATIENCE: usize = 300;
/// A network with its features.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Candidate {
    pub(super) memory: Memory,
    pub(super) inputs: InputChoice,
    pub(super) hidden: usize,
    pub(super) method: Method,
    pub(super) starts: usize,
    pub(super) initialization: Initialization,
}

/// A candidate that was cross-validated.
pub(super) struct Measured {
    pub(super) candidate: Candidate,
    /// Index of its record.
    place: usize,
    pub(super) best: BestEpoch,
    /// Number of weights of one network.
    pub(super) weights: usize,
}

/// A search in progress.
pub(super) struct Search<'a> {
    base: RunSettings,
    pub(super) fixed: &'a AutoFixed,
    pub(super) samples: &'a AutoSamples<'a>,
    pub(super) folds: Folds,
    budget_s: f64,
    memory: MemoryBudget,
    /// Multiplications used so far.
    pub(super) work: f64,
    tried: Vec<Tried>,
    pub(super) networks: Vec<Measured>,
    /// Number of candidates still expected.
    pub(super) expected: usize,
    job: &'a Job<'a>,
    on_progress: &'a mut dyn FnMut(AutoProgress),
}

impl<'a> Search<'a> {
    pub(super) fn new(
        base: &RunSettings,
        fixed: &'a AutoFixed,
        samples: &'a AutoSamples<'a>,
        budget_s: f64,
        memory: MemoryBudget,
        job: &'a Job<'a>,
        on_progress: &'a mut dyn FnMut(AutoProgress),
    ) -> Result<Self, RunError> {
        if variances(samples.set.targets()).iter().all(|variance| *variance == 0.0) {
            return Err(TrainingError::NothingVaries.into());
        }
        let folds = folds(samples, base.seed)?;
        Ok(Self {
            base: *base,
            fixed,
            samples,
            folds,
            budget_s,
            memory,
            work: 0.0,
            tried: Vec::new(),
            networks: Vec::new(),
            expected: 0,
            job,
            on_progress,
        })
    }

    pub(super) fn run(mut self) -> Result<AutoChoice, RunError> {
        let chosen = self.stages()?;
        Ok(self.choice(chosen))
    }

    /// Cross-validates a network within its part of the budget: what is left until `share`, divided by the number of
    /// candidates still to come in this stage. Returns its error; `None` if the `needed` epochs are too expensive.
    pub(super) fn try_network(
        &mut self,
        mut candidate: Candidate,
        share: f64,
        to_come: usize,
        needed: usize,
    ) -> Result<Option<f64>, RunError> {
        if let Some(place) = self.networks.iter().position(|network| network.candidate == candidate) {
            return Ok(Some(self.networks[place].best.errors.relative()));
        }
        let is_first = self.networks.is_empty();
        let limit = (share * self.budget() - self.work).max(0.0) / to_come.max(1) as f64;
        let Some(set) = self.samples.with_memory(&candidate.memory) else {
            return Ok(None);
        };
        let mut settings = RunSettings {
            inputs: candidate.inputs,
            hidden: candidate.hidden,
            starts: candidate.starts,
            initialization: candidate.initialization,
            ..self.base
        };
        settings.training.method = candidate.method;
        // Fewer samples would call for fewer hidden nodes; one start instead of two only makes the comparison less certain.
        if candidate.starts == SCREENED
            && self.fixed.starts.is_none()
            && self.stride(&settings, &set, limit, needed) != Some(1)
        {
            settings.starts = 1;
            candidate.starts = 1;
        }
        let stride = self.stride(&settings, &set, limit, needed);
        let Some(stride) = stride.or(is_first.then_some(self.largest_stride())) else {
            return Ok(None);
        };
        let name = format!(
            "{}, {}",
            describe_features(&candidate.memory, candidate.inputs),
            describe_network(candidate.hidden, &candidate.method, candidate.starts)
        );
        self.announce(name)?;
        let mut training = match FoldedTraining::new(&settings, &set, &self.folds, stride, self.memory) {
            Ok(training) => training,
            Err(_) if !is_first => return Ok(None),
            Err(error) => return Err(error),
        };
        let weights = shape(&set, candidate.hidden).weights();
        let epoch = training.epoch_multiplications();
        let (most, patience) = match candidate.method {
            Method::ScaledConjugateGradient(_) => (MAX_SHORT_EPOCHS, SHORT_PATIENCE),
            _ => (MAX_EPOCHS, PATIENCE),
        };
        let max_epochs = self.fixed.epochs.unwrap_or(most);
        let mut used = 0.0;
        while training.epoch() < max_epochs && !training.has_passed_its_best(patience) {
            if used + epoch > limit && training.epoch() >= MIN_EPOCHS {
                break;
            }
            self.job.check()?;
            training.step();
            used += epoch;
        }
        self.work += used;
        let Some(best) = training.best() else { return Ok(None) };
        let error = best.errors.relative();
        let model = TriedModel::Network {
            hidden: candidate.hidden,
            method: candidate.method,
            starts: candidate.starts,
            epochs: self.fixed.epochs.unwrap_or(best.epoch),
            begin: candidate.initialization,
        };
        self.record(&candidate.memory, candidate.inputs, model, &best.errors, used);
        self.networks.push(Measured {
            weights,
            place: self.tried.len() - 1,
            candidate,
            best,
        });
        Ok(Some(error))
    }

    /// Returns the smallest number such that, with every so manieth sample, trainings of [`TYPICAL_EPOCHS`] stay within
    /// `limit` multiplications; `None` if too few samples would be left, even for the `needed` epochs.
    fn stride(&self, settings: &RunSettings, set: &Dataset, limit: f64, needed: usize) -> Option<usize> {
        let inputs = match settings.inputs.scaling {
            ScalingChoice::MinMax => set.channels(),
            ScalingChoice::Whitening => {
                let inputs = Inputs::fit(settings.inputs, set.readings(), crate::scene::NoiseSource::default()).ok()?;
                match inputs.scaling() {
                    InputScaling::Whitening(whitening) => whitening.components(),
                    InputScaling::MinMax(_) => set.channels(),
                }
            }
        };
        let shape = Shape {
            inputs,
            ..shape(set, settings.hidden)
        };
        let samples = set.samples() * (self.folds.count() - 1) / self.folds.count();
        let epoch = |stride: usize| {
            let method = &settings.training.method;
            let trainings = (self.folds.count() * settings.starts) as f64;
            trainings * method.epoch_multiplications(shape, samples.div_ceil(stride))
        };
        let largest = self.largest_stride();
        let fits = |epochs: usize| (1..=largest).find(|&stride| epoch(stride) * epochs as f64 <= limit);
        fits(TYPICAL_EPOCHS.max(needed)).or_else(|| fits(needed))
    }

    /// Largest number such that enough samples are left when every so manieth is kept.
    fn largest_stride(&self) -> usize {
        /// Minimum number of samples after thinning.
        const ENOUGH: usize = 3000;
        (self.samples.set.samples() / ENOUGH).clamp(1, 20)
    }

    /// Budget in multiplications.
    pub(super) fn budget(&self) -> f64 {
        self.budget_s * MULTIPLICATIONS_PER_SECOND
    }

    pub(super) fn announce(&mut self, name: String) -> Result<(), RunError> {
        self.job.check()?;
        let best = self
            .ranked()
            .first()
            .map(|&place| self.networks[place].best.errors.relative());
        let candidate = self.tried.len() + 1;
        let share = (self.work / self.budget()).min(1.0);
        (self.on_progress)(AutoProgress {
            candidate,
            candidates: candidate + self.expected.saturating_sub(1),
            name,
            best,
            share,
        });
        Ok(())
    }

    pub(super) fn record(
        &mut self,
        memory: &Memory,
        inputs: InputChoice,
        model: TriedModel,
        errors: &FoldErrors,
        work: f64,
    ) {
        self.tried.push(Tried {
            memory: memory.clone(),
            inputs,
            model,
            error: errors.relative(),
            standard_error: errors.standard_error(),
            seconds: work / MULTIPLICATIONS_PER_SECOND,
        });
    }

    /// Indices of the networks, best first.
    pub(super) fn ranked(&self) -> Vec<usize> {
        let error = |place: usize| self.networks[place].best.errors.upper();
        let mut places = Vec::from_iter(0..self.networks.len());
        places.sort_by(|&one, &other| error(one).total_cmp(&error(other)));
        places
    }

    fn choice(mut self, chosen: usize) -> AutoChoice {
        let Measured {
            candidate, place, best, ..
        } = self.networks.swap_remove(chosen);
        let mut settings = RunSettings {
            inputs: candidate.inputs,
            hidden: candidate.hidden,
            starts: self
                .fixed
                .starts
                .unwrap_or(COMMITTEE)
                .min(LARGEST_HIDDEN / candidate.hidden)
                .max(1),
            combine: Combination::Mean,
            initialization: candidate.initialization,
            ..self.base
        };
        settings.training.method = candidate.method;
        settings.training.stopping.epochs = self.fixed.epochs.unwrap_or(best.epoch);
        AutoChoice {
            settings,
            memory: candidate.memory,
            record: AutoRecord {
                budget_s: self.budget_s,
                folds: self.folds.count(),
                by: self.samples.by,
                tried: self.tried,
                chosen: place,
            },
            folds: self.folds,
            answers: best.answers,
        }
    }
}

/// Shape of a network with this many hidden nodes for the samples of `set`.
pub(super) fn shape(set: &Dataset, hidden: usize) -> Shape {
    Shape {
        inputs: set.channels(),
        hidden,
        outputs: set.outputs(),
    }
}

/// Divides the samples by their rule; a part without enough groups is divided in time.
fn folds(samples: &AutoSamples<'_>, seed: Seed) -> Result<Folds, RunError> {
    let mut rng = seed.rng(Stream::Folds);
    let (set, groups) = (samples.set, samples.set.snapshots().len());
    match samples.by {
        SplitBy::Random => Ok(Folds::by(set, FOLDS, SplitBy::Random, &mut rng)?),
        SplitBy::Group if groups >= 2 => Ok(Folds::by(set, FOLDS.min(groups), SplitBy::Group, &mut rng)?),
        SplitBy::Time if groups >= 2 * FOLDS => Ok(Folds::by(set, FOLDS, SplitBy::Time, &mut rng)?),
        SplitBy::Time | SplitBy::Group => {
            let ungrouped = set.ungrouped();
            Ok(Folds::by(&ungrouped, FOLDS, SplitBy::Time, &mut rng)?)
        }
    }
}

/// Minimum number of epochs of a candidate.
pub(super) const MIN_EPOCHS: usize = 10;
/// Number of epochs for which samples are thinned out.
const TYPICAL_EPOCHS: usize = 30;
