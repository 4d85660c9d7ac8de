use ndarray::{Array1, Array2};
use rand::{Rng, RngExt, seq::SliceRandom};

use super::{FittedModel, Interval, evidence::Evidence};
use crate::{
    dataset::{Dataset, DividedSamples, Split, SplitBy, Stream},
    evaluation::{RunError, RunSettings, cross_validation::nth_seed},
    job::Job,
    text::format_percent,
};

/// Test error as a function of the number of training samples, for one target.
#[derive(Clone, Debug, PartialEq)]
pub struct LearningCurve {
    /// Errors at each number of samples, ascending.
    pub points: Vec<LearningPoint>,
    /// Law fitted to the points; `None` with fewer than three numbers of samples.
    pub law: Option<PowerLaw>,
    /// Ratio of the error with twice the training samples to the error with all available samples: below 1 if more
    /// samples would help; `None` without a law. It is the median over bootstrap samples of the test set and of the fits,
    /// and over laws fitted from each number of samples upwards, since laws do not hold for few samples.
    pub doubling: Option<Interval>,
    /// Standard deviation of the target in the test samples.
    pub deviation: f64,
}

/// RMSE at one number of training samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningPoint {
    /// Number of training samples.
    pub samples: usize,
    /// Mean RMSE of the fits, in the unit of the target.
    pub rmse: f64,
    /// RMSE of the best and of the worst fit.
    pub range: [f64; 2],
}

/// Squared errors of one fit on the test set.
struct TestSquares {
    samples: usize,
    /// Samples × outputs.
    squares: Array2<f64>,
}

impl LearningCurve {
    /// Number of fits at each number of samples, except with all samples.
    pub const REPEATS: usize = 4;
    /// Number of levels, which differ by factors of √2 up to all samples. Stretches shorter than an eighth of a
    /// recording miss whole regions of the input space, and their errors follow no law that could be extrapolated.
    const LEVELS: i32 = 7;
    /// Maximum number of fits of [`Self::measure`].
    pub(super) const MAX_FITS: usize = Self::LEVELS as usize * Self::REPEATS;
    /// Minimum number of training samples of a fit.
    const MIN_SAMPLES: usize = 8;
    /// Minimum relative reduction of the error with twice the samples that counts as a gain.
    const MIN_GAIN: f64 = 0.01;
    /// Error relative to the standard deviation of the target below which no more samples are asked for.
    const NEGLIGIBLE: f64 = 1e-3;

    /// Fits `model` to all training samples of `parts`, to 1/√2 of them, and so on down to an eighth, and measures the
    /// error on the test samples, target by target. Subsets of the training set are stretches of
    /// the recording, whole groups or single samples, depending on `by`, so that twice as many samples mean a recording
    /// twice as long, or twice as many groups. Takes up to 28 fits.
    ///
    /// # Errors
    /// If the settings are invalid, or the job is cancelled.
    pub fn measure(
        settings: &RunSettings,
        set: &Dataset,
        (parts, by): (&DividedSamples, SplitBy),
        model: FittedModel,
        job: &Job<'_>,
    ) -> Result<Vec<Self>, RunError> {
        let (whole, test) = (parts.split(set), parts.test_set(set));
        let mut rng = settings.seed.rng(Stream::Resampling);
        let mut fits = Vec::new();
        for level in (0..Self::LEVELS).rev() {
            let share = std::f64::consts::FRAC_1_SQRT_2.powi(level);
            let wanted = (share * whole.training.samples() as f64).round() as usize;
            if wanted < Self::MIN_SAMPLES {
                continue;
            }
            // With all samples, networks differ by their initialisation.
            let repeats = if level == 0 && model == FittedModel::Ridge {
                1
            } else {
                Self::REPEATS
            };
            for repeat in 0..repeats {
                job.check()?;
                let chosen = choose(&whole.training, wanted, by, (repeat, repeats), &mut rng);
                let split = Split {
                    training: whole.training.select(&chosen),
                    validation: whole.validation.clone(),
                };
                let seed = nth_seed(settings.seed, repeat);
                let answers = model.answers(&RunSettings { seed, ..*settings }, split, &test, job)?;
                fits.push(TestSquares {
                    samples: chosen.len(),
                    squares: (answers - test.targets()).powi(2),
                });
            }
        }
        let curve = |target| Self::of_target(&fits, &test, target, by, &mut rng);
        Ok((0..set.outputs()).map(curve).collect())
    }

    fn of_target(fits: &[TestSquares], test: &Dataset, target: usize, by: SplitBy, rng: &mut impl Rng) -> Self {
        let levels: Vec<&[TestSquares]> = fits.chunk_by(|one, other| near(one.samples, other.samples)).collect();
        let rmse = |fit: &TestSquares| fit.squares.column(target).mean().unwrap_or(0.0).sqrt();
        let points: Vec<LearningPoint> = levels.iter().map(|level| point(level, rmse)).collect();
        let law = law_of(&points);
        let doubling = law.and_then(|_| doubling(fits, &levels, &Evidence::of(test, by), target, rng));
        let deviation = test.targets().column(target).std(0.0);
        Self {
            points,
            law,
            doubling,
            deviation,
        }
    }

    /// Returns `true` if the error with all samples is at most a thousandth of the target's standard deviation.
    fn is_negligible(&self) -> bool {
        self.points
            .last()
            .is_some_and(|all| all.rmse <= Self::NEGLIGIBLE * self.deviation)
    }

    /// Returns `true` if twice the samples would lower the error significantly.
    pub fn gains(&self) -> bool {
        let is_significant = |ratio: Interval| ratio.high < 1.0 - Self::MIN_GAIN;
        !self.is_negligible() && self.doubling.is_some_and(is_significant)
    }

    /// Returns a sentence on the gain from twice the samples for the target of this name.
    pub fn sentence(&self, name: &str) -> String {
        let percent = |ratio: f64| 100.0 * (1.0 - ratio);
        match self.doubling {
            _ if self.is_negligible() => {
                let percent = format_percent(self.points.last().map(|all| 100.0 * all.rmse / self.deviation));
                format!("the error of {name} is {percent} of its standard deviation: no more samples are needed")
            }
            None => format!("too few samples to estimate the gain from more for {name}"),
            Some(ratio) if self.gains() => format!(
                "twice the samples would lower the error of {name} by about {:.0} % ({:.0} to {:.0} %)",
                percent(ratio.value),
                percent(ratio.high),
                percent(ratio.low)
            ),
            Some(ratio) => format!(
                "no gain found for {name} from more samples like these (twice as many: {:.0} %, {:.0} to {:.0} %)",
                percent(ratio.value),
                percent(ratio.high),
                percent(ratio.low)
            ),
        }
    }
}

/// Returns `true` if two numbers of samples belong to the same level: whole groups cannot be halved exactly.
fn near(one: usize, other: usize) -> bool {
    let ratio = one as f64 / other as f64;
    (0.85..1.18).contains(&ratio)
}

fn point(level: &[TestSquares], rmse: impl Fn(&TestSquares) -> f64) -> LearningPoint {
    let errors: Vec<f64> = level.iter().map(rmse).collect();
    LearningPoint {
        samples: mean_samples(level).round() as usize,
        rmse: errors.iter().sum::<f64>() / level.len() as f64,
        range: [
            errors.iter().copied().fold(f64::INFINITY, f64::min),
            errors.iter().copied().fold(0.0, f64::max),
        ],
    }
}

/// Bootstraps the ratio of the error with twice the samples to that with all: see [`LearningCurve::doubling`]. Test
/// samples are drawn in independent units (Davison and Hinkley 1997, section 3.8; Carlstein 1986).
fn doubling(
    fits: &[TestSquares],
    levels: &[&[TestSquares]],
    evidence: &Evidence,
    target: usize,
    rng: &mut impl Rng,
) -> Option<Interval> {
    const REPLICATES: usize = 1000;
    let whole = mean_samples(levels.last()?);
    let units = evidence.units(&fits.last()?.squares.column(target).to_vec());
    if units.len() < Interval::FEWEST_UNITS {
        return None;
    }
    let sum_of = |fit: &TestSquares, unit: &[usize]| unit.iter().map(|&sample| fit.squares[[sample, target]]).sum();
    let sums = Array2::from_shape_fn((fits.len(), units.len()), |(fit, unit)| {
        sum_of(&fits[fit], &units[unit])
    });
    let counts = Array1::from_iter(units.iter().map(|unit| unit.len() as f64));
    let replicate = || {
        let mut times = Array1::zeros(units.len());
        (0..units.len()).for_each(|_| times[rng.random_range(0..units.len())] += 1.0);
        let errors = (sums.dot(&times) / counts.dot(&times)).sqrt().to_vec();
        let (mut rest, mut before): (&[f64], &[f64]) = (&errors, &[]);
        let mut drawn = Vec::with_capacity(levels.len());
        for level in levels {
            let (errors, others) = rest.split_at(level.len());
            let mut pick = |errors: &[f64]| errors[rng.random_range(0..errors.len())];
            let picked = errors.iter().map(|_| pick(errors)).sum::<f64>() / errors.len() as f64;
            // A single fit varies with its samples as much as one fit of the previous level.
            let luck = if errors.len() == 1 && !before.is_empty() {
                pick(before) * before.len() as f64 / before.iter().sum::<f64>()
            } else {
                1.0
            };
            drawn.push((mean_samples(level), picked * luck));
            (rest, before) = (others, errors);
        }
        // The smallest number of samples for which the law holds is unknown, so it is drawn.
        let lowest = rng.random_range(0..=drawn.len().saturating_sub(3));
        PowerLaw::fit(&drawn[lowest..]).map_or(f64::NAN, |law| law.doubling(whole))
    };
    Interval::of_replicates(&Vec::from_iter(std::iter::repeat_with(replicate).take(REPLICATES)))
}

/// Mean number of samples of fits.
fn mean_samples(fits: &[TestSquares]) -> f64 {
    fits.iter().map(|fit| fit.samples as f64).sum::<f64>() / fits.len() as f64
}

fn law_of(points: &[LearningPoint]) -> Option<PowerLaw> {
    let points: Vec<(f64, f64)> = points.iter().map(|point| (point.samples as f64, point.rmse)).collect();
    PowerLaw::fit(&points)
}

/// Chooses about `wanted` samples for one of several repeats: a stretch that begins later with each repeat, or random
/// groups or samples.
fn choose(
    training: &Dataset,
    wanted: usize,
    by: SplitBy,
    (repeat, repeats): (usize, usize),
    rng: &mut impl Rng,
) -> Vec<usize> {
    let all = training.samples();
    match by {
        SplitBy::Time => {
            let first = (all - wanted) * repeat / (repeats - 1).max(1);
            (first..first + wanted).collect()
        }
        SplitBy::Group => {
            let mut groups = training.snapshots();
            groups.shuffle(rng);
            let mut chosen = Vec::new();
            for group in groups {
                // Chooses the nearest possible number, but at least one group.
                if !chosen.is_empty() && (chosen.len() + group.len() / 2) >= wanted {
                    break;
                }
                chosen.extend(group);
            }
            chosen.sort_unstable();
            chosen
        }
        SplitBy::Random => {
            let mut chosen: Vec<usize> = (0..all).collect();
            chosen.shuffle(rng);
            chosen.truncate(wanted);
            chosen.sort_unstable();
            chosen
        }
    }
}

/// Error as a function of the number of training samples: floor + scale · n^(−exponent), the form that learning curves
/// follow (Viering and Loog 2023, doi:10.1109/TPAMI.2022.3220744).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// Error in the limit of infinitely many samples.
    pub floor: f64,
    /// Error above the floor at one sample.
    pub scale: f64,
    /// Exponent of the decrease; 0.5 corresponds to averaging noise.
    pub exponent: f64,
}

impl PowerLaw {
    /// Fits the law to errors at numbers of samples by least squares on relative errors; `None` with fewer than three
    /// different numbers or without errors above 0. Weights are proportional to the number of samples, since the law is
    /// extrapolated beyond the largest number.
    ///
    /// For each exponent of a grid, floor and scale are the nonnegative least-squares solution.
    pub(super) fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let mut numbers: Vec<f64> = points.iter().map(|(number, _)| *number).collect();
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        if numbers.len() < 3 || points.iter().any(|(_, error)| !(*error > 0.0 && error.is_finite())) {
            return None;
        }
        let exponents = (1..=40).map(|step| f64::from(step) * 0.05);
        let laws = exponents.map(|exponent| Self::with_exponent(points, exponent));
        let best = laws.min_by(|(_, one), (_, other)| one.total_cmp(other));
        best.map(|(law, _)| law)
    }

    /// Returns the best law with this exponent, and its sum of squared relative errors.
    fn with_exponent(points: &[(f64, f64)], exponent: f64) -> (Self, f64) {
        // Weighted sums of 1·1, 1·x, x·x, 1·y and x·y, with x = n^(−exponent).
        let mut sums = [0.0; 5];
        for (number, error) in points {
            let (x, weight) = (number.powf(-exponent), number / (error * error));
            let terms = [1.0, x, x * x, *error, x * error];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
        }
        let [one, x, xx, y, xy] = sums;
        let determinant = one * xx - x * x;
        let free = ((y * xx - x * xy) / determinant, (one * xy - x * y) / determinant);
        let candidates = [free, (y / one, 0.0), (0.0, xy / xx)];
        let laws = candidates
            .into_iter()
            .filter(|(floor, scale)| *floor >= 0.0 && *scale >= 0.0);
        let judged = laws.map(|(floor, scale)| {
            let law = Self { floor, scale, exponent };
            let misses = points
                .iter()
                .map(|(number, error)| number * (law.at(*number) / error - 1.0).powi(2));
            (law, misses.sum::<f64>())
        });
        let best = judged.min_by(|(_, one), (_, other)| one.total_cmp(other));
        best.expect("the constant law of positive errors is nonnegative")
    }

    /// Returns the error at this number of samples.
    pub fn at(&self, samples: f64) -> f64 {
        self.floor + self.scale * samples.powf(-self.exponent)
    }

    /// Returns the ratio of the error with twice this many samples to the error with this many: 1 if more have no
    /// benefit.
    pub fn doubling(&self, samples: f64) -> f64 {
        self.at(2.0 * samples) / self.at(samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_recovered_from_its_values() {
        for law in [
            PowerLaw {
                floor: 0.2,
                scale: 3.0,
                exponent: 0.5,
            },
            PowerLaw {
                floor: 0.0,
                scale: 1.0,
                exponent: 0.3,
            },
            PowerLaw {
                floor: 0.5,
                scale: 0.0,
                exponent: 1.0,
            },
        ] {
            let points: Vec<(f64, f64)> = (5..12).map(|k| 2.0_f64.powi(k)).map(|n| (n, law.at(n))).collect();
            let found = PowerLaw::fit(&points).unwrap();
            for samples in [50.0, 1e3, 1e4] {
                assert!(
                    (found.at(samples) / law.at(samples) - 1.0).abs() < 1e-6,
                    "{law:?}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn no_more_samples_are_asked_for_when_the_error_is_negligible() {
        let ratio = Interval {
            value: 0.5,
            low: 0.4,
            high: 0.6,
        };
        let curve = |rmse| LearningCurve {
            points: vec![LearningPoint {
                samples: 100,
                rmse,
                range: [rmse; 2],
            }],
            law: None,
            doubling: Some(ratio),
            deviation: 2.0,
        };
        assert!(curve(0.02).gains() && curve(0.02).sentence("y").starts_with("twice the samples would lower"));
        assert!(!curve(1e-4).gains());
        assert_eq!(
            curve(1e-4).sentence("y"),
            "the error of y is 0.00500 % of its standard deviation: no more samples are needed"
        );
    }

    #[test]
    fn a_rising_curve_has_no_gain_and_two_numbers_have_no_law() {
        let rising = [(10.0, 1.0), (20.0, 1.1), (40.0, 1.3)];
        assert_eq!(PowerLaw::fit(&rising).unwrap().doubling(40.0), 1.0);
        assert_eq!(PowerLaw::fit(&[(10.0, 1.0), (20.0, 0.9), (20.0, 0.8)]), None);
        assert_eq!(PowerLaw::fit(&[(10.0, 1.0), (20.0, 0.0), (40.0, 0.5)]), None);
    }
}
