//! Rows with exact readings.

use super::polish;
use crate::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{Estimator, LARGEST_ERROR, Solution, resistance_residual},
    scene::{Movement, Rows, Scene},
    sensor::{ArrayScale, SensorModel},
};

/// An estimator for known rows.
fn estimator(model: &SensorModel, scene: &Scene) -> Estimator {
    let rows = Vec::from_iter(0..model.scale.rows());
    let scene = Scene {
        rows: match scene.rows {
            Rows::All => Rows::Known,
            rows => rows,
        },
        ..*scene
    };
    Estimator::new(model, &scene, &rows).unwrap()
}

fn worst(scene: &Scene, model: &SensorModel, snapshots: usize) -> (f64, usize) {
    let rows = model.scale.rows();
    let set = Dataset::simulate(model, scene, snapshots * rows, &mut Seed(5).rng(Stream::Test)).unwrap();
    let mut newton = estimator(model, scene);
    let mut worst_mm = 0.0_f64;
    let mut max_steps = 0;
    for sample in 0..set.samples() {
        let mut coordinates = vec![0.0; model.scale.coordinates_per_row()];
        let readings = set.sample_readings(sample);
        let report = newton
            .solve(set.row_wire(sample).unwrap(), readings, &mut coordinates)
            .unwrap();
        assert!(report.has_converged, "{report:?}");
        assert_eq!(report.solution, Solution::Unique, "{report:?}");
        assert!(report.residual < 1e-13);
        max_steps = max_steps.max(report.steps);
        for (ours, truth) in coordinates.iter().zip(set.sample_targets(sample)) {
            worst_mm = worst_mm.max((ours - truth).abs());
        }
    }
    (worst_mm, max_steps)
}

#[test]
fn random_deformations_are_recovered_on_all_presets() {
    for scale in ArrayScale::PRESETS {
        let model = SensorModel::new(scale);
        let (worst_mm, steps) = worst(&Scene::default(), &model, 20);
        assert!(worst_mm < 1e-9, "{scale}: {worst_mm:e} mm");
        assert!(steps <= 5, "{scale}: {steps}");
    }
}

#[test]
fn sideways_shifts_of_a_small_array_are_recovered() {
    let model = SensorModel::new("2x1_3x9".parse().unwrap());
    let scene = Scene {
        movement: Movement::SIDEWAYS,
        ..Scene::default()
    };
    let (worst_mm, _) = worst(&scene, &model, 10);
    assert!(worst_mm < 1e-6, "{worst_mm:e} mm");
}

#[test]
fn impossible_readings_are_refused_and_inconsistent_ones_stay_within_the_bounds() {
    let model = SensorModel::new("10x6_3x18".parse().unwrap());
    let mut newton = estimator(&model, &Scene::default());
    let mut coordinates = vec![0.0; 18];
    let mut readings = vec![20.0; 18];
    readings[3] = f64::NAN;
    let error = newton.solve(0, &readings, &mut coordinates).unwrap_err();
    assert!(error.to_string().contains("reading 4"), "{error}");
    for ohm in [1e-300, 1e-3, 1e6, 1e300] {
        let report = newton.solve(0, &[ohm; 18], &mut coordinates).unwrap();
        assert!(!report.residual.is_nan());
        assert_eq!(report.solution, Solution::None);
        for z in coordinates.iter().skip(2).step_by(3) {
            assert!((4.0..=5.0).contains(z), "{ohm}: {z}");
        }
    }
}

/// Numbers of rows that are right, wrong but flagged, and wrong without a flag; wrong means an unknown that is off by
/// more than [`LARGEST_ERROR`] of its range.
fn counts(scene: &Scene, model: &SensorModel, rows: usize) -> [usize; 3] {
    let set = Dataset::simulate(model, scene, rows, &mut Seed(7).rng(Stream::Test)).unwrap();
    let mut newton = estimator(model, scene);
    let mut counts = [0; 3];
    for sample in 0..set.samples() {
        let mut coordinates = vec![0.0; model.scale.coordinates_per_row()];
        let row = set.row_wire(sample).unwrap();
        let report = newton
            .solve(row, set.sample_readings(sample), &mut coordinates)
            .unwrap();
        let pairs = coordinates.iter().zip(set.sample_targets(sample)).enumerate();
        let error = |(place, (ours, truth)): (usize, (&f64, &f64))| {
            let range_mm = match place % 3 {
                2 => scene.stroke_mm(&model.geometry),
                _ => 2.0 * scene.movement.largest_shift_mm(),
            };
            let error = (ours - truth).abs();
            if error == 0.0 { 0.0 } else { error / range_mm }
        };
        let is_right = pairs.map(error).fold(0.0, f64::max) <= LARGEST_ERROR;
        let is_unique = report.solution == Solution::Unique;
        counts[if is_right { 0 } else { 1 + usize::from(is_unique) }] += 1;
    }
    counts
}

#[test]
fn hard_pressed_rows_are_solved_or_flagged() {
    let model = SensorModel::new("10x8_4x24".parse().unwrap());
    for largest_compression in [0.2, 0.5, 0.9] {
        let scene = Scene {
            largest_compression,
            ..Scene::default()
        };
        let [right, flagged, wrong] = counts(&scene, &model, 600);
        assert_eq!(wrong, 0, "{largest_compression}");
        assert!(flagged <= 6, "{largest_compression}: {flagged} flagged, {right} right");
    }
}

#[test]
fn sensors_of_any_size_are_solved() {
    for factor in [1e-6, 1e6] {
        let mut model = SensorModel::new("2x4_3x12".parse().unwrap());
        let lengths = &mut model.geometry;
        lengths.height_mm *= factor;
        lengths.row_x0_mm *= factor;
        lengths.row_pitch_mm *= factor;
        lengths.node_pitch_mm *= factor;
        lengths.column_pitch_mm *= factor;
        lengths.column_node_x0_mm *= factor;
        lengths.column_node_pitch_mm *= factor;
        assert_eq!(counts(&Scene::default(), &model, 100), [100, 0, 0], "{factor}");
    }
}

#[test]
fn undetermined_rows_are_flagged() {
    // Fewer readings than nodes.
    let few = SensorModel::new("10x6_3x4".parse().unwrap());
    assert_eq!(counts(&Scene::default(), &few, 50), [0, 50, 0]);
    // So flat that the readings do not depend on the height; so high that all nodes look alike.
    for height_mm in [1e-6, 1e6] {
        let mut model = SensorModel::new("2x4_3x12".parse().unwrap());
        model.geometry.height_mm = height_mm;
        assert_eq!(counts(&Scene::default(), &model, 20)[2], 0, "{height_mm}");
    }
}

#[test]
fn a_row_over_the_middle_of_the_electrodes_is_ambiguous() {
    let scene = Scene {
        movement: Movement::SIDEWAYS,
        rows: Rows::One(6),
        ..Scene::default()
    };
    // Electrodes at x = 11.5 and 16.5, the row at x = 14.
    let mut model = SensorModel::new("10x1_2x9".parse().unwrap());
    model.geometry.column_node_x0_mm = 11.5;
    let [_, flagged, wrong] = counts(&scene, &model, 40);
    assert_eq!(wrong, 0);
    assert!(flagged > 0);
    let off_centre = Scene {
        rows: Rows::One(5),
        ..scene
    };
    assert_eq!(counts(&off_centre, &model, 40), [40, 0, 0]);
}

#[test]
fn the_residual_is_the_relative_error_of_the_readings() {
    let model = SensorModel::new("10x6_3x18".parse().unwrap());
    let set = Dataset::simulate(&model, &Scene::default(), 10, &mut Seed(0).rng(Stream::Test)).unwrap();
    let coordinates = set.sample_targets(7).to_vec();
    let readings: Vec<f64> = set.sample_readings(7).iter().map(|ohm| ohm * 1.03).collect();
    assert!((resistance_residual(&model, &readings, &coordinates) - 0.03).abs() < 1e-12);
    assert_eq!(resistance_residual(&model, &readings, &[f64::NAN; 18]), f64::INFINITY);
}

/// The affine estimate is within a hundredth of the stroke, and errors are squared with every step.
#[test]
fn an_answer_is_polished_to_rounding_in_a_few_steps() {
    let model = SensorModel::new("10x10_5x30".parse().unwrap());
    let set = Dataset::simulate(&model, &Scene::default(), 20, &mut Seed(2).rng(Stream::Test)).unwrap();
    let mut newton = estimator(&model, &Scene::default());
    for sample in 0..20 {
        let truth = set.sample_targets(sample);
        let mut coordinates: Vec<f64> = truth.to_vec();
        for (node, z) in coordinates.iter_mut().skip(2).step_by(3).enumerate() {
            *z += 0.01 * (node as f64).sin();
        }
        let row = set.row_wire(sample).unwrap();
        let report = polish(&mut newton, row, set.sample_readings(sample), &mut coordinates, 9);
        assert!(report.solution == Solution::Unique && report.steps <= 5, "{report:?}");
        for (ours, truth) in coordinates.iter().zip(truth) {
            assert!((ours - truth).abs() < 1e-9, "{sample}: {ours} {truth}");
        }
    }
}

/// For readings that no deformation explains, the misfit reported is that of the answer, a local minimum.
#[test]
fn the_residual_reported_is_that_of_the_answer() {
    let model = SensorModel::new("3x4_2x12".parse().unwrap());
    let set = Dataset::simulate(&model, &Scene::default(), 30, &mut Seed(2).rng(Stream::Test)).unwrap();
    for steps in [0, 1, 2, 50] {
        let mut newton = estimator(&model, &Scene::default());
        for sample in 0..30 {
            let mut readings = set.sample_readings(sample).to_vec();
            readings[5] *= 1.0 + 1e-9 * sample as f64;
            let row = set.row_wire(sample).unwrap();
            let mut solved = vec![0.0; 12];
            let mut polished = Vec::from_iter(set.sample_targets(sample).iter().map(|mm| mm - 0.02));
            for (report, coordinates) in [
                (newton.solve(row, &readings, &mut solved).unwrap(), &solved),
                (polish(&mut newton, row, &readings, &mut polished, steps), &polished),
            ] {
                let residual = resistance_residual(&model, &readings, coordinates);
                let apart = (report.residual - residual).abs();
                assert!(apart < 1e-14 + 1e-6 * residual, "{steps}: {report:?} {residual:e}");
            }
        }
    }
}
