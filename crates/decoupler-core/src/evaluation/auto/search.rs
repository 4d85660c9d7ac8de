use ndarray::{Array1, Array2, ArrayView1};

use super::{
    super::{Combination, Run, RunError, RunSettings},
    AutoChoice, AutoFixed, AutoProgress, AutoRecord, AutoSamples, MULTIPLICATIONS_PER_SECOND, Tried, TriedModel,
    features::{Features, margin},
    fits::UNDETERMINED,
    folded_training::{all_for_training, residual},
    judge::Judge,
};
use crate::{
    decoupling::{Combined, Precision, Program},
    job::Job,
    machine::MemoryBudget,
    network::InputChoice,
    numerics::convex_weights,
    text::format_percent,
    training::TrainingError,
};

/// Largest ratio of the error of a member of the combination to that of the best.
const WORST_MEMBER: f64 = 1.5;
/// Smallest weight of a member, below which it is not worth its place.
const SMALLEST_WEIGHT: f64 = 0.05;

/// A candidate that was cross-validated.
pub(super) struct Candidate {
    pub(super) tried: Tried,
    /// Settings of a network, and the inputs of others.
    pub(super) settings: RunSettings,
    /// The candidate fitted to all samples; `None` for a network, which is trained if it is used.
    pub(super) program: Option<Program>,
    /// Held-out answers.
    pub(super) answers: Array2<f64>,
}

impl Candidate {
    /// Returns `true` for a network on what ridge regression leaves.
    pub(super) fn is_on_residual(&self) -> bool {
        matches!(self.tried.model, TriedModel::Network { is_on_residual, .. } if is_on_residual)
    }
}

/// A search in progress. Its candidates are named by their place in the order in which they were tried.
pub(super) struct Search<'a> {
    pub(super) base: &'a RunSettings,
    pub(super) fixed: &'a AutoFixed,
    pub(super) samples: &'a AutoSamples<'a>,
    pub(super) judge: Judge,
    pub(super) memory: MemoryBudget,
    /// Networks are tried on every so manieth sample.
    pub(super) stride: usize,
    /// Multiplications used so far.
    pub(super) work: f64,
    pub(super) candidates: Vec<Candidate>,
    /// What was found, without the candidates.
    pub(super) record: AutoRecord,
    pub(super) job: &'a Job<'a>,
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
    (budget_s, memory): (f64, MemoryBudget),
    job: &Job<'_>,
    on_progress: &mut dyn FnMut(AutoProgress),
) -> Result<AutoChoice, RunError> {
    let mut search = Search::new(base, fixed, samples, (budget_s, memory), job, on_progress)?;
    // What is cheap decides on the features.
    let (features, mut members) = search.compare_fits()?;
    let networks = search.choose_networks(&features, search.candidates[members[1]].settings.inputs)?;
    members.extend(search.try_on_residual(&features, networks[0])?);
    members.extend(networks.into_iter().rev());
    search.combine(&features, &members)
}

/// Fits with which a choice of settings begins.
pub(crate) struct Fits {
    /// Ridge and kernel ridge regression, the best first, with their held-out answers (samples × targets).
    pub(crate) answers: Vec<(Tried, Array2<f64>)>,
    /// Everything that was fitted.
    pub(crate) record: AutoRecord,
}

/// Compares what [`choose_settings`] begins with, without networks.
///
/// # Errors
/// As [`choose_settings`].
pub(crate) fn compare_fits(
    base: &RunSettings,
    fixed: &AutoFixed,
    samples: &AutoSamples<'_>,
    job: &Job<'_>,
) -> Result<Fits, RunError> {
    const BUDGET_S: f64 = 20.0;
    let (limits, mut on_progress) = ((BUDGET_S, MemoryBudget::UNLIMITED), |_| ());
    let mut search = Search::new(base, fixed, samples, limits, job, &mut on_progress)?;
    let (_, mut members) = search.compare_fits()?;
    members[1..].sort_by(|one, other| search.error(*one).total_cmp(&search.error(*other)));
    let fit = |place: &usize| {
        let Candidate { tried, answers, .. } = &search.candidates[*place];
        (tried.clone(), search.judge.mean_of_repeats(answers))
    };
    Ok(Fits {
        answers: members[1..].iter().map(fit).collect(),
        record: search.record,
    })
}

impl<'a> Search<'a> {
    fn new(
        base: &'a RunSettings,
        fixed: &'a AutoFixed,
        samples: &'a AutoSamples<'a>,
        (budget_s, memory): (f64, MemoryBudget),
        job: &'a Job<'a>,
        on_progress: &'a mut dyn FnMut(AutoProgress),
    ) -> Result<Self, RunError> {
        let judge = Judge::new(samples, Judge::FOLDS, base.seed)?;
        if judge.counted().is_empty() {
            return Err(TrainingError::NothingVaries.into());
        }
        Ok(Self {
            base,
            fixed,
            samples,
            memory,
            stride: 1,
            work: 0.0,
            candidates: Vec::new(),
            record: AutoRecord {
                budget_s,
                folds: judge.repeats[0].count(),
                by: samples.by,
                ..AutoRecord::default()
            },
            judge,
            job,
            on_progress,
        })
    }

    /// Budget in multiplications.
    pub(super) fn budget(&self) -> f64 {
        self.record.budget_s * MULTIPLICATIONS_PER_SECOND
    }

    /// Error of a candidate.
    pub(super) fn error(&self, place: usize) -> f64 {
        self.candidates[place].tried.error
    }

    /// The one with the smallest error.
    pub(super) fn best_of(&self, places: &[usize]) -> Option<usize> {
        let by_error = |one: &&usize, other: &&usize| self.error(**one).total_cmp(&self.error(**other));
        places.iter().min_by(by_error).copied()
    }

    /// Announces a candidate, and returns its record, which has no error yet.
    pub(super) fn begin(
        &mut self,
        features: &Features,
        inputs: InputChoice,
        model: TriedModel,
    ) -> Result<Tried, RunError> {
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
        let (count, features) = (self.candidates.len(), tried.features());
        let mut text = format!("Trying candidate {}: {features}, {model}", count + 1);
        if let Some(best) = self.best_of(&Vec::from_iter(0..count)) {
            text += &format!(", best error so far {}", format_percent(100.0 * self.error(best)));
        }
        let share = (self.work / self.budget()).min(1.0);
        (self.on_progress)(AutoProgress { text, share });
        Ok(tried)
    }

    /// Keeps a candidate with its held-out answers, and the program fitted to all samples. Returns its place.
    pub(super) fn keep(
        &mut self,
        mut tried: Tried,
        (answers, program): (Array2<f64>, impl Into<Option<Program>>),
        work: f64,
    ) -> usize {
        self.work += work;
        tried.seconds = work / MULTIPLICATIONS_PER_SECOND;
        (tried.error, tried.standard_error) = self.judge.error(&answers);
        let settings = RunSettings {
            inputs: tried.inputs,
            ..*self.base
        };
        self.candidates.push(Candidate {
            tried,
            settings,
            program: program.into(),
            answers,
        });
        self.candidates.len() - 1
    }

    /// Combines the members, the last of which is the network.
    pub(super) fn combine(mut self, features: &Features, members: &[usize]) -> Result<AutoChoice, RunError> {
        let (samples, targets) = (self.judge.samples(), self.samples.set.outputs());
        let of_targets = Vec::from_iter((0..targets).map(|target| self.weights(members, target)));
        let weights_of = |member: usize| Vec::from_iter(of_targets.iter().map(|weights| weights[member]));
        let counted = self.judge.counted();
        let (mut answers, mut others) = (Array2::zeros(self.judge.truth.dim()), Vec::new());
        for (member, &place) in members.iter().enumerate() {
            let weights = weights_of(member);
            answers += &(&self.candidates[place].answers * &ArrayView1::from(&weights));
            let sum: f64 = counted.iter().map(|target| weights[*target]).sum();
            self.candidates[place].tried.share = sum / counted.len().max(1) as f64;
            if member + 1 < members.len() && weights.iter().any(|weight| *weight > 0.0) {
                others.push((self.fitted(features, place)?, weights));
            }
        }
        let network = members[members.len() - 1];
        let mut settings = self.candidates[network].settings;
        settings.combine = Combination::Mean;
        let training = self.training(features, network);
        let combined = self.judge.error(&answers).0;
        let mean = self.judge.mean_of_repeats(&answers);
        let record = AutoRecord {
            tried: self.candidates.into_iter().map(|candidate| candidate.tried).collect(),
            chosen: network,
            combined: Some(combined),
            training_s: training / MULTIPLICATIONS_PER_SECOND,
            ..self.record
        };
        Ok(AutoChoice {
            settings,
            memory: features.memory.clone(),
            combined: Combined {
                network: weights_of(members.len() - 1),
                others,
                margin: margin(samples),
            },
            record,
            answers: mean,
        })
    }

    /// Weights of the members for a target: those within 1.5 times the smallest error on it, without weights that are not worth
    /// their place, and never worse than the best alone.
    fn weights(&self, members: &[usize], target: usize) -> Vec<f64> {
        let truth = self.judge.truth.column(target);
        let square = |answers: ArrayView1<'_, f64>| (&answers - &truth).mapv(|error| error * error).sum();
        let answers = |member: usize| self.candidates[members[member]].answers.column(target);
        let squares = Vec::from_iter((0..members.len()).map(|member| square(answers(member))));
        let best = squares.iter().copied().fold(f64::INFINITY, f64::min);
        let least = best / (truth.len() as f64 * truth.var(0.0)).max(f64::MIN_POSITIVE);
        let is_open = self.judge.variances[target] == 0.0 || least > UNDETERMINED;
        // The mean and ridge regression come first. Nothing else is worth a chance where nothing is determined.
        let best = if is_open { squares[0].min(squares[1]) } else { best };
        let is_among = |m: &usize| squares[*m] <= best * WORST_MEMBER.powi(2) && (*m < 2 || !is_open);
        let mut among = Vec::from_iter((0..members.len()).filter(is_among));
        loop {
            let columns = Array2::from_shape_fn((truth.len(), among.len()), |(row, place)| answers(among[place])[row]);
            let found = Array1::from(convex_weights(&columns, truth));
            if let Some(small) = found.iter().position(|weight| *weight < SMALLEST_WEIGHT) {
                among.remove(small);
                continue;
            }
            let mut weights = vec![0.0; members.len()];
            if square(columns.dot(&found).view()) > best {
                weights[squares.iter().position(|square| *square == best).unwrap_or(0)] = 1.0;
            } else {
                let found = among.iter().zip(found);
                found.for_each(|(member, weight)| weights[*member] = weight);
            }
            return weights;
        }
    }

    /// Returns the candidate fitted to all samples.
    fn fitted(&mut self, features: &Features, place: usize) -> Result<Program, RunError> {
        let candidate = &self.candidates[place];
        if let Some(program) = &candidate.program {
            return Ok(program.clone());
        }
        self.job.check()?;
        let settings = candidate.settings;
        let (mut training, mut parts) = (features.set.clone(), Vec::new());
        if candidate.is_on_residual() {
            let (ridge, left) = residual(&features.set, &settings)?;
            (training, parts) = (left, vec![ridge]);
        }
        let mut run = Run::new(settings, all_for_training(training, self.memory), None, self.job)?;
        run.finish(self.job)?;
        parts.push(run.network().program(Precision::Double));
        let ones = vec![1.0; features.set.outputs()];
        let parts = parts.into_iter().map(|part| (part, ones.clone()));
        Ok(Program::combination(&Vec::from_iter(parts)))
    }
}
