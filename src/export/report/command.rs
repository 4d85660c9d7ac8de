use std::fmt;

use crate::{
    evaluation::SimulatedSettings,
    scene::{Loading, Movement, NoisySets},
    sensor::SensorModel,
};

/// Settings for which the terminal has no option.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandGap(Vec<&'static str>);

impl fmt::Display for CommandGap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the terminal has no option for {}", self.0.join(", "))
    }
}

/// Returns the command that trains with `settings` in a terminal. What is not said has its default.
///
/// # Errors
/// Settings for which the terminal has no option.
pub fn train_command(settings: &SimulatedSettings) -> Result<String, CommandGap> {
    let default = SimulatedSettings::default();
    let (source, usual) = (&settings.source, &default.source);
    let (scene, noise) = (&source.scene, &source.scene.noise);
    let read_back = |loading: Loading| loading.to_string().parse() == Ok(loading);
    let gaps = [
        (
            source.sensor != SensorModel::new(source.sensor.scale),
            "the geometry or the resistance per mm",
        ),
        (
            scene.largest_compression.to_bits() != usual.scene.largest_compression.to_bits(),
            "the largest compression",
        ),
        (
            !matches!(scene.movement, Movement::Z) && scene.movement != Movement::SIDEWAYS,
            "the largest shift sideways",
        ),
        (!read_back(scene.loading), "the sizes of the indenter"),
    ];
    let gaps: Vec<_> = gaps
        .into_iter()
        .filter_map(|(is_gap, name)| is_gap.then_some(name))
        .collect();
    if !gaps.is_empty() {
        return Err(CommandGap(gaps));
    }
    let mut command = Command("decoupler train".to_owned());
    let array = source.sensor.scale.to_string().replace('×', "x");
    command.option("array", Some(array), usual.sensor.scale.to_string().replace('×', "x"));
    command.option("rows", Some(scene.rows), usual.scene.rows);
    command.option("axes", Some(scene.movement), usual.scene.movement);
    command.option("loading", Some(scene.loading), usual.scene.loading);
    command.option("noise", Some(noise.relative), 0.0);
    command.option("noise-ohm", Some(noise.additive_ohm), 0.0);
    command.option("adc-bits", noise.converter_bits, 0);
    command.option("drift", Some(noise.drift), 0.0);
    let sets = |sets| match sets {
        NoisySets::Both => "both",
        NoisySets::Training => "training",
        NoisySets::Test => "test",
    };
    command.option("noise-in", Some(sets(noise.sets)), "both");
    command.option("inputs", Some(settings.inputs.quantity), default.inputs.quantity);
    command.option("scaling", Some(settings.inputs.scaling), default.inputs.scaling);
    command.option("hidden", Some(settings.hidden), default.hidden);
    command.option("starts", Some(settings.starts), default.starts);
    let (mut method, rules, usual_rules) = (
        settings.training.method,
        settings.training.stopping,
        default.training.stopping,
    );
    command.option(
        "method",
        Some(method.short_name()),
        default.training.method.short_name(),
    );
    for setting in method.settings() {
        if setting.value.to_bits() != setting.default.to_bits() {
            command.add(&format!("--set {}={}", setting.name.replace(' ', "-"), setting.value));
        }
    }
    command.option("epochs", Some(rules.epochs), usual_rules.epochs);
    command.option("goal", Some(rules.goal_mse), usual_rules.goal_mse);
    command.option("max-fail", Some(rules.max_fail), usual_rules.max_fail);
    command.option("min-gradient", Some(rules.min_gradient), usual_rules.min_gradient);
    command.option("samples", Some(source.samples), usual.samples);
    command.option(
        "validation-samples",
        Some(source.validation_samples),
        usual.validation_samples,
    );
    command.option("test-samples", Some(source.test_samples), usual.test_samples);
    command.option("seed", Some(settings.seed.0), default.seed.0);
    Ok(command.0)
}

struct Command(String);

impl Command {
    fn add(&mut self, words: &str) {
        self.0 += " ";
        self.0 += words;
    }

    /// Adds an option that is given and not as usual.
    fn option<T: PartialEq + fmt::Display>(&mut self, name: &str, value: Option<T>, usual: T) {
        if let Some(value) = value.filter(|value| *value != usual) {
            self.add(&format!("--{name} {value}"));
        }
    }
}
