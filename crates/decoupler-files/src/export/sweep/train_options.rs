use serde_json::Value;

use super::TrialOptions;
use crate::import::Plan;
use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{RunSettings, Simulation, Source},
    scene::{NoisySets, RowModel, Rows},
    training::Method,
};

/// Decoders in the order in which they are offered, each once: neither changes a result.
pub fn decoders_in_order(decoders: &[DecoderKind]) -> Vec<DecoderKind> {
    let all = DecoderKind::ALL.into_iter();
    all.filter(|kind| decoders.contains(kind)).collect()
}

/// Options that give exactly these settings and decoders, with every default written out, so that the same trial has
/// the same options however it was specified. Those of a recording name no files.
pub fn train_options(settings: &RunSettings, decoders: &[DecoderKind]) -> TrialOptions {
    let training = &settings.training;
    let rules = &training.stopping;
    let mut options = TrialOptions::from([
        ("scaling".to_owned(), text(&settings.inputs.scaling)),
        ("decoder".to_owned(), decoders.iter().map(ToString::to_string).collect()),
        ("hidden".to_owned(), Value::from(settings.hidden)),
        ("starts".to_owned(), Value::from(settings.starts)),
        ("method".to_owned(), Value::from(training.method.short_name())),
        ("set".to_owned(), method_settings(training.method)),
        ("epochs".to_owned(), Value::from(rules.epochs)),
        ("goal".to_owned(), number(rules.goal_mse)),
        ("max-fail".to_owned(), Value::from(rules.max_fail)),
        ("min-gradient".to_owned(), number(rules.min_gradient)),
        ("seed".to_owned(), Value::from(settings.seed.0)),
    ]);
    match &settings.source {
        Source::Simulated(source) => {
            options.insert("inputs".to_owned(), text(&settings.inputs.quantity));
            options.extend(simulation_options(source));
        }
        Source::Measured(source) => {
            let rows = match source.rows {
                RowModel::Shared => Rows::All,
                RowModel::Each => Rows::Known,
            };
            options.insert("rows".to_owned(), text(&rows));
        }
    }
    options
}

/// Options that a recording adds: names and checksums of its files, meanings of their columns, and the division of its samples.
/// The folders of the files are left out, so that a trial is the same wherever they are.
pub fn recording_options(plan: &Plan, crc32: &[String]) -> TrialOptions {
    let named = plan.named();
    let mut import = serde_json::to_value(&named.import).unwrap_or_default();
    let mut taken = |field: &str| {
        let fields = import.as_object_mut();
        fields.and_then(|fields| fields.remove(field)).unwrap_or_default()
    };
    let mut options = TrialOptions::from([
        ("data".to_owned(), taken("data")),
        ("inputs".to_owned(), taken("inputs")),
        ("targets".to_owned(), taken("targets")),
        ("crc32".to_owned(), crc32.iter().cloned().collect()),
        ("split".to_owned(), text(&plan.division.by)),
        ("test-fraction".to_owned(), number(plan.division.test_fraction)),
        (
            "validation-fraction".to_owned(),
            number(plan.division.validation_fraction),
        ),
    ]);
    options.insert("import".to_owned(), import);
    if let Some(test) = &named.test {
        options.insert("test".to_owned(), serde_json::to_value(test).unwrap_or_default());
    }
    options
}

fn simulation_options(source: &Simulation) -> TrialOptions {
    let scene = &source.scene;
    let noise = &scene.noise;
    let noisy_sets = match noise.sets {
        NoisySets::Both => "both",
        NoisySets::Training => "training",
        NoisySets::Test => "test",
    };
    let options = [
        ("array", Value::from(source.sensor.scale.to_string().replace('×', "x"))),
        ("rows", text(&scene.rows)),
        ("axes", text(&scene.movement)),
        ("loading", text(&scene.loading)),
        ("noise", number(noise.relative)),
        ("noise-ohm", number(noise.additive_ohm)),
        ("drift", number(noise.drift)),
        ("noise-in", Value::from(noisy_sets)),
        ("samples", Value::from(source.samples)),
        ("test-samples", Value::from(source.test_samples)),
        ("validation-samples", Value::from(source.validation_samples)),
    ];
    let bits = noise.converter_bits.map(|bits| ("adc-bits", Value::from(bits)));
    let named = options.into_iter().chain(bits);
    named.map(|(option, value)| (option.to_owned(), value)).collect()
}

/// Zero has two signs and one meaning.
fn number(value: f64) -> Value {
    Value::from(value + 0.0)
}

fn text(value: &dyn ToString) -> Value {
    Value::from(value.to_string())
}

fn method_settings(mut method: Method) -> Value {
    let settings = method.settings();
    let pairs = settings.iter().map(|setting| {
        let value = Value::from(*setting.value + 0.0);
        format!("{}={value}", setting.name.replace(' ', "-"))
    });
    pairs.collect()
}
