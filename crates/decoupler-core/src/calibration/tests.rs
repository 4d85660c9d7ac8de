use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::*;
use crate::{
    scene::{Movement, Scene},
    sensor::SensorModel,
};

fn nominal() -> SensorModel {
    of_scale("10x6_3x18")
}

fn of_scale(scale: &str) -> SensorModel {
    SensorModel::new(scale.parse().unwrap())
}

/// A sensor whose height, pitches and column position are off by 5 %, each up or down.
fn real(rng: &mut impl Rng) -> SensorModel {
    off(nominal(), rng)
}

fn off(nominal: SensorModel, rng: &mut impl Rng) -> SensorModel {
    let mut real = nominal;
    let geometry = &mut real.geometry;
    for length in [
        &mut geometry.height_mm,
        &mut geometry.row_pitch_mm,
        &mut geometry.node_pitch_mm,
        &mut geometry.column_node_x0_mm,
    ] {
        *length *= if rng.random() { 1.05 } else { 0.95 };
    }
    real
}

/// Frames of random presses, read with this relative noise.
fn frames(real: &SensorModel, rows: &[usize], frames: usize, noise: f64, rng: &mut impl Rng) -> Vec<PressedRow> {
    let mut samples = Vec::new();
    for frame in 0..frames {
        for &row in rows {
            let displacements_mm: Vec<DVec3> = (0..real.scale.nodes_per_row())
                .map(|_| DVec3::new(0.0, 0.0, rng.random_range(0.0..1.0)))
                .collect();
            let mut resistances_ohm = real.row_resistances(row, &displacements_mm).unwrap();
            for ohm in &mut resistances_ohm {
                // The sum of 12 uniform values is nearly normal with variance 1.
                let normal: f64 = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
                *ohm *= 1.0 + noise * normal;
            }
            samples.push(PressedRow {
                frame,
                row,
                displacements_mm,
                resistances_ohm,
            });
        }
    }
    samples
}

/// Returns `true` if every interval contains the true value.
fn intervals_hold(calibration: &Calibration, real: &SensorModel) -> bool {
    let mut parameters = calibration.parameters.iter();
    parameters.all(|fitted| match fitted.half_width {
        Some(half_width) => (fitted.value - fitted.parameter.of(real)).abs() <= half_width,
        None => fitted.value == fitted.nominal,
    })
}

fn determined(calibration: &Calibration) -> Vec<SensorParameter> {
    let determined = calibration
        .parameters
        .iter()
        .filter(|fitted| fitted.half_width.is_some());
    determined.map(|fitted| fitted.parameter).collect()
}

/// All intervals of a calibration together hold with 95 %; 45 of 50 leaves room for chance.
#[test]
fn a_sensor_off_by_5_percent_is_recovered_within_the_stated_intervals() {
    let mut within = 0;
    for seed in 0..50 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let real = real(&mut rng);
        let samples = frames(&real, &Vec::from_iter(0..10), 12, 1e-3, &mut rng);
        let calibration = Calibration::of_presses(&nominal(), &samples).unwrap();
        for parameter in [
            SensorParameter::Height,
            SensorParameter::RowPitch,
            SensorParameter::NodePitch,
            SensorParameter::ColumnNodeX,
        ] {
            let mut fitted = calibration.parameters.iter();
            let fitted = fitted.find(|fitted| fitted.parameter == parameter).unwrap();
            assert!(fitted.half_width.is_some(), "seed {seed}: {fitted}");
        }
        assert!(
            (calibration.residual / 1e-3 - 1.0).abs() < 0.1,
            "{}",
            calibration.residual
        );
        assert!(calibration.nominal_residual > 10.0 * calibration.residual);
        within += usize::from(intervals_hold(&calibration, &real));
    }
    assert!(within >= 45, "{within} of 50");
}

#[test]
fn readings_without_noise_give_the_sensor_exactly() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let real = real(&mut rng);
    let samples = frames(&real, &Vec::from_iter(0..10), 6, 0.0, &mut rng);
    let calibration = Calibration::of_presses(&nominal(), &samples).unwrap();
    assert_eq!(determined(&calibration), SensorParameter::ALL);
    for fitted in &calibration.parameters {
        let truth = fitted.parameter.of(&real);
        assert!((fitted.value - truth).abs() < 1e-6, "{fitted}: {truth}");
    }
}

/// The position of the first row-wire does not depend on the pitch.
#[test]
fn parameters_undetermined_by_one_row_keep_their_nominal_values() {
    let mut within = 0;
    for seed in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let real = real(&mut rng);
        let samples = frames(&real, &[0], 60, 1e-4, &mut rng);
        let calibration = Calibration::of_presses(&nominal(), &samples).unwrap();
        let determined = determined(&calibration);
        assert!(!determined.contains(&SensorParameter::RowPitch), "{determined:?}");
        within += usize::from(intervals_hold(&calibration, &real));
    }
    assert!(within >= 17, "{within} of 20");
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let samples = frames(&real(&mut rng), &[0], 20, 1e-3, &mut rng);
    let pitch = Calibration::of_presses(&nominal(), &samples).unwrap().parameters[SensorParameter::RowPitch.index()];
    assert_eq!(
        pitch.to_string(),
        "row pitch: 1 mm, its nominal value: these readings do not determine it"
    );
}

/// There the pitch and the position of the columns are one unknown: neither has an interval of its own.
#[test]
fn a_single_row_other_than_the_first_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let samples = frames(&real(&mut rng), &[6], 60, 1e-4, &mut rng);
    let error = Calibration::of_presses(&nominal(), &samples).unwrap_err();
    assert!(matches!(error, CalibrationError::OneRow { row: 6 }), "{error}");
    assert!(error.to_string().starts_with("all samples are of row-wire 7:"));
}

/// A wire with its own resistance affects all frames: its readings are not independent from frame to frame.
#[test]
fn intervals_allow_for_deviating_wires() {
    let half_width = |wire_error: f64| {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let real = real(&mut rng);
        let mut samples = frames(&real, &Vec::from_iter(0..10), 40, 1e-3, &mut rng);
        let wires: Vec<f64> = (0..180)
            .map(|_| 1.0 + wire_error * rng.random_range(-1.0..1.0))
            .collect();
        for sample in &mut samples {
            let crossings = &wires[18 * sample.row..][..18];
            sample
                .resistances_ohm
                .iter_mut()
                .zip(crossings)
                .for_each(|(ohm, factor)| *ohm *= factor);
        }
        let calibration = Calibration::of_presses(&nominal(), &samples).unwrap();
        let half_width = calibration.parameters[SensorParameter::Height.index()].half_width;
        half_width.map_or(f64::INFINITY, |half_width| half_width / calibration.residual)
    };
    let (wide, narrow) = (half_width(0.01), half_width(0.0));
    assert!(wide > 2.0 * narrow, "{wide} and {narrow} of the residual");
}

/// Sets that leave patterns of the parameters undetermined: few readings, one row-wire, and no press, where all
/// lengths and the resistivity are known up to a common factor. The first residual is that of the true sensor.
#[test]
fn few_frames_and_frames_at_rest_converge_within_the_intervals() {
    let mut within = 0;
    let mut all = 0;
    for (scale, rows, count, noise, at_rest, seeds) in [
        ("3x2_2x6", 3, 1, 1e-4, false, 20),
        ("1x5_3x15", 1, 10, 1e-3, false, 20),
        ("4x3_2x8", 4, 30, 1e-3, true, 6),
        ("2x5_2x15", 2, 2, 2e-3, false, 10),
        ("1x10_4x30", 1, 20, 3e-4, true, 4),
    ] {
        for seed in 0..seeds {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let nominal = of_scale(scale);
            let real = off(nominal, &mut rng);
            let mut samples = frames(&real, &Vec::from_iter(0..rows), count, noise, &mut rng);
            if at_rest {
                for sample in &mut samples {
                    sample.displacements_mm.fill(DVec3::ZERO);
                    let ohm = real.row_resistances(sample.row, &sample.displacements_mm).unwrap();
                    sample.resistances_ohm = ohm
                        .iter()
                        .map(|ohm| ohm * (1.0 + noise * rng.random_range(-1.7..1.7)))
                        .collect();
                }
            }
            let calibration = Calibration::of_presses(&nominal, &samples)
                .unwrap_or_else(|error| panic!("{scale}, seed {seed}: {error}"));
            assert!(calibration.residual < 1.6 * noise, "{scale}: {}", calibration.residual);
            assert!(calibration.warnings.is_empty(), "{scale}, seed {seed}");
            within += usize::from(at_rest || intervals_hold(&calibration, &real));
            all += 1;
        }
    }
    assert!(10 * within >= 9 * all, "{within} of {all}");
}

/// With one electrode too many on each column-wire, the fit is as good as with the true scale: only the values show
/// it. With column-wires in the wrong order, the residual does.
#[test]
fn a_wrong_sensor_gives_a_warning() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let samples = frames(&of_scale("4x3_2x8"), &[0, 1, 2, 3], 30, 1e-3, &mut rng);
    let calibration = Calibration::of_presses(&of_scale("4x3_3x8"), &samples).unwrap();
    let words = &calibration.warnings[0];
    assert!(
        words.contains("resistance per millimetre: 15") && words.contains("check the array scale"),
        "{words}"
    );
    let calibration = Calibration::of_presses(&of_scale("4x3_2x8"), &samples).unwrap();
    assert!(calibration.warnings.is_empty());
    let mut swapped = samples;
    for sample in &mut swapped {
        sample.resistances_ohm.swap(0, 3);
    }
    let warnings = Calibration::of_presses(&of_scale("4x3_2x8"), &swapped)
        .unwrap()
        .warnings;
    let is_misfit = |warning: &String| warning.starts_with("the readings of a crossing are off by ");
    assert!(warnings.iter().any(is_misfit), "{warnings:?}");
}

#[test]
fn presses_outside_the_limits_are_named() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let good = frames(&nominal(), &[0, 1, 2], 4, 1e-3, &mut rng);
    let scene = Scene {
        movement: Movement::SIDEWAYS,
        ..Scene::default()
    };
    assert_eq!(limits::check(&nominal(), Some(&scene), &good), Ok(()));
    let message = |spoil: &dyn Fn(&mut PressedRow)| {
        let mut samples = good.clone();
        spoil(&mut samples[4]);
        let error = limits::check(&nominal(), Some(&scene), &samples).unwrap_err();
        assert_eq!(error.sample(), Some(4), "{error}");
        error.to_string()
    };
    assert!(message(&|sample| sample.resistances_ohm[1] = 0.0).contains("column 2"));
    assert!(message(&|sample| sample.resistances_ohm[0] = 1e300).contains("1e300 ohm is implausible"));
    assert!(message(&|sample| sample.resistances_ohm[0] = 1e-12).contains("1e-12 ohm is implausible"));
    assert!(message(&|sample| sample.displacements_mm[2].z = -3.0).contains("node 3: it is pressed down by -3 mm"));
    assert!(message(&|sample| sample.displacements_mm[2].z = 1.5).contains("0 to 1 mm is possible"));
    assert!(message(&|sample| sample.displacements_mm[0].y = -0.5).contains("sideways by 0.5 mm"));
    // Another rubber is not an error.
    let mut samples = good.clone();
    for sample in &mut samples {
        sample.resistances_ohm.iter_mut().for_each(|ohm| *ohm *= 1e9);
    }
    assert_eq!(limits::check(&nominal(), Some(&scene), &samples), Ok(()));
}

#[test]
fn invalid_samples_are_named() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let good = frames(&nominal(), &[0, 1, 2], 4, 1e-3, &mut rng);
    let message = |spoil: &dyn Fn(&mut PressedRow)| {
        let mut samples = good.clone();
        spoil(&mut samples[4]);
        Calibration::of_presses(&nominal(), &samples).unwrap_err().to_string()
    };
    assert!(message(&|sample| sample.row = 10).contains("sample 5"));
    assert!(message(&|sample| sample.resistances_ohm.truncate(3)).contains("3 readings"));
    assert!(message(&|sample| sample.resistances_ohm[1] = -1.0).contains("sample 5, column 2: the reading -1"));
    assert!(message(&|sample| sample.displacements_mm[2].z = 5.0).contains("sample 5, node 3"));
    assert!(message(&|sample| sample.displacements_mm[2].x = f64::NAN).contains("node 3"));
    assert_eq!(
        Calibration::of_presses(&nominal(), &[]),
        Err(CalibrationError::TooFew {
            readings: 0,
            parameters: 7
        })
    );
}
