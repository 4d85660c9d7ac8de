use faer::Mat;
use ndarray::Axis;
use rand::{Rng, seq::SliceRandom};

use super::{
    antecedents::Antecedents,
    consequents::{NormalEquations, Penalty, mean_target, regressors, weighted},
};
use crate::decoupling::units::Units;

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
const MAX_REGRESSORS: usize = 512;
/// Regressors of the largest system in proportion to the samples: a fold must leave enough for its fit.
const REGRESSORS_PER_SAMPLE: f64 = 0.75;
const FOLDS: usize = 5;
/// Samples that the cross-validation uses.
const MAX_VALIDATED: usize = 1000;
/// A system with more rules must reduce the mean squared error to this, so that it is not chosen by chance.
const WORTHWHILE: f64 = 0.99;

/// Choice of a cross-validation.
pub(super) struct Choice {
    pub antecedents: Antecedents,
    /// Penalty of each output.
    pub penalties: Vec<Penalty>,
}

/// The antecedents of the least held-out error of all outputs in a k-fold cross-validation over `units`, and the penalty, with
/// `noise` of the inputs (variances) or without, of the least error of each.
///
/// The centres are those of all units; the consequents of each fold know nothing of its targets.
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
    let most = MAX_REGRESSORS.min((REGRESSORS_PER_SAMPLE * samples as f64) as usize);
    let affordable = RULES.into_iter().filter(|rules| rules * (inputs + 1) <= most);
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
    // What the pilot took for no output is not tried again.
    let mut noises = [None, Some(noise)].to_vec();
    noises.retain(|noise| penalties.iter().any(|penalty| penalty.is_noisy == noise.is_some()));
    let mut least = f64::INFINITY;
    for rules in affordable {
        // A single rule is the linear map, whose penalty is the noise.
        let noises = if rules == 1 { &[Some(noise)] } else { &noises[..] };
        let (error, choice) = validated(rules, components, noises);
        if error < WORTHWHILE * least {
            least = error;
            best = choice;
        }
    }
    best
}

/// Sum of squared held-out errors of all outputs in a cross-validation over folds of adjacent samples, each output with the best
/// penalty and the best of `noises`, and these penalties. Larger ones are tried until no error falls.
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
    // Errors of each output; infinite where a fold has no solution.
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
}
