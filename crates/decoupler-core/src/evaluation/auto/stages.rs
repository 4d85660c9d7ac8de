//! The order in which a search tries features, hidden nodes, methods and committees.

use super::{
    super::{Initialization, RunError},
    TriedModel, describe_features,
    fold_errors::{FoldErrors, variances},
    search::{COMMITTEE, Candidate, MIN_EPOCHS, Measured, SCREENED, Search, shape},
    spans::memories,
};
use crate::{
    dataset::{Memory, SplitBy},
    decoupling::{Regression, ridge},
    network::{InputChoice, LARGEST_HIDDEN, Quantity, ScalingChoice},
    training::{Damping, Method, RegularizationSettings, ScaledConjugateGradientSettings, TrainingError},
};

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

impl Search<'_> {
    /// Runs all stages; returns the index of the choice in [`Self::networks`].
    pub(super) fn stages(&mut self) -> Result<usize, RunError> {
        // Shares of the budget at the end of each stage.
        let [features, nodes, refined, all] = [0.35, 0.7, 0.85, 1.0];
        let feature_sets = self.screen_features()?;
        let hidden = self.fixed.hidden.unwrap_or(self.first_hidden());
        let damped = Method::LevenbergMarquardt(DAMPING);
        let is_wide = self.is_wide();
        let method = if is_wide { self.decaying(DECAYS[0]) } else { damped };
        let method = self.fixed.method.unwrap_or(method);
        let starts = self.fixed.starts.unwrap_or(SCREENED).min(SCREENED);
        let first: Vec<Candidate> = feature_sets
            .into_iter()
            .flat_map(|(memory, inputs)| {
                // A regression on many averages that overlap may be worse to begin with than random weights, and one on
                // nearly as many inputs as samples is.
                let begins: &[Initialization] = match (is_wide, memory.is_empty()) {
                    (true, _) => &[Initialization::Random],
                    (false, true) => &[Initialization::Ridge],
                    (false, false) => &[Initialization::Ridge, Initialization::Random],
                };
                let with = move |initialization| Candidate {
                    memory: memory.clone(),
                    inputs,
                    hidden,
                    method,
                    starts,
                    initialization,
                };
                begins.iter().copied().map(with)
            })
            .collect();
        let count = first.len();
        for (number, candidate) in first.into_iter().enumerate() {
            self.expected = count - number + 4 + 3 + FINALISTS;
            self.try_network(candidate, features, count - number, MIN_EPOCHS)?;
        }
        if self.fixed.hidden.is_none() {
            self.vary_hidden(nodes)?;
        }
        self.refine(refined)?;
        self.decide(all)
    }

    /// Returns `true` if even a small network has more weights than there are samples. Levenberg-Marquardt then fits
    /// noise within an epoch or two, and its epochs are expensive.
    fn is_wide(&self) -> bool {
        let set = self.samples.set;
        shape(set, FIRST_HIDDEN).weights() > set.samples()
    }

    fn first_hidden(&self) -> usize {
        if self.is_wide() {
            FIRST_HIDDEN_WIDE
        } else {
            FIRST_HIDDEN
        }
    }

    /// Compares features by ridge regression; returns the plain readings and the best others.
    fn screen_features(&mut self) -> Result<Vec<(Memory, InputChoice)>, RunError> {
        let plain = InputChoice {
            quantity: Quantity::Raw,
            scaling: self.fixed.scaling.unwrap_or_default(),
        };
        let all_memories = match &self.fixed.memory {
            Some(memory) => vec![memory.clone()],
            None if self.samples.by == SplitBy::Random => vec![Memory::default()],
            None => std::iter::once(Memory::default())
                .chain(memories(self.samples))
                .collect(),
        };
        let first = all_memories.first().cloned().unwrap_or_default();
        let mut sets: Vec<(Memory, InputChoice)> = all_memories.into_iter().map(|memory| (memory, plain)).collect();
        for quantity in [Quantity::LogResistance, Quantity::Conductance] {
            if self.suits(quantity) {
                sets.push((first.clone(), InputChoice { quantity, ..plain }));
            }
        }
        let count = sets.len();
        let mut plain_error: Option<f64> = None;
        let mut measured: Vec<(f64, (Memory, InputChoice))> = Vec::new();
        for (number, (memory, inputs)) in sets.into_iter().enumerate() {
            self.expected = count - number + FEATURE_SETS + 1 + 4 + 3 + FINALISTS;
            let width = memory.features(self.samples.set.channels());
            let work = Regression::multiplications(self.samples.set.samples(), width, self.folds.count());
            if number > 0 && self.work + work > 0.2 * self.budget() {
                continue;
            }
            let name = format!("{}, ridge", describe_features(&memory, inputs));
            self.announce(name)?;
            let Some(set) = self.samples.with_memory(&memory) else {
                continue;
            };
            let values = set.readings().mapv(|reading| inputs.quantity.of(reading));
            self.work += work;
            let error = match ridge(values.view(), set.targets(), &self.folds) {
                Ok(fit) => {
                    let errors = FoldErrors::new(&fit.squares, &variances(set.targets()), &self.folds);
                    self.record(&memory, inputs, TriedModel::Ridge, &errors, work);
                    errors.relative()
                }
                Err(_) => f64::INFINITY,
            };
            // The plain readings are always tried, and many inputs are not multiplied unless that helps.
            let plain = plain_error.get_or_insert(error);
            if number > 0 && self.is_wide() && error >= *plain {
                continue;
            }
            let rank = if number == 0 { -1.0 } else { error };
            measured.push((rank, (memory, inputs)));
        }
        measured.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        measured.truncate(1 + FEATURE_SETS);
        let mut sets: Vec<(Memory, InputChoice)> = Vec::new();
        for (_, (memory, inputs)) in measured {
            // To ridge regression, averages and their differences from the readings are the same; not to a network.
            let can_differ = self.fixed.memory.is_none() && !memory.is_empty() && inputs.quantity == Quantity::Raw;
            let differences = Memory {
                differences: true,
                ..memory.clone()
            };
            sets.push((if can_differ { differences } else { memory }, inputs));
        }
        Ok(sets)
    }

    /// Returns `true` if the quantity is defined for all readings and clearly not linear in them.
    fn suits(&self, quantity: Quantity) -> bool {
        /// Ratio of the largest to the smallest reading of a channel.
        const RATIO: f64 = 3.0;
        let readings = self.samples.set.readings();
        let is_curved = |column: ndarray::ArrayView1<'_, f64>| {
            let (low, high) = column.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), &value| {
                (low.min(value), high.max(value))
            });
            high > RATIO * low
        };
        readings.iter().all(|&reading| quantity.accepts(reading)) && readings.columns().into_iter().any(is_curved)
    }

    /// Tries other numbers of hidden nodes on the best features and on the plain readings, which need more of them, and
    /// then the second best features with the number found.
    fn vary_hidden(&mut self, share: f64) -> Result<(), RunError> {
        let Some(best) = self.best().cloned() else {
            return Ok(());
        };
        let plain = self
            .ranked()
            .into_iter()
            .map(|place| &self.networks[place].candidate)
            .find(|candidate| candidate.memory.is_empty() && !same_features(&best, candidate))
            .cloned();
        self.vary_hidden_of(&best, share)?;
        if let Some(plain) = plain {
            self.vary_hidden_of(&plain, share)?;
        }
        let hidden = self.best().map_or(self.first_hidden(), |candidate| candidate.hidden);
        let ranked = self.ranked();
        let others = ranked.iter().map(|&place| &self.networks[place].candidate);
        let second = others
            .clone()
            .find(|candidate| !same_features(&best, candidate) && !candidate.memory.is_empty())
            .cloned();
        if let Some(second) = second {
            self.expected = 1 + 3 + FINALISTS;
            self.try_network(Candidate { hidden, ..second }, share, 1, MIN_EPOCHS)?;
        }
        Ok(())
    }

    /// The scaled conjugate gradient with this weight decay for each sample.
    fn decaying(&self, decay: f64) -> Method {
        Method::ScaledConjugateGradient(ScaledConjugateGradientSettings {
            decay: decay * self.samples.set.samples() as f64,
            ..ScaledConjugateGradientSettings::default()
        })
    }

    /// Tries `base` with more hidden nodes while it helps, and with fewer if it does not.
    fn vary_hidden_of(&mut self, base: &Candidate, share: f64) -> Result<(), RunError> {
        let first = HIDDEN
            .iter()
            .position(|&hidden| hidden == self.first_hidden())
            .unwrap_or(0);
        let mut has_improved = false;
        for (place, &hidden) in HIDDEN.iter().enumerate().skip(first + 1) {
            self.expected = HIDDEN.len() - place + 1 + 3 + FINALISTS;
            if !self.improves(base, hidden, share)? {
                break;
            }
            has_improved = true;
        }
        for place in (0..first).rev() {
            self.expected = place + 2 + 3 + FINALISTS;
            if has_improved || !self.improves(base, HIDDEN[place], share)? {
                break;
            }
        }
        Ok(())
    }

    /// Tries `base` with this many hidden nodes; returns `true` if it is the best so far of those with the same features.
    fn improves(&mut self, base: &Candidate, hidden: usize, share: f64) -> Result<bool, RunError> {
        let alike = self
            .networks
            .iter()
            .filter(|network| same_features(&network.candidate, base));
        let before = alike
            .map(|network| network.best.errors.relative())
            .min_by(f64::total_cmp);
        let candidate = Candidate { hidden, ..base.clone() };
        let error = self.try_network(candidate, share, 2, MIN_EPOCHS)?;
        Ok(error.zip(before).is_some_and(|(error, before)| error < before))
    }

    /// Returns the best candidate so far.
    fn best(&self) -> Option<&Candidate> {
        self.ranked().first().map(|&place| &self.networks[place].candidate)
    }

    /// Varies scaling, regularisation and method of the best network.
    fn refine(&mut self, share: f64) -> Result<(), RunError> {
        let Some(best) = self.best().cloned() else {
            return Ok(());
        };
        let mut variants: Vec<Candidate> = Vec::new();
        if self.fixed.scaling.is_none() {
            let scaling = ScalingChoice::Whitening;
            let inputs = InputChoice { scaling, ..best.inputs };
            variants.push(Candidate { inputs, ..best.clone() });
        }
        if self.fixed.method.is_none() {
            let methods = if self.is_wide() {
                DECAYS[1..].iter().map(|&decay| self.decaying(decay)).collect()
            } else {
                vec![regularized(0.0)]
            };
            variants.extend(methods.into_iter().map(|method| Candidate { method, ..best.clone() }));
        }
        let count = variants.len();
        for (number, variant) in variants.into_iter().enumerate() {
            self.expected = count + 1 - number + FINALISTS;
            self.try_network(variant, share, count + 1 - number, MIN_EPOCHS)?;
        }
        let is_regularized = |network: &&Measured| {
            network.candidate.method == regularized(0.0) && network.best.epoch > CORRELATION_EPOCH as usize
        };
        let measured = self.networks.last().filter(is_regularized);
        if let Some(candidate) = measured.map(|network| network.candidate.clone()) {
            let method = regularized(CORRELATION_EPOCH);
            self.try_network(Candidate { method, ..candidate }, share, 1, MIN_EPOCHS)?;
        }
        Ok(())
    }

    /// Cross-validates the best candidates again as committees, and decides.
    fn decide(&mut self, share: f64) -> Result<usize, RunError> {
        let wanted = self.fixed.starts.unwrap_or(COMMITTEE);
        let ranked = self.ranked().into_iter().take(FINALISTS);
        let best: Vec<(Candidate, usize)> = ranked
            .map(|place| &self.networks[place])
            .map(|network| (network.candidate.clone(), network.best.epoch))
            .collect();
        for (number, (candidate, epochs)) in best.iter().enumerate() {
            /// Epochs beyond the best.
            const BEYOND: usize = 5;
            self.expected = best.len() - number;
            let committee = Candidate {
                starts: wanted.min(LARGEST_HIDDEN / candidate.hidden).max(1),
                ..candidate.clone()
            };
            self.try_network(committee, share, best.len() - number, epochs + BEYOND)?;
        }
        // A committee is compared with a smaller one where it was too expensive: it would hardly be worse.
        let ranked = self.ranked();
        let best = *ranked.first().ok_or(TrainingError::NothingVaries)?;
        let (errors, features) = (&self.networks[best].best.errors, &self.networks[best].candidate);
        // A few folds do not show that features are dispensable: only networks with the same are compared.
        let smallest = ranked
            .into_iter()
            .filter(|&place| same_features(&self.networks[place].candidate, features))
            .filter(|&place| self.networks[place].best.errors.is_as_good_as(errors))
            .min_by_key(|&place| self.networks[place].weights);
        Ok(smallest.unwrap_or(best))
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

fn same_features(one: &Candidate, other: &Candidate) -> bool {
    one.memory == other.memory && one.inputs == other.inputs
}
