//! The command that trains the network of a point of the trade-off again.

use std::path::Path;

use super::{import_arguments::ImportArguments, shell::quoted};
use crate::{
    dataset::Division,
    evaluation::{Measured, RunSettings, SimulatedSettings, TradeOffPoint},
    import::{DialectChoice, Plan, Recipe},
    scene::RowModel,
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
    let hidden = point.hidden()?;
    let mut command = "decoupler train".to_owned();
    let mut add = |name: &str, value: &str| command += &format!(" --{name} {}", quoted(Path::new(value)));
    match import.recipe() {
        Some(recipe) => add("recipe", &recipe.to_string_lossy()),
        None => import_arguments(&plan.import, &mut add),
    }
    if let Some(test) = &plan.test {
        add("test-data", &test.data.to_string_lossy());
        test.join
            .iter()
            .for_each(|file| add("test-join", &file.to_string_lossy()));
    }
    let (division, default) = (plan.division, Division::default());
    let is_recipe = import.recipe().is_some();
    if is_recipe || division.by != default.by {
        add("split", &division.by.to_string());
    }
    if plan.test.is_none() && (is_recipe || division.test_fraction != default.test_fraction) {
        add("test-fraction", &division.test_fraction.to_string());
    }
    if import.holds_out() {
        add("validation-fraction", &division.validation_fraction.to_string());
    }
    let RunSettings {
        source,
        inputs,
        training,
        seed,
        ..
    } = &point.settings;
    let default = RunSettings::from(Measured { rows: RowModel::Shared });
    if source.row_model() == RowModel::Each {
        add("rows", "known");
    }
    if inputs.scaling != default.inputs.scaling {
        add("scaling", &inputs.scaling.to_string());
    }
    add("hidden", &hidden.to_string());
    if training.method.short_name() != default.training.method.short_name() {
        add("method", training.method.short_name());
    }
    if training.stopping.epochs != default.training.stopping.epochs {
        add("epochs", &training.stopping.epochs.to_string());
    }
    if *seed != default.seed {
        add("seed", &seed.to_string());
    }
    Some(command)
}

/// Adds the arguments that give `recipe`, which was made of arguments.
fn import_arguments(recipe: &Recipe, add: &mut impl FnMut(&str, &str)) {
    let Recipe {
        data,
        join,
        dialect,
        inputs,
        targets,
        time,
        group,
        row_wire,
        conditions,
        missing,
        units,
        positions,
    } = recipe;
    add("data", &data.to_string_lossy());
    join.iter()
        .for_each(|joined| add("join", &joined.file.to_string_lossy()));
    let times = Vec::from_iter(join.iter().filter_map(|joined| joined.time.as_deref()));
    // One for all, or one for each.
    let is_one = times.windows(2).all(|pair| pair[0] == pair[1]);
    let most = if is_one { 1 } else { times.len() };
    times.iter().take(most).for_each(|time| add("join-time", time));
    if let Some(limit) = join.first().and_then(|joined| joined.limit) {
        add("join-limit", &limit.to_string());
    }
    add("inputs", &inputs.join(","));
    add("targets", &targets.join(","));
    let columns = [("time", time), ("group", group), ("row-wire", row_wire)];
    for (name, column) in columns {
        column.iter().for_each(|column| add(name, column));
    }
    conditions
        .iter()
        .for_each(|condition| add("where", &condition.to_string()));
    missing.iter().for_each(|missing| add("missing", &missing.to_string()));
    units
        .iter()
        .for_each(|(column, unit)| add("unit", &format!("{column}={unit}")));
    positions
        .iter()
        .for_each(|file| add("positions", &file.to_string_lossy()));
    let DialectChoice {
        encoding,
        separator,
        decimal,
        header,
        skip_lines,
    } = dialect;
    let words = [
        ("separator", separator.map(|separator| separator.to_string())),
        ("decimal", decimal.map(|decimal| decimal.to_string())),
        (
            "header",
            header.map(|header| if header { "yes" } else { "no" }.to_owned()),
        ),
        ("encoding", encoding.map(|encoding| encoding.to_string())),
        ("skip-lines", skip_lines.map(|lines| lines.to_string())),
    ];
    for (name, word) in words {
        word.iter().for_each(|word| add(name, word));
    }
}
