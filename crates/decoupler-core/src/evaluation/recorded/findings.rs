use super::{Determination, SplitComparison, Undetermined};
use crate::{
    dataset::SplitBy,
    evaluation::{
        RunError, RunSettings,
        auto::{AutoFixed, AutoRecord, AutoSamples, TriedModel, compare_fits},
    },
    job::Job,
};

/// Findings on a recording, from the fits with which a [choice of settings](super::super::auto) begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Findings on each target.
    pub targets: Vec<TargetFindings>,
    /// Comparison with a random split, for the better of the fits.
    pub comparison: SplitComparison,
    /// What was fitted. Its leaks are targets that a memory predicts and the readings of the moment do not.
    pub record: AutoRecord,
}

/// Findings on one target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetFindings {
    /// R² of ridge regression, or the reason why it is not determined.
    pub ridge: Result<Determination, Undetermined>,
    /// R² of the better kernel ridge regression; `None` if there is none, or it is not determined.
    pub kernel: Option<Determination>,
}

impl Findings {
    /// Measures how well the readings of `samples` determine their targets, by the held-out answers of ridge and kernel ridge
    /// regression, which takes seconds: a network of few hidden nodes seldom explains more.
    ///
    /// # Errors
    /// If the samples cannot be divided, or the job is cancelled.
    pub fn measure(
        settings: &RunSettings,
        samples: &AutoSamples<'_>,
        fixed: &AutoFixed,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        let (set, by) = (samples.set, SplitBy::honest(samples.set));
        let given = compare_fits(settings, fixed, samples, job)?;
        let fixed = AutoFixed {
            memory: Some(given.answers[0].0.memory.clone()),
            ..fixed.clone()
        };
        let of_rule = |by| compare_fits(settings, &fixed, &AutoSamples { by, ..*samples }, job);
        let random = of_rule(SplitBy::Random)?;
        let honest = if samples.by == by { None } else { Some(of_rule(by)?) };
        let mut r2 = [const { Vec::new() }; 2];
        // The best comes last.
        for (tried, answers) in given.answers.iter().rev() {
            r2[usize::from(tried.model != TriedModel::Ridge)] = Determination::measure(set, answers.view(), samples.by);
        }
        let [ridge, mut kernel] = r2.map(Vec::into_iter);
        let targets = ridge.map(|ridge| TargetFindings {
            ridge,
            kernel: kernel.next().and_then(Result::ok),
        });
        Ok(Self {
            targets: targets.collect(),
            comparison: SplitComparison::of(set, by, [honest.as_ref().unwrap_or(&given), &random]),
            record: given.record,
        })
    }
}

impl TargetFindings {
    /// The larger R², and `true` if it is that of kernel ridge regression.
    pub fn best(&self) -> Option<(Determination, bool)> {
        let both = [
            self.ridge.ok().map(|ridge| (ridge, false)),
            self.kernel.map(|kernel| (kernel, true)),
        ];
        let both = both.into_iter().flatten();
        both.max_by(|(one, _), (other, _)| one.r2.value.total_cmp(&other.r2.value))
    }
}
