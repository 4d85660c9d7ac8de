use ndarray::{Array2, ArrayView1, Axis};

use super::{
    super::{Combination, Initialization, Run, RunError, RunSettings},
    AutoChoice, AutoFixed, AutoProgress, AutoRecord, AutoSamples, Combined, MULTIPLICATIONS_PER_SECOND, Tried,
    TriedModel,
    features::{Features, margin},
    folded_training::{FoldedTraining, all_for_training, residual, training_multiplications},
    judge::Judge,
    spans::memories,
};
use crate::{
    dataset::{Memory, SplitBy},
    decoupling::{KernelShape, Precision, Program, Regression},
    job::Job,
    machine::MemoryBudget,
    network::{InputChoice, InputScaling, Inputs, LARGEST_HIDDEN, Quantity, ScalingChoice, Shape},
    numerics::convex_weights,
    scene::NoiseSource,
    text::format_percent,
    training::{Damping, Method, RegularizationSettings, TrainingError},
};

/// Largest number of networks whose mean is taken.
const COMMITTEE: usize = 5;
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
/// Hidden nodes with which the search begins, and those where samples are fewer than weights.
const FIRST_HIDDEN: [usize; 2] = [4, 16];
/// Weight decays to try, for each sample; the first one first.
const DECAYS: [f64; 3] = [3e-4, 3e-5, 3e-3];
/// Largest ratio of the error of a member of the combination to that of the best.
const WORST_MEMBER: f64 = 1.5;
/// Smallest weight of a member, below which it is not worth its place.
const SMALLEST_WEIGHT: f64 = 0.05;
/// Share of the variance that the best candidate leaves of a target that is not determined, and those that the readings of
/// the moment and a memory leave of one that may leak.
const UNDETERMINED: f64 = 0.95;
const LEAK: [f64; 2] = [0.75, 0.4];

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

/// A candidate that was cross-validated.
#[derive(Clone)]
struct Member {
    /// The candidate fitted to all samples; `None` for a network, which is trained if it is used.
    program: Option<Program>,
    /// Settings of a network, and the inputs of others.
    settings: RunSettings,
    /// Held-out answers.
    answers: Array2<f64>,
    /// Index of its record.
    place: usize,
}

/// A search in progress.
struct Search<'a> {
    base: RunSettings,
    fixed: &'a AutoFixed,
    samples: &'a AutoSamples<'a>,
    judge: Judge,
    budget_s: f64,
    memory: MemoryBudget,
    /// `true` if even a small network has more weights than there are samples. Levenberg-Marquardt then fits noise within
    /// an epoch or two, and its epochs are expensive.
    is_wide: bool,
    /// Multiplications used so far.
    work: f64,
    record: AutoRecord,
    /// The best network so far.
    best: Option<Member>,
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
    let judge = Judge::new(samples, Judge::FOLDS, base.seed)?;
    if judge.counted().is_empty() {
        return Err(TrainingError::NothingVaries.into());
    }
    let search = Search {
        base: *base,
        fixed,
        samples,
        budget_s,
        memory,
        is_wide: false,
        work: 0.0,
        record: AutoRecord {
            budget_s,
            folds: judge.repeats[0].count(),
            by: samples.by,
            ..AutoRecord::default()
        },
        judge,
        best: None,
        job,
        on_progress,
    };
    search.run()
}

impl Search<'_> {
    /// Compares what is cheap, which decides on the features, and then networks.
    fn run(mut self) -> Result<AutoChoice, RunError> {
        let (features, mut members, inputs) = self.compare_fits()?;
        let small = RunSettings {
            hidden: FIRST_HIDDEN[0],
            inputs: InputChoice::MEASURED,
            ..self.base
        };
        self.is_wide = self.shape(&features, &small).weights() > self.samples.set.samples();
        self.try_networks(&features, inputs)?;
        let best = self.best.clone().ok_or(TrainingError::NothingVaries)?;
        let network = self.finalist(&features, best)?;
        self.record.chosen = network.place;
        let alone = RunSettings {
            starts: 1,
            initialization: Initialization::Random,
            ..network.settings
        };
        // The training on all samples must fit into the budget, too.
        let training = self.epoch_of_all(&features, &alone) * alone.training.stopping.epochs as f64;
        let limit = 0.5 * (self.budget() - self.work - training).max(0.0);
        members.extend(self.try_network(&features, (alone, true), (limit, MIN_EPOCHS))?);
        members.push(network);
        self.combine(&features, &members)
    }

    /// Tries the mean, ridge and kernel ridge regression on the readings and on their memories, and decides which targets count
    /// and which features are used. Returns the features, the candidates on them, and quantity and scaling.
    fn compare_fits(&mut self) -> Result<(Features, Vec<Member>, InputChoice), RunError> {
        let none = Memory::default();
        let plain = Features::of(self.samples, &none).ok_or(TrainingError::NothingVaries)?;
        let mut ridges = Vec::new();
        for quantity in [Quantity::Raw, Quantity::LogResistance, Quantity::Conductance] {
            if plain.suits(quantity) {
                ridges.extend(self.try_ridge(&plain, quantity)?);
            }
        }
        let best = ridges
            .iter()
            .min_by(|one, other| self.error(one).total_cmp(&self.error(other)));
        let ridge = best.cloned().ok_or(TrainingError::NothingVaries)?;
        let quantity = ridge.settings.inputs.quantity;
        let scaling = self.fixed.scaling.unwrap_or_default();
        let mut inputs = InputChoice { quantity, scaling };
        let mut members = vec![self.mean(&plain)?, ridge];
        members.extend(self.try_kernels(&plain, inputs)?);
        let tried = match &self.fixed.memory {
            Some(memory) => Vec::from_iter(Some(memory.clone()).filter(|memory| !memory.is_empty())),
            // Neighbours in different folds give each other away. Differences have no logarithms and reciprocals.
            None if self.samples.by != SplitBy::Random && (self.fixed.tries_memory || self.samples.is_timed()) => {
                memories(self.samples, quantity == Quantity::Raw)
            }
            None => Vec::new(),
        };
        let mut past = Vec::new();
        for memory in tried {
            if let Some(features) = Features::of(self.samples, &memory) {
                let quantity = features.quantity(quantity);
                past.extend(self.try_ridge(&features, quantity)?.map(|ridge| (features, ridge)));
            }
        }
        let varying = self.judge.variances.clone();
        for target in self.judge.counted() {
            let now = self.least(target, members.iter());
            let then = self.least(target, past.iter().map(|(_, ridge)| ridge));
            if now > LEAK[0] && then < LEAK[1] {
                self.record.leaks.push((target, [1.0 - now, 1.0 - then]));
                // A memory must not win by what may be a leak.
                self.judge.variances[target] = 0.0;
            }
        }
        // Ridge regression takes little time, and more folds show more clearly whether a memory is better.
        let mut finer = Judge::new(self.samples, 2 * Judge::FOLDS, self.base.seed)?;
        finer.variances.clone_from(&self.judge.variances);
        let of_plain = plain.ridge(&finer, quantity)?.0;
        let is_taken = |(with, _): &&(Features, Member)| {
            let of_memory = || with.ridge(&finer, with.quantity(quantity));
            let is_better = |(answers, _)| finer.is_clearly_better(&answers, &of_plain, past.len());
            self.fixed.memory.is_some() || of_memory().is_ok_and(is_better)
        };
        let error = |(_, with): &(Features, Member)| self.judge.error(&with.answers).0;
        let taken = past
            .iter()
            .filter(is_taken)
            .min_by(|one, other| error(one).total_cmp(&error(other)));
        self.judge.variances = varying;
        let mut compared = members.clone();
        let mut features = plain;
        if let Some((with, ridge)) = taken.cloned() {
            (inputs.quantity, features) = (with.quantity(quantity), with);
            members = vec![self.mean(&features)?, ridge];
            members.extend(self.try_kernels(&features, inputs)?);
        }
        self.leave_out_open(&features, &members);
        compared.extend(ridges);
        compared.extend(past.into_iter().map(|(_, ridge)| ridge));
        for member in members.iter().chain(&compared) {
            let tried = &mut self.record.tried[member.place];
            (tried.error, tried.standard_error) = self.judge.error(&member.answers);
        }
        Ok((features, members, inputs))
    }

    /// Smallest share of the variance of a target that any of these leaves.
    fn least<'m>(&self, target: usize, members: impl Iterator<Item = &'m Member>) -> f64 {
        let left = members.map(|member| self.judge.unexplained(target, &member.answers));
        left.fold(f64::INFINITY, f64::min)
    }

    /// Lets only those targets count that a member explains, unless none does.
    fn leave_out_open(&mut self, features: &Features, members: &[Member]) {
        let is_leak = |target: &usize| self.record.leaks.iter().any(|(leak, _)| leak == target);
        let varying = self.judge.counted();
        let is_open = |target: &usize| {
            features.memory.is_empty() && is_leak(target) || self.least(*target, members.iter()) > UNDETERMINED
        };
        let open = Vec::from_iter(varying.iter().copied().filter(is_open));
        if open.len() < varying.len() {
            open.iter().for_each(|target| self.judge.variances[*target] = 0.0);
            self.record.undetermined = open;
        }
    }

    /// Error of a member.
    fn error(&self, member: &Member) -> f64 {
        self.record.tried[member.place].error
    }

    fn mean(&mut self, features: &Features) -> Result<Member, RunError> {
        let tried = self.begin(features, InputChoice::MEASURED, TriedModel::Mean)?;
        let mean = |samples: &[usize]| Ok(Program::mean(&features.set.select(samples)));
        let fitted = features.fitted(&self.judge, Quantity::Raw, mean)?;
        Ok(self.keep(tried, fitted, 0.0))
    }

    fn try_ridge(&mut self, features: &Features, quantity: Quantity) -> Result<Option<Member>, RunError> {
        let inputs = InputChoice {
            quantity,
            scaling: ScalingChoice::MinMax,
        };
        let sizes = (self.judge.samples(), features.set.channels(), self.judge.parts());
        let work = Regression::multiplications(sizes.0, sizes.1, sizes.2);
        if !self.record.tried.is_empty() && work > 0.05 * self.budget() {
            return Ok(None);
        }
        let tried = self.begin(features, inputs, TriedModel::Ridge)?;
        let fitted = features.ridge(&self.judge, quantity);
        Ok(fitted.ok().map(|fitted| self.keep(tried, fitted, work)))
    }

    /// Tries kernel ridge regression with and without a linear kernel, with as many centres as a quarter of the budget allows.
    fn try_kernels(&mut self, features: &Features, inputs: InputChoice) -> Result<Vec<Member>, RunError> {
        const CENTRES: [usize; 5] = [1000, 700, 450, 300, 150];
        let (samples, parts) = (self.judge.samples(), self.judge.parts());
        let (folds, repeats) = (self.record.folds, self.judge.repeats.len());
        let work = |subset: usize| {
            let [choice, fit] = KernelShape::multiplications(samples, folds, subset);
            let centres = if samples <= 4 * subset { samples } else { subset };
            let answers = samples * centres * (features.set.channels() + 10);
            choice + (parts + 1) as f64 * fit + (repeats * answers) as f64
        };
        let is_affordable = |subset: &usize| 2.0 * work(*subset) < 0.25 * self.budget();
        let Some(subset) = CENTRES.into_iter().find(is_affordable) else {
            return Ok(Vec::new());
        };
        let mut members = Vec::new();
        for is_linear in [false, true] {
            let tried = self.begin(features, inputs, TriedModel::Kernel { is_linear })?;
            let fitted = features.kernel(&self.judge, (inputs, is_linear, subset));
            members.extend(fitted.ok().map(|fitted| self.keep(tried, fitted, work(subset))));
        }
        Ok(members)
    }

    /// Tries networks: numbers of hidden nodes, then scaling, method and regularisation of the best.
    fn try_networks(&mut self, features: &Features, inputs: InputChoice) -> Result<(), RunError> {
        let is_few = self.judge.samples() < Judge::FEW;
        let first = FIRST_HIDDEN[usize::from(self.is_wide && !is_few)];
        let mut inputs = inputs;
        if is_few && self.fixed.scaling.is_none() && features.set.channels() > self.judge.samples() {
            inputs.scaling = ScalingChoice::Whitening;
        }
        let mut settings = RunSettings {
            inputs,
            hidden: self.fixed.hidden.unwrap_or(first),
            starts: 1,
            initialization: Initialization::Random,
            ..self.base
        };
        settings.training.method = self.fixed.method.unwrap_or(match self.is_wide {
            true => self.decaying(DECAYS[0]),
            false => Method::LevenbergMarquardt(DAMPING),
        });
        let mut begun = vec![settings];
        if !self.is_wide {
            // A regression on nearly as many inputs as samples is worse to begin with than random weights.
            begun.push(with(settings, |settings| {
                settings.initialization = Initialization::Ridge;
            }));
        }
        self.try_all(features, begun, 0.45)?;
        let best = self.best.as_ref().ok_or(TrainingError::NothingVaries)?.settings;
        if self.fixed.hidden.is_none() {
            let largest = if is_few { 2 * first } else { HIDDEN[HIDDEN.len() - 1] };
            let more = HIDDEN.into_iter().filter(|&hidden| hidden > first && hidden <= largest);
            let fewer = HIDDEN.into_iter().rev().filter(|&hidden| hidden < first);
            for numbers in [Vec::from_iter(more), Vec::from_iter(fewer)] {
                for hidden in numbers {
                    let settings = with(best, |settings| settings.hidden = hidden);
                    if !self.try_all(features, vec![settings], 0.6)? {
                        break;
                    }
                }
                // Fewer are tried only if more are no better.
                if self.best.as_ref().is_some_and(|best| best.settings.hidden != first) {
                    break;
                }
            }
        }
        let best = self.best.as_ref().map_or(best, |best| best.settings);
        let mut variants = Vec::new();
        if self.fixed.scaling.is_none() {
            variants.push(with(best, |settings| {
                settings.inputs.scaling = ScalingChoice::Whitening;
            }));
        }
        if self.fixed.method.is_none() {
            let methods = match self.is_wide {
                true => DECAYS[1..].iter().map(|&decay| self.decaying(decay)).collect(),
                false => vec![regularized()],
            };
            variants.extend(
                methods
                    .into_iter()
                    .map(|method| with(best, |settings| settings.training.method = method)),
            );
        }
        self.try_all(features, variants, 0.7)?;
        Ok(())
    }

    /// Cross-validates networks within this share of the budget for all work until then; returns `true` if one is better than
    /// all before.
    fn try_all(&mut self, features: &Features, all: Vec<RunSettings>, share: f64) -> Result<bool, RunError> {
        let (mut left, mut is_any_better) = (all.len(), false);
        for settings in all {
            let limit = (share * self.budget() - self.work).max(0.0) / left as f64;
            if let Some(tried) = self.try_network(features, (settings, false), (limit, MIN_EPOCHS))?
                && self
                    .best
                    .as_ref()
                    .is_none_or(|best| self.error(&tried) < self.error(best))
            {
                (self.best, is_any_better) = (Some(tried), true);
            }
            left -= 1;
        }
        Ok(is_any_better)
    }

    /// Multiplications of an epoch on all samples.
    fn epoch_of_all(&self, features: &Features, settings: &RunSettings) -> f64 {
        let shape = self.shape(features, settings);
        training_multiplications(settings, shape, self.judge.samples(), 0)
    }

    /// Cross-validates a network within `limit` multiplications, on what ridge regression leaves if the flag is set. Returns
    /// `None` if the `needed` epochs are too expensive.
    fn try_network(
        &mut self,
        features: &Features,
        (settings, is_on_residual): (RunSettings, bool),
        (limit, needed): (f64, usize),
    ) -> Result<Option<Member>, RunError> {
        let is_first = self.best.is_none();
        let stride = self.stride(features, &settings, limit, needed);
        let Some(stride) = stride.or(is_first.then_some(self.largest_stride())) else {
            return Ok(None);
        };
        let model = |epochs: usize| TriedModel::Network {
            hidden: settings.hidden,
            method: settings.training.method,
            starts: settings.starts,
            epochs,
            begin: settings.initialization,
            is_on_residual,
        };
        let mut tried = self.begin(features, settings.inputs, model(0))?;
        let part = (stride, is_on_residual);
        let mut training = match FoldedTraining::new(&settings, features, &self.judge, part, self.memory) {
            Ok(training) => training,
            Err(_) if !is_first => return Ok(None),
            Err(error) => return Err(error),
        };
        let (max_epochs, patience) = match settings.training.method {
            Method::ScaledConjugateGradient { .. } => SHORT_EPOCHS,
            _ => EPOCHS,
        };
        let max_epochs = match needed {
            MIN_EPOCHS => self.fixed.epochs.unwrap_or(max_epochs),
            needed => needed,
        };
        let final_epoch = self.epoch_of_all(features, &settings);
        let mut used = 0.0;
        while training.epoch < max_epochs && !training.has_passed_its_best(patience) {
            // The training on all samples must fit into what is left, too.
            let left = self.budget() - self.work - used - final_epoch * training.epoch as f64;
            tried.is_cut_off = used + training.epoch_multiplications > limit || left < 0.0;
            if tried.is_cut_off && training.epoch >= needed {
                break;
            }
            self.job.check()?;
            training.step();
            used += training.epoch_multiplications;
        }
        let Some((epoch, _, answers)) = training.best else {
            self.work += used;
            return Ok(None);
        };
        let epochs = self.fixed.epochs.unwrap_or(epoch);
        tried.model = model(epochs);
        let mut member = self.keep(tried, (answers, None::<Program>), used);
        member.settings = with(settings, |settings| settings.training.stopping.epochs = epochs);
        Ok(Some(member))
    }

    /// Returns the smallest number such that, with every so manieth sample, trainings of [`TYPICAL_EPOCHS`] stay within
    /// `limit` multiplications; `None` if too few samples would be left, even for the `needed` epochs.
    fn stride(&self, features: &Features, settings: &RunSettings, limit: f64, needed: usize) -> Option<usize> {
        let shape = self.shape(features, settings);
        let folds = self.record.folds;
        let samples = self.judge.samples() * (folds - 1) / folds;
        let epoch = |stride: usize| {
            self.judge.parts() as f64 * training_multiplications(settings, shape, samples.div_ceil(stride), 0)
        };
        let largest = self.largest_stride();
        let of_all = self.epoch_of_all(features, settings);
        let fits = |epochs: usize| {
            let is_trainable = of_all * epochs as f64 <= 0.5 * self.budget();
            (1..=largest).find(|&stride| is_trainable && epoch(stride) * epochs as f64 <= limit)
        };
        fits(TYPICAL_EPOCHS.max(needed)).or_else(|| fits(needed))
    }

    /// Largest number such that enough samples are left when every so manieth is kept.
    fn largest_stride(&self) -> usize {
        /// Minimum number of samples after thinning.
        const ENOUGH: usize = 3000;
        (self.judge.samples() / ENOUGH).clamp(1, 20)
    }

    fn shape(&self, features: &Features, settings: &RunSettings) -> Shape {
        let mut shape = Shape {
            inputs: features.set.channels(),
            hidden: settings.hidden,
            outputs: features.set.outputs(),
        };
        if settings.inputs.scaling == ScalingChoice::Whitening {
            let inputs = Inputs::fit(settings.inputs, features.set.readings(), NoiseSource::default());
            if let Ok(InputScaling::Whitening(whitening)) = inputs.as_ref().map(Inputs::scaling) {
                shape.inputs = whitening.components();
            }
        }
        shape
    }

    /// Budget in multiplications.
    fn budget(&self) -> f64 {
        self.budget_s * MULTIPLICATIONS_PER_SECOND
    }

    /// Announces a candidate, and returns its record, which has no error yet.
    fn begin(&mut self, features: &Features, inputs: InputChoice, model: TriedModel) -> Result<Tried, RunError> {
        self.job.check()?;
        let tried = Tried {
            memory: features.memory.clone(),
            inputs,
            model,
            error: f64::NAN,
            standard_error: f64::NAN,
            seconds: 0.0,
            share: 0.0,
            is_cut_off: false,
        };
        let number = self.record.tried.len() + 1;
        let mut text = format!("Trying candidate {number}: {}, {model}", tried.features());
        let errors = self.record.tried.iter().map(|tried| tried.error);
        if let Some(best) = errors.min_by(f64::total_cmp) {
            text += &format!(", best error so far {}", format_percent(100.0 * best));
        }
        let share = (self.work / self.budget()).min(1.0);
        (self.on_progress)(AutoProgress { text, share });
        Ok(tried)
    }

    /// Records a candidate with its held-out answers.
    fn keep(
        &mut self,
        mut tried: Tried,
        (answers, program): (Array2<f64>, impl Into<Option<Program>>),
        work: f64,
    ) -> Member {
        self.work += work;
        tried.seconds = work / MULTIPLICATIONS_PER_SECOND;
        (tried.error, tried.standard_error) = self.judge.error(&answers);
        let inputs = tried.inputs;
        self.record.tried.push(tried);
        Member {
            program: program.into(),
            settings: RunSettings { inputs, ..self.base },
            answers,
            place: self.record.tried.len() - 1,
        }
    }

    /// The scaled conjugate gradient with this weight decay for each sample.
    fn decaying(&self, decay: f64) -> Method {
        Method::scaled_conjugate_gradient(decay * self.samples.set.samples() as f64)
    }

    /// Cross-validates the best network again as the mean of as many networks as the budget allows.
    fn finalist(&mut self, features: &Features, best: Member) -> Result<Member, RunError> {
        /// Epochs beyond the best.
        const BEYOND: usize = 5;
        let settings = best.settings;
        let epochs = settings.training.stopping.epochs + BEYOND;
        // Each is trained once without every fold, and once on all samples.
        let of_one = self.epoch_of_all(features, &settings) * (epochs * self.judge.parts()) as f64;
        let most = COMMITTEE.min(LARGEST_HIDDEN / settings.hidden).max(1) as f64;
        let starts = 0.9 * (self.budget() - self.work) / of_one.max(1.0);
        let starts = self.fixed.starts.unwrap_or(starts.clamp(1.0, most) as usize);
        let committee = with(settings, |settings| settings.starts = starts);
        let limit = of_one * starts as f64;
        if starts > 1
            && let Some(tried) = self.try_network(features, (committee, false), (limit, epochs))?
            && (self.error(&tried) < self.error(&best) || self.fixed.starts.is_some())
        {
            return Ok(tried);
        }
        Ok(best)
    }

    /// Combines the members, the last of which is the network.
    fn combine(mut self, features: &Features, members: &[Member]) -> Result<AutoChoice, RunError> {
        let (samples, targets) = (self.judge.samples(), self.samples.set.outputs());
        let of_targets = Vec::from_iter((0..targets).map(|target| self.weights(members, target)));
        let weights = Array2::from_shape_fn((members.len(), targets), |(member, target)| of_targets[target][member]);
        let parts = members.iter().zip(weights.rows());
        let parts = parts.map(|(member, weights)| &member.answers * &weights);
        let answers = parts.fold(Array2::zeros(self.judge.truth.dim()), |sum, part| sum + part);
        let counted = self.judge.counted();
        for (member, weights) in members.iter().zip(weights.rows()) {
            let sum: f64 = counted.iter().map(|target| weights[*target]).sum();
            self.record.tried[member.place].share = sum / counted.len().max(1) as f64;
        }
        self.record.combined = Some(self.judge.error(&answers).0);
        let network = members.len() - 1;
        let settings = with(members[network].settings, |settings| {
            settings.combine = Combination::Mean;
        });
        let mut others = Vec::new();
        for (member, weights) in members[..network].iter().zip(weights.rows()) {
            if weights.iter().any(|weight| *weight > 0.0) {
                others.push((self.fitted(features, member)?, weights.to_vec()));
            }
        }
        let epochs = settings.training.stopping.epochs as f64;
        self.record.training_s = self.epoch_of_all(features, &settings) * epochs / MULTIPLICATIONS_PER_SECOND;
        let repeats = answers.axis_chunks_iter(Axis(0), samples);
        let mean = repeats.fold(Array2::zeros((samples, targets)), |sum, part| sum + part);
        Ok(AutoChoice {
            settings,
            memory: features.memory.clone(),
            combined: Combined {
                network: weights.row(network).to_vec(),
                others,
                margin: margin(samples),
            },
            record: self.record,
            answers: mean / self.judge.repeats.len() as f64,
        })
    }

    /// Weights of the members for a target: those within 1.5 times the smallest error on it, without weights that are not worth
    /// their place, and never worse than the best alone.
    fn weights(&self, members: &[Member], target: usize) -> Vec<f64> {
        let truth = self.judge.truth.column(target);
        let square = |answers: ArrayView1<'_, f64>| (&answers - &truth).mapv(|error| error * error).sum();
        let squares = Vec::from_iter(members.iter().map(|member| square(member.answers.column(target))));
        let best = squares.iter().copied().fold(f64::INFINITY, f64::min);
        let least = best / (truth.len() as f64 * truth.var(0.0)).max(f64::MIN_POSITIVE);
        let is_open = self.judge.variances[target] == 0.0 || least > UNDETERMINED;
        // The mean and ridge regression come first. Nothing else is worth a chance where nothing is determined.
        let best = if is_open { squares[0].min(squares[1]) } else { best };
        let is_among = |m: &usize| squares[*m] <= best * WORST_MEMBER.powi(2) && (*m < 2 || !is_open);
        let mut among = Vec::from_iter((0..members.len()).filter(is_among));
        loop {
            let answer = |(row, place): (usize, usize)| members[among[place]].answers[[row, target]];
            let columns = Array2::from_shape_fn((truth.len(), among.len()), answer);
            let found = convex_weights(&columns, truth);
            let kept = Vec::from_iter((0..among.len()).filter(|&place| found[place] >= SMALLEST_WEIGHT));
            let mut weights = vec![0.0; members.len()];
            if kept.len() == among.len() || kept.is_empty() {
                if square(columns.dot(&ArrayView1::from(&found)).view()) > best || kept.is_empty() {
                    weights[squares.iter().position(|square| *square == best).unwrap_or(0)] = 1.0;
                } else {
                    among
                        .iter()
                        .zip(found)
                        .for_each(|(&member, weight)| weights[member] = weight);
                }
                return weights;
            }
            among = kept.into_iter().map(|place| among[place]).collect();
        }
    }

    /// Returns the candidate fitted to all samples; a network on what ridge regression leaves of them.
    fn fitted(&mut self, features: &Features, member: &Member) -> Result<Program, RunError> {
        if let Some(program) = &member.program {
            return Ok(program.clone());
        }
        self.job.check()?;
        let (ridge, training) = residual(&features.set, &member.settings)?;
        let mut run = Run::new(member.settings, all_for_training(training, self.memory), None, self.job)?;
        run.finish(self.job)?;
        let ones = vec![1.0; features.set.outputs()];
        let network = run.network().program(Precision::Double);
        Ok(Program::combination(&[(ridge, ones.clone()), (network, ones)]))
    }
}

fn with(mut settings: RunSettings, change: impl FnOnce(&mut RunSettings)) -> RunSettings {
    change(&mut settings);
    settings
}

/// Bayesian regularisation for recordings.
fn regularized() -> Method {
    let mut settings = RegularizationSettings::recorded();
    settings.damping.mu = PER_NOISE * DAMPING.mu;
    settings.damping.mu_decrease = DAMPING.mu_decrease;
    Method::BayesianRegularization(settings)
}
