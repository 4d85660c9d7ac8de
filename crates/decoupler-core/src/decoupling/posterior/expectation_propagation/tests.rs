use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::*;
use crate::{
    decoupling::{
        posterior::{gaussian::RoundedReading, truncated::medians},
        row_problem::Range,
    },
    numerics::normal_cdf,
    scene::standard_normal,
};

const UNIT: Range = Range {
    lowest: 0.0,
    highest: 1.0,
};

fn alone(model: LinearModel) -> Marginals {
    let [found, ..] = Propagation::default().marginals(&[Some(model)]);
    found.unwrap()
}

fn marginals(equations: Vec<f64>, ranges: Vec<Range>) -> Vec<Marginal> {
    let model = LinearModel {
        equations,
        linear: vec![0.0; ranges.len()],
        ranges,
        rounded: Vec::new(),
        first_factors: Vec::new(),
        tolerance: TOLERANCE,
    };
    let marginals = alone(model);
    assert!(marginals.converged);
    marginals.of_unknowns
}

#[test]
fn one_unknown_is_the_truncated_normal_in_closed_form() {
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    for (mean, deviation) in [(0.5, 0.01), (0.2, 0.3), (-0.5, 0.4), (1.3, 0.2), (0.4, 50.0)] {
        let ours = marginals(vec![1.0 / deviation, mean / deviation], vec![UNIT])[0];
        let (alpha, beta) = (-mean / deviation, (1.0 - mean) / deviation);
        let mass = normal_cdf(beta) - normal_cdf(alpha);
        let ratio = (density(alpha) - density(beta)) / mass;
        let expected = mean + deviation * ratio;
        let spread = 1.0 + (alpha * density(alpha) - beta * density(beta)) / mass - ratio * ratio;
        assert!(
            (ours.mean - expected).abs() < 2e-4 * deviation.min(1.0),
            "{mean} {deviation}: {ours:?}"
        );
        assert!(
            (ours.variance / (deviation * deviation * spread) - 1.0).abs() < 2e-3,
            "{mean} {deviation}"
        );
        let below = (normal_cdf((medians(&[ours])[0] - mean) / deviation) - normal_cdf(alpha)) / mass;
        assert!((below - 0.5).abs() < 2e-3, "{mean} {deviation}: {below}");
    }
}

/// A reading with noise 1/50 that is only known to be in an interval: the density of the unknown is a difference of
/// two distribution functions, integrated here by the midpoint rule.
#[test]
fn an_interval_blurred_by_noise_is_the_difference_of_two_distribution_functions() {
    // Where both the range and the interval truncate the unknown, their factors are accurate to a fifth of its
    // spread.
    for (lowest, highest, tolerance) in [
        (0.2, 0.3, 0.02),
        (0.45, 0.452, 0.02),
        (-1.0, 0.1, 0.2),
        (0.7, f64::INFINITY, 0.2),
    ] {
        let model = LinearModel {
            equations: Vec::new(),
            linear: vec![0.0],
            ranges: vec![UNIT],
            rounded: vec![RoundedReading {
                form: vec![50.0],
                misfit: 0.0,
                range: Range {
                    lowest: 50.0 * lowest,
                    highest: 50.0 * highest,
                },
            }],
            first_factors: Vec::new(),
            tolerance: TOLERANCE,
        };
        let ours = alone(model).of_unknowns[0];
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in 0..10_000 {
            let x = (f64::from(k) + 0.5) / 1e4;
            let weight = normal_cdf(50.0 * (highest - x)) - normal_cdf(50.0 * (lowest - x));
            total += weight;
            first += weight * x;
            second += weight * x * x;
        }
        let mean = first / total;
        let deviation = (second / total - mean * mean).sqrt();
        assert!(
            (ours.mean - mean).abs() < tolerance * deviation,
            "{lowest}: {ours:?} {mean} {deviation}"
        );
        assert!(
            (ours.variance.sqrt() / deviation - 1.0).abs() < tolerance,
            "{lowest}: {ours:?} {deviation}"
        );
    }
}

#[test]
fn a_wide_box_does_not_change_the_gaussian() {
    // Equations with AᵀA = [400 250; 250 400].
    let (a, b) = (20.0, 12.5);
    let c = (400.0_f64 - b * b).sqrt();
    let truth = [0.4, 0.7];
    let wide = Range {
        lowest: -100.0,
        highest: 100.0,
    };
    let equations = vec![a, b, a * truth[0] + b * truth[1], 0.0, c, c * truth[1]];
    for (ours, truth) in marginals(equations, vec![wide; 2]).iter().zip(truth) {
        assert!((ours.mean - truth).abs() < 1e-4);
        assert!((ours.variance * (400.0 * 400.0 - 250.0 * 250.0) / 400.0 - 1.0).abs() < 1e-3);
    }
}

/// Two unknowns whose difference is known: one unknown remains, in the range that both share; the factors are
/// accurate to a fifth of its spread, and do not change down to rounding.
#[test]
fn a_combination_known_to_rounding_leaves_the_rest_unknown() {
    for deviation in [1e-4, 1e-8, 1e-12, 1e-15] {
        let equations = vec![1.0 / deviation, -1.0 / deviation, 0.5 / deviation];
        let ours = marginals(equations, vec![UNIT; 2]);
        // x − y = ½, so x is uniform from ½ to 1.
        for (ours, middle) in ours.iter().zip([0.75, 0.25]) {
            assert!((ours.mean - middle).abs() < 1e-3, "{deviation}: {ours:?}");
            assert!(
                (ours.variance.sqrt() * 48.0_f64.sqrt() - 1.0).abs() < 0.2,
                "{deviation}: {ours:?}"
            );
        }
    }
}

/// Draws uniformly from the box with weights: exact for any shape.
#[test]
fn several_correlated_unknowns_agree_with_sampling() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for trial in 0..5 {
        let n = 3;
        let noise = 0.5;
        let truth: Vec<f64> = (0..n).map(|_| rng.random()).collect();
        let mut equations = Vec::new();
        for _ in 0..4 {
            let a: Vec<f64> = (0..n).map(|_| standard_normal(&mut rng)).collect();
            let y = a.iter().zip(&truth).map(|(a, u)| a * u).sum::<f64>() + noise * standard_normal(&mut rng);
            equations.extend(a.iter().map(|a| a / noise));
            equations.push(y / noise);
        }
        let marginals = marginals(equations.clone(), vec![UNIT; n]);
        let (mut total, mut first, mut second) = (0.0, [0.0; 3], [0.0; 3]);
        for _ in 0..400_000 {
            let u: [f64; 3] = std::array::from_fn(|_| rng.random());
            let misfit: f64 = equations
                .chunks_exact(n + 1)
                .map(|row| ((0..n).map(|i| row[i] * u[i]).sum::<f64>() - row[n]).powi(2))
                .sum();
            let weight = (-0.5 * misfit).exp();
            total += weight;
            for i in 0..n {
                first[i] += weight * u[i];
                second[i] += weight * u[i] * u[i];
            }
        }
        for i in 0..n {
            let mean = first[i] / total;
            let deviation = (second[i] / total - mean * mean).sqrt();
            let ours = marginals[i];
            assert!(
                (ours.mean - mean).abs() < 0.03 * deviation,
                "{trial}: {ours:?} {mean} {deviation}"
            );
            assert!(
                (ours.variance.sqrt() / deviation - 1.0).abs() < 0.05,
                "{trial}: {ours:?} {deviation}"
            );
        }
    }
}

/// Models that converge early and late, one whose numbers overflow, and one with initial factors: alone, and in every
/// lane next to the others.
#[test]
fn models_side_by_side_are_bit_identical_to_single_ones() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let n = 3;
    let mut model = |noise: f64, offset: f64| {
        // The columns have a different order of size in each.
        let sizes: Vec<f64> = (0..n).map(|_| 10.0_f64.powf(rng.random_range(-2.0..2.0))).collect();
        let mut row = || -> Vec<f64> { (0..=n).map(|_| standard_normal(&mut rng)).collect() };
        let mut equations = Vec::new();
        for _ in 0..5 {
            let row = row();
            equations.extend(row[..n].iter().zip(&sizes).map(|(value, size)| value * size / noise));
            equations.push((row[n] + offset) / noise);
        }
        LinearModel {
            equations,
            linear: vec![0.3; n],
            ranges: vec![UNIT; n],
            rounded: Vec::new(),
            first_factors: Vec::new(),
            tolerance: TOLERANCE,
        }
    };
    let soon = model(5.0, 0.0);
    // If differences are known, all unknowns must move together.
    let of_differences = [
        [1.0, -1.0, 0.0, 0.5],
        [0.0, 1.0, -1.0, -0.2],
        [0.0; 4],
        [0.0; 4],
        [0.0; 4],
    ];
    let late = LinearModel {
        equations: of_differences.as_flattened().iter().map(|value| value / 1e-4).collect(),
        ..model(1.0, 0.0)
    };
    let overflowing = LinearModel {
        equations: vec![f64::MAX; 5 * (n + 1)],
        ..model(1.0, 0.0)
    };
    let mut warm = model(0.1, 0.5);
    let factors = alone(warm.clone()).of_unknowns;
    warm.first_factors = factors.iter().map(|marginal| marginal.factor).collect();
    let of = |found: &Option<Marginals>| {
        found.as_ref().map(|found| {
            let marginals = found.of_unknowns.iter();
            let bits = marginals.flat_map(|marginal| [marginal.mean, marginal.variance, marginal.factor.precision]);
            (found.rounds, bits.map(f64::to_bits).collect::<Vec<u64>>())
        })
    };
    let models = [soon, late, overflowing, warm];
    let by_itself = |model: &LinearModel| of(&Propagation::default().marginals(&[Some(model.clone())])[0]);
    let expected: Vec<_> = models.iter().map(by_itself).collect();
    let rounds: Vec<_> = expected
        .iter()
        .map(|found| found.as_ref().map(|found| found.0))
        .collect();
    assert!(
        rounds[0] < rounds[1] && rounds[2].is_none() && rounds[3] < rounds[1],
        "{rounds:?}"
    );
    let mut propagation = Propagation::default();
    for turn in 0..LANES {
        let place = |lane: usize| (lane + turn) % models.len();
        let together: Vec<_> = (0..LANES).map(|lane| Some(models[place(lane)].clone())).collect();
        for (lane, found) in propagation.marginals(&together).iter().enumerate() {
            assert_eq!(of(found), expected[place(lane)], "{turn} {lane}");
        }
    }
}
