use rand::{Rng, seq::SliceRandom};

use super::FittedModel;
use crate::{
    dataset::{Dataset, DividedSamples, Split, SplitBy, Stream},
    evaluation::{RunError, RunSettings, cross_validation::nth_seed},
    job::Job,
};

/// Test errors of several fits to about the same number of training samples: a point of the learning curve.
#[derive(Clone, Debug, PartialEq)]
pub struct LearningPoint {
    /// Mean number of training samples of the fits.
    pub samples: usize,
    /// Mean RMSE of the fits for each target, in its unit.
    pub rmse: Vec<f64>,
    /// RMSE of the best and of the worst fit for each target.
    pub range: Vec<[f64; 2]>,
}

impl LearningPoint {
    /// Number of fits at each number of samples, except with all samples.
    const REPEATS: usize = 4;
    /// Number of levels, which differ by factors of √2 up to all samples. Stretches shorter than an eighth of a
    /// recording miss whole regions of the input space.
    const LEVELS: i32 = 7;
    /// Maximum number of fits of [`Self::measure`].
    pub(super) const MAX_FITS: usize = Self::LEVELS as usize * Self::REPEATS;
    /// Minimum number of training samples of a fit.
    const MIN_SAMPLES: usize = 8;

    /// Fits `model` to all training samples of `parts`, to 1/√2 of them, and so on down to an eighth, and measures the
    /// error on the test samples; returns the points by ascending number of samples. Subsets of the training set are
    /// stretches of the recording, whole groups or single samples, depending on `by`. Takes up to 28 fits.
    ///
    /// # Errors
    /// If the settings are invalid, or the job is cancelled.
    pub(super) fn measure(
        settings: &RunSettings,
        set: &Dataset,
        (parts, by): (&DividedSamples, SplitBy),
        model: FittedModel,
        job: &Job<'_>,
    ) -> Result<Vec<Self>, RunError> {
        let (whole, test) = (parts.split(set), parts.test_set(set));
        let mut rng = settings.seed.rng(Stream::Resampling);
        let mut fits: Vec<(usize, Vec<f64>)> = Vec::new();
        for level in (0..Self::LEVELS).rev() {
            let share = std::f64::consts::FRAC_1_SQRT_2.powi(level);
            let wanted = (share * whole.training.samples() as f64).round() as usize;
            if wanted < Self::MIN_SAMPLES {
                continue;
            }
            // With all samples, networks differ by their initialisation.
            let is_the_same = level == 0 && model == FittedModel::Ridge;
            let repeats = if is_the_same { 1 } else { Self::REPEATS };
            for repeat in 0..repeats {
                job.check()?;
                let chosen = choose(&whole.training, wanted, by, (repeat, repeats), &mut rng);
                let split = Split {
                    training: whole.training.select(&chosen),
                    validation: whole.validation.clone(),
                };
                let seed = nth_seed(settings.seed, repeat);
                let answers = model.answers(&RunSettings { seed, ..*settings }, split, &test, job)?;
                let squares = (answers - test.targets()).powi(2);
                let rmse = squares.columns().into_iter().map(|of| of.mean().unwrap_or(0.0).sqrt());
                fits.push((chosen.len(), rmse.collect()));
            }
        }
        // Whole groups cannot be halved exactly.
        let is_near = |one: &(usize, _), other: &(usize, _)| (0.85..1.18).contains(&(one.0 as f64 / other.0 as f64));
        let levels = fits.chunk_by(is_near);
        Ok(levels.map(|fits| Self::of(fits, set.outputs())).collect())
    }

    fn of(fits: &[(usize, Vec<f64>)], targets: usize) -> Self {
        let count = fits.len() as f64;
        let errors = |target: usize| fits.iter().map(move |(_, rmse)| rmse[target]);
        Self {
            samples: (fits.iter().map(|(samples, _)| *samples as f64).sum::<f64>() / count).round() as usize,
            rmse: (0..targets).map(|target| errors(target).sum::<f64>() / count).collect(),
            range: (0..targets)
                .map(|target| {
                    [
                        errors(target).fold(f64::INFINITY, f64::min),
                        errors(target).fold(0.0, f64::max),
                    ]
                })
                .collect(),
        }
    }
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
    let mut units = match by {
        SplitBy::Time => {
            let first = (all - wanted) * repeat / (repeats - 1).max(1);
            return (first..first + wanted).collect();
        }
        SplitBy::Group => training.snapshots(),
        SplitBy::Random => (0..all).map(|sample| vec![sample]).collect(),
    };
    units.shuffle(rng);
    let mut chosen = Vec::new();
    for unit in units {
        // Chooses the nearest possible number, but at least one unit.
        if !chosen.is_empty() && (chosen.len() + unit.len() / 2) >= wanted {
            break;
        }
        chosen.extend(unit);
    }
    chosen.sort_unstable();
    chosen
}
