use faer::Mat;
use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};
use rand::{Rng, seq::SliceRandom};

use super::consequents::{NormalEquations, Penalty, mean_target, regressors, weighted};
use crate::decoupling::{
    clusters::{distance2, k_means},
    units::Units,
};

/// Candidate numbers of rules.
const RULES: [usize; 8] = [1, 2, 4, 8, 12, 16, 24, 32];
/// Number of rules (or the next smaller possible one) with which the inputs of the memberships are chosen.
const PILOT_RULES: usize = 8;
/// Candidate numbers of leading inputs for the memberships.
const COMPONENTS: [usize; 2] = [3, 10];
/// Width of the memberships, relative to the root mean square distance between centres.
const RELATIVE_WIDTH: f64 = 4.0;
/// Penalties in ascending order, relative to the mean of the diagonal of the normal equations.
const RIDGES: [f64; 5] = [1e-10, 1e-8, 1e-6, 1e-4, 1e-2];
/// Maximum number of regressors of a candidate.
const MAX_REGRESSORS: usize = 512;
/// Maximum ratio of regressors to samples: a fold must leave enough samples for its fit.
const REGRESSORS_PER_SAMPLE: f64 = 0.75;
const FOLDS: usize = 5;
/// Maximum number of samples in the cross-validation.
const MAX_VALIDATED: usize = 1000;
/// A system with more rules must reduce the mean squared error to this fraction, to avoid choosing it by chance.
const WORTHWHILE: f64 = 0.99;

/// Result of the cross-validation.
pub(super) struct Choice {
    pub antecedents: Antecedents,
    /// Penalty of each output.
    pub penalties: Vec<Penalty>,
}

/// Returns the antecedents with the minimum held-out error of all outputs in a k-fold cross-validation over `units`,
/// and for each output the best penalty, with or without `noise` of the inputs (variances).
///
/// The centres are those of all units; the consequents of each fold do not depend on its targets.
pub(super) fn choose(units: &Units, noise: &[f64], rng: &mut impl Rng) -> Choice {
    let mut order: Vec<usize> = (0..units.weights.len()).collect();
    order.shuffle(rng);
    order.truncate(MAX_VALIDATED);
    let units = Units {
        x: units.x.select(Axis(0), &order),
        y: units.y.select(Axis(0), &order),
        weights: order.iter().map(|&unit| units.weights[unit]).collect(),
    };
    let (x, y) = (units.x.view(), units.y.view());
    let first = Penalty {
        ridge: RIDGES[0],
        is_noisy: true,
    };
    let mut best = Choice {
        antecedents: Antecedents::everywhere(),
        penalties: vec![first; y.ncols()],
    };
    let Some(mean) = mean_target(&units) else {
        return best;
    };
    let targets = weighted((&y - &mean).view(), &units.weights);
    let (samples, inputs) = x.dim();
    let max_regressors = MAX_REGRESSORS.min((REGRESSORS_PER_SAMPLE * samples as f64) as usize);
    let affordable = RULES.into_iter().filter(|rules| rules * (inputs + 1) <= max_regressors);
    let affordable: Vec<usize> = affordable.collect();
    if inputs == 0 || targets.ncols() == 0 || affordable.len() < 2 {
        return best;
    }
    let mut validated = |rules: usize, components: usize, noises: &[Option<&[f64]>]| {
        let candidate = if rules == 1 {
            Antecedents::everywhere()
        } else {
            let (centres, distance) = Antecedents::clusters(x, components, rules, rng);
            Antecedents::new(centres, RELATIVE_WIDTH * distance)
        };
        let (error, penalties) = held_out(&regressors(&candidate, x, &units.weights), &targets, noises);
        let choice = Choice {
            antecedents: candidate,
            penalties,
        };
        (error, choice)
    };
    let pilot = affordable.iter().rfind(|&&rules| rules <= PILOT_RULES);
    let pilot = pilot.copied().unwrap_or(1);
    let pilots = COMPONENTS.map(|components| (validated(pilot, components, &[None, Some(noise)]), components));
    let pilot = pilots.into_iter().min_by(|a, b| a.0.0.total_cmp(&b.0.0));
    let (penalties, components) = pilot.map_or((vec![first], COMPONENTS[0]), |((_, choice), components)| {
        (choice.penalties, components)
    });
    // Noise settings that the pilot chose for no output are not tried again.
    let mut noises = [None, Some(noise)].to_vec();
    noises.retain(|noise| penalties.iter().any(|penalty| penalty.is_noisy == noise.is_some()));
    let mut min_error = f64::INFINITY;
    for rules in affordable {
        // A single rule is the linear map, whose penalty is the noise.
        let noises = if rules == 1 { &[Some(noise)] } else { &noises[..] };
        let (error, choice) = validated(rules, components, noises);
        if error < WORTHWHILE * min_error {
            min_error = error;
            best = choice;
        }
    }
    best
}

/// Sum of squared held-out errors of all outputs in a cross-validation over folds of adjacent samples, each output
/// with the best penalty and the best of `noises`, and these penalties. Larger penalties are tried until no error
/// decreases.
fn held_out(regressors: &Mat<f64>, targets: &Mat<f64>, noises: &[Option<&[f64]>]) -> (f64, Vec<Penalty>) {
    let samples = regressors.nrows();
    let folds = FOLDS.min(samples);
    let bounds = |fold: usize| fold * samples / folds..(fold + 1) * samples / folds;
    let parts: Vec<_> = (0..folds)
        .map(|fold| NormalEquations::of(regressors, targets, bounds(fold)))
        .collect();
    let empty = NormalEquations::zeros(regressors.ncols(), targets.ncols());
    let all = parts.iter().fold(empty, NormalEquations::plus);
    let others: Vec<_> = parts.iter().map(|part| all.clone().minus(part)).collect();
    // Errors of each output; infinite if a fold has no solution.
    let errors = |ridge: f64, noise: Option<&[f64]>| {
        let mut errors = vec![0.0; targets.ncols()];
        for (fold, others) in others.iter().enumerate() {
            let held_out = bounds(fold);
            let a = regressors.subrows(held_out.start, held_out.len());
            let t = targets.subrows(held_out.start, held_out.len());
            match others.consequents(ridge, noise) {
                Some(consequents) => {
                    let off = a * consequents - t;
                    let squares = off.col_iter().map(|column| column.squared_norm_l2());
                    errors.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
                }
                None => errors.fill(f64::INFINITY),
            }
        }
        errors
    };
    let first = Penalty {
        ridge: RIDGES[0],
        is_noisy: false,
    };
    let mut best = vec![(f64::INFINITY, first); targets.ncols()];
    for &noise in noises {
        let mut least = vec![f64::INFINITY; targets.ncols()];
        for ridge in RIDGES {
            let mut falls = false;
            for (output, error) in errors(ridge, noise).into_iter().enumerate() {
                falls |= error <= least[output];
                least[output] = error.min(least[output]);
                if error < best[output].0 {
                    let is_noisy = noise.is_some();
                    best[output] = (error, Penalty { ridge, is_noisy });
                }
            }
            if !falls {
                break;
            }
        }
    }
    let total = best.iter().map(|(error, _)| error).sum();
    (total, best.into_iter().map(|(_, penalty)| penalty).collect())
}

/// Antecedents of fuzzy rules: each has a Gaussian membership exp(−‖x − c‖² / 2σ²) around its centre c, a product of
/// one membership for each input, with one width σ for all inputs.
#[derive(Clone, Debug)]
pub(super) struct Antecedents {
    /// Rules × the leading inputs that memberships use.
    centres: Array2<f64>,
    /// 1 / 2σ².
    sharpness: f64,
}

impl Antecedents {
    /// One rule that holds everywhere.
    pub fn everywhere() -> Self {
        Self {
            centres: Array2::zeros((1, 0)),
            sharpness: 0.0,
        }
    }

    /// Memberships of this width around `centres`; if the width is 0, all rules fire equally.
    pub fn new(centres: Array2<f64>, width: f64) -> Self {
        let sharpness = 0.5 / (width * width);
        Self {
            centres,
            sharpness: if sharpness.is_finite() { sharpness } else { 0.0 },
        }
    }

    /// Centres of `rules` clusters of the leading `components` of the inputs `x` (samples × inputs), at most one per
    /// sample, with their root mean square distance.
    pub fn clusters(x: ArrayView2<'_, f64>, components: usize, rules: usize, rng: &mut impl Rng) -> (Array2<f64>, f64) {
        let leading = x.slice_axis(Axis(1), Slice::from(..components.min(x.ncols())));
        let centres = k_means(leading, rules.clamp(1, x.nrows()), rng);
        let pairs = centres.rows().into_iter().enumerate();
        let squares: f64 = pairs
            .flat_map(|(i, a)| centres.rows().into_iter().take(i).map(move |b| distance2(a, b)))
            .sum();
        let count = centres.nrows() * (centres.nrows() - 1) / 2;
        let distance = (squares / count.max(1) as f64).sqrt();
        (centres, distance)
    }

    /// Number of rules.
    pub fn rules(&self) -> usize {
        self.centres.nrows()
    }

    /// Logarithms of the memberships as an affine map of `inputs` inputs: slopes (rules × inputs) and offsets. They
    /// omit −‖x‖² / 2σ², which all rules share and normalisation cancels.
    pub fn logarithms(&self, inputs: usize) -> (Array2<f64>, Array1<f64>) {
        let slopes = Array2::from_shape_fn((self.rules(), inputs), |(rule, input)| {
            let coordinate = self.centres.get((rule, input)).copied().unwrap_or(0.0);
            2.0 * self.sharpness * coordinate
        });
        let offset = |centre: ndarray::ArrayView1<'_, f64>| -self.sharpness * centre.dot(&centre);
        let offsets = self.centres.rows().into_iter().map(offset).collect();
        (slopes, offsets)
    }

    /// Normalised firing strengths (samples × rules) of the inputs `x` (samples × inputs).
    pub fn firing_strengths(&self, x: ArrayView2<'_, f64>) -> Array2<f64> {
        let (slopes, offsets) = self.logarithms(x.ncols());
        // A product with a single input is computed column by column.
        let mut strengths = (x.dot(&slopes.t()) + &offsets).as_standard_layout().into_owned();
        for mut row in strengths.rows_mut() {
            normalise(row.as_slice_mut().expect("rows of a standard array are contiguous"));
        }
        strengths
    }
}

/// Converts logarithms of memberships, up to a common term, to firing strengths, whose sum is 1. The largest is
/// subtracted first to avoid 0/0: far from all centres, the nearest rule fires.
pub(super) fn normalise(strengths: &mut [f64]) {
    let largest = strengths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut total = 0.0;
    for strength in strengths.iter_mut() {
        *strength = (*strength - largest).exp();
        total += *strength;
    }
    for strength in strengths {
        *strength /= total;
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::standard_normal,
    };

    fn chosen_rules(curved: bool, seed: u64) -> usize {
        let mut rng = Seed(seed).rng(Stream::Training);
        let x = Array2::from_shape_simple_fn((300, 3), || standard_normal(&mut rng));
        let y = Array2::from_shape_fn((300, 1), |(s, _)| {
            let affine = 0.4 * x[[s, 0]] - 0.2 * x[[s, 2]] + 0.1;
            let bend = if curved { (2.0 * x[[s, 1]]).sin() } else { 0.0 };
            affine + bend + 0.05 * standard_normal(&mut rng)
        });
        let mut rng = Seed(seed).rng(Stream::Expectation);
        let weights = vec![1.0; 300];
        choose(&Units { x, y, weights }, &[0.0; 3], &mut rng)
            .antecedents
            .rules()
    }

    #[test]
    fn an_affine_target_with_noise_has_one_rule_and_a_curved_one_several() {
        for seed in 0..5 {
            assert_eq!(chosen_rules(false, seed), 1, "affine, seed {seed}");
            assert!(chosen_rules(true, seed) > 2, "curved, seed {seed}");
        }
    }

    #[test]
    fn far_from_all_centres_the_nearest_rule_fires() {
        let antecedents = Antecedents::new(array![[0.0, 0.0], [1.0, 0.0]], 0.1);
        // Both memberships are 0 in double precision.
        for far in [1e3, 1e8] {
            let strengths = antecedents.firing_strengths(array![[far, 7.0], [-far, 7.0]].view());
            assert_eq!(strengths, array![[0.0, 1.0], [1.0, 0.0]]);
        }
        let middle = antecedents.firing_strengths(array![[0.5, 1e3]].view());
        assert!((middle[[0, 0]] - 0.5).abs() < 1e-12, "{middle}");
    }

    #[test]
    fn coincident_centres_fire_equally() {
        let mut rng = Seed(0).rng(Stream::Expectation);
        let (centres, distance) = Antecedents::clusters(array![[2.0], [2.0], [2.0]].view(), 1, 2, &mut rng);
        assert_eq!((centres.nrows(), distance), (2, 0.0));
        let strengths = Antecedents::new(centres, distance).firing_strengths(array![[2.0], [-1e9]].view());
        assert_eq!(strengths, array![[0.5, 0.5], [0.5, 0.5]]);
    }
}
