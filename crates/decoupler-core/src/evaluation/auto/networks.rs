use super::{
    super::{Initialization, RunError, RunSettings},
    TriedModel,
    features::Features,
    folded_training::FoldedTraining,
    judge::Judge,
    search::Search,
};
use crate::{
    decoupling::Program,
    network::{InputChoice, ScalingChoice, Shape},
    training::{Damping, Method, RegularizationSettings, TrainingError},
};

/// Number of networks that may take part in the answer.
const COMMITTEE: usize = 3;
/// Minimum number of epochs of a candidate.
const MIN_EPOCHS: usize = 10;
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

impl Search<'_> {
    /// Tries networks: numbers of hidden nodes, then scaling, method and regularisation of the best. Returns the best ones, the
    /// best first.
    pub(super) fn choose_networks(
        &mut self,
        features: &Features,
        mut inputs: InputChoice,
    ) -> Result<Vec<usize>, RunError> {
        let samples = self.judge.samples();
        let is_few = samples < Judge::FEW;
        // Even a small network has more weights than there are samples. Levenberg-Marquardt then fits noise within an epoch or
        // two, and its epochs are expensive.
        let is_wide = FIRST_HIDDEN[0] * (features.set.channels() + 1) > samples;
        let first = FIRST_HIDDEN[usize::from(is_wide && !is_few)];
        if is_few && self.fixed.scaling.is_none() && features.set.channels() > samples {
            inputs.scaling = ScalingChoice::Whitening;
        }
        let decaying = |decay: &f64| Method::scaled_conjugate_gradient(decay * samples as f64);
        let mut settings = RunSettings {
            inputs,
            hidden: self.fixed.hidden.unwrap_or(first),
            starts: self.fixed.starts.unwrap_or(1),
            initialization: Initialization::Random,
            ..*self.base
        };
        settings.training.method = self.fixed.method.unwrap_or(match is_wide {
            true => decaying(&DECAYS[0]),
            false => Method::LevenbergMarquardt(DAMPING),
        });
        self.stride = self.stride(features, &settings);
        let mut begun = vec![settings];
        if !is_wide {
            // A regression on nearly as many inputs as samples is worse to begin with than random weights.
            let initialization = Initialization::Ridge;
            begun.push(RunSettings {
                initialization,
                ..settings
            });
        }
        let mut best = self.try_better(features, None, begun, 0.45)?;
        if self.fixed.hidden.is_none() {
            let largest = if is_few { 2 * first } else { HIDDEN[HIDDEN.len() - 1] };
            let more = HIDDEN.into_iter().filter(|&hidden| hidden > first && hidden <= largest);
            let fewer = HIDDEN.into_iter().rev().filter(|&hidden| hidden < first);
            for numbers in [Vec::from_iter(more), Vec::from_iter(fewer)] {
                for hidden in numbers {
                    let (before, settings) = (best, self.candidates[best].settings);
                    let tried = vec![RunSettings { hidden, ..settings }];
                    best = self.try_better(features, Some(before), tried, 0.6)?;
                    if best == before {
                        break;
                    }
                }
                // Fewer are tried only if more are no better.
                if self.candidates[best].settings.hidden != first {
                    break;
                }
            }
        }
        let settings = self.candidates[best].settings;
        let mut variants = Vec::new();
        if self.fixed.scaling.is_none() && settings.inputs.scaling != ScalingChoice::Whitening {
            let mut whitened = settings;
            whitened.inputs.scaling = ScalingChoice::Whitening;
            variants.push(whitened);
        }
        if self.fixed.method.is_none() {
            let methods = if is_wide {
                DECAYS[1..].iter().map(decaying).collect()
            } else {
                vec![regularized()]
            };
            for method in methods {
                let mut other = settings;
                other.training.method = method;
                variants.push(other);
            }
        }
        self.try_better(features, Some(best), variants, 0.7)?;
        let mut networks = Vec::from_iter((0..self.candidates.len()).filter(|place| self.is_network(*place)));
        networks.sort_by(|one, other| self.error(*one).total_cmp(&self.error(*other)));
        networks.truncate(COMMITTEE);
        // Each is trained on all samples if it takes part.
        let (best, left) = (networks[0], (self.budget() - self.work) / COMMITTEE as f64);
        networks.retain(|place| *place == best || self.training(features, *place) <= left);
        Ok(networks)
    }

    /// Cross-validates a network on what ridge regression leaves, otherwise as the one that was chosen.
    pub(super) fn try_on_residual(&mut self, features: &Features, chosen: usize) -> Result<Option<usize>, RunError> {
        let mut settings = self.candidates[chosen].settings;
        settings.initialization = Initialization::Random;
        let limit = 0.5 * (self.budget() - self.work - self.training(features, chosen)).max(0.0);
        self.try_network(features, (settings, true), limit)
    }

    /// Cross-validates networks within this share of the budget for all work until then. Returns the best of them and the best so
    /// far.
    fn try_better(
        &mut self,
        features: &Features,
        mut best: Option<usize>,
        all: Vec<RunSettings>,
        share: f64,
    ) -> Result<usize, RunError> {
        let mut left = all.len();
        for settings in all {
            let limit = (share * self.budget() - self.work).max(0.0) / left as f64;
            let tried = self.try_network(features, (settings, false), limit)?;
            best = self.best_of(&Vec::from_iter(best.into_iter().chain(tried)));
            left -= 1;
        }
        best.ok_or(TrainingError::NothingVaries.into())
    }

    /// Multiplications of an epoch on all samples.
    fn epoch_of_all(&self, features: &Features, settings: &RunSettings) -> f64 {
        let shape = shape(features, settings);
        let of_one = settings
            .training
            .method
            .epoch_multiplications(shape, self.judge.samples());
        settings.starts as f64 * of_one
    }

    /// Multiplications of the training of a network that was tried on all samples.
    pub(super) fn training(&self, features: &Features, place: usize) -> f64 {
        let settings = &self.candidates[place].settings;
        self.epoch_of_all(features, settings) * settings.training.stopping.epochs as f64
    }

    /// Returns `true` for a network that answers alone.
    fn is_network(&self, place: usize) -> bool {
        self.candidates[place].program.is_none() && !self.candidates[place].is_on_residual()
    }

    /// Returns the smallest number such that trainings of this network, on every so manieth sample, take a small part of the
    /// budget.
    fn stride(&self, features: &Features, settings: &RunSettings) -> usize {
        const EPOCHS: f64 = 30.0;
        const SHARE: f64 = 0.1;
        /// Minimum number of samples after thinning.
        const ENOUGH: usize = 3000;
        let work = EPOCHS * self.judge.parts() as f64 * self.epoch_of_all(features, settings);
        ((work / (SHARE * self.budget())) as usize).clamp(1, (self.judge.samples() / ENOUGH).clamp(1, 20))
    }

    /// Cross-validates a network within `limit` multiplications, on what ridge regression leaves if the flag is set. Returns
    /// `None` if it is too expensive.
    fn try_network(
        &mut self,
        features: &Features,
        (mut settings, is_on_residual): (RunSettings, bool),
        limit: f64,
    ) -> Result<Option<usize>, RunError> {
        // There must be one.
        let is_first = !(0..self.candidates.len()).any(|place| self.is_network(place));
        let final_epoch = self.epoch_of_all(features, &settings);
        let of_epoch = final_epoch * self.judge.parts() as f64 / self.stride as f64;
        let [least, final_least] = [of_epoch, final_epoch].map(|of_epoch| of_epoch * MIN_EPOCHS as f64);
        if !is_first && (least > limit || final_least > 0.5 * self.budget()) {
            return Ok(None);
        }
        let model = |epochs: usize| TriedModel::Network {
            hidden: settings.hidden,
            method: settings.training.method,
            starts: settings.starts,
            epochs,
            begin: settings.initialization,
            is_on_residual,
        };
        let mut tried = self.begin(features, settings.inputs, model(0))?;
        let part = (self.stride, is_on_residual);
        let mut training = match FoldedTraining::new(&settings, features, &self.judge, part, self.memory) {
            Ok(training) => training,
            Err(_) if !is_first => return Ok(None),
            Err(error) => return Err(error),
        };
        let (max_epochs, patience) = match settings.training.method {
            Method::ScaledConjugateGradient(_) => SHORT_EPOCHS,
            _ => EPOCHS,
        };
        let max_epochs = self.fixed.epochs.unwrap_or(max_epochs);
        let mut used = 0.0;
        while training.epoch < max_epochs && !training.has_passed_its_best(patience) {
            // The training on all samples must fit into what is left, too.
            let left = self.budget() - self.work - used - final_epoch * training.epoch as f64;
            tried.is_cut_off = used + of_epoch > limit || left < 0.0;
            if tried.is_cut_off && training.epoch >= MIN_EPOCHS {
                break;
            }
            self.job.check()?;
            training.step();
            used += of_epoch;
        }
        let Some((epochs, _, answers)) = training.best else {
            self.work += used;
            return Ok(None);
        };
        let epochs = self.fixed.epochs.unwrap_or(epochs);
        tried.model = model(epochs);
        let place = self.keep(tried, (answers, None::<Program>), used);
        settings.training.stopping.epochs = epochs;
        self.candidates[place].settings = settings;
        Ok(Some(place))
    }
}

/// Shape of networks on these features. Whitening leaves at most as many components as there are samples.
fn shape(features: &Features, settings: &RunSettings) -> Shape {
    let most = match settings.inputs.scaling {
        ScalingChoice::Whitening => features.set.samples(),
        ScalingChoice::MinMax => usize::MAX,
    };
    Shape {
        inputs: features.set.channels().min(most),
        hidden: settings.hidden,
        outputs: features.set.outputs(),
    }
}

/// Bayesian regularisation for recordings.
fn regularized() -> Method {
    let mut settings = RegularizationSettings::recorded();
    settings.damping.mu = PER_NOISE * DAMPING.mu;
    settings.damping.mu_decrease = DAMPING.mu_decrease;
    Method::BayesianRegularization(settings)
}
