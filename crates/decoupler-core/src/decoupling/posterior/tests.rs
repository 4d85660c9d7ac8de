use super::*;
use crate::{
    dataset::{Dataset, Seed, Stream},
    scene::{Movement, Noise},
};

/// A case of `tests/fixtures/posterior.py`, which integrates or samples the exact posterior.
#[derive(serde::Deserialize)]
struct Case {
    array: String,
    relative: f64,
    additive_ohm: f64,
    drift: f64,
    readings_ohm: Vec<f64>,
    medians_mm: Vec<f64>,
    deviations_mm: Vec<f64>,
}

#[test]
fn medians_match_the_exact_posterior() {
    let cases: Vec<Case> = serde_json::from_str(include_str!("../../../tests/fixtures/posterior.json")).unwrap();
    for case in cases {
        let model = SensorModel::new(case.array.parse().unwrap());
        let scene = Scene {
            noise: Noise {
                relative: case.relative,
                additive_ohm: case.additive_ohm,
                drift: case.drift,
                ..Noise::default()
            },
            ..Scene::default()
        };
        let mut posterior = Posterior::new(&model, &scene, &[0], &mut Seed(1).rng(Stream::Expectation)).unwrap();
        let mut coordinates = vec![0.0; model.scale.coordinates_per_row()];
        let report = posterior.solve(0, &case.readings_ohm, &mut coordinates).unwrap();
        let ours: Vec<f64> = coordinates
            .chunks_exact(3)
            .map(|node| model.geometry.height_mm - node[2])
            .collect();
        // Gains and noise in ohm are linearised as well.
        let tolerance = if case.additive_ohm > 0.0 || case.drift > 0.0 {
            0.03
        } else {
            0.015
        };
        for ((ours, exact), deviation) in ours.iter().zip(&case.medians_mm).zip(&case.deviations_mm) {
            let apart = (ours - exact) / deviation;
            assert!(apart.abs() < tolerance, "{} {}: {apart}", case.array, case.relative);
        }
        let squares = case.deviations_mm.iter().map(|deviation| deviation * deviation);
        let spread_mm = (squares.sum::<f64>() / case.deviations_mm.len() as f64).sqrt();
        assert!((report.spread_mm / spread_mm - 1.0).abs() < 0.02);
    }
}

/// Mean errors of z of the limit and of the decoder, relative to those of the mid-range answer.
fn shares(array: &str, movement: Movement, noise: Noise, samples: usize) -> (f64, f64) {
    let model = SensorModel::new(array.parse().unwrap());
    let scene = Scene {
        movement,
        noise,
        ..Scene::default()
    };
    let rows = model.scale.rows();
    let mut set = Dataset::simulate(&model, &scene, samples * rows, &mut Seed(1).rng(Stream::Test)).unwrap();
    set.disturb(&model, &scene.noise, &mut Seed(1).rng(Stream::TestNoise))
        .unwrap();
    let mut posterior = Posterior::new(&model, &scene, &[0], &mut Seed(1).rng(Stream::Expectation)).unwrap();
    let (mut limits, mut answers, mut middles) = (0.0, 0.0, 0.0);
    for sample in (0..set.samples()).step_by(rows) {
        let (readings, truth) = (set.sample_readings(sample), set.sample_targets(sample));
        let mut limit = truth.to_vec();
        assert!(posterior.limit(0, readings, truth, &mut limit), "{array} {noise:?}");
        let mut answer = truth.to_vec();
        posterior.solve(0, readings, &mut answer).unwrap();
        for z in (2..truth.len()).step_by(3) {
            limits += (limit[z] - truth[z]).abs();
            answers += (answer[z] - truth[z]).abs();
            middles += (4.5 - truth[z]).abs();
        }
    }
    (limits / middles, answers / middles)
}

/// 30 sideways unknowns with a condition number near 1e14, and 6 unknowns with 4 readings: the smallest noise leaves
/// some patterns undetermined, and more noise never leaves fewer.
#[test]
fn no_noise_is_too_small_for_a_posterior() {
    for (array, movement) in [("10x10_5x30", Movement::SIDEWAYS), ("2x6_3x4", Movement::Z)] {
        let mut last = 0.0;
        for noise in [0.0, 1e-15, 1e-12, 9.9e-9, 1.01e-8, 1e-7, 1e-5, 1e-3] {
            let (limit, answer) = shares(array, movement, Noise::relative(noise), 6);
            assert!(
                limit > 1e-3 && limit < 1.0 && limit > 0.98 * last,
                "{array} {noise}: {limit} {last:?}"
            );
            // With 14 decades between the patterns, a decoder that does not know the linearisation point is worse
            // than the limit.
            let most = (1.05 * limit).max(if movement == Movement::Z { 0.0 } else { 0.6 });
            assert!(answer < most, "{array} {noise}: {answer} {limit}");
            last = limit;
        }
    }
}

#[test]
fn overwhelming_noise_gives_the_middle() {
    let additive = |additive_ohm| Noise {
        additive_ohm,
        ..Noise::default()
    };
    for noise in [1e3, 1e4, 1e100, 1e155, 1e300].map(additive) {
        let (limit, answer) = shares("2x2_2x6", Movement::Z, noise, 300);
        assert!(
            (limit - 1.0).abs() < 0.02 && (answer - 1.0).abs() < 0.02,
            "{noise:?}: {limit} {answer}"
        );
    }
}

#[test]
fn a_coarse_converter_is_never_worse_than_the_middle() {
    let mut last = 0.0;
    for converter_bits in [32, 24, 16, 12, 8, 6, 4, 2, 1].map(Some) {
        let noise = Noise {
            converter_bits,
            ..Noise::default()
        };
        let (limit, answer) = shares("2x2_2x6", Movement::Z, noise, 100);
        assert!(
            limit < 1.02 && limit > 0.98 * last,
            "{converter_bits:?}: {limit} after {last}"
        );
        assert!(answer < 1.02, "{converter_bits:?}: {answer}");
        last = limit;
    }
}

/// From 1e-3 down to zero, past the rounding of the readings, below which noise has no effect.
#[test]
fn vanishing_noise_turns_into_rounding_smoothly() {
    let model = SensorModel::new("2x4_2x12".parse().unwrap());
    let set = Dataset::simulate(&model, &Scene::default(), 4, &mut Seed(1).rng(Stream::Test)).unwrap();
    let solved = |noise| {
        let noise = Noise::relative(noise);
        let scene = Scene {
            noise,
            ..Scene::default()
        };
        let mut posterior = Posterior::new(&model, &scene, &[1], &mut Seed(1).rng(Stream::Expectation)).unwrap();
        let mut coordinates = vec![0.0; 12];
        let report = posterior.solve(1, set.sample_readings(3), &mut coordinates).unwrap();
        assert!(report.converged, "{noise:?}: {report:?}");
        let errors = coordinates
            .iter()
            .zip(set.sample_targets(3))
            .map(|(a, b)| (a - b).abs());
        (report, errors.fold(0.0, f64::max))
    };
    let mut last = f64::INFINITY;
    for noise in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-18] {
        let (report, error_mm) = solved(noise);
        assert!(report.spread_mm < last, "{noise}: {report:?} {last}");
        assert!(error_mm < 10.0 * report.spread_mm, "{noise}: {error_mm} {report:?}");
        last = report.spread_mm;
    }
    let (report, error_mm) = solved(0.0);
    assert!((report.spread_mm / last - 1.0).abs() < 1e-5, "{report:?} {last}");
    assert!(
        report.determined && report.spread_mm < 1e-10 && error_mm < 1e-10,
        "{report:?} {error_mm}"
    );
}

#[test]
fn limits_side_by_side_match_single_rows() {
    let model = SensorModel::new("7x3_2x9".parse().unwrap());
    for noise in [1e-2, 1e-5, 0.0] {
        let scene = Scene {
            noise: Noise::relative(noise),
            ..Scene::default()
        };
        let mut set = Dataset::simulate(&model, &scene, 7, &mut Seed(1).rng(Stream::Test)).unwrap();
        set.disturb(&model, &scene.noise, &mut Seed(1).rng(Stream::TestNoise))
            .unwrap();
        let rows: Vec<usize> = (0..7).map(|sample| set.row_wire(sample).unwrap()).collect();
        let all: Vec<usize> = (0..7).collect();
        let mut posterior = Posterior::new(&model, &scene, &all, &mut Seed(1).rng(Stream::Expectation)).unwrap();
        let (readings, truths) = (set.readings().to_owned(), set.targets().to_owned());
        let mut limits = vec![0.0; truths.len()];
        let (readings, truths) = (readings.as_slice().unwrap(), truths.as_slice().unwrap());
        assert!(posterior.limits(&rows, readings, truths, &mut limits));
        for (sample, limit) in limits.chunks_exact(9).enumerate() {
            let mut alone = vec![0.0; 9];
            assert!(posterior.limit(
                rows[sample],
                set.sample_readings(sample),
                set.sample_targets(sample),
                &mut alone
            ));
            assert_eq!(alone, limit, "{noise} {sample}");
        }
    }
}
