mod exact;

use super::*;
use crate::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{LARGEST_ERROR, Solution},
    scene::{Movement, Noise, Rows, Scene},
    sensor::SensorModel,
};

fn noisy_set(model: &SensorModel, scene: &Scene, samples: usize) -> Dataset {
    let mut set = Dataset::simulate(model, scene, samples, &mut Seed(3).rng(Stream::Test)).unwrap();
    set.disturb(model, &scene.noise, &mut Seed(3).rng(Stream::TestNoise))
        .unwrap();
    set
}

/// Takes at most `steps` steps from the answer in `coordinates_mm`, which is replaced.
fn polish(
    estimator: &mut Estimator,
    row: usize,
    readings_ohm: &[f64],
    coordinates_mm: &mut [f64],
    steps: usize,
) -> Estimate {
    let mut found = None;
    estimator.solve_rows(&[row], readings_ohm, coordinates_mm, Some(steps), |estimate| {
        found = Some(estimate);
    });
    found.unwrap()
}

fn scene_with(noise: Noise) -> Scene {
    Scene {
        rows: Rows::Known,
        noise,
        ..Scene::default()
    }
}

fn all_rows(model: &SensorModel) -> Vec<usize> {
    (0..model.scale.rows()).collect()
}

/// Twice the negative logarithm of the posterior from its definition: normal readings about the resistances of the
/// model, and independent uniform nodes replaced by normal ones of the same moments. NaN is a reading left out.
fn deviance(model: &SensorModel, scene: &Scene, row: usize, readings_ohm: &[f64], z_mm: &[f64], drift: f64) -> f64 {
    let moved: Vec<glam::DVec3> = z_mm.iter().map(|&z| glam::DVec3::Z * z).collect();
    let resistances = model.row_resistances(row, &moved).unwrap();
    let noise = scene.noise;
    let gain = 1.0 + noise.drift * drift;
    let of_reading = |(reading, ohm): (&f64, f64)| {
        let predicted = gain * ohm;
        let deviation = (noise.relative * predicted).hypot(noise.additive_ohm);
        ((reading - predicted) / deviation).powi(2) + 2.0 * deviation.ln()
    };
    let pairs = readings_ohm.iter().zip(resistances);
    let of_readings: f64 = pairs.filter(|(reading, _)| !reading.is_nan()).map(of_reading).sum();
    let stroke_mm = scene.stroke_mm(&model.geometry);
    let of_prior: f64 = z_mm.iter().map(|z| 12.0 * (z / stroke_mm - 0.5).powi(2)).sum();
    of_readings + of_prior + drift * drift
}

fn depths_mm(model: &SensorModel, coordinates_mm: &[f64]) -> Vec<f64> {
    let z_mm = coordinates_mm.iter().skip(2).step_by(3);
    z_mm.map(|z| model.geometry.height_mm - z).collect()
}

/// No deformation within the bounds nearby is more probable, by the posterior computed from its definition.
#[test]
fn the_answer_maximises_the_posterior_within_the_bounds() {
    let model = SensorModel::new("4x4_2x12".parse().unwrap());
    let of_relative = Noise::relative;
    for noise in [
        of_relative(1e-4),
        of_relative(1e-2),
        of_relative(0.3),
        Noise {
            additive_ohm: 0.5,
            ..of_relative(1e-3)
        },
        Noise {
            drift: 0.05,
            ..of_relative(1e-3)
        },
    ] {
        let scene = scene_with(noise);
        let set = noisy_set(&model, &scene, 40);
        let mut estimator = Estimator::new(&model, &scene, &all_rows(&model)).unwrap();
        let mut at_bounds = 0;
        for sample in 0..set.samples() {
            let row = set.row_wire(sample).unwrap();
            // Some readings are beyond those of any deformation.
            let is_beyond = sample % 4 == 0;
            let factor = if is_beyond { 0.3 } else { 1.0 };
            let mut readings_ohm: Vec<f64> = set.sample_readings(sample).iter().map(|ohm| factor * ohm).collect();
            // Readings left out may be anything.
            let left_out = [0..0, 3..5, 0..12][sample % 3].clone();
            readings_ohm[left_out.clone()].iter_mut().for_each(|ohm| *ohm *= 7.0);
            let mut answer_mm = vec![0.0; 12];
            let found = estimator.solve_without(left_out.clone(), row, &readings_ohm, &mut answer_mm);
            let found = found.unwrap();
            readings_ohm[left_out].fill(f64::NAN);
            let readings_ohm = &readings_ohm;
            assert!(found.has_converged, "{noise:?}");
            assert!(is_beyond || found.solution == Solution::Unique, "{noise:?}");
            let z_mm = depths_mm(&model, &answer_mm);
            let stroke_mm = scene.stroke_mm(&model.geometry);
            let of = |z_mm: &[f64], drift: f64| deviance(&model, &scene, row, readings_ohm, z_mm, drift);
            let lowest = of(&z_mm, found.drift);
            at_bounds += z_mm.iter().filter(|z| **z < 1e-9 || **z > stroke_mm - 1e-9).count();
            for node in 0..4 {
                for step in [1e-4, -1e-4] {
                    let mut other = z_mm.clone();
                    other[node] = (other[node] + step).clamp(0.0, stroke_mm);
                    assert!(
                        of(&other, found.drift) > lowest - 1e-6,
                        "{noise:?}, {sample}, node {node}"
                    );
                }
            }
            if noise.drift > 0.0 {
                for step in [1e-3, -1e-3] {
                    assert!(of(&z_mm, found.drift + step) > lowest - 1e-6, "{sample}");
                }
            }
        }
        assert!(at_bounds > 0 || noise.relative > 0.1 || noise.drift > 0.0, "{noise:?}");
    }
}

/// The surprise is that of the integral over the deformation, for one node, where it is a plain sum.
#[test]
fn the_surprise_is_the_evidence_of_one_node() {
    let mut model = SensorModel::new("5x1_1x3".parse().unwrap());
    // Rows so close that all of them explain the readings.
    model.geometry.row_pitch_mm = 0.02;
    let scene = scene_with(Noise::relative(1e-2));
    let set = noisy_set(&model, &scene, 5);
    let mut estimator = Estimator::new(&model, &scene, &all_rows(&model)).unwrap();
    let readings_ohm = set.sample_readings(2);
    let mut evidence = |row: usize| {
        let found = estimator.solve(row, readings_ohm, &mut [0.0; 3]).unwrap();
        let nodes = (-4000..=8000).map(|k| f64::from(k) * 2.5e-4);
        let sum: f64 = nodes
            .map(|z| (-0.5 * (deviance(&model, &scene, row, readings_ohm, &[z], 0.0))).exp())
            .sum();
        (found.surprise, -2.0 * sum.ln())
    };
    let pairs: Vec<(f64, f64)> = (1..4).map(&mut evidence).collect();
    for pair in pairs.windows(2) {
        let (ours, truth) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
        assert!((ours - truth).abs() < 0.05 * (1.0 + truth.abs()), "{pairs:?}");
    }
}

/// The spread is the error that the noise causes, on average.
#[test]
fn errors_are_as_large_as_the_spread() {
    let model = SensorModel::new("2x1_2x6".parse().unwrap());
    let scene = scene_with(Noise::relative(1e-3));
    let set = noisy_set(&model, &scene, 400);
    let mut estimator = Estimator::new(&model, &scene, &[0, 1]).unwrap();
    let mut ratios = 0.0;
    for sample in 0..set.samples() {
        let mut answer_mm = vec![0.0; 3];
        let row = set.row_wire(sample).unwrap();
        let found = estimator
            .solve(row, set.sample_readings(sample), &mut answer_mm)
            .unwrap();
        ratios += ((answer_mm[2] - set.sample_targets(sample)[2]) / found.spread).powi(2);
    }
    let ratio = (ratios / set.samples() as f64).sqrt();
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

/// Without noise, determined rows are solved as by Newton's method, and the prior decides among the deformations that
/// explain the readings of others: the one nearest to the middle.
#[test]
fn the_prior_decides_only_what_exact_readings_leave_open() {
    let model = SensorModel::new("2x6_3x4".parse().unwrap());
    let scene = scene_with(Noise::default());
    let set = noisy_set(&model, &scene, 20);
    let mut estimator = Estimator::new(&model, &scene, &[0, 1]).unwrap();
    for sample in 0..set.samples() {
        let mut answer_mm = vec![0.0; 18];
        let row = set.row_wire(sample).unwrap();
        let readings_ohm = set.sample_readings(sample);
        let found = estimator.solve(row, readings_ohm, &mut answer_mm).unwrap();
        assert_eq!(
            (found.has_converged, found.solution),
            (true, Solution::Undetermined),
            "{sample}: {found:?}"
        );
        assert!(found.residual < 1e-13 && found.spread > 0.01, "{found:?}");
        let from_middle = |z_mm: &[f64]| z_mm.iter().map(|z| (z - 0.5).powi(2)).sum::<f64>();
        let (ours, truth) = (
            depths_mm(&model, &answer_mm),
            depths_mm(&model, set.sample_targets(sample)),
        );
        assert!(from_middle(&ours) <= from_middle(&truth) + 1e-9, "{sample}");
    }
    let model = SensorModel::new("2x6_3x18".parse().unwrap());
    let set = noisy_set(&model, &scene, 20);
    let mut estimator = Estimator::new(&model, &scene, &[0, 1]).unwrap();
    for sample in 0..set.samples() {
        let row = set.row_wire(sample).unwrap();
        let mut answer_mm = vec![0.0; 18];
        let readings_ohm = set.sample_readings(sample);
        let found = estimator.solve(row, readings_ohm, &mut answer_mm).unwrap();
        assert!(
            found.solution == Solution::Unique && found.spread <= LARGEST_ERROR,
            "{found:?}"
        );
        for (ours, truth) in answer_mm.iter().zip(set.sample_targets(sample)) {
            assert!((ours - truth).abs() < 1e-9, "{sample}: {ours} {truth}");
        }
    }
}

/// One column-wire in the middle between two nodes: its reading does not distinguish them, nor does the prior.
#[test]
fn nodes_that_readings_cannot_distinguish_get_the_same_answer() {
    let model = SensorModel::new("2x2_2x1".parse().unwrap());
    for noise in [0.0, 1e-9, 1e-3] {
        let scene = scene_with(Noise::relative(noise));
        let set = noisy_set(&model, &scene, 20);
        let mut estimator = Estimator::new(&model, &scene, &[0, 1]).unwrap();
        for sample in 0..set.samples() {
            let mut answer_mm = vec![0.0; 6];
            let row = set.row_wire(sample).unwrap();
            let found = estimator
                .solve(row, set.sample_readings(sample), &mut answer_mm)
                .unwrap();
            assert!(found.has_converged, "{noise:e}, {sample}");
            let ours = depths_mm(&model, &answer_mm);
            assert!((ours[0] - ours[1]).abs() < 1e-6, "{noise:e}, {sample}: {ours:?}");
            assert!(
                found.spread > 0.1 && (noise > 0.0 || found.solution == Solution::Undetermined),
                "{found:?}"
            );
        }
    }
}

/// Answers are finite and within the bounds whatever the sizes, units and noise, and rows of readings that the model
/// explains are solved.
#[test]
fn extremes_stay_within_the_bounds() {
    let arrays = ["1x1_1x1", "1x1_1x3", "3x4_2x12", "1x30_1x90"];
    let noises = [0.0, 1e-12, 1e-4, 1e-1, 1.0];
    for array in arrays {
        for (resistivity, compression) in [(1.0, 0.2), (1e-12, 0.2), (1e12, 0.2), (1.0, 0.999_999)] {
            for relative in noises {
                let mut model = SensorModel::new(array.parse().unwrap());
                model.resistivity_ohm_per_mm *= resistivity;
                let scene = Scene {
                    largest_compression: compression,
                    ..scene_with(Noise::relative(relative))
                };
                let set = noisy_set(&model, &scene, 3 * model.scale.rows());
                let mut estimator = Estimator::new(&model, &scene, &all_rows(&model)).unwrap();
                for sample in 0..set.samples() {
                    let mut answer_mm = vec![0.0; model.scale.coordinates_per_row()];
                    let row = set.row_wire(sample).unwrap();
                    let readings_ohm = set.sample_readings(sample);
                    let found = estimator.solve(row, readings_ohm, &mut answer_mm).unwrap();
                    let name = format!("{array} {resistivity:e} {compression} {relative:e}: {found:?}");
                    assert!(found.residual.is_finite() && found.spread >= 0.0, "{name}");
                    let highest = scene.stroke_mm(&model.geometry) * (1.0 + 1e-12);
                    assert!(
                        depths_mm(&model, &answer_mm)
                            .iter()
                            .all(|z| (-1e-12..=highest).contains(z)),
                        "{name}"
                    );
                    // Nodes that nearly touch the electrodes may have local maxima, which are flagged.
                    assert!(
                        relative == 0.0 || compression > 0.2 || found.solution != Solution::None,
                        "{name}"
                    );
                    // Readings of another sensor.
                    for factor in [1e-30, 1e30] {
                        let wild: Vec<f64> = readings_ohm.iter().map(|ohm| ohm * factor).collect();
                        estimator.solve(row, &wild, &mut answer_mm).unwrap();
                        assert!(
                            depths_mm(&model, &answer_mm)
                                .iter()
                                .all(|z| (-1e-12..=highest).contains(z))
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn sideways_movement_and_saturated_converters_converge() {
    let model = SensorModel::new("3x3_3x18".parse().unwrap());
    for (movement, converter_bits, relative) in [
        (Movement::SIDEWAYS, None, 1e-4),
        (Movement::SIDEWAYS, None, 1e-2),
        (Movement::Z, Some(4), 0.0),
        (Movement::Z, Some(16), 1e-3),
        (Movement::Z, Some(1), 0.0),
    ] {
        let scene = Scene {
            movement,
            ..scene_with(Noise {
                converter_bits,
                ..Noise::relative(relative)
            })
        };
        let set = noisy_set(&model, &scene, 60);
        let mut estimator = Estimator::new(&model, &scene, &[0, 1, 2]).unwrap();
        let converged = (0..set.samples()).filter(|&sample| {
            let row = set.row_wire(sample).unwrap();
            let found = estimator
                .solve(row, set.sample_readings(sample), &mut [0.0; 9])
                .unwrap();
            found.has_converged
        });
        let converged = converged.count();
        assert!(
            converged >= 58,
            "{movement:?} {converter_bits:?} {relative}: {converged}"
        );
    }
}

/// From an answer that is close, one step is nearly enough; none leaves it as it is.
#[test]
fn polishing_takes_at_most_the_given_steps() {
    let model = SensorModel::new("3x4_2x12".parse().unwrap());
    let scene = scene_with(Noise::relative(1e-3));
    let set = noisy_set(&model, &scene, 30);
    let mut estimator = Estimator::new(&model, &scene, &[0, 1, 2]).unwrap();
    let mut farthest = [0.0_f64; 3];
    for sample in 0..set.samples() {
        let (row, readings_ohm) = (set.row_wire(sample).unwrap(), set.sample_readings(sample));
        let mut solved_mm = vec![0.0; 12];
        estimator.solve(row, readings_ohm, &mut solved_mm).unwrap();
        for (steps, farthest) in farthest.iter_mut().enumerate() {
            let mut polished_mm: Vec<f64> = set.sample_targets(sample).to_vec();
            let found = polish(&mut estimator, row, readings_ohm, &mut polished_mm, steps);
            assert!(found.steps <= steps);
            let apart = polished_mm.iter().zip(&solved_mm).map(|(a, b)| (a - b).abs());
            *farthest = apart.fold(*farthest, f64::max);
        }
    }
    assert!(
        farthest[0] > 0.1 && farthest[1] < 0.05 && farthest[2] < 5e-3,
        "{farthest:?}"
    );
}
