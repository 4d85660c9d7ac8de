use faer::Mat;
use ndarray::{ArrayView2, Axis};
use rand::{Rng, seq::SliceRandom};

use super::{
    antecedents::Antecedents,
    consequents::{NormalEquations, matrix, regressors},
};

/// Numbers of rules that are tried.
const RULES: [usize; 8] = [1, 2, 4, 8, 12, 16, 24, 32];
/// Number of rules, or the next smaller one possible, with which the inputs of the memberships are chosen.
const PILOT_RULES: usize = 8;
/// Leading inputs that memberships look at.
const COMPONENTS: [usize; 2] = [3, 10];
/// Width of the memberships in proportion to the root mean square distance between centres.
const RELATIVE_WIDTH: f64 = 4.0;
/// Penalties in ascending order, in proportion to the mean of the diagonal of the normal equations.
const RIDGES: [f64; 5] = [1e-10, 1e-8, 1e-6, 1e-4, 1e-2];
/// Regressors of the largest system tried.
const MOST_REGRESSORS: usize = 512;
/// Regressors of the largest system in proportion to the samples: a fold must leave enough for its fit.
const REGRESSORS_PER_SAMPLE: f64 = 0.75;
const FOLDS: usize = 5;
/// Samples that the cross-validation uses.
const MOST_VALIDATED: usize = 1000;
/// A system with more rules must reduce the mean squared error to this, so that it is not chosen by chance.
const WORTHWHILE: f64 = 0.99;

/// Choice of a cross-validation.
pub(super) struct Choice {
    pub antecedents: Antecedents,
    pub ridge: f64,
    /// True if the consequents are those expected with noise of the inputs.
    pub is_noisy: bool,
}

/// The antecedents and penalty, with `noise` of the inputs (variances) or without, of the least held-out error of `y` (samples × outputs) on `x` (samples × inputs) in
/// a k-fold cross-validation.
///
/// The centres are those of all samples; the consequents of each fold know nothing of its targets.
pub(super) fn choose(x: ArrayView2<'_, f64>, y: ArrayView2<'_, f64>, noise: &[f64], rng: &mut impl Rng) -> Choice {
    let mut order: Vec<usize> = (0..x.nrows()).collect();
    order.shuffle(rng);
    order.truncate(MOST_VALIDATED);
    let (x, y) = (x.select(Axis(0), &order), y.select(Axis(0), &order));
    let mut best = Choice {
        antecedents: Antecedents::everywhere(),
        ridge: RIDGES[0],
        is_noisy: true,
    };
    let Some(mean) = y.mean_axis(Axis(0)) else {
        return best;
    };
    let targets = matrix((&y - &mean).view());
    let (samples, inputs) = x.dim();
    let most = MOST_REGRESSORS.min((REGRESSORS_PER_SAMPLE * samples as f64) as usize);
    let affordable = RULES.into_iter().filter(|rules| rules * (inputs + 1) <= most);
    let affordable: Vec<usize> = affordable.collect();
    if inputs == 0 || targets.ncols() == 0 || affordable.len() < 2 {
        return best;
    }
    let mut validated = |rules: usize, components: usize, noises: &[Option<&[f64]>]| {
        let candidate = if rules == 1 {
            Antecedents::everywhere()
        } else {
            let (centres, distance) = Antecedents::clusters(x.view(), components, rules, rng);
            Antecedents::new(centres, RELATIVE_WIDTH * distance)
        };
        let (error, ridge, noise) = held_out(&regressors(&candidate, x.view()), &targets, noises);
        let choice = Choice {
            antecedents: candidate,
            ridge,
            is_noisy: noise.is_some(),
        };
        (error, choice)
    };
    let pilot = affordable.iter().rfind(|&&rules| rules <= PILOT_RULES);
    let pilot = pilot.copied().unwrap_or(1);
    let pilots = COMPONENTS.map(|components| (validated(pilot, components, &[None, Some(noise)]), components));
    let pilot = pilots.into_iter().min_by(|a, b| a.0.0.total_cmp(&b.0.0));
    let chosen = pilot.map(|((_, choice), components)| (components, choice.is_noisy));
    let (components, is_noisy) = chosen.unwrap_or((COMPONENTS[0], true));
    let mut least = f64::INFINITY;
    for rules in affordable {
        // A single rule is the linear map, whose penalty is the noise.
        let noise = (is_noisy || rules == 1).then_some(noise);
        let (error, choice) = validated(rules, components, &[noise]);
        if error < WORTHWHILE * least {
            least = error;
            best = choice;
        }
    }
    best
}

/// Sum of squared held-out errors in a cross-validation over folds of adjacent samples with the best penalty and the best of
/// `noises`, and these two. Larger penalties are tried until the error rises.
fn held_out<'a>(
    regressors: &Mat<f64>,
    targets: &Mat<f64>,
    noises: &[Option<&'a [f64]>],
) -> (f64, f64, Option<&'a [f64]>) {
    let samples = regressors.nrows();
    let folds = FOLDS.min(samples);
    let bounds = |fold: usize| fold * samples / folds..(fold + 1) * samples / folds;
    let parts: Vec<_> = (0..folds)
        .map(|fold| NormalEquations::of(regressors, targets, bounds(fold)))
        .collect();
    let empty = NormalEquations::zeros(regressors.ncols(), targets.ncols());
    let all = parts.iter().fold(empty, NormalEquations::plus);
    let others: Vec<_> = parts.iter().map(|part| all.clone().minus(part)).collect();
    let mut best = (f64::INFINITY, RIDGES[0], None);
    for &noise in noises {
        let mut least = f64::INFINITY;
        for ridge in RIDGES {
            let errors = others.iter().enumerate().map(|(fold, others)| {
                let held_out = bounds(fold);
                let a = regressors.subrows(held_out.start, held_out.len());
                let t = targets.subrows(held_out.start, held_out.len());
                (a * others.consequents(ridge, noise) - t).squared_norm_l2()
            });
            let error: f64 = errors.sum();
            if error > least {
                break;
            }
            least = error;
            if error < best.0 {
                best = (error, ridge, noise);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    use crate::{
        dataset::{Seed, Stream},
        scene::normal::standard_normal,
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
        choose(x.view(), y.view(), &[0.0; 3], &mut rng).antecedents.rules()
    }

    #[test]
    fn an_affine_target_with_noise_has_one_rule_and_a_curved_one_several() {
        for seed in 0..5 {
            assert_eq!(chosen_rules(false, seed), 1, "affine, seed {seed}");
            assert!(chosen_rules(true, seed) > 2, "curved, seed {seed}");
        }
    }
}
