use super::{FittedModel, Interval, channel_remark::rmse_ratio};
use crate::{
    dataset::{Dataset, Folds, History, Memory, Span, SplitBy, Stream},
    evaluation::{RunError, RunSettings},
    job::Job,
};

/// Held-out error of ridge regression with a memory, compared with its error without one: whether the past helps.
#[derive(Clone, Debug, PartialEq)]
pub struct MemoryGain {
    /// The memory.
    pub memory: Memory,
    /// Ratio of the RMSE with the memory to the RMSE without, target by target; `None` if it is not determined.
    pub ratios: Vec<Option<Interval>>,
}

impl MemoryGain {
    /// Memory that is tried where none is given: averages over about 10, 100 and 1000 samples, as far as the recording
    /// has five times as many; in seconds if there are times.
    pub fn usual_memory(history: &History) -> Memory {
        let rows = history.readings().nrows();
        let counts = [10, 100, 1000].into_iter().filter(|count| 5 * count <= rows);
        let span = |count: usize| match history.interval_s() {
            Some(interval_s) => Span::Seconds(one_digit(count as f64 * interval_s)),
            None => Span::Samples(count as f64),
        };
        Memory {
            averages: counts.map(span).collect(),
            ..Memory::default()
        }
    }

    /// Compares `with`, samples with the features of `memory`, with the samples `without` by cross-validation with
    /// `folds` folds by the rule `by`.
    ///
    /// # Errors
    /// If the samples cannot be divided or scaled, or the job is cancelled.
    pub fn measure(
        settings: &RunSettings,
        memory: &Memory,
        [without, with]: [&Dataset; 2],
        (by, folds): (SplitBy, usize),
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        let folds = Folds::by(without, folds, by, &mut settings.seed.rng(Stream::Split))?;
        let held_out = |set| FittedModel::Ridge.held_out(settings, set, &folds, job);
        let (before, after) = (held_out(without)?, held_out(with)?);
        let ratio = |target| rmse_ratio(without, [after.view(), before.view()], target, by);
        Ok(Self {
            memory: memory.clone(),
            ratios: (0..without.outputs()).map(ratio).collect(),
        })
    }

    /// Returns `true` if the memory reduces the error of the target by at least 5 %, and significantly.
    pub fn helps(&self, target: usize) -> bool {
        self.ratios[target].as_ref().is_some_and(Interval::is_improvement)
    }

    /// Returns a sentence on the target of this name, such as "the past helps to predict y: …".
    pub fn sentence(&self, target: usize, name: &str) -> String {
        let memory = &self.memory;
        match &self.ratios[target] {
            None => format!("the recording is too short to say whether the past helps to predict {name}"),
            Some(ratio) if self.helps(target) => {
                format!(
                    "the past helps to predict {name}: with {memory}, the error of ridge regression is {ratio} times that without"
                )
            }
            Some(ratio) => format!(
                "the past does not clearly help to predict {name}: with {memory}, the error of ridge regression is {ratio} times \
                 that without"
            ),
        }
    }
}

/// Rounds to one significant digit.
fn one_digit(value: f64) -> f64 {
    let text = format!("{value:.0e}");
    text.parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::RngExt;

    use super::*;
    use crate::{
        dataset::{History, Seed},
        evaluation::Measured,
        scene::RowModel,
    };

    /// A reading that follows the target with a time constant of 20 samples, or at once, with noise.
    fn recording(creeps: bool) -> (Dataset, History) {
        let mut rng = Seed(4).rng(Stream::Training);
        let rows = 1200;
        let (mut readings, mut targets) = (Array2::zeros((rows, 1)), Array2::zeros((rows, 1)));
        let (mut target, mut crept) = (0.0, 0.0);
        for row in 0..rows {
            target = 0.9 * target + rng.random_range(-1.0..1.0);
            crept += 0.05 * (target - crept);
            targets[[row, 0]] = target;
            readings[[row, 0]] =
                rng.random_range(-0.3..0.3) + if creeps { 0.5 * (target + 4.0 * crept) } else { target };
        }
        let times_s = Vec::from_iter((0..rows).map(|row| 0.01 * row as f64));
        let history = History::new(readings.clone(), None, None, Some(times_s), Vec::from_iter(0..rows));
        (
            Dataset::new(readings, targets, None, Vec::from_iter(0..rows)).unwrap(),
            history,
        )
    }

    #[test]
    fn the_past_helps_where_the_sensor_creeps_and_only_there() {
        for creeps in [true, false] {
            let (set, history) = recording(creeps);
            let memory = MemoryGain::usual_memory(&history);
            assert_eq!(memory, Memory::of_averages_s(&[0.1, 1.0]));
            let with = set.with_readings(history.features(&memory).unwrap());
            let settings = RunSettings::from(Measured { rows: RowModel::Shared });
            let measured = MemoryGain::measure(
                &settings,
                &memory,
                [&set, &with],
                (SplitBy::Time, 5),
                &Job::UNINTERRUPTED,
            );
            let gain = measured.unwrap();
            assert_eq!(gain.helps(0), creeps, "{gain:?}");
            let ratio = gain.ratios[0].unwrap();
            if creeps {
                assert!(ratio.value < 0.8, "{ratio}");
                assert!(
                    gain.sentence(0, "y")
                        .starts_with("the past helps to predict y: with averages over 0.1s, 1s")
                );
            } else {
                assert!((ratio.value - 1.0).abs() < 0.05, "{ratio}");
            }
        }
    }
}
