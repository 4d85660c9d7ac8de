//! The terminal command that repeats a training.

use std::{fmt, path::Path};

use crate::import::{DialectChoice, FileSet, Plan, Recipe, Setup};
use decoupler_core::{
    dataset::{Division, Simulation, Span, SplitBy},
    evaluation::{RUN_OPTIONS, RunSettings},
    scene::{Loading, Movement, RowModel, Scene},
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

/// Returns the terminal command that trains with `setup`. Options that have their default value are omitted. A plan
/// that was read from `recipe` is given by that file; one that needs a recipe is first written to a recipe by another command.
///
/// # Errors
/// Settings for which the terminal has no option.
pub fn train_command(setup: &Setup, recipe: Option<&Path>) -> Result<String, CommandGap> {
    let settings = setup.settings();
    let mut command = Command::default();
    let mut usual = match (settings.simulation(), setup.plan()) {
        (Some(simulation), _) => {
            check_simulation(simulation)?;
            RunSettings::default()
        }
        (None, Some(plan)) => {
            let usual = RunSettings::measured(RowModel::Shared);
            check([(
                settings.inputs.quantity != usual.inputs.quantity,
                "the quantity of the inputs",
            )])?;
            check_plan(plan, recipe)?;
            command.recording(plan, recipe, settings.validation_fraction());
            // Without it, settings are chosen.
            command.add("hidden", settings.hidden);
            RunSettings {
                hidden: settings.hidden,
                ..usual
            }
        }
        (None, None) => return Err(CommandGap(vec!["samples in memory"])),
    };
    let method = settings.training.method;
    if method.short_name() != usual.training.method.short_name() {
        command.add("method", method.short_name());
        usual.choose_method(method.with_defaults());
    }
    for setting in method.settings() {
        let [value, usual] = [method, usual.training.method].map(|method| setting.number(&method).unwrap_or(f64::NAN));
        if value.to_bits() != usual.to_bits() {
            command.add("set", format!("{}={value}", setting.word("-")));
        }
    }
    changed_options(settings, &usual).for_each(|(word, value)| command.add(&word, value));
    Ok(command.text())
}

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

fn check_simulation(source: &Simulation) -> Result<(), CommandGap> {
    let (scene, usual) = (&source.scene, Scene::default());
    let read_back = |loading: Loading| loading.to_string().parse() == Ok(loading);
    check([
        (
            source.sensor != SensorModel::new(source.sensor.scale),
            "the geometry or the resistance per mm",
        ),
        (
            scene.largest_compression.to_bits() != usual.largest_compression.to_bits(),
            "the largest compression",
        ),
        (
            !matches!(scene.movement, Movement::Z) && scene.movement != Movement::SIDEWAYS,
            "the largest shift sideways",
        ),
        (!read_back(scene.loading), "the sizes of the indenter"),
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

/// Options of `train`, and those of a recipe written before.
#[derive(Default)]
struct Command {
    import: String,
    recipe: String,
    training: String,
}

impl Command {
    /// Adds an option of the training.
    fn add(&mut self, name: &str, value: impl fmt::Display) {
        add(&mut self.training, name, value);
    }

    fn text(&self) -> String {
        let Self {
            import,
            recipe,
            training,
        } = self;
        if recipe.is_empty() {
            return format!("decoupler train{import}{training}");
        }
        format!(
            "decoupler inspect{import}{recipe} --recipe-out recipe.json && decoupler train --recipe recipe.json{training}"
        )
    }

    /// Adds the files of a recording, the meanings of their columns and the division of the samples, of which
    /// `validation_fraction` is held out by default.
    fn recording(&mut self, plan: &Plan, recipe: Option<&Path>, validation_fraction: f64) {
        match recipe {
            Some(recipe) => add(&mut self.import, "recipe", recipe.display()),
            None => self.import(&plan.import),
        }
        if let Some(test) = &plan.test {
            let sets = std::iter::once((&test.data, &test.join));
            let sets = sets.chain(test.append.iter().map(|set| (&set.data, &set.join)));
            for (data, join) in sets {
                add(&mut self.import, "test-data", data.display());
                join.iter()
                    .for_each(|file| add(&mut self.recipe, "test-join", file.display()));
            }
        }
        let (division, default) = (plan.division, Division::default());
        let by_default = match plan.import.has_groups() {
            true => SplitBy::Group,
            false => default.by,
        };
        // The recipe may have another rule.
        if recipe.is_some() || division.by != by_default || division.by != default.by {
            add(&mut self.import, "split", division.by);
        }
        if recipe.is_some() {
            return;
        }
        if plan.test.is_none() && division.test_fraction != default.test_fraction {
            add(&mut self.recipe, "test-fraction", division.test_fraction);
        }
        // A recipe fixes the share, which otherwise follows from the method.
        if division.validation_fraction != validation_fraction || !self.recipe.is_empty() {
            add(&mut self.recipe, "validation-fraction", division.validation_fraction);
        }
    }

    fn import(&mut self, recipe: &Recipe) {
        let Recipe {
            data,
            join,
            append,
            dialect,
            inputs,
            targets,
            time,
            group,
            row_wire,
            memory,
            conditions,
            derive,
            missing,
            units,
            positions,
        } = recipe;
        let (import, rest) = (&mut self.import, &mut self.recipe);
        add(import, "data", data.display());
        join.iter()
            .for_each(|joined| add(import, "join", joined.file.display()));
        for FileSet { data, join } in append {
            add(import, "data", data.display());
            join.iter().for_each(|file| add(import, "join", file.display()));
        }
        let times = Vec::from_iter(join.iter().filter_map(|joined| joined.time.as_deref()));
        // One for all, or one for each.
        let is_one = times.windows(2).all(|pair| pair[0] == pair[1]);
        let most = if is_one { 1 } else { times.len() };
        times.iter().take(most).for_each(|time| add(rest, "join-time", time));
        if let Some(limit) = join.first().and_then(|joined| joined.limit) {
            add(rest, "join-limit", limit);
        }
        add(import, "inputs", inputs.join(","));
        add(import, "targets", targets.join(","));
        for (name, column) in [("time", time), ("group", group), ("row-wire", row_wire)] {
            column.iter().for_each(|column| add(import, name, column));
        }
        if let Some(memory) = memory {
            let spans = |spans: &[Span]| Vec::from_iter(spans.iter().map(Span::to_string)).join(",");
            if !memory.averages.is_empty() {
                add(import, "history", spans(&memory.averages));
            }
            if !memory.lags.is_empty() {
                add(rest, "lags", spans(&memory.lags));
            }
            if memory.differences {
                *rest += " --differences";
            }
        }
        conditions.iter().for_each(|condition| add(import, "where", condition));
        derive.iter().for_each(|derived| add(rest, "derive", derived));
        missing.iter().for_each(|missing| add(rest, "missing", missing));
        units
            .iter()
            .for_each(|(column, unit)| add(rest, "unit", format!("{column}={unit}")));
        positions.iter().for_each(|file| add(rest, "positions", file.display()));
        let DialectChoice {
            encoding,
            separator,
            decimal,
            header,
            skip_lines,
        } = dialect;
        separator.iter().for_each(|separator| add(rest, "separator", separator));
        decimal.iter().for_each(|decimal| add(rest, "decimal", decimal));
        let header = header.map(|header| if header { "yes" } else { "no" });
        header.iter().for_each(|header| add(rest, "header", header));
        encoding.iter().for_each(|encoding| add(rest, "encoding", encoding));
        skip_lines.iter().for_each(|lines| add(rest, "skip-lines", lines));
    }
}

fn add(options: &mut String, name: &str, value: impl fmt::Display) {
    let value = value.to_string();
    // Otherwise it would be taken for an option.
    let between = if value.starts_with('-') { "=" } else { " " };
    *options += &format!(" --{name}{between}{}", quoted(Path::new(&value)));
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
