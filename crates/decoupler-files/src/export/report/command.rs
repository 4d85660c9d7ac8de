//! The terminal command that repeats a training.

use std::{
    borrow::Cow,
    fmt,
    path::{Path, PathBuf},
};

use crate::import::{DialectChoice, FileSet, Plan, Recipe, Setup};
use decoupler_core::{
    dataset::{Division, Memory, Simulation, Span},
    evaluation::{RUN_OPTIONS, RunOption, RunSettings},
    scene::RowModel,
    text::Named as _,
};

/// Settings for which the terminal has no option.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandGap(Vec<&'static str>);

impl fmt::Display for CommandGap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the terminal has no option for {}", self.0.join(", "))
    }
}

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
            check([(
                settings.inputs.quantity != usual.inputs.quantity,
                "the quantity of the inputs",
            )])?;
            check_plan(plan, recipe)?;
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
        (None, None) => return Err(CommandGap(vec!["samples in memory"])),
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
    let (in_recipe, direct): (Vec<_>, Vec<_>) = of_plan.into_iter().partition(|(name, _)| IN_RECIPE.contains(&&**name));
    let [in_recipe, direct, options] = [in_recipe, direct, options].map(|options| written(&options));
    Ok(match &*in_recipe {
        "" => format!("decoupler train{direct}{options}"),
        _ => format!(
            "decoupler inspect{direct}{in_recipe} --recipe-out recipe.json && decoupler train --recipe recipe.json{options}"
        ),
    })
}

/// Options that only a recipe has.
const IN_RECIPE: [&str; 18] = [
    "test-join",
    "test-fraction",
    "validation-fraction",
    "join-time",
    "join-limit",
    "lags",
    "differences",
    "derive",
    "missing",
    "unit",
    "positions",
    "separator",
    "decimal",
    "header",
    "encoding",
    "skip-lines",
    "skip-damaged",
    "truncate",
];

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
    check([
        (
            described.sensor != source.sensor,
            "the geometry or the resistance per mm",
        ),
        (
            scene.largest_compression.to_bits() != same.largest_compression.to_bits(),
            "the largest compression",
        ),
        (scene.movement != same.movement, "the largest shift sideways"),
        (scene.loading != same.loading, "the sizes of the indenter"),
    ])
}

fn check_plan(plan: &Plan, recipe: Option<&Path>) -> Result<(), CommandGap> {
    if recipe.is_some() {
        return Ok(());
    }
    let join = &plan.import.join;
    let is_same_limit = join.windows(2).all(|pair| pair[0].limit == pair[1].limit);
    let times = join.iter().filter(|joined| joined.time.is_some()).count();
    let mut unnamed = plan.import.clone();
    unnamed.join.iter_mut().for_each(|joined| joined.stem = None);
    check([
        (!is_same_limit, "a different --join-limit for each joined file"),
        (
            times != 0 && times != join.len(),
            "a time column of some of the joined files only",
        ),
        (plan.import.stems() != unnamed.stems(), "other names for joined files"),
    ])
}

fn check<const N: usize>(gaps: [(bool, &'static str); N]) -> Result<(), CommandGap> {
    let gaps = Vec::from_iter(gaps.into_iter().filter_map(|(is_gap, name)| is_gap.then_some(name)));
    if gaps.is_empty() { Ok(()) } else { Err(CommandGap(gaps)) }
}

/// Options with the files of a recording and the meanings of their columns.
pub(super) fn file_options(plan: &Plan, recipe: Option<&Path>) -> Vec<GivenOption> {
    let mut options = match recipe {
        Some(recipe) => vec![("recipe".into(), recipe.display().to_string())],
        None => import_options(&plan.import),
    };
    if let Some(test) = &plan.test {
        let names = ["test-data", "test-join"];
        options.extend(set_options(&test.data, &test.join, &test.append, names));
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
fn set_options(data: &Path, join: &[PathBuf], append: &[FileSet], names: [&'static str; 2]) -> Vec<GivenOption> {
    let [of_data, of_join] = names.map(|name| move |file: &Path| (name.into(), file.display().to_string()));
    let mut options = Vec::new();
    let more = append.iter().map(|set| (&*set.data, &*set.join));
    for (data, join) in std::iter::once((data, join)).chain(more) {
        options.push(of_data(data));
        options.extend(join.iter().map(|file| of_join(file)));
    }
    options
}

fn import_options(recipe: &Recipe) -> Vec<GivenOption> {
    let Recipe {
        data,
        join,
        append,
        dialect:
            DialectChoice {
                encoding,
                separator,
                decimal,
                header,
                skip_lines,
            },
        inputs,
        targets,
        time,
        group,
        row_wire,
        memory,
        conditions,
        derive,
        missing,
        skip_damaged,
        truncate,
        units,
        positions,
    } = recipe;
    let joined = Vec::from_iter(join.iter().map(|joined| joined.file.clone()));
    let mut options = set_options(data, &joined, append, ["data", "join"]);
    let mut times = Vec::from_iter(join.iter().filter_map(|joined| joined.time.clone()));
    // One for all, or one for each.
    if times.windows(2).all(|pair| pair[0] == pair[1]) {
        times.truncate(1);
    }
    let spans = |of: fn(&Memory) -> &Vec<Span>| {
        let spans = memory.as_ref().map(of).filter(|spans| !spans.is_empty());
        spans.map(|spans| texts(spans).join(","))
    };
    let has_differences = memory.as_ref().is_some_and(|memory| memory.differences);
    let flag = |is_on: bool| Vec::from_iter(is_on.then(String::new));
    let units = units.iter().map(|(column, unit)| format!("{column}={unit}"));
    let options_of_columns = [
        ("join-time", times),
        (
            "join-limit",
            texts(join.first().and_then(|joined| joined.limit.as_ref())),
        ),
        ("inputs", vec![inputs.join(",")]),
        ("targets", vec![targets.join(",")]),
        ("time", texts(time)),
        ("group", texts(group)),
        ("row-wire", texts(row_wire)),
        ("lags", texts(&spans(|memory| &memory.lags))),
        ("history", texts(&spans(|memory| &memory.averages))),
        ("differences", flag(has_differences)),
        ("skip-damaged", flag(*skip_damaged)),
        ("truncate", flag(*truncate)),
        ("where", texts(conditions)),
        ("derive", texts(derive)),
        ("missing", texts(missing)),
        ("unit", units.collect()),
        ("positions", texts(&positions.as_ref().map(|file| file.display()))),
        ("separator", texts(&separator.map(|separator| separator.name()))),
        ("decimal", texts(&decimal.map(|decimal| decimal.name()))),
        ("header", texts(&header.map(|header| if header { "yes" } else { "no" }))),
        ("encoding", texts(&encoding.map(|encoding| encoding.name()))),
        ("skip-lines", texts(skip_lines)),
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
