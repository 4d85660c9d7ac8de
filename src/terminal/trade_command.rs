//! The command that trains the network of a point of the trade-off again.

use super::import_arguments::ImportArguments;
use decoupler_core::evaluation::{SimulatedSettings, TradeOffPoint};
use decoupler_files::{
    export::report::train_command,
    import::{Plan, Setup},
};

/// Command that trains with the settings of `point`, on the samples of `plan` if there is one; `None` for decoders of a
/// recording that have no network.
pub(super) fn command(point: &TradeOffPoint, plan: Option<&Plan>, import: &ImportArguments) -> Option<String> {
    match (plan, point.settings.simulated()) {
        (Some(plan), _) => on_recording(point, plan, import),
        (None, Some(settings)) => Some(on_array(point, &settings)),
        (None, None) => None,
    }
}

fn on_array(point: &TradeOffPoint, settings: &SimulatedSettings) -> String {
    let preset = point.preset.unwrap_or_default();
    // As `train` would begin: with this noise the preset has these samples and epochs, without the noise itself.
    let mut of_preset = preset.settings_in(settings.source.scene.noise);
    of_preset.source.scene = preset.settings().source.scene;
    let array = settings.source.sensor.scale.to_string().replace('×', "x");
    let mut command = format!("decoupler train --preset {preset} --array {array}");
    let mut add = |name: &str, value: &dyn Fn(&SimulatedSettings) -> String| {
        if value(settings) != value(&of_preset) {
            command += &format!(" --{name} {}", value(settings));
        }
    };
    add("rows", &|settings| settings.source.scene.rows.to_string());
    add("axes", &|settings| settings.source.scene.movement.to_string());
    add("loading", &|settings| settings.source.scene.loading.to_string());
    add("inputs", &|settings| settings.inputs.quantity.to_string());
    add("scaling", &|settings| settings.inputs.scaling.to_string());
    add("noise", &|settings| {
        format!("{:e}", settings.source.scene.noise.relative)
    });
    add("noise-ohm", &|settings| {
        format!("{:e}", settings.source.scene.noise.additive_ohm)
    });
    add("drift", &|settings| format!("{:e}", settings.source.scene.noise.drift));
    add("adc-bits", &|settings| {
        settings.source.scene.noise.converter_bits.unwrap_or(0).to_string()
    });
    add("noise-in", &|settings| {
        format!("{:?}", settings.source.scene.noise.sets).to_lowercase()
    });
    add("samples", &|settings| settings.source.samples.to_string());
    add("epochs", &|settings| settings.training.stopping.epochs.to_string());
    add("seed", &|settings| settings.seed.to_string());
    if let Some(hidden) = point.hidden() {
        command += &format!(" --hidden {hidden}");
    }
    command + &format!(" --decoder {}", point.report.kind)
}

fn on_recording(point: &TradeOffPoint, plan: &Plan, import: &ImportArguments) -> Option<String> {
    point.hidden()?;
    let setup = Setup::recording(point.settings, plan.clone());
    train_command(&setup, import.recipe()).ok()
}
