//! The settings of a run as text.

use crate::{
    export::{NetworkFile, format_number},
    import::{Plan, Recorded},
};
use decoupler_core::{
    dataset::{Dataset, Simulation},
    evaluation::Combination,
    problem::Channel,
    scene::{Loading, Movement, Noise, NoisySets, RowModel},
    text::counted,
};

/// Names and values of all settings.
pub(super) fn settings_facts(file: &NetworkFile, source: &Simulation) -> Vec<(&'static str, String)> {
    let settings = &file.settings;
    let inputs = &settings.inputs;
    let (geometry, scene) = (&source.sensor.geometry, &source.scene);
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
    ];
    facts.extend(training_facts(file));
    facts.push((
        "Samples",
        format!(
            "{} for training, {} for validation, {} for test, each rounded up to whole snapshots",
            source.samples, source.validation_samples, source.test_samples
        ),
    ));
    facts.push(("Seed", file.settings.seed.to_string()));
    facts
}

/// Names and values of the settings of a run on a recording.
pub(super) fn recording_facts(file: &NetworkFile, recorded: &Recorded, test: &Dataset) -> Vec<(&'static str, String)> {
    let Plan {
        import,
        test: tests,
        division,
    } = &recorded.plan;
    let names = |channels: &[Channel]| Vec::from_iter(channels.iter().map(Channel::title)).join(", ");
    let mut facts = vec![("Recording", import.data.display().to_string())];
    for joined in &import.join {
        facts.push(("Joined file", joined.file.display().to_string()));
    }
    for set in &import.append {
        facts.push(("Appended", set.data.display().to_string()));
    }
    if let Some(time) = &import.time {
        facts.push(("Time", time.clone()));
    }
    if let Some(group) = &import.group {
        facts.push(("Group", group.clone()));
    }
    for derived in &import.derive {
        facts.push(("Derived column", derived.to_string()));
    }
    for condition in &import.conditions {
        facts.push(("Rows used", condition.to_string()));
    }
    facts.push(("Readings", names(&file.problem.inputs)));
    if let Some(memory) = &file.problem.memory {
        facts.push(("Memory", memory.to_string()));
    }
    facts.push(("Targets", names(&file.problem.targets)));
    let samples = counted(test.samples(), "test sample");
    facts.push((
        "Split",
        match tests {
            Some(tests) => format!("{samples} of {}", tests.data.display()),
            None => format!(
                "by {}, {} % for the test: {samples}",
                division.by,
                format_number(100.0 * division.test_fraction)
            ),
        },
    ));
    facts.push((
        "Validation",
        match division.validation_fraction {
            0.0 => "nothing held out".to_owned(),
            fraction => format!("{} % of the other samples", format_number(100.0 * fraction)),
        },
    ));
    let inputs = file.settings.inputs;
    facts.push(("Inputs", format!("{} ({})", inputs.quantity, inputs.scaling)));
    facts.push((
        "Row-wires",
        match (&file.row_wires, file.settings.source.row_model()) {
            (None, _) => "not known".to_owned(),
            (Some(rows), RowModel::Each) => format!("{}, a network for each", rows.len()),
            (Some(rows), RowModel::Shared) => format!("{}, one network for all", rows.len()),
        },
    ));
    facts.extend(training_facts(file));
    facts.push(("Seed", file.settings.seed.to_string()));
    facts
}

/// Names and values of the settings of the network and its training.
fn training_facts(file: &NetworkFile) -> Vec<(&'static str, String)> {
    let rules = file.settings.training.stopping;
    let mut facts = vec![
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
        (
            "Starts",
            match file.settings.combine {
                Combination::Best => file.settings.starts.to_string(),
                Combination::Mean => format!("{}, whose mean is the network", file.settings.starts),
            },
        ),
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
