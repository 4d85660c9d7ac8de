use serde_json::Value;

use super::TrialOptions;
use crate::{decoupling::DecoderKind, evaluation::SimulatedSettings, scene::NoisySets, training::Method};

/// Decoders in the order in which they are offered, each once: neither changes a result.
pub(crate) fn decoders_in_order(decoders: &[DecoderKind]) -> Vec<DecoderKind> {
    let all = DecoderKind::ALL.into_iter();
    all.filter(|kind| decoders.contains(kind)).collect()
}

/// Options that give exactly these settings and decoders, with every default written out, so that the same trial has
/// the same options however it was specified.
pub(crate) fn train_options(settings: &SimulatedSettings, decoders: &[DecoderKind]) -> TrialOptions {
    let (source, training) = (&settings.source, &settings.training);
    let (scene, rules) = (&source.scene, &training.stopping);
    let noise = &scene.noise;
    // Zero has two signs and one meaning.
    let number = |value: f64| Value::from(value + 0.0);
    let text = |value: &dyn ToString| Value::from(value.to_string());
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
        ("inputs", text(&settings.inputs.quantity)),
        ("scaling", text(&settings.inputs.scaling)),
        ("noise", number(noise.relative)),
        ("noise-ohm", number(noise.additive_ohm)),
        ("drift", number(noise.drift)),
        ("noise-in", Value::from(noisy_sets)),
        ("decoder", decoders.iter().map(ToString::to_string).collect()),
        ("hidden", Value::from(settings.hidden)),
        ("starts", Value::from(settings.starts)),
        ("method", Value::from(training.method.short_name())),
        ("set", method_settings(training.method)),
        ("epochs", Value::from(rules.epochs)),
        ("goal", number(rules.goal_mse)),
        ("max-fail", Value::from(rules.max_fail)),
        ("min-gradient", number(rules.min_gradient)),
        ("samples", Value::from(source.samples)),
        ("test-samples", Value::from(source.test_samples)),
        ("validation-samples", Value::from(source.validation_samples)),
        ("seed", Value::from(settings.seed.0)),
    ];
    let bits = noise.converter_bits.map(|bits| ("adc-bits", Value::from(bits)));
    let named = options.into_iter().chain(bits);
    named.map(|(option, value)| (option.to_owned(), value)).collect()
}

fn method_settings(mut method: Method) -> Value {
    let settings = method.settings();
    let pairs = settings.iter().map(|setting| {
        let value = Value::from(*setting.value + 0.0);
        format!("{}={value}", setting.name.replace(' ', "-"))
    });
    pairs.collect()
}
