use ndarray::ArrayView2;
use rand::Rng;

use super::{Interval, resampling::Resampling};
use crate::dataset::{Dataset, SplitBy};

/// Coefficient of determination R² of held-out answers for one target: how much of it the readings tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Determination {
    /// R² with its interval.
    pub r2: Interval,
    /// Number of independent units (blocks or groups) behind the interval.
    pub units: usize,
}

/// Degrees to which readings tell a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// Neither of the others.
    Told,
    /// R² is below 0.5: more of the target's variance remains than the readings explain.
    HardlyTold,
    /// The interval of R² reaches 0, so that always answering the mean may be as good; or R² is below 0.1, so that the
    /// error is within 5 % (√0.9) of that of the mean.
    NotTold,
}

impl Determination {
    /// Fewest units for an interval that can be relied on.
    pub const FEW_UNITS: usize = 10;

    /// Measures `answers` (samples × outputs) against the targets of `set`, target by target. The interval resamples
    /// groups if `by` is [`SplitBy::Group`], otherwise blocks in the order of the samples. `None` for a constant target,
    /// and where there are not two units.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn measure(set: &Dataset, answers: ArrayView2<'_, f64>, by: SplitBy, rng: &mut impl Rng) -> Vec<Option<Self>> {
        assert_eq!(set.targets().dim(), answers.dim());
        (0..set.outputs())
            .map(|target| Self::of_one(set, answers, target, by, rng))
            .collect()
    }

    fn of_one(
        set: &Dataset,
        answers: ArrayView2<'_, f64>,
        target: usize,
        by: SplitBy,
        rng: &mut impl Rng,
    ) -> Option<Self> {
        let truth = set.targets().column(target).to_vec();
        let count = truth.len() as f64;
        let mean = truth.iter().sum::<f64>() / count;
        let squared_error = |sample: usize| (answers[[sample, target]] - truth[sample]).powi(2);
        let errors: f64 = (0..truth.len()).map(squared_error).sum();
        let variation: f64 = truth.iter().map(|value| (value - mean).powi(2)).sum();
        if truth.iter().all(|value| *value == truth[0]) {
            return None;
        }
        let r2 = 1.0 - errors / variation;
        // By how much each sample moves R², to first order: its autocorrelation decides the blocks.
        let influence = |sample: usize| squared_error(sample) - (1.0 - r2) * (truth[sample] - mean).powi(2);
        let influences: Vec<f64> = (0..truth.len()).map(influence).collect();
        let resampling = Resampling::of(set, by, [&influences[..]]);
        if resampling.count() < 2 {
            return None;
        }
        // Count, Σe², Σ(y − ȳ) and Σ(y − ȳ)².
        let sums = resampling.sums(|sample| {
            let off = truth[sample] - mean;
            [1.0, squared_error(sample), off, off * off]
        });
        let replicates = resampling.replicates(&sums, rng, |[count, errors, off, squares]| {
            1.0 - errors / (squares - off * off / count)
        });
        Some(Self {
            r2: Interval::of_replicates(r2, &replicates)?,
            units: resampling.count(),
        })
    }

    /// Returns the degree to which the readings tell the target.
    pub fn standing(&self) -> Standing {
        if self.r2.value < 0.1 || self.r2.low <= 0.0 {
            Standing::NotTold
        } else if self.r2.value < 0.5 {
            Standing::HardlyTold
        } else {
            Standing::Told
        }
    }

    /// A sentence on the target of this name, such as "the readings do not tell y: R² 0.04 ± 0.03".
    pub fn sentence(&self, name: &str) -> String {
        let verb = match self.standing() {
            Standing::Told => "tell",
            Standing::HardlyTold => "hardly tell",
            Standing::NotTold => "do not tell",
        };
        let few = if self.units < Self::FEW_UNITS {
            format!(
                ", from only {} independent stretches or groups: give a longer recording",
                self.units
            )
        } else {
            String::new()
        };
        // Decimals that show how far a good R² is from 1.
        let digits = (1.0 - (1.0 - self.r2.value).abs().max(1e-9).log10().floor()).clamp(2.0, 6.0) as usize;
        format!("the readings {verb} {name}: R² {:.digits$}{few}", self.r2)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::normal::standard_normal;

    /// Targets and errors that follow autoregressive series, of which the answers explain `share`.
    fn recording(samples: usize, memory: f64, share: f64, seed: u64) -> (Dataset, Array2<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let step = (1.0 - memory * memory).sqrt();
        let (mut told, mut hidden) = (standard_normal(&mut rng), standard_normal(&mut rng));
        let (mut targets, mut answers) = (Array2::zeros((samples, 1)), Array2::zeros((samples, 1)));
        for sample in 0..samples {
            told = memory * told + step * standard_normal(&mut rng);
            hidden = memory * hidden + step * standard_normal(&mut rng);
            answers[[sample, 0]] = share.sqrt() * told;
            targets[[sample, 0]] = share.sqrt() * told + (1.0 - share).sqrt() * hidden;
        }
        let set = Dataset::new(targets.clone(), targets, None, (0..samples).collect()).unwrap();
        (set, answers)
    }

    fn measure(set: &Dataset, answers: &Array2<f64>, by: SplitBy) -> Option<Determination> {
        Determination::measure(set, answers.view(), by, &mut ChaCha8Rng::seed_from_u64(0))[0]
    }

    /// The truth is known by construction: R² = 0.6 for a long recording. Of 100 intervals of 95 %, about 95 hold it;
    /// percentile intervals of some dozen blocks hold it less often, single samples for blocks far less.
    #[test]
    fn intervals_hold_the_true_r2_although_samples_are_correlated() {
        for (memory, least) in [(0.0, 88), (0.9, 80)] {
            let holds = (0..100).filter(|&seed| {
                let (set, answers) = recording(1500, memory, 0.6, seed);
                let r2 = measure(&set, &answers, SplitBy::Time).unwrap().r2;
                r2.low <= 0.6 && 0.6 <= r2.high
            });
            let holds = holds.count();
            assert!(holds >= least, "memory {memory}: {holds} of 100");
        }
    }

    #[test]
    fn groups_are_drawn_whole() {
        // 20 groups of 50 equal samples are 20 pieces of evidence, not 1000.
        let (few, answers) = recording(20, 0.0, 0.5, 3);
        let repeated: Vec<usize> = (0..1000).map(|sample| sample / 50).collect();
        let set = few.select(&repeated);
        let answers = answers.select(ndarray::Axis(0), &repeated);
        let [by_group, of_few] = [
            measure(&set, &answers, SplitBy::Group).unwrap(),
            measure(&few, &few_answers(&answers), SplitBy::Group).unwrap(),
        ];
        assert_eq!((by_group.units, of_few.units), (20, 20));
        assert!((by_group.r2.half_width() / of_few.r2.half_width() - 1.0).abs() < 1e-9);
    }

    fn few_answers(repeated: &Array2<f64>) -> Array2<f64> {
        Array2::from_shape_fn((20, 1), |(sample, _)| repeated[[50 * sample, 0]])
    }

    #[test]
    fn each_standing_is_said_in_its_words() {
        for (share, words) in [
            (0.9, "the readings tell y: R² 0."),
            (0.3, "hardly tell y"),
            (0.01, "do not tell y"),
        ] {
            let (set, answers) = recording(4000, 0.0, share, 5);
            let sentence = measure(&set, &answers, SplitBy::Time).unwrap().sentence("y");
            assert!(sentence.contains(words), "{share}: {sentence}");
        }
        let (set, answers) = recording(12, 0.0, 0.9, 6);
        let few = set.select(&[0, 1, 2, 3, 4]);
        let sentence = measure(&few, &answers.select(ndarray::Axis(0), &[0, 1, 2, 3, 4]), SplitBy::Time)
            .unwrap()
            .sentence("y");
        assert!(sentence.contains("from only 5 independent"), "{sentence}");
    }

    #[test]
    fn a_constant_target_has_no_r2() {
        let zeros = Array2::zeros((30, 1));
        let set = Dataset::new(zeros.clone(), zeros.clone(), None, (0..30).collect()).unwrap();
        assert_eq!(measure(&set, &zeros, SplitBy::Time), None);
    }
}
