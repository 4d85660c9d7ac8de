//! The terminal command that repeats a training.

use std::{borrow::Cow, path::Path};

use crate::import::{FileSet, Plan, Recipe, Setup};
use decoupler_core::{
    dataset::{Division, Memory, Simulation, Span},
    evaluation::{RUN_OPTIONS, RunOption, RunSettings},
    scene::RowModel,
};
use thiserror::Error;

/// Settings for which the terminal has no option.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("the terminal has no option for {0}")]
pub struct CommandGap(String);

/// Returns the terminal command that trains with `setup`. Options that have their default value are omitted. A plan
/// that was read from `recipe` is given by that file; one that needs a recipe is first written to a recipe by another command.
///
/// # Errors
/// Settings for which the terminal has no option.
pub fn train_command(setup: &Setup, recipe: Option<&Path>) -> Result<String, CommandGap> {
    let settings = setup.settings();
    let (mut of_plan, mut options) = (Vec::new(), Vec::new());
    let mut usual = RunSettings::default();
    match (settings.simulation(), setup.plan()) {
        (Some(simulation), _) => check_simulation(simulation)?,
        (None, Some(plan)) => {
            usual = RunSettings::measured(RowModel::Shared);
            let is_other = settings.inputs.quantity != usual.inputs.quantity;
            check([is_other.then_some("the quantity of the inputs")])?;
            if recipe.is_none() {
                check_plan(plan)?;
            }
            of_plan = file_options(plan, recipe);
            match recipe {
                // It has the fractions, but may have another rule.
                Some(_) => of_plan.push(("split".into(), plan.division.by.to_string())),
                None => of_plan.extend(division_options(plan, Some(settings.validation_fraction()))),
            }
            // Without it, settings are chosen.
            options.push(("hidden".into(), settings.hidden.to_string()));
            usual.hidden = settings.hidden;
        }
        (None, None) => return Err(CommandGap("samples in memory".to_owned())),
    }
    let method = settings.training.method;
    if method.short_name() != usual.training.method.short_name() {
        options.push(("method".into(), method.short_name().to_owned()));
        usual.choose_method(method.with_defaults());
    }
    for setting in method.settings() {
        let [value, usual] = [method, usual.training.method].map(|method| setting.number(&method).unwrap_or(f64::NAN));
        if value.to_bits() != usual.to_bits() {
            options.push(("set".into(), format!("{}={value}", setting.word("-"))));
        }
    }
    options.extend(changed_options(settings, &usual).map(|(word, value)| (word.into(), value)));
    let (mut direct, mut in_recipe) = (Vec::new(), Vec::new());
    for option in of_plan {
        match &*option.0 {
            "recipe" | "data" | "test-data" | "join" | "inputs" | "targets" | "time" | "group" | "row-wire"
            | "history" | "where" | "split" => direct.push(option),
            // The others are only options of `inspect`.
            _ => in_recipe.push(option),
        }
    }
    let [in_recipe, direct, options] = [in_recipe, direct, options].map(|options| written(&options));
    Ok(match &*in_recipe {
        "" => format!("decoupler train{direct}{options}"),
        _ => format!(
            "decoupler inspect{direct}{in_recipe} --recipe-out recipe.json && decoupler train --recipe recipe.json{options}"
        ),
    })
}

fn written(options: &[GivenOption]) -> String {
    let written = options.iter().map(|(name, value)| match &**value {
        "" => format!(" --{name}"),
        value => {
            // Otherwise it would be taken for an option.
            let between = if value.starts_with('-') { "=" } else { " " };
            format!(" --{name}{between}{}", quoted(Path::new(value)))
        }
    });
    written.collect()
}

/// An option and its value, empty if it has none.
pub(super) type GivenOption = (Cow<'static, str>, String);

/// Options, with their values, in which `settings` differ from `usual`, except those of the method.
pub fn changed_options(settings: &RunSettings, usual: &RunSettings) -> impl Iterator<Item = (String, String)> {
    RUN_OPTIONS.iter().filter_map(|option| {
        let setting = &option.setting;
        let (value, usual) = (setting.get(settings)?, setting.get(usual));
        (Some(&value) != usual.as_ref()).then(|| match (setting.word("-"), option.is_rare()) {
            (word, true) => ("set".to_owned(), format!("{word}={value}")),
            (word, false) => (word, value.to_string()),
        })
    })
}

/// Quotes a word for a POSIX shell.
pub fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text;
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// Checks that the table of settings describes the array completely.
fn check_simulation(source: &Simulation) -> Result<(), CommandGap> {
    let (run, mut described) = (RunSettings::from(*source), RunSettings::default());
    for RunOption { setting, .. } in &RUN_OPTIONS {
        if let Some(value) = setting.get(&run) {
            // A value that cannot be set again is a difference.
            let _ = setting.set(&mut described, &value);
        }
    }
    let described = described.simulation().copied().unwrap_or_default();
    let (scene, same) = (&source.scene, &described.scene);
    let compressions = [scene, same].map(|scene| scene.largest_compression.to_bits());
    check([
        (described.sensor != source.sensor).then_some("the geometry or the resistance per mm"),
        (compressions[0] != compressions[1]).then_some("the largest compression"),
        (scene.movement != same.movement).then_some("the largest shift sideways"),
        (scene.loading != same.loading).then_some("the sizes of the indenter"),
    ])
}

fn check_plan(plan: &Plan) -> Result<(), CommandGap> {
    let join = &plan.import.join;
    let is_same_limit = join.windows(2).all(|pair| pair[0].limit == pair[1].limit);
    let times = join.iter().filter(|joined| joined.time.is_some()).count();
    let has_some_times = times != 0 && times != join.len();
    let mut unnamed = plan.import.clone();
    unnamed.join.iter_mut().for_each(|joined| joined.stem = None);
    check([
        (!is_same_limit).then_some("a different --join-limit for each joined file"),
        has_some_times.then_some("a time column of some of the joined files only"),
        (plan.import.stems() != unnamed.stems()).then_some("other names for joined files"),
    ])
}

fn check<const N: usize>(gaps: [Option<&str>; N]) -> Result<(), CommandGap> {
    let gaps = Vec::from_iter(gaps.into_iter().flatten()).join(", ");
    if gaps.is_empty() { Ok(()) } else { Err(CommandGap(gaps)) }
}

/// Options with the files of a recording and the meanings of their columns.
pub(super) fn file_options(plan: &Plan, recipe: Option<&Path>) -> Vec<GivenOption> {
    let mut options = match recipe {
        Some(recipe) => vec![("recipe".into(), recipe.display().to_string())],
        None => import_options(&plan.import),
    };
    if let Some(test) = &plan.test {
        options.extend(set_options(test, ["test-data", "test-join"]));
    }
    options
}

/// Options with the division of the samples; without those that have their default, if `usual` is given, the fraction held out
/// for validation by default.
pub(super) fn division_options(plan: &Plan, usual: Option<f64>) -> Vec<GivenOption> {
    let (division, default) = (plan.division, Division::default());
    let is_given = |is_default: bool| usual.is_none() || !is_default;
    let mut options = Vec::new();
    // Groups are the rule where there are some, and time is the default of recipes.
    if is_given(!plan.import.has_groups() && division.by == default.by) {
        options.push(("split".into(), division.by.to_string()));
    }
    if plan.test.is_none() && is_given(division.test_fraction == default.test_fraction) {
        options.push(("test-fraction".into(), division.test_fraction.to_string()));
    }
    let validation = division
        .validation_fraction
        .filter(|share| is_given(usual == Some(*share)));
    options.extend(validation.map(|share| ("validation-fraction".into(), share.to_string())));
    options
}

/// Options with the files of the first set and of those appended to it.
fn set_options(set: &FileSet, names: [&'static str; 2]) -> Vec<GivenOption> {
    let [of_data, of_join] = names.map(|name| move |file: &Path| (name.into(), file.display().to_string()));
    let mut options = Vec::new();
    for FileSet { data, join, .. } in set.flat() {
        options.push(of_data(&data));
        options.extend(join.iter().map(|file| of_join(file)));
    }
    options
}

fn import_options(recipe: &Recipe) -> Vec<GivenOption> {
    let (join, memory, dialect) = (&recipe.join, &recipe.memory, &recipe.dialect);
    let mut options = set_options(&recipe.files(), ["data", "join"]);
    let mut times = Vec::from_iter(join.iter().filter_map(|joined| joined.time.clone()));
    // One for all, or one for each.
    if times.windows(2).all(|pair| pair[0] == pair[1]) {
        times.truncate(1);
    }
    let limit = join.first().and_then(|joined| joined.limit.as_ref());
    let spans = |of: fn(&Memory) -> &Vec<Span>| {
        let spans = memory.as_ref().map(of).filter(|spans| !spans.is_empty());
        spans.map(|spans| texts(spans).join(","))
    };
    let has_differences = memory.as_ref().is_some_and(|memory| memory.differences);
    let flag = |is_on: bool| Vec::from_iter(is_on.then(String::new));
    let positions = recipe.positions.as_ref().map(|file| file.display());
    let header = dialect.header.map(|header| if header { "yes" } else { "no" });
    let units = recipe.units.iter().map(|(column, unit)| format!("{column}={unit}"));
    let options_of_columns = [
        ("join-time", times),
        ("join-limit", texts(limit)),
        ("inputs", vec![recipe.inputs.join(",")]),
        ("targets", vec![recipe.targets.join(",")]),
        ("time", texts(&recipe.time)),
        ("group", texts(&recipe.group)),
        ("row-wire", texts(&recipe.row_wire)),
        ("lags", texts(&spans(|memory| &memory.lags))),
        ("history", texts(&spans(|memory| &memory.averages))),
        ("differences", flag(has_differences)),
        ("skip-damaged", flag(recipe.skip_damaged)),
        ("truncate", flag(recipe.truncate)),
        ("where", texts(&recipe.conditions)),
        ("derive", texts(&recipe.derive)),
        ("missing", texts(&recipe.missing)),
        ("unit", units.collect()),
        ("positions", texts(&positions)),
        ("separator", texts(&dialect.separator)),
        ("decimal", texts(&dialect.decimal)),
        ("header", texts(&header)),
        ("encoding", texts(&dialect.encoding)),
        ("skip-lines", texts(&dialect.skip_lines)),
    ];
    let of_columns = options_of_columns.into_iter();
    options.extend(of_columns.flat_map(|(name, values)| values.into_iter().map(move |value| (name.into(), value))));
    options
}

fn texts<'a, T: ToString + 'a>(values: impl IntoIterator<Item = &'a T>) -> Vec<String> {
    values.into_iter().map(ToString::to_string).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_a_shell() {
        let cases = [
            ("run.checkpoint", "run.checkpoint"),
            ("my runs/a.json", "'my runs/a.json'"),
            ("it's", r"'it'\''s'"),
            ("$HOME", "'$HOME'"),
        ];
        for (path, expected) in cases {
            assert_eq!(quoted(Path::new(path)), expected);
        }
    }
}
