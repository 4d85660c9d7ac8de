//! The settings of a run as text.

use std::fmt::Display;

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

/// Names and values of settings.
#[derive(Default)]
struct Facts(Vec<(&'static str, String)>);

impl Facts {
    fn add(&mut self, name: &'static str, value: impl Display) {
        self.0.push((name, value.to_string()));
    }

    /// Adds the settings of the network and its training.
    fn add_training(&mut self, file: &NetworkFile) {
        let settings = &file.settings;
        let rules = settings.training.stopping;
        self.add("Hidden nodes", settings.hidden);
        self.add("Weights", file.network.weights());
        for (number, stage) in file.training.stages.iter().enumerate() {
            match number {
                0 => self.add("Method", stage.method),
                _ => self.add(
                    "Method",
                    format_args!("from epoch {}: {}", stage.first_epoch, stage.method),
                ),
            }
        }
        match settings.combine {
            Combination::Best => self.add("Starts", settings.starts),
            Combination::Mean => self.add("Starts", format_args!("{}, whose mean is the network", settings.starts)),
        }
        let ends = format_args!(
            "after {}, at a training error of {:?}, a gradient below {:?}, or {}",
            counted(rules.epochs, "epoch"),
            rules.goal_mse,
            rules.min_gradient,
            counted(rules.max_fail, "validation failure")
        );
        self.add("Ends", ends);
    }
}

/// Names and values of all settings.
pub(super) fn settings_facts(file: &NetworkFile, source: &Simulation) -> Vec<(&'static str, String)> {
    let inputs = &file.settings.inputs;
    let (geometry, scene) = (&source.sensor.geometry, &source.scene);
    let mut facts = Facts::default();
    facts.add("Array", source.sensor.scale);
    facts.add("Height", format_args!("{} mm", geometry.height_mm));
    let wires = |axis: &str, from_mm: f64, apart_mm: f64| format!("from {axis} = {from_mm} mm, {apart_mm} mm apart");
    facts.add("Row-wires", wires("x", geometry.row_x0_mm, geometry.row_pitch_mm));
    facts.add(
        "Nodes of a row-wire",
        format_args!("{} mm apart", geometry.node_pitch_mm),
    );
    facts.add(
        "Column-wires",
        wires("y", geometry.column_y0_mm, geometry.column_pitch_mm),
    );
    let nodes = wires("x", geometry.column_node_x0_mm, geometry.column_node_pitch_mm);
    facts.add("Nodes of a column-wire", nodes);
    let rubber = source.sensor.resistivity_ohm_per_mm;
    facts.add("Resistance of the rubber", format_args!("{rubber} ohm/mm"));
    facts.add("Rows", scene.rows);
    match scene.movement {
        Movement::Z => facts.add("Moving axes", "z"),
        Movement::Xyz { largest_shift_mm } => {
            facts.add(
                "Moving axes",
                format_args!("x, y, z; sideways by up to {largest_shift_mm} mm"),
            );
        }
    }
    facts.add("Loading", loading_words(&scene.loading));
    let [percent, mm] = [100.0 * scene.largest_compression, source.stroke_mm()].map(format_number);
    facts.add(
        "Largest compression",
        format_args!("{percent} % of the height, {mm} mm"),
    );
    facts.add("Noise", noise_words(&scene.noise));
    facts.add("Inputs", format_args!("{} ({})", inputs.quantity, inputs.scaling));
    facts.add_training(file);
    let samples = format_args!(
        "{} for training, {} for validation, {} for test, each rounded up to whole snapshots",
        source.samples, source.validation_samples, source.test_samples
    );
    facts.add("Samples", samples);
    facts.add("Seed", file.settings.seed);
    facts.0
}

/// Names and values of the settings of a run on a recording.
pub(super) fn recording_facts(file: &NetworkFile, recorded: &Recorded, test: &Dataset) -> Vec<(&'static str, String)> {
    let Plan {
        import,
        test: tests,
        division,
    } = &recorded.plan;
    let names = |channels: &[Channel]| Vec::from_iter(channels.iter().map(Channel::title)).join(", ");
    let mut facts = Facts::default();
    facts.add("Recording", import.data.display());
    import
        .join
        .iter()
        .for_each(|joined| facts.add("Joined file", joined.file.display()));
    import
        .append
        .iter()
        .for_each(|set| facts.add("Appended", set.data.display()));
    import.time.iter().for_each(|time| facts.add("Time", time));
    import.group.iter().for_each(|group| facts.add("Group", group));
    import
        .derive
        .iter()
        .for_each(|derived| facts.add("Derived column", derived));
    import
        .conditions
        .iter()
        .for_each(|condition| facts.add("Rows used", condition));
    facts.add("Readings", names(&file.problem.inputs));
    file.problem
        .memory
        .iter()
        .for_each(|memory| facts.add("Memory", memory));
    facts.add("Targets", names(&file.problem.targets));
    let samples = counted(test.samples(), "test sample");
    let percent = |fraction: f64| format_number(100.0 * fraction);
    match tests {
        Some(tests) => facts.add("Split", format_args!("{samples} of {}", tests.data.display())),
        None => {
            let held_out = percent(division.test_fraction);
            facts.add(
                "Split",
                format_args!("by {}, {held_out} % for the test: {samples}", division.by),
            );
        }
    }
    match division.validation_fraction {
        0.0 => facts.add("Validation", "nothing held out"),
        fraction => facts.add(
            "Validation",
            format_args!("{} % of the other samples", percent(fraction)),
        ),
    }
    let inputs = file.settings.inputs;
    facts.add("Inputs", format_args!("{} ({})", inputs.quantity, inputs.scaling));
    match (&file.row_wires, file.settings.source.row_model()) {
        (None, _) => facts.add("Row-wires", "not known"),
        (Some(rows), RowModel::Each) => facts.add("Row-wires", format_args!("{}, a network for each", rows.len())),
        (Some(rows), RowModel::Shared) => facts.add("Row-wires", format_args!("{}, one network for all", rows.len())),
    }
    facts.add_training(file);
    facts.add("Seed", file.settings.seed);
    facts.0
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
