//! The settings of a run in words.

use crate::{
    evaluation::SimulatedSettings,
    export::{NetworkFile, format_number},
    scene::{Loading, Movement, Noise, NoisySets},
    sensor::counted,
};

/// Names and values of all settings.
pub(super) fn settings_facts(file: &NetworkFile, settings: &SimulatedSettings) -> Vec<(&'static str, String)> {
    let SimulatedSettings { source, inputs, .. } = settings;
    let (geometry, scene) = (&source.sensor.geometry, &source.scene);
    let rules = file.settings.training.stopping;
    let mut facts = vec![
        ("Array", source.sensor.scale.to_string()),
        ("Height", format!("{} mm", geometry.height_mm)),
        (
            "Row-wires",
            format!("from x = {} mm, {} mm apart", geometry.row_x0_mm, geometry.row_pitch_mm),
        ),
        ("Nodes of a row-wire", format!("{} mm apart", geometry.node_pitch_mm)),
        (
            "Column-wires",
            format!(
                "from y = {} mm, {} mm apart",
                geometry.column_y0_mm, geometry.column_pitch_mm
            ),
        ),
        (
            "Nodes of a column-wire",
            format!(
                "from x = {} mm, {} mm apart",
                geometry.column_node_x0_mm, geometry.column_node_pitch_mm
            ),
        ),
        (
            "Resistance of the rubber",
            format!("{} ohm/mm", source.sensor.resistivity_ohm_per_mm),
        ),
        ("Rows", scene.rows.to_string()),
        (
            "Moving axes",
            match scene.movement {
                Movement::Z => "z".to_owned(),
                Movement::Xyz { largest_shift_mm } => format!("x, y, z; sideways by up to {largest_shift_mm} mm"),
            },
        ),
        ("Loading", loading_words(&scene.loading)),
        (
            "Largest compression",
            format!(
                "{} % of the height, {} mm",
                format_number(100.0 * scene.largest_compression),
                format_number(source.stroke_mm())
            ),
        ),
        ("Noise", noise_words(&scene.noise)),
        ("Inputs", format!("{} ({})", inputs.quantity, inputs.scaling)),
        ("Hidden nodes", file.settings.hidden.to_string()),
        ("Weights", file.network.weights().to_string()),
    ];
    for (number, stage) in file.training.stages.iter().enumerate() {
        let from = match number {
            0 => String::new(),
            _ => format!("from epoch {}: ", stage.first_epoch),
        };
        facts.push(("Method", format!("{from}{}", stage.method)));
    }
    facts.extend([
        ("Starts", file.settings.starts.to_string()),
        (
            "Ends",
            format!(
                "after {}, at a training error of {:?}, a gradient below {:?}, or {}",
                counted(rules.epochs, "epoch"),
                rules.goal_mse,
                rules.min_gradient,
                counted(rules.max_fail, "validation failure")
            ),
        ),
        (
            "Samples",
            format!(
                "{} for training, {} for validation, {} for test, each rounded up to whole snapshots",
                source.samples, source.validation_samples, source.test_samples
            ),
        ),
        ("Seed", file.settings.seed.to_string()),
    ]);
    facts
}

fn loading_words(loading: &Loading) -> String {
    let Loading::Indenter(indenter) = loading else {
        return loading.to_string();
    };
    let (radius, tilt_degrees) = indenter.radius_mm_and_tilt_degrees();
    let mut words = indenter.name().to_owned();
    if let Some(radius) = radius {
        words += &format!(", radius {} to {} mm", radius.smallest, radius.largest);
    }
    if tilt_degrees > 0.0 {
        words += &format!(", tilted by up to {tilt_degrees}°");
    }
    format!("{words}, decay length {} mm", indenter.spread_mm)
}

fn noise_words(noise: &Noise) -> String {
    let &Noise {
        relative,
        additive_ohm,
        converter_bits,
        drift,
        sets,
    } = noise;
    if noise.is_none() {
        return "none".to_owned();
    }
    let parts = [
        (relative > 0.0).then(|| format!("{relative:?} of the reading")),
        (additive_ohm > 0.0).then(|| format!("{additive_ohm:?} ohm")),
        converter_bits.map(|bits| format!("converter of {bits} bits")),
        (drift > 0.0).then(|| format!("gain drift {drift:?}")),
        match sets {
            NoisySets::Both => None,
            NoisySets::Training => Some("in training only".to_owned()),
            NoisySets::Test => Some("in test only".to_owned()),
        },
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}
