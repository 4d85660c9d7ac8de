use super::{super::RunError, AutoSamples, TriedModel, features::Features, judge::Judge, search::Search};
use crate::{
    dataset::{Memory, Span, SplitBy},
    decoupling::{KernelShape, Program, Regression},
    network::{InputChoice, Quantity, ScalingChoice},
    training::TrainingError,
};

/// Share of the variance that the best candidate leaves of a target that is not determined.
pub(super) const UNDETERMINED: f64 = 0.95;
/// Shares of the variance that the readings of the moment and a memory leave of a target that may leak.
const LEAK: [f64; 2] = [0.75, 0.4];

impl Search<'_> {
    /// Tries the mean, ridge and kernel ridge regression on the readings and on their memories, and decides which targets count
    /// and which features are used. Returns the features, and the mean, ridge and kernel ridge regression on them.
    pub(super) fn compare_fits(&mut self) -> Result<(Features, Vec<usize>), RunError> {
        let mut features = Features::of(self.samples, &Memory::default()).ok_or(TrainingError::NothingVaries)?;
        let mut ridges = Vec::new();
        for quantity in [Quantity::Raw, Quantity::LogResistance, Quantity::Conductance] {
            if features.suits(quantity) {
                ridges.extend(self.try_ridge(&features, quantity)?);
            }
        }
        let ridge = self.best_of(&ridges).ok_or(TrainingError::NothingVaries)?;
        let quantity = self.candidates[ridge].settings.inputs.quantity;
        let mut members = self.with_ridge(&features, ridge)?;
        let mut past = Vec::new();
        let memories = match &self.fixed.memory {
            Some(memory) => vec![memory.clone()],
            // Differences have no logarithms and reciprocals.
            None => averages(self.samples, quantity == Quantity::Raw, self.fixed.tries_memory),
        };
        for memory in memories.into_iter().filter(|memory| !memory.is_empty()) {
            if let Some(with) = Features::of(self.samples, &memory) {
                let ridge = self.try_ridge(&with, with.quantity(quantity))?;
                past.extend(ridge.map(|ridge| (with, ridge)));
            }
        }
        let unexplained = self.find_leaks(&members, &past);
        if let Some((with, ridge)) = self.clearly_best(&features, (quantity, &unexplained), past)? {
            members = self.with_ridge(&with, ridge)?;
            features = with;
        }
        self.leave_out_open(&features, &members);
        for candidate in &mut self.candidates {
            let tried = &mut candidate.tried;
            (tried.error, tried.standard_error) = self.judge.error(&candidate.answers);
        }
        Ok((features, members))
    }

    /// Tries the mean and kernel ridge regression on the features of this ridge regression, with as many centres as a quarter of
    /// the budget allows. Returns all four.
    fn with_ridge(&mut self, features: &Features, ridge: usize) -> Result<Vec<usize>, RunError> {
        const CENTRES: [usize; 5] = [1000, 700, 450, 300, 150];
        let of_mean = |samples: &[usize]| Ok(Program::mean(&features.set.select(samples)));
        let tried = self.begin(features, InputChoice::MEASURED, TriedModel::Mean)?;
        let mean = features.fitted(&self.judge, Quantity::Raw, of_mean)?;
        let mut members = vec![self.keep(tried, mean, 0.0), ridge];
        let inputs = InputChoice {
            scaling: self.fixed.scaling.unwrap_or_default(),
            ..self.candidates[ridge].settings.inputs
        };
        self.candidates[ridge].settings.inputs = inputs;
        let (samples, parts) = (self.judge.samples(), self.judge.parts());
        let (folds, repeats) = (self.judge.repeats[0].count(), self.judge.repeats.len());
        let work = |subset: usize| {
            let [choice, fit] = KernelShape::multiplications(samples, folds, subset);
            let centres = if samples <= 4 * subset { samples } else { subset };
            let answers = samples * centres * (features.set.channels() + 10);
            choice + (parts + 1) as f64 * fit + (repeats * answers) as f64
        };
        let is_affordable = |subset: &usize| 2.0 * work(*subset) < 0.25 * self.budget();
        if let Some(subset) = CENTRES.into_iter().find(is_affordable) {
            for is_linear in [false, true] {
                let tried = self.begin(features, inputs, TriedModel::Kernel { is_linear })?;
                let fitted = features.kernel(&self.judge, (inputs, is_linear, subset));
                members.extend(fitted.ok().map(|fitted| self.keep(tried, fitted, work(subset))));
            }
        }
        Ok(members)
    }

    fn try_ridge(&mut self, features: &Features, quantity: Quantity) -> Result<Option<usize>, RunError> {
        let inputs = InputChoice {
            quantity,
            scaling: ScalingChoice::MinMax,
        };
        let sizes = (self.judge.samples(), features.set.channels(), self.judge.parts());
        let work = Regression::multiplications(sizes.0, sizes.1, sizes.2);
        if !self.candidates.is_empty() && work > 0.05 * self.budget() {
            return Ok(None);
        }
        let tried = self.begin(features, inputs, TriedModel::Ridge)?;
        let fitted = features.ridge(&self.judge, quantity).ok();
        Ok(fitted.map(|fitted| self.keep(tried, fitted, work)))
    }

    /// Smallest share of the variance of a target that any of these leaves.
    fn least(&self, target: usize, places: impl Iterator<Item = usize>) -> f64 {
        let left = places.map(|place| self.judge.unexplained(target, &self.candidates[place].answers));
        left.fold(f64::INFINITY, f64::min)
    }

    /// Finds targets that the readings of the moment hardly explain, and records those of them that a memory predicts.
    fn find_leaks(&mut self, now: &[usize], past: &[(Features, usize)]) -> Vec<usize> {
        let mut unexplained = self.judge.counted();
        unexplained.retain(|target| self.least(*target, now.iter().copied()) > LEAK[0]);
        for &target in &unexplained {
            let now = self.least(target, now.iter().copied());
            let then = self.least(target, past.iter().map(|(_, ridge)| *ridge));
            if then < LEAK[1] {
                self.record.leaks.push((target, [1.0 - now, 1.0 - then]));
            }
        }
        unexplained
    }

    /// Returns the features with the lowest error of ridge regression among those that are clearly better than the readings of the
    /// moment, by this quantity, or that were asked for.
    fn clearly_best(
        &self,
        plain: &Features,
        (quantity, unexplained): (Quantity, &[usize]),
        past: Vec<(Features, usize)>,
    ) -> Result<Option<(Features, usize)>, RunError> {
        if past.is_empty() {
            return Ok(None);
        }
        // Ridge regression takes little time, and more folds show more clearly whether a memory is better.
        let mut judge = Judge::new(self.samples, 2 * Judge::FOLDS, self.base.seed)?;
        // A memory must not win by what may be a leak, or by averages of noise that follow the order of recording.
        unexplained.iter().for_each(|target| judge.variances[*target] = 0.0);
        let (of_plain, _) = plain.ridge(&judge, quantity)?;
        let (tried, mut best) = (past.len(), None);
        let mut least = f64::INFINITY;
        for (with, ridge) in past {
            let (answers, _) = with.ridge(&judge, with.quantity(quantity))?;
            let is_better = judge.is_clearly_better(&answers, &of_plain, tried) || self.fixed.memory.is_some();
            if is_better && self.error(ridge) < least {
                (least, best) = (self.error(ridge), Some((with, ridge)));
            }
        }
        Ok(best)
    }

    /// Lets only those targets count that a member explains, unless none does.
    fn leave_out_open(&mut self, features: &Features, members: &[usize]) {
        let is_leak = |target: &usize| self.record.leaks.iter().any(|(leak, _)| leak == target);
        let varying = self.judge.counted();
        let is_open = |target: &usize| {
            features.memory.is_empty() && is_leak(target) || self.least(*target, members.iter().copied()) > UNDETERMINED
        };
        let open = Vec::from_iter(varying.iter().copied().filter(is_open));
        if open.len() < varying.len() {
            open.iter().for_each(|target| self.judge.variances[*target] = 0.0);
            self.record.undetermined = open;
        }
    }
}

/// Returns memories to try: exponential averages with time constants from a few samples to a tenth of the recording, since
/// some sensors forget within a moment and others creep for hours. There are none without times, unless they are `wanted`.
fn averages(samples: &AutoSamples<'_>, differences: bool, are_wanted: bool) -> Vec<Memory> {
    /// Shortest time constant in samples.
    const SHORTEST: f64 = 3.0;
    /// Number of time constants, spread evenly in their logarithm.
    const CONSTANTS: i32 = 5;
    /// Those of each memory.
    const SETS: [&[i32]; 5] = [&[0, 1], &[1, 2], &[2, 3], &[3, 4], &[0, 2, 4]];
    // Neighbours in different folds give each other away.
    let past = samples.past.filter(|_| samples.by != SplitBy::Random);
    let Some((history, _)) = past.filter(|(history, _)| are_wanted || history.times_s().is_some()) else {
        return Vec::new();
    };
    let interval_s = history.interval_s();
    let ratio = (samples.set.samples() as f64 / 10.0 / SHORTEST).max(2.0);
    let span = |place: &i32| {
        let length = SHORTEST * ratio.powf(f64::from(*place) / f64::from(CONSTANTS - 1));
        match interval_s {
            // Two significant digits.
            Some(interval_s) => Span::Seconds(format!("{:.1e}", length * interval_s).parse().expect("a number")),
            None => Span::Samples(length.round()),
        }
    };
    let memory = |places: &[i32]| Memory {
        averages: places.iter().map(span).collect(),
        differences,
        interval_s,
        ..Memory::default()
    };
    SETS.into_iter().map(memory).collect()
}
