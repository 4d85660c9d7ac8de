//! Simulated settings at their extremes, with a sentence each.

use decoupler_core::{
    dataset::Simulation,
    evaluation::RunSettings,
    glam::DVec3,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Movement, Noise, NoisySets, Rows, Scene},
    sensor::{Geometry, SensorModel},
};

pub(crate) type Situation = (String, RunSettings);

/// A small array, slightly larger than the smallest, whose readings determine all deformations.
fn ordinary() -> RunSettings {
    let mut settings = RunSettings {
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
        ..RunSettings::default()
    };
    settings.training.stopping.epochs = 25;
    settings
}

/// The ordinary settings with a change of what is simulated.
fn changed(change: impl FnOnce(&mut Simulation)) -> RunSettings {
    let mut settings = ordinary();
    change(settings.simulation_mut().unwrap());
    settings
}

fn on_array(array: &str, rows: Rows, test_samples: usize) -> RunSettings {
    changed(|simulation| {
        simulation.sensor = SensorModel::new(array.parse().unwrap());
        simulation.scene.rows = rows;
        simulation.test_samples = test_samples;
    })
}

/// Resistance of the first row-wire and column-wire at rest, in ohm, which sets the scale of noise in ohm.
pub(crate) fn resistance_ohm(model: &SensorModel) -> f64 {
    let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
    model.row_resistances(0, &rest).unwrap()[0]
}

/// Noise of every kind and size, and which of it is impossible.
fn noises() -> Vec<(String, Noise, bool)> {
    let none = Noise::default();
    let ohm = resistance_ohm(&ordinary().simulation().unwrap().sensor);
    let mut noises = Vec::new();
    for exponent in -12..=0 {
        let size = 10_f64.powi(exponent);
        noises.push((format!("relative noise {size:e}"), Noise::relative(size), true));
        noises.push((format!("drift {size:e}"), Noise { drift: size, ..none }, true));
    }
    for exponent in [
        -12, -9, -6, -4, -3, -2, -1, 0, 1, 2, 3, 4, 6, 9, 30, 100, 154, 200, 300, 306,
    ] {
        let additive_ohm = ohm * 10_f64.powi(exponent);
        noises.push((
            format!("noise of 1e{exponent} readings"),
            Noise { additive_ohm, ..none },
            true,
        ));
    }
    for bits in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32] {
        let converter_bits = Some(bits);
        noises.push((format!("{bits} bits"), Noise { converter_bits, ..none }, true));
    }
    for sets in [NoisySets::Training, NoisySets::Test] {
        let noise = Noise::relative(1e-2);
        noises.push((format!("noise in {sets:?} only"), Noise { sets, ..noise }, true));
    }
    for size in [-1.0, 1.5, 1e300, f64::NAN, f64::INFINITY] {
        let additive_ohm = -size.abs();
        noises.push((format!("relative noise {size}"), Noise::relative(size), false));
        noises.push((
            format!("noise of {additive_ohm} ohm"),
            Noise { additive_ohm, ..none },
            false,
        ));
    }
    noises
}

fn sizes() -> Vec<Situation> {
    let mut found = Vec::new();
    for array in [
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
            found.push((format!("{array}, rows {rows}"), on_array(array, rows, 120)));
        }
    }
    if !cfg!(debug_assertions) {
        for rows in [Rows::All, Rows::One(0)] {
            let mut settings = on_array("32x32_16x96", rows, 64);
            settings.simulation_mut().unwrap().samples = 800;
            found.push((format!("32x32_16x96, rows {rows}"), settings));
        }
    }
    for numbers in [
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
            let settings = changed(|simulation| {
                simulation.scene.rows = rows;
                (
                    simulation.samples,
                    simulation.validation_samples,
                    simulation.test_samples,
                ) = numbers;
            });
            let sentence = format!("{numbers:?} samples for training, validation and test, rows {rows}");
            found.push((sentence, settings));
        }
    }
    for hidden in [0, 1, 2, 100, 512, 513] {
        let settings = RunSettings {
            hidden,
            ..on_array("1x1_1x3", Rows::Known, 400)
        };
        found.push((format!("{hidden} hidden nodes"), settings));
    }
    found
}

/// Returns the geometry with every length multiplied by `factor`.
fn in_other_units(geometry: Geometry, factor: f64) -> Geometry {
    Geometry {
        height_mm: factor * geometry.height_mm,
        row_x0_mm: factor * geometry.row_x0_mm,
        row_pitch_mm: factor * geometry.row_pitch_mm,
        node_pitch_mm: factor * geometry.node_pitch_mm,
        column_y0_mm: factor * geometry.column_y0_mm,
        column_pitch_mm: factor * geometry.column_pitch_mm,
        column_node_x0_mm: factor * geometry.column_node_x0_mm,
        column_node_pitch_mm: factor * geometry.column_node_pitch_mm,
    }
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
        let settings = changed(|simulation| simulation.scene.largest_compression = compression);
        found.push((format!("compressed by {compression:e}"), settings));
    }
    for factor in [1e-6, 1e-3, 1e3, 1e6] {
        let settings = changed(|simulation| {
            simulation.sensor.geometry = in_other_units(Geometry::default(), factor);
        });
        found.push((format!("all lengths times {factor:e}"), settings));
    }
    for height_mm in [1e-6, 1e-3, 1e3, 1e6, 0.0, -1.0, f64::NAN, f64::INFINITY] {
        let settings = changed(|simulation| simulation.sensor.geometry.height_mm = height_mm);
        found.push((format!("height {height_mm:e} mm"), settings));
    }
    for ohm in [
        1e-300,
        1e-150,
        1e-12,
        1e-6,
        1e6,
        1e12,
        1e150,
        1e300,
        0.0,
        -1.0,
        f64::NAN,
        f64::INFINITY,
    ] {
        let settings = changed(|simulation| simulation.sensor.resistivity_ohm_per_mm = ohm);
        found.push((format!("{ohm:e} ohm a millimetre"), settings));
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
                let settings = changed(|simulation| {
                    let scene = &mut simulation.scene;
                    (scene.loading, scene.movement, scene.rows) = (loading, movement, rows);
                    simulation.test_samples = 120;
                });
                found.push((format!("{loading}, {movement:?}, rows {rows}"), settings));
            }
        }
    }
    found
}

fn inputs() -> Vec<Situation> {
    let coarse = Noise {
        converter_bits: Some(6),
        ..Noise::default()
    };
    let mut found = Vec::new();
    for quantity in [Quantity::Raw].into_iter().chain(Quantity::ALL) {
        for scaling in [ScalingChoice::MinMax, ScalingChoice::Whitening] {
            for noise in [Noise::default(), Noise::relative(1e-3), coarse] {
                let mut settings = changed(|simulation| simulation.scene.noise = noise);
                settings.inputs = InputChoice { quantity, scaling };
                found.push((format!("{quantity:?} {scaling:?}, {noise:?}"), settings));
            }
        }
    }
    found
}

/// Returns every situation.
pub(crate) fn all() -> Vec<Situation> {
    let mut found = vec![("nothing extreme".to_owned(), ordinary())];
    found.extend([sizes(), lengths(), loadings(), inputs()].concat());
    for (sentence, noise, is_possible) in noises() {
        // The last has fewer readings than unknowns.
        for (array, rows) in [
            ("4x3_2x9", Rows::Known),
            ("4x3_2x9", Rows::All),
            ("4x6_3x4", Rows::Known),
        ] {
            let mut settings = on_array(array, rows, if array == "4x6_3x4" { 120 } else { 400 });
            settings.simulation_mut().unwrap().scene.noise = noise;
            if is_possible || array != "4x6_3x4" {
                found.push((format!("{sentence}, {array}, rows {rows}"), settings));
            }
        }
    }
    found
}
