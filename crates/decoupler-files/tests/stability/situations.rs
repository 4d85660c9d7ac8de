//! Simulated settings at their extremes, with a sentence each.

use decoupler_core::{
    dataset::Simulation,
    evaluation::RunSettings,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Movement, Noise, NoisySets, Rows, Scene},
    sensor::{Geometry, SensorModel},
    training::{Method, StoppingRules, TrainingSettings},
};

use crate::sensors::in_other_units;

pub(crate) type Situation = (&'static str, String, RunSettings);

/// A small array, slightly larger than the smallest, whose readings determine all deformations.
pub(crate) fn ordinary() -> RunSettings {
    RunSettings {
        source: Simulation {
            sensor: SensorModel::new("4x3_2x9".parse().unwrap()),
            scene: Scene {
                rows: Rows::Known,
                ..Scene::default()
            },
            samples: 160,
            validation_samples: 40,
            test_samples: 400,
        }
        .into(),
        inputs: InputChoice {
            quantity: Quantity::Conductance,
            scaling: ScalingChoice::Whitening,
        },
        hidden: 6,
        training: TrainingSettings {
            method: Method::default(),
            stopping: StoppingRules {
                epochs: 25,
                ..StoppingRules::default()
            },
        },
        ..RunSettings::default()
    }
}

fn changed(change: impl FnOnce(&mut RunSettings)) -> RunSettings {
    let mut settings = ordinary();
    change(&mut settings);
    settings
}

/// Resistance of the ordinary array at rest, in ohm, which sets the scale of noise in ohm.
pub(crate) fn resistance_ohm(model: &SensorModel) -> f64 {
    let rest = vec![decoupler_core::glam::DVec3::ZERO; model.scale.nodes_per_row()];
    model.row_resistances(0, &rest).unwrap()[0]
}

pub(crate) fn noises() -> Vec<(&'static str, String, Noise)> {
    let ohm = resistance_ohm(&ordinary().simulation().unwrap().sensor);
    let mut noises = Vec::new();
    for exponent in [-12, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1, 0] {
        let size = 10_f64.powi(exponent);
        noises.push((
            "relative noise",
            format!("relative noise {size:e}"),
            Noise::relative(size),
        ));
        let noise = Noise {
            drift: size,
            ..Noise::default()
        };
        noises.push(("drift", format!("drift {size:e}"), noise));
    }
    for exponent in [
        -12, -9, -6, -4, -3, -2, -1, 0, 1, 2, 3, 4, 6, 9, 30, 100, 154, 200, 300, 306,
    ] {
        let noise = Noise {
            additive_ohm: ohm * 10_f64.powi(exponent),
            ..Noise::default()
        };
        noises.push(("additive noise", format!("noise of 1e{exponent} readings"), noise));
    }
    for bits in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32] {
        let noise = Noise {
            converter_bits: Some(bits),
            ..Noise::default()
        };
        noises.push(("converter", format!("{bits} bits"), noise));
    }
    for sets in [NoisySets::Training, NoisySets::Test] {
        let noise = Noise {
            sets,
            ..Noise::relative(1e-2)
        };
        noises.push(("noise in one set only", format!("noise in {sets:?} only"), noise));
    }
    for size in [-1.0, 1.5, 1e300, f64::NAN, f64::INFINITY] {
        noises.push((
            "noise out of range",
            format!("relative noise {size}"),
            Noise::relative(size),
        ));
        let noise = Noise {
            additive_ohm: -size.abs(),
            ..Noise::default()
        };
        noises.push(("noise out of range", format!("noise of {} ohm", -size.abs()), noise));
    }
    noises
}

fn sizes() -> Vec<Situation> {
    let mut found = Vec::new();
    for scale in [
        "1x1_1x1",
        "1x1_1x3",
        "1x6_3x18",
        "6x1_3x3",
        "2x2_1x1",
        "2x2_2x6",
        "3x2_2x6",
        "10x6_3x4",
        "10x6_3x18",
        "4x3_2x40",
        "16x16_8x48",
        "3x24_12x72",
    ] {
        for rows in [Rows::All, Rows::Known, Rows::One(0), Rows::One(9)] {
            let settings = changed(|settings| {
                settings.simulation_mut().unwrap().sensor = SensorModel::new(scale.parse().unwrap());
                settings.simulation_mut().unwrap().scene.rows = rows;
                settings.simulation_mut().unwrap().test_samples = 120;
            });
            found.push(("array sizes and rows", format!("{scale}, rows {rows}"), settings));
        }
    }
    if !cfg!(debug_assertions) {
        for rows in [Rows::All, Rows::One(0)] {
            let settings = changed(|settings| {
                settings.simulation_mut().unwrap().sensor = SensorModel::new("32x32_16x96".parse().unwrap());
                settings.simulation_mut().unwrap().scene.rows = rows;
                settings.simulation_mut().unwrap().samples = 800;
                settings.simulation_mut().unwrap().test_samples = 64;
            });
            found.push(("array sizes and rows", format!("32x32_16x96, rows {rows}"), settings));
        }
    }
    for (samples, validation, test) in [
        (1, 0, 1),
        (1, 0, 100),
        (2, 0, 100),
        (4, 4, 100),
        (8, 0, 100),
        (20, 1, 1),
        (0, 0, 0),
        (2_000_000, 0, 10),
    ] {
        for rows in [Rows::Known, Rows::All] {
            let settings = changed(|settings| {
                settings.simulation_mut().unwrap().scene.rows = rows;
                settings.simulation_mut().unwrap().samples = samples;
                settings.simulation_mut().unwrap().validation_samples = validation;
                settings.simulation_mut().unwrap().test_samples = test;
            });
            let sentence = format!("{samples} training, {validation} validation and {test} test samples, rows {rows}");
            found.push(("numbers of samples", sentence, settings));
        }
    }
    for hidden in [0, 1, 2, 100, 512, 513] {
        let settings = changed(|settings| {
            settings.hidden = hidden;
            settings.simulation_mut().unwrap().sensor = SensorModel::new("1x1_1x3".parse().unwrap());
        });
        found.push(("hidden nodes", format!("{hidden} hidden nodes"), settings));
    }
    found
}

fn lengths() -> Vec<Situation> {
    let mut found = Vec::new();
    for compression in [
        1e-300,
        1e-12,
        1e-6,
        1e-3,
        0.2,
        0.5,
        0.9,
        0.99,
        0.999,
        0.99999,
        1.0,
        0.0,
        -1.0,
        f64::NAN,
    ] {
        let settings = changed(|settings| settings.simulation_mut().unwrap().scene.largest_compression = compression);
        found.push(("compression", format!("compressed by {compression:e}"), settings));
    }
    for exponent in [-6, -3, 3, 6] {
        let factor = 10_f64.powi(exponent);
        let settings = changed(|settings| {
            settings.simulation_mut().unwrap().sensor.geometry = in_other_units(Geometry::default(), factor);
        });
        found.push((
            "heights and units of length",
            format!("all lengths times {factor:e}"),
            settings,
        ));
        let settings = changed(|settings| settings.simulation_mut().unwrap().sensor.geometry.height_mm = factor);
        found.push(("heights and units of length", format!("height {factor:e} mm"), settings));
    }
    for exponent in [-300, -150, -12, -6, 6, 12, 150, 300] {
        let settings = changed(|settings| {
            settings.simulation_mut().unwrap().sensor.resistivity_ohm_per_mm = 10_f64.powi(exponent);
        });
        found.push(("resistance per mm", format!("1e{exponent} ohm a millimetre"), settings));
    }
    found
}

fn loadings() -> Vec<Situation> {
    let mut loadings = vec![Loading::RandomNodes];
    for correlation_length_mm in [0.0, 1e-9, 0.1, 3.0, 1e3, 1e9, 1e300, f64::NAN] {
        loadings.push(Loading::SmoothField { correlation_length_mm });
    }
    loadings.extend(Indenter::all().map(Loading::Indenter));
    let movements = [
        Movement::Z,
        Movement::SIDEWAYS,
        Movement::Xyz { largest_shift_mm: 1e-6 },
        Movement::Xyz { largest_shift_mm: 1e3 },
    ];
    let mut found = Vec::new();
    for loading in loadings {
        for movement in movements {
            for rows in [Rows::Known, Rows::All] {
                let settings = changed(|settings| {
                    let scene = &mut settings.simulation_mut().unwrap().scene;
                    (scene.loading, scene.movement, scene.rows) = (loading, movement, rows);
                    settings.simulation_mut().unwrap().test_samples = 120;
                });
                found.push((
                    "loadings and axes",
                    format!("{loading}, {movement:?}, rows {rows}"),
                    settings,
                ));
            }
        }
    }
    found
}

fn inputs() -> Vec<Situation> {
    let mut found = Vec::new();
    for quantity in [
        Quantity::Resistance,
        Quantity::Conductance,
        Quantity::LogResistance,
        Quantity::Raw,
    ] {
        for scaling in [ScalingChoice::MinMax, ScalingChoice::Whitening] {
            for (noise_name, noise) in [
                ("no noise", Noise::default()),
                ("noise 1e-3", Noise::relative(1e-3)),
                (
                    "6 bits",
                    Noise {
                        converter_bits: Some(6),
                        ..Noise::default()
                    },
                ),
            ] {
                let settings = changed(|settings| {
                    settings.inputs = InputChoice { quantity, scaling };
                    settings.simulation_mut().unwrap().scene.noise = noise;
                });
                found.push(("inputs", format!("{quantity:?} {scaling:?}, {noise_name}"), settings));
            }
        }
    }
    found
}

/// Returns every situation.
pub(crate) fn all() -> Vec<Situation> {
    let noisy = |rows: Rows| {
        noises().into_iter().map(move |(extreme, sentence, noise)| {
            let settings = changed(|settings| {
                settings.simulation_mut().unwrap().scene.noise = noise;
                settings.simulation_mut().unwrap().scene.rows = rows;
            });
            (extreme, format!("{sentence}, rows {rows}"), settings)
        })
    };
    let few = noises()
        .into_iter()
        .filter(|(extreme, ..)| *extreme != "noise out of range");
    let underdetermined = few.map(|(extreme, sentence, noise)| {
        let settings = changed(|settings| {
            settings.simulation_mut().unwrap().scene.noise = noise;
            settings.simulation_mut().unwrap().sensor = SensorModel::new("4x6_3x4".parse().unwrap());
            settings.simulation_mut().unwrap().test_samples = 120;
        });
        (extreme, format!("{sentence}, fewer readings than unknowns"), settings)
    });
    let mut found = vec![("an ordinary scene", "nothing extreme".to_owned(), ordinary())];
    found.extend(sizes());
    found.extend(lengths());
    found.extend(loadings());
    found.extend(inputs());
    found.extend(noisy(Rows::Known));
    found.extend(noisy(Rows::All));
    found.extend(underdetermined);
    found
}
