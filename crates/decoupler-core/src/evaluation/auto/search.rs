use super::{
    super::{Combination, Initialization, RunError, RunSettings, errors::extremes},
    AutoChoice, AutoFixed, AutoProgress, AutoRecord, AutoSamples, MULTIPLICATIONS_PER_SECOND, Tried, TriedModel,
    describe_features,
    fold_errors::{FoldErrors, variances},
    folded_training::{BestEpoch, FoldedTraining, training_multiplications},
    spans::memories,
};
use crate::{
    dataset::{Dataset, Folds, Memory, Seed, SplitBy, Stream},
    decoupling::{Regression, ridge},
    job::Job,
    machine::MemoryBudget,
    network::{InputChoice, InputScaling, Inputs, LARGEST_HIDDEN, Quantity, ScalingChoice, Shape},
    text::format_percent,
    training::{Damping, Method, RegularizationSettings, TrainingError},
};

/// Number of blocks or sets of groups in the cross-validation.
const FOLDS: usize = 4;
/// Networks of a committee.
const COMMITTEE: usize = 5;
/// Networks of a committee while settings are compared.
const SCREENED: usize = 2;
/// Minimum number of epochs of a candidate.
const MIN_EPOCHS: usize = 10;
/// Number of epochs for which samples are thinned out.
const TYPICAL_EPOCHS: usize = 30;
/// Maximum number of epochs, and epochs to wait for a noticeable gain in any case.
const EPOCHS: (usize, usize) = (400, 15);
/// As [`EPOCHS`], for the scaled conjugate gradient, whose epochs are short.
const SHORT_EPOCHS: (usize, usize) = (3000, 300);
/// Numbers of hidden nodes to try, in ascending order.
const HIDDEN: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Hidden nodes with which features are compared.
const FIRST_HIDDEN: usize = 4;
/// Hidden nodes with which features are compared where samples are fewer than weights.
const FIRST_HIDDEN_WIDE: usize = 16;
/// Weight decays to try, for each sample; the first one first.
const DECAYS: [f64; 3] = [3e-4, 3e-5, 3e-3];
/// Feature sets that networks try, next to the plain readings.
const FEATURE_SETS: usize = 2;
/// Candidates that are compared again as committees.
const FINALISTS: usize = 2;
/// Epoch after which the correlation of errors is measured, if it is: not for trainings that end before.
const CORRELATION_EPOCH: f64 = 20.0;

/// Initial damping, and its factor after each epoch. Gauss-Newton steps without damping fit noise within an epoch or two
/// where weights are many; with damping that falls gradually, the number of epochs regularises.
const DAMPING: Damping = Damping {
    mu: 1e3,
    mu_decrease: 0.3,
    mu_increase: 10.0,
    mu_max: 1e10,
};

/// Ratio of the damping of Bayesian regularisation, which is relative to the noise, to that of Levenberg-Marquardt.
const PER_NOISE: f64 = 100.0;

/// A network with its features.
#[derive(Clone, Debug, PartialEq)]
struct Candidate {
    memory: Memory,
    settings: RunSettings,
}

impl Candidate {
    fn has_features_of(&self, other: &Self) -> bool {
        self.memory == other.memory && self.settings.inputs == other.settings.inputs
    }

    fn with(&self, change: impl FnOnce(&mut RunSettings)) -> Self {
        let mut changed = self.clone();
        change(&mut changed.settings);
        changed
    }

    fn model(&self, epochs: usize) -> TriedModel {
        TriedModel::Network {
            hidden: self.settings.hidden,
            method: self.settings.training.method,
            starts: self.settings.starts,
            epochs,
            begin: self.settings.initialization,
        }
    }
}

/// A candidate that was cross-validated.
#[derive(Clone)]
struct Measured {
    candidate: Candidate,
    /// Index of its record.
    place: usize,
    best: BestEpoch,
}

/// A search in progress.
struct Search<'a> {
    base: RunSettings,
    fixed: &'a AutoFixed,
    samples: &'a AutoSamples<'a>,
    folds: Folds,
    budget_s: f64,
    memory: MemoryBudget,
    /// `true` if even a small network has more weights than there are samples. Levenberg-Marquardt then fits noise within
    /// an epoch or two, and its epochs are expensive.
    is_wide: bool,
    /// Hidden nodes with which features are compared.
    first_hidden: usize,
    /// Multiplications used so far.
    work: f64,
    tried: Vec<Tried>,
    networks: Vec<Measured>,
    job: &'a Job<'a>,
    on_progress: &'a mut dyn FnMut(AutoProgress),
}

/// Chooses settings for `samples` by cross-validation. `base` gives the source (one network for all rows), the seed, and
/// whatever is not searched; its inputs are raw readings. Networks whose equations do not fit into `memory` are not tried.
///
/// # Errors
/// If the samples cannot be divided into folds, or cannot be scaled, or the job is cancelled.
pub fn choose_settings(
    base: &RunSettings,
    fixed: &AutoFixed,
    samples: &AutoSamples<'_>,
    budget_s: f64,
    memory: MemoryBudget,
    job: &Job<'_>,
    on_progress: &mut dyn FnMut(AutoProgress),
) -> Result<AutoChoice, RunError> {
    if variances(samples.set.targets()).iter().all(|variance| *variance == 0.0) {
        return Err(TrainingError::NothingVaries.into());
    }
    let is_wide = shape(samples.set, FIRST_HIDDEN).weights() > samples.set.samples();
    let search = Search {
        base: *base,
        fixed,
        samples,
        folds: folds(samples, base.seed)?,
        budget_s,
        memory,
        is_wide,
        first_hidden: if is_wide { FIRST_HIDDEN_WIDE } else { FIRST_HIDDEN },
        work: 0.0,
        tried: Vec::new(),
        networks: Vec::new(),
        job,
        on_progress,
    };
    search.run()
}

impl Search<'_> {
    /// Tries features, then hidden nodes, then scalings and methods, then committees.
    fn run(mut self) -> Result<AutoChoice, RunError> {
        let candidates = self.screen_features()?;
        self.try_all(candidates, 0.35, 0)?;
        if self.fixed.hidden.is_none() {
            self.vary_hidden(0.7)?;
        }
        self.refine(0.85)?;
        self.try_committees()?;
        self.decide()
    }

    /// Cross-validates candidates, within this share of the budget for all work until then and for `reserve` later ones.
    fn try_all(&mut self, candidates: Vec<Candidate>, share: f64, reserve: usize) -> Result<(), RunError> {
        let mut left = candidates.len() + reserve;
        for candidate in candidates {
            self.try_network(candidate, self.part(share, left), MIN_EPOCHS)?;
            left -= 1;
        }
        Ok(())
    }

    /// Cross-validates candidates up to the first that is no better than all before it with the same features; returns `true`
    /// if there is a better one.
    fn try_while_better(&mut self, candidates: impl Iterator<Item = Candidate>, share: f64) -> Result<bool, RunError> {
        let mut is_any_better = false;
        for candidate in candidates {
            let alike = self
                .networks
                .iter()
                .filter(|network| network.candidate.has_features_of(&candidate));
            let before = alike
                .map(|network| network.best.errors.relative())
                .fold(f64::INFINITY, f64::min);
            let error = self.try_network(candidate, self.part(share, 2), MIN_EPOCHS)?;
            if error.is_none_or(|error| error >= before) {
                break;
            }
            is_any_better = true;
        }
        Ok(is_any_better)
    }

    /// Returns one of `parts` equal parts of the multiplications that are left of this share of the budget.
    fn part(&self, share: f64, parts: usize) -> f64 {
        (share * self.budget() - self.work).max(0.0) / parts as f64
    }

    /// Cross-validates a network within `limit` multiplications. Returns its error; `None` if the `needed` epochs are too
    /// expensive.
    fn try_network(&mut self, mut candidate: Candidate, limit: f64, needed: usize) -> Result<Option<f64>, RunError> {
        if let Some(network) = self.networks.iter().find(|network| network.candidate == candidate) {
            return Ok(Some(network.best.errors.relative()));
        }
        let is_first = self.networks.is_empty();
        let Some(set) = self.samples.with_memory(&candidate.memory) else {
            return Ok(None);
        };
        let stride = |settings: &RunSettings| self.stride(settings, &set, limit, needed);
        // Fewer samples would call for fewer hidden nodes; one start instead of two only makes the comparison less certain.
        let may_shrink = candidate.settings.starts == SCREENED && self.fixed.starts.is_none();
        if may_shrink && stride(&candidate.settings) != Some(1) {
            candidate.settings.starts = 1;
        }
        let stride = stride(&candidate.settings).or(is_first.then_some(self.largest_stride()));
        let Some(stride) = stride else { return Ok(None) };
        self.announce(&candidate.memory, candidate.settings.inputs, &candidate.model(0))?;
        let mut training = match FoldedTraining::new(&candidate.settings, &set, &self.folds, stride, self.memory) {
            Ok(training) => training,
            Err(_) if !is_first => return Ok(None),
            Err(error) => return Err(error),
        };
        let (max_epochs, patience) = match candidate.settings.training.method {
            Method::ScaledConjugateGradient { .. } => SHORT_EPOCHS,
            _ => EPOCHS,
        };
        let max_epochs = self.fixed.epochs.unwrap_or(max_epochs);
        let mut used = 0.0;
        while training.epoch < max_epochs && !training.has_passed_its_best(patience) {
            if used + training.epoch_multiplications > limit && training.epoch >= MIN_EPOCHS {
                break;
            }
            self.job.check()?;
            training.step();
            used += training.epoch_multiplications;
        }
        self.work += used;
        let Some(best) = training.best else { return Ok(None) };
        let model = candidate.model(self.fixed.epochs.unwrap_or(best.epoch));
        self.record(&candidate.memory, candidate.settings.inputs, model, &best.errors, used);
        let error = best.errors.relative();
        self.networks.push(Measured {
            place: self.tried.len() - 1,
            candidate,
            best,
        });
        Ok(Some(error))
    }

    /// Returns the smallest number such that, with every so manieth sample, trainings of [`TYPICAL_EPOCHS`] stay within
    /// `limit` multiplications; `None` if too few samples would be left, even for the `needed` epochs.
    fn stride(&self, settings: &RunSettings, set: &Dataset, limit: f64, needed: usize) -> Option<usize> {
        let mut shape = shape(set, settings.hidden);
        if settings.inputs.scaling == ScalingChoice::Whitening {
            let inputs = Inputs::fit(settings.inputs, set.readings(), crate::scene::NoiseSource::default()).ok()?;
            if let InputScaling::Whitening(whitening) = inputs.scaling() {
                shape.inputs = whitening.components();
            }
        }
        let samples = set.samples() * (self.folds.count() - 1) / self.folds.count();
        let epoch = |stride: usize| {
            self.folds.count() as f64 * training_multiplications(settings, shape, samples.div_ceil(stride), 0)
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
    fn budget(&self) -> f64 {
        self.budget_s * MULTIPLICATIONS_PER_SECOND
    }

    fn announce(&mut self, memory: &Memory, inputs: InputChoice, model: &TriedModel) -> Result<(), RunError> {
        self.job.check()?;
        let number = self.tried.len() + 1;
        let features = describe_features(memory, inputs);
        let mut text = format!("Trying candidate {number}: {features}, {model}");
        if let Some(best) = self.ranked().first() {
            let error = format_percent(100.0 * best.best.errors.relative());
            text += &format!(", best error so far {error}");
        }
        let share = (self.work / self.budget()).min(1.0);
        (self.on_progress)(AutoProgress { text, share });
        Ok(())
    }

    fn record(&mut self, memory: &Memory, inputs: InputChoice, model: TriedModel, errors: &FoldErrors, work: f64) {
        self.tried.push(Tried {
            memory: memory.clone(),
            inputs,
            model,
            error: errors.relative(),
            standard_error: errors.standard_error(),
            seconds: work / MULTIPLICATIONS_PER_SECOND,
        });
    }

    /// Networks, best first.
    fn ranked(&self) -> Vec<&Measured> {
        let mut networks = Vec::from_iter(&self.networks);
        networks.sort_by(|one, other| one.best.errors.upper().total_cmp(&other.best.errors.upper()));
        networks
    }

    /// Returns the best candidate so far among those that suit.
    fn best(&self, suits: impl Fn(&Candidate) -> bool) -> Option<Candidate> {
        let mut candidates = self.ranked().into_iter().map(|network| &network.candidate);
        candidates.find(|candidate| suits(candidate)).cloned()
    }

    /// Compares features by ridge regression; returns networks on the plain readings and on the best others.
    fn screen_features(&mut self) -> Result<Vec<Candidate>, RunError> {
        let plain = InputChoice {
            quantity: Quantity::Raw,
            scaling: self.fixed.scaling.unwrap_or_default(),
        };
        let first = self.fixed.memory.clone().unwrap_or_default();
        let mut features = vec![(first.clone(), plain)];
        if self.fixed.memory.is_none() && self.samples.by != SplitBy::Random {
            features.extend(memories(self.samples).into_iter().map(|memory| (memory, plain)));
        }
        for quantity in [Quantity::LogResistance, Quantity::Conductance] {
            if self.suits(quantity) {
                features.push((first.clone(), InputChoice { quantity, ..plain }));
            }
        }
        let mut plain_error: Option<f64> = None;
        let mut measured: Vec<(f64, (Memory, InputChoice))> = Vec::new();
        for (number, (memory, inputs)) in features.into_iter().enumerate() {
            let width = memory.features(self.samples.set.channels());
            let work = Regression::multiplications(self.samples.set.samples(), width, self.folds.count());
            if number > 0 && self.work + work > 0.2 * self.budget() {
                continue;
            }
            self.announce(&memory, inputs, &TriedModel::Ridge)?;
            let Some(set) = self.samples.with_memory(&memory) else {
                continue;
            };
            let values = set.readings().mapv(|reading| inputs.quantity.of(reading));
            self.work += work;
            let fit = ridge(values.view(), set.targets(), &self.folds);
            let error = fit.map_or(f64::INFINITY, |fit| {
                let errors = FoldErrors::new(&fit.squares, &variances(set.targets()), &self.folds);
                self.record(&memory, inputs, TriedModel::Ridge, &errors, work);
                errors.relative()
            });
            // The plain readings are always tried, and many inputs are not multiplied unless that helps.
            let plain = plain_error.get_or_insert(error);
            if number > 0 && self.is_wide && error >= *plain {
                continue;
            }
            let rank = if number == 0 { -1.0 } else { error };
            measured.push((rank, (memory, inputs)));
        }
        measured.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        measured.truncate(1 + FEATURE_SETS);
        let networks = measured
            .into_iter()
            .flat_map(|(_, (memory, inputs))| self.first_candidates(memory, inputs));
        Ok(networks.collect())
    }

    /// Networks with which features are compared.
    fn first_candidates(&self, mut memory: Memory, inputs: InputChoice) -> Vec<Candidate> {
        // To ridge regression, averages and their differences from the readings are the same; not to a network.
        memory.differences |= self.fixed.memory.is_none() && !memory.is_empty() && inputs.quantity == Quantity::Raw;
        // A regression on many averages that overlap may be worse to begin with than random weights, and one on
        // nearly as many inputs as samples is.
        let begins: &[Initialization] = match (self.is_wide, memory.is_empty()) {
            (true, _) => &[Initialization::Random],
            (false, true) => &[Initialization::Ridge],
            (false, false) => &[Initialization::Ridge, Initialization::Random],
        };
        let mut settings = RunSettings {
            inputs,
            hidden: self.fixed.hidden.unwrap_or(self.first_hidden),
            starts: self.fixed.starts.unwrap_or(SCREENED).min(SCREENED),
            ..self.base
        };
        settings.training.method = self.fixed.method.unwrap_or(if self.is_wide {
            self.decaying(DECAYS[0])
        } else {
            Method::LevenbergMarquardt(DAMPING)
        });
        let candidate = Candidate { memory, settings };
        let begins = begins
            .iter()
            .map(|&begin| candidate.with(|settings| settings.initialization = begin));
        begins.collect()
    }

    /// Returns `true` if the quantity is defined for all readings and clearly not linear in them.
    fn suits(&self, quantity: Quantity) -> bool {
        /// Ratio of the largest to the smallest reading of a channel.
        const RATIO: f64 = 3.0;
        let readings = self.samples.set.readings();
        let is_curved = |column| {
            let (low, high) = extremes(column);
            high > RATIO * low
        };
        readings.iter().all(|&reading| quantity.accepts(reading)) && readings.columns().into_iter().any(is_curved)
    }

    /// The scaled conjugate gradient with this weight decay for each sample.
    fn decaying(&self, decay: f64) -> Method {
        Method::scaled_conjugate_gradient(decay * self.samples.set.samples() as f64)
    }

    /// Tries other numbers of hidden nodes on the best features and on the plain readings, which need more of them: more
    /// while it helps, and fewer if it does not. Then tries the second best features with the number found.
    fn vary_hidden(&mut self, share: f64) -> Result<(), RunError> {
        let best = self.best(|_| true).ok_or(TrainingError::NothingVaries)?;
        let is_other = |candidate: &Candidate| !candidate.has_features_of(&best);
        let plain = self.best(|candidate| is_other(candidate) && candidate.memory.is_empty());
        let first = self.first_hidden;
        for base in std::iter::once(best.clone()).chain(plain) {
            let with = |hidden| base.with(|settings| settings.hidden = hidden);
            let more = HIDDEN.into_iter().filter(|&hidden| hidden > first).map(with);
            if !self.try_while_better(more, share)? {
                let fewer = HIDDEN.into_iter().rev().filter(|&hidden| hidden < first).map(with);
                self.try_while_better(fewer, share)?;
            }
        }
        let hidden = self.best(|_| true).map_or(first, |best| best.settings.hidden);
        let second = self.best(|candidate| is_other(candidate) && !candidate.memory.is_empty());
        let second = second.map(|second| second.with(|settings| settings.hidden = hidden));
        self.try_all(Vec::from_iter(second), share, 0)
    }

    /// Varies scaling, regularisation and method of the best network.
    fn refine(&mut self, share: f64) -> Result<(), RunError> {
        let best = self.best(|_| true).ok_or(TrainingError::NothingVaries)?;
        let mut variants = Vec::new();
        if self.fixed.scaling.is_none() {
            variants.push(best.with(|settings| settings.inputs.scaling = ScalingChoice::Whitening));
        }
        if self.fixed.method.is_none() {
            let methods = if self.is_wide {
                DECAYS[1..].iter().map(|&decay| self.decaying(decay)).collect()
            } else {
                vec![regularized(0.0)]
            };
            let with = |method| best.with(|settings| settings.training.method = method);
            variants.extend(methods.into_iter().map(with));
        }
        self.try_all(variants, share, 1)?;
        let is_regularized = |network: &&Measured| {
            network.candidate.settings.training.method == regularized(0.0)
                && network.best.epoch > CORRELATION_EPOCH as usize
        };
        let correlated = self.networks.last().filter(is_regularized).map(|network| {
            let method = regularized(CORRELATION_EPOCH);
            network.candidate.with(|settings| settings.training.method = method)
        });
        self.try_all(Vec::from_iter(correlated), share, 0)
    }

    /// Number of networks of a committee with this many hidden nodes each.
    fn committee(&self, hidden: usize) -> usize {
        let wanted = self.fixed.starts.unwrap_or(COMMITTEE);
        wanted.min(LARGEST_HIDDEN / hidden).max(1)
    }

    /// Cross-validates the best candidates again as committees.
    fn try_committees(&mut self) -> Result<(), RunError> {
        /// Epochs beyond the best.
        const BEYOND: usize = 5;
        let finalists = self.ranked().into_iter().take(FINALISTS).map(|network| {
            let starts = self.committee(network.candidate.settings.hidden);
            let committee = network.candidate.with(|settings| settings.starts = starts);
            (committee, network.best.epoch)
        });
        let finalists = Vec::from_iter(finalists);
        let mut left = finalists.len();
        for (committee, epochs) in finalists {
            self.try_network(committee, self.part(1.0, left), epochs + BEYOND)?;
            left -= 1;
        }
        Ok(())
    }

    /// Returns the smallest network that is about as good as the best.
    ///
    /// A committee is compared with a smaller one where it was too expensive: it would hardly be worse.
    fn decide(self) -> Result<AutoChoice, RunError> {
        let ranked = self.ranked();
        let best = *ranked.first().ok_or(TrainingError::NothingVaries)?;
        // A few folds do not show that features are dispensable: only networks with the same are compared.
        let smallest = ranked
            .into_iter()
            .filter(|network| network.candidate.has_features_of(&best.candidate))
            .filter(|network| network.best.errors.is_as_good_as(&best.best.errors))
            .min_by_key(|network| network.candidate.settings.hidden);
        let chosen = smallest.unwrap_or(best).clone();
        let Measured { candidate, place, best } = chosen;
        let mut settings = candidate.settings;
        (settings.starts, settings.combine) = (self.committee(settings.hidden), Combination::Mean);
        settings.training.stopping.epochs = self.fixed.epochs.unwrap_or(best.epoch);
        Ok(AutoChoice {
            settings,
            memory: candidate.memory,
            record: AutoRecord {
                budget_s: self.budget_s,
                folds: self.folds.count(),
                by: self.samples.by,
                tried: self.tried,
                chosen: place,
            },
            answers: best.answers,
        })
    }
}

/// Bayesian regularisation for recordings.
fn regularized(correlation_epoch: f64) -> Method {
    let usual = RegularizationSettings::recorded();
    Method::BayesianRegularization(RegularizationSettings {
        damping: Damping {
            mu: PER_NOISE * DAMPING.mu,
            mu_decrease: DAMPING.mu_decrease,
            ..usual.damping
        },
        correlation_epoch,
        ..usual
    })
}

/// Shape of a network with this many hidden nodes for the samples of `set`.
fn shape(set: &Dataset, hidden: usize) -> Shape {
    Shape {
        inputs: set.channels(),
        hidden,
        outputs: set.outputs(),
    }
}

/// Divides the samples by their rule; a part without enough groups is divided in time.
pub(super) fn folds(samples: &AutoSamples<'_>, seed: Seed) -> Result<Folds, RunError> {
    let mut rng = seed.rng(Stream::Folds);
    let (set, groups) = (samples.set, samples.set.snapshots().len());
    Ok(match samples.by {
        SplitBy::Random => Folds::by(set, FOLDS, SplitBy::Random, &mut rng)?,
        SplitBy::Group if groups >= 2 => Folds::by(set, FOLDS.min(groups), SplitBy::Group, &mut rng)?,
        SplitBy::Time if groups >= 2 * FOLDS => Folds::by(set, FOLDS, SplitBy::Time, &mut rng)?,
        SplitBy::Time | SplitBy::Group => Folds::by(&set.ungrouped(), FOLDS, SplitBy::Time, &mut rng)?,
    })
}
