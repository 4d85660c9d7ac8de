use std::path::{Path, PathBuf};

use clap::Args;

use super::{checkpointing::check_same, failure::Failure, output::progress_bar};
use crate::{
    dataset::{Division, SplitBy},
    export::RecipeFile,
    import::{
        Condition, Decimal, DialectChoice, Encoding, Joined, Missing, Plan, Progress, Recipe, Separator, TestFiles,
    },
};

// Layout of files of text, where it should not be found.
#[derive(Args)]
#[command(next_help_heading = "Files of text")]
pub(super) struct DialectArguments {
    /// Separator of the cells [default: found]
    #[arg(long, value_name = "comma|semicolon|tab|bar|space")]
    separator: Option<Separator>,
    /// Decimal separator [default: found]
    #[arg(long, value_name = "point|comma")]
    decimal: Option<Decimal>,
    /// Whether the first row has the names of the columns [default: found]
    #[arg(long, value_name = "yes|no", value_parser = yes_or_no)]
    header: Option<bool>,
    /// Encoding [default: found]
    #[arg(long, value_name = "utf-8|latin-1|utf-16le|utf-16be")]
    encoding: Option<Encoding>,
    /// Lines before the table, which are skipped [default: 0]
    #[arg(long, value_name = "N")]
    skip_lines: Option<usize>,
}

// Own data: files, meanings of their columns, and the split.
#[derive(Args)]
#[command(next_help_heading = "Own data")]
pub(super) struct ImportArguments {
    /// Train on the samples of this file (CSV, .npy, .npz or .mat) instead of a simulated sensor
    ///
    /// A column is named as in the header, or c1, c2, … without one; c2..c16 is a range. --inputs and --targets name
    /// columns, separated by commas.
    #[arg(long, value_name = "FILE", conflicts_with = "recipe")]
    pub(super) data: Option<PathBuf>,
    /// Join this file: by time (nearest row), or row by row without --time; its columns get its stem in front, as in
    /// states.c2; may be repeated
    #[arg(long, value_name = "FILE", requires = "data")]
    join: Vec<PathBuf>,
    /// Column of the times of a joined file, without its stem; once, or once for each --join [default: as --time]
    #[arg(long, value_name = "COLUMN", requires = "join")]
    join_time: Vec<String>,
    /// Largest time between a row and its partner [default: half the median interval of the joined file]
    #[arg(long, value_name = "TIME", requires = "join", value_parser = positive)]
    join_limit: Option<f64>,
    /// Columns to be told from the inputs
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', requires = "data")]
    targets: Vec<String>,
    /// Column of the times
    #[arg(long, value_name = "COLUMN", requires = "data")]
    pub(super) time: Option<String>,
    /// Column whose equal values belong together, such as one press or session
    #[arg(long, value_name = "COLUMN", requires = "data")]
    group: Option<String>,
    /// Column of the number of the row-wire, from 1
    #[arg(long, value_name = "COLUMN", requires = "data")]
    row_wire: Option<String>,
    /// Use only rows that meet this, for example "c4<145.1 and c5!=0"; may be repeated
    #[arg(long = "where", value_name = "CONDITION", requires = "data")]
    conditions: Vec<Condition>,
    /// A number or text that means missing, in all columns or in one, such as -1 or states.c5=-1; may be repeated
    #[arg(long, value_name = "[COLUMN=]VALUE", requires = "data")]
    missing: Vec<Missing>,
    /// Unit of a column, such as states.c2=mm; may be repeated [default: from a header such as "x (mm)"]
    #[arg(long, value_name = "COLUMN=UNIT", value_parser = assignment, requires = "data")]
    unit: Vec<(String, String)>,
    /// Positions of the targets on the skin, for surfaces in the window: a table with the columns target,x,y (mm)
    #[arg(long, value_name = "FILE", requires = "data")]
    positions: Option<PathBuf>,
    /// Repeat the import that --save-recipe wrote
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
    /// Write a file (JSON) by which --recipe repeats this import and split
    #[arg(long, value_name = "FILE")]
    save_recipe: Option<PathBuf>,
    /// Samples of the test: the last in time, whole groups, or random ones [default: group with --group, else time]
    #[arg(long, value_name = "time|group|random")]
    split: Option<SplitBy>,
    /// Share of the samples for the test [default: 0.2]
    #[arg(long, value_name = "SHARE", value_parser = share, conflicts_with = "test_data")]
    test_fraction: Option<f64>,
    /// Share of the other samples that selects the best weights and ends the training; 0 for none [default: 0 with --method
    /// br, the default; else 0.2]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    validation_fraction: Option<f64>,
    /// File of the test samples, with the columns of --data
    #[arg(long, value_name = "FILE")]
    test_data: Option<PathBuf>,
    /// File joined to --test-data, in the place of that of --join; may be repeated
    #[arg(long, value_name = "FILE", requires = "test_data")]
    test_join: Vec<PathBuf>,
    /// Test on every sample by cross-validation with this many folds, made as by --split
    #[arg(long, value_name = "K", conflicts_with_all = ["test_fraction", "test_data"])]
    pub(super) folds: Option<usize>,
    #[command(flatten)]
    pub(super) dialect: DialectArguments,
}

fn yes_or_no(text: &str) -> Result<bool, String> {
    match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err("give yes or no".to_owned()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..1.0).contains(share));
    share.ok_or_else(|| "give a number from 0 to below 1, for example 0.2".to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .ok()
        .filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "give a number above 0, in the unit of the times".to_owned())
}

fn assignment(text: &str) -> Result<(String, String), String> {
    let (column, unit) = text
        .split_once('=')
        .ok_or("write COLUMN=UNIT, for example states.c2=mm")?;
    Ok((column.trim().to_owned(), unit.trim().to_owned()))
}

impl DialectArguments {
    pub(super) fn choice(&self) -> DialectChoice {
        DialectChoice {
            encoding: self.encoding,
            separator: self.separator,
            decimal: self.decimal,
            header: self.header,
            skip_lines: self.skip_lines,
        }
    }
}

impl ImportArguments {
    /// Returns `true` if the samples come from files.
    pub(super) fn is_given(&self) -> bool {
        self.data.is_some() || self.recipe.is_some()
    }

    /// Returns `true` if columns have meanings, so that there are samples.
    pub(super) fn has_meanings(&self) -> bool {
        !self.targets.is_empty() || self.recipe.is_some()
    }

    /// The file, where nothing is asked of its columns.
    ///
    /// # Errors
    /// There is none, or an argument needs targets.
    pub(super) fn only_file(&self) -> Result<&Path, Failure> {
        let given = [
            (!self.join.is_empty(), "--join"),
            (self.group.is_some(), "--group"),
            (self.row_wire.is_some(), "--row-wire"),
            (!self.conditions.is_empty(), "--where"),
            (!self.missing.is_empty(), "--missing"),
            (!self.unit.is_empty(), "--unit"),
            (self.positions.is_some(), "--positions"),
            (self.save_recipe.is_some(), "--save-recipe"),
            (self.split.is_some(), "--split"),
            (self.test_fraction.is_some(), "--test-fraction"),
            (self.validation_fraction.is_some(), "--validation-fraction"),
            (self.test_data.is_some(), "--test-data"),
            (self.folds.is_some(), "--folds"),
        ];
        if let Some((_, argument)) = given.into_iter().find(|(is_given, _)| *is_given) {
            return Err(Failure::Arguments(format!("{argument} needs --inputs and --targets")));
        }
        let message = "--data: name the file to inspect";
        self.data
            .as_deref()
            .ok_or_else(|| Failure::Arguments(message.to_owned()))
    }

    /// Returns `true` if the share for validation is given, in an argument or a recipe.
    pub(super) fn holds_out(&self) -> bool {
        self.validation_fraction.is_some() || self.recipe.is_some()
    }

    /// Refuses arguments that have no meaning without own data.
    pub(super) fn check_unused(&self) -> Result<(), Failure> {
        let given = [
            (self.save_recipe.is_some(), "--save-recipe"),
            (self.split.is_some(), "--split"),
            (self.test_fraction.is_some(), "--test-fraction"),
            (self.validation_fraction.is_some(), "--validation-fraction"),
            (self.test_data.is_some(), "--test-data"),
            (self.folds.is_some(), "--folds"),
            (self.dialect.choice() != DialectChoice::default(), "the layout of files"),
        ];
        match given.into_iter().find(|(is_given, _)| *is_given) {
            Some((_, argument)) => Err(Failure::Arguments(format!("{argument} needs --data or --recipe"))),
            None => Ok(()),
        }
    }

    /// Refuses arguments that differ from the `saved` plan of a training that is resumed. Those that name files and columns
    /// need --data, which is refused already.
    pub(super) fn check_resumed(&self, saved: &Plan) -> Result<(), Failure> {
        let division = &saved.division;
        check_same("split", self.split, division.by)?;
        check_same("test-fraction", self.test_fraction, division.test_fraction)?;
        check_same(
            "validation-fraction",
            self.validation_fraction,
            division.validation_fraction,
        )?;
        let given = [
            (self.test_data.is_some(), "--test-data"),
            (self.folds.is_some(), "--folds"),
            (self.save_recipe.is_some(), "--save-recipe"),
            (self.dialect.choice() != DialectChoice::default(), "the layout of files"),
        ];
        match given.into_iter().find(|(is_given, _)| *is_given) {
            Some((_, argument)) => Err(Failure::Arguments(format!(
                "{argument}: the checkpoint names the files and their division; leave it out to resume, or start a new \
                 training with another --checkpoint"
            ))),
            None => Ok(()),
        }
    }

    /// The plan that the arguments describe, with paths relative to the working folder; `inputs` are the columns read.
    pub(super) fn plan(&self, inputs: &[String]) -> Result<Plan, Failure> {
        self.plan_of(inputs, &self.targets)
    }

    /// As [`Self::plan`], with these columns as the targets.
    pub(super) fn plan_of(&self, inputs: &[String], targets: &[String]) -> Result<Plan, Failure> {
        let mut plan = match &self.recipe {
            Some(path) => {
                if !inputs.is_empty() {
                    let message = "--inputs: the recipe names the inputs; leave it out, or give --data";
                    return Err(Failure::Arguments(message.to_owned()));
                }
                RecipeFile::load_recording(path)?
            }
            None => {
                let mut plan = Plan {
                    import: self.import(inputs, targets)?,
                    ..Plan::default()
                };
                if self.group.is_some() {
                    plan.division.by = SplitBy::Group;
                }
                plan
            }
        };
        let Division {
            by,
            test_fraction,
            validation_fraction,
        } = plan.division;
        plan.division = Division {
            by: self.split.unwrap_or(by),
            test_fraction: self.test_fraction.unwrap_or(test_fraction),
            validation_fraction: self.validation_fraction.unwrap_or(validation_fraction),
        };
        if let Some(data) = &self.test_data {
            plan.test = Some(TestFiles {
                data: data.clone(),
                join: self.test_join.clone(),
            });
        }
        if plan.division.by == SplitBy::Group && plan.import.group.is_none() {
            let message = "--split group: say which column is the group with --group";
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok(plan)
    }

    fn import(&self, inputs: &[String], targets: &[String]) -> Result<Recipe, Failure> {
        for (argument, columns) in [("--inputs", inputs), ("--targets", targets)] {
            if columns.is_empty() {
                let message = format!("{argument}: name the columns; decoupler inspect --data FILE lists them");
                return Err(Failure::Arguments(message));
            }
        }
        if self.join_time.len() > 1 && self.join_time.len() != self.join.len() {
            let message = "--join-time: give it once, or once for each --join";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let joined = |(number, file): (usize, &PathBuf)| Joined {
            file: file.clone(),
            stem: None,
            time: self.join_time.get(number).or(self.join_time.first()).cloned(),
            limit: self.join_limit,
        };
        Ok(Recipe {
            data: self.data.clone().unwrap_or_default(),
            join: self.join.iter().enumerate().map(joined).collect(),
            dialect: self.dialect.choice(),
            inputs: inputs.to_vec(),
            targets: targets.to_vec(),
            time: self.time.clone(),
            group: self.group.clone(),
            row_wire: self.row_wire.clone(),
            conditions: self.conditions.clone(),
            missing: self.missing.clone(),
            units: self.unit.iter().cloned().collect(),
            positions: self.positions.clone(),
        })
    }

    /// The recipe that is repeated.
    pub(super) fn recipe(&self) -> Option<&Path> {
        self.recipe.as_deref()
    }

    /// Writes the recipe, if that is asked for.
    pub(super) fn save_recipe(&self, plan: &Plan) -> Result<(), Failure> {
        match &self.save_recipe {
            Some(path) => Ok(RecipeFile::save(plan, path)?),
            None => Ok(()),
        }
    }
}

/// Runs `import` with a bar that shows how far the file has been read.
pub(super) fn with_bar<T>(
    is_hidden: bool,
    import: impl FnOnce(&mut dyn FnMut(Progress) -> std::ops::ControlFlow<()>) -> T,
) -> T {
    let bar = progress_bar(is_hidden, 1, "reading {bytes} of {total_bytes}");
    let result = import(&mut |progress| {
        bar.set_length(progress.of.unwrap_or(progress.bytes));
        bar.set_position(progress.bytes);
        std::ops::ControlFlow::Continue(())
    });
    bar.finish_and_clear();
    result
}

/// Folder to which the paths of a plan from arguments are relative.
pub(super) fn working_folder() -> &'static Path {
    Path::new("")
}
