use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use clap::Args;

use super::{
    failure::Failure,
    file_patterns::{expanded, file_sets},
    interruption::check_same,
};
use decoupler_core::{
    dataset::{DatasetError, Division, Memory, Span, SplitBy},
    text::Named,
};
use decoupler_files::{
    export::{RecipeFile, RecipeSource},
    import::{
        Condition, Decimal, Derived, DialectChoice, Encoding, FileSet, Joined, Missing, Plan, Recipe, Recorded,
        Separator, TestFiles,
    },
};

/// A value of `--memory`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum MemoryArgument {
    /// No memory.
    None,
    /// Memories are tried.
    Auto,
    /// A time constant.
    Span(Span),
}

impl MemoryArgument {
    fn span(&self) -> Option<Span> {
        match self {
            Self::Span(span) => Some(*span),
            Self::None | Self::Auto => None,
        }
    }
}

impl FromStr for MemoryArgument {
    type Err = DatasetError;

    fn from_str(text: &str) -> Result<Self, DatasetError> {
        match text {
            "none" => Ok(Self::None),
            "auto" => Ok(Self::Auto),
            _ => text.parse().map(Self::Span),
        }
    }
}

// Layout of text files, if it should not be detected.
#[derive(Args)]
#[command(next_help_heading = "Text files")]
pub(super) struct DialectArguments {
    /// Separator of the cells [default: detected]
    #[arg(long, value_name = "comma|semicolon|tab|bar|space", value_parser = Separator::named)]
    separator: Option<Separator>,
    /// Decimal separator [default: detected]
    #[arg(long, value_name = "point|comma", value_parser = Decimal::named)]
    decimal: Option<Decimal>,
    /// Whether the first row has the names of the columns [default: detected]
    #[arg(long, value_name = "yes|no", value_parser = yes_or_no)]
    header: Option<bool>,
    /// Encoding [default: detected]
    #[arg(long, value_name = "utf-8|latin-1|utf-16le|utf-16be", value_parser = |text: &str| Encoding::parse(&text.to_lowercase()))]
    encoding: Option<Encoding>,
    /// Number of lines to skip before the table [default: 0]
    #[arg(long, value_name = "N")]
    skip_lines: Option<usize>,
}

// A recording: files, roles of their columns, and the split.
#[derive(Args)]
#[command(next_help_heading = "Recording")]
pub(super) struct ImportArguments {
    /// Use the samples of this file (CSV, Excel, .npy, .npz or .mat) instead of a simulated array; several files, a pattern
    /// or a folder for one experiment
    ///
    /// A column is named as in the header, or c1, c2, … without one; c2..c16 is a range. --inputs and --targets name
    /// columns, separated by commas. The rows of several files with the same columns follow one another; without --group,
    /// each file is a group.
    #[arg(long, value_name = "FILE", conflicts_with = "recipe", num_args = 1..)]
    pub(super) data: Vec<PathBuf>,
    /// Join this file: by time (nearest row), or row by row without --time; its columns are prefixed with its stem, as in
    /// states.c2; may be repeated. With several files in --data, first those joined to the first, then those joined to the
    /// second, and so on
    #[arg(long, value_name = "FILE", requires = "data", num_args = 1..)]
    join: Vec<PathBuf>,
    /// Time column of a joined file, without its stem; once, or once for each --join [default: as --time]
    #[arg(long, value_name = "COLUMN", requires = "join")]
    join_time: Vec<String>,
    /// Maximum time between matched rows [default: half the median interval of the joined file]
    #[arg(long, value_name = "TIME", requires = "join", value_parser = positive)]
    join_limit: Option<f64>,
    /// Columns to be predicted from the inputs
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', requires = "data")]
    targets: Vec<String>,
    /// Time column
    #[arg(long, value_name = "COLUMN", requires = "data")]
    pub(super) time: Option<String>,
    /// Column that groups samples with equal values, such as one press or session
    #[arg(long, value_name = "COLUMN", requires = "data")]
    group: Option<String>,
    /// Inputs from the past: the readings this number of samples, or seconds, before each sample, such as 5,10,20 or 0.5s;
    /// within a group and across no gap in time (over fifty usual intervals)
    #[arg(long, value_name = "SPANS", value_delimiter = ',', requires = "data")]
    lags: Vec<Span>,
    /// Inputs from the past: exponential averages of the readings with these time constants, such as 0.1s,1s,10s, which need
    /// --time, or 20,100 samples. For a choice of settings, none tries no memory, and auto tries some even without --time;
    /// otherwise it tries some with --time
    #[arg(long, value_name = "SPANS|none|auto", value_delimiter = ',', requires = "data")]
    memory: Vec<MemoryArgument>,
    /// The past as its difference from the present reading; without --lags and --memory, from the sample before
    #[arg(long, requires = "data")]
    differences: bool,
    /// Column with the row number from 1
    #[arg(long, value_name = "COLUMN", requires = "data")]
    row_wire: Option<String>,
    /// Use only rows that meet this condition, for example "c4<145.1 and c5!=0"; may be repeated
    #[arg(long = "where", value_name = "CONDITION", requires = "data")]
    conditions: Vec<Condition>,
    /// Add a column computed from others of the same file: a difference such as d=c1-c2, a ratio such as q=c1/c2, or either
    /// with its own mean over the first seconds or rows, such as r=c1/start(2s) or r=c1-start(100); may be repeated
    #[arg(long, value_name = "NAME=EXPRESSION", requires = "data")]
    derive: Vec<Derived>,
    /// Number or text that marks a missing value, in all columns or in one, such as -1 or states.c5=-1; may be repeated
    #[arg(long, value_name = "[COLUMN=]VALUE", requires = "data")]
    missing: Vec<Missing>,
    /// Unit of a column, such as states.c2=mm; may be repeated [default: from a header such as "x (mm)"]
    #[arg(long, value_name = "COLUMN=UNIT", value_parser = assignment, requires = "data")]
    unit: Vec<(String, String)>,
    /// Positions of the targets on the skin, for surfaces in the window: a table with the columns target,x,y (mm)
    #[arg(long, value_name = "FILE", requires = "data")]
    positions: Option<PathBuf>,
    /// Use the simulated array or the recording of this recipe, written by --save-recipe
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
    /// Write a recipe (JSON), with which --recipe uses this array, or this recording and its split, again
    #[arg(long, value_name = "FILE")]
    save_recipe: Option<PathBuf>,
    /// Test samples: the last in time, whole groups, or random ones [default: group with --group, else time]
    #[arg(long, value_name = "time|group|random", value_parser = SplitBy::parse)]
    split: Option<SplitBy>,
    /// Share of the samples held out for testing [default: 0.2]
    #[arg(long, value_name = "SHARE", value_parser = share, conflicts_with = "test_data")]
    test_fraction: Option<f64>,
    /// Share of the other samples that selects the best weights and ends the training; 0 for none [default: 0 with
    /// --method br, the default; else 0.2]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    validation_fraction: Option<f64>,
    /// File of the test samples, with the columns of --data; may be repeated, or be a pattern or a folder
    #[arg(long, value_name = "FILE", num_args = 1..)]
    test_data: Vec<PathBuf>,
    /// File joined to --test-data, corresponding to --join; may be repeated
    #[arg(long, value_name = "FILE", requires = "test_data", num_args = 1..)]
    test_join: Vec<PathBuf>,
    /// Test on every sample by cross-validation with this many folds, divided by --split
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

/// Refuses the first argument that is given.
fn refuse(given: &[(bool, &str)], message: impl Fn(&str) -> String) -> Result<(), Failure> {
    match given.iter().find(|(is_given, _)| *is_given) {
        Some((_, argument)) => Err(Failure::Arguments(message(argument))),
        None => Ok(()),
    }
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
        !self.data.is_empty() || self.recipe.is_some()
    }

    /// Returns `true` if columns have roles, so that there are samples.
    pub(super) fn has_roles(&self) -> bool {
        !self.targets.is_empty() || self.recipe.is_some()
    }

    /// The files, if no columns are selected.
    ///
    /// # Errors
    /// If there is no file, or an argument needs targets.
    pub(super) fn only_files(&self) -> Result<Vec<PathBuf>, Failure> {
        let given = [
            (!self.join.is_empty(), "--join"),
            (self.group.is_some(), "--group"),
            (self.row_wire.is_some(), "--row-wire"),
            (!self.lags.is_empty(), "--lags"),
            (!self.memory.is_empty(), "--memory"),
            (self.differences, "--differences"),
            (!self.conditions.is_empty(), "--where"),
            (!self.derive.is_empty(), "--derive"),
            (!self.missing.is_empty(), "--missing"),
            (!self.unit.is_empty(), "--unit"),
            (self.positions.is_some(), "--positions"),
            (self.save_recipe.is_some(), "--save-recipe"),
        ];
        let message = |argument: &str| format!("{argument} needs --inputs and --targets");
        refuse(&given, message)?;
        self.refuse_division(message)?;
        if self.data.is_empty() {
            let message = "--data: name the file to inspect";
            return Err(Failure::Arguments(message.to_owned()));
        }
        expanded("--data", &self.data)
    }

    /// Returns `true` if the validation share is given in an argument or a recipe.
    pub(super) fn holds_out(&self) -> bool {
        self.validation_fraction.is_some() || self.recipe.is_some()
    }

    /// Refuses arguments that need a recording.
    pub(super) fn check_unused(&self) -> Result<(), Failure> {
        let message = |argument: &str| format!("{argument} needs --data or --recipe");
        self.refuse_division(message)?;
        let given = [(self.dialect.choice() != DialectChoice::default(), "the layout of files")];
        refuse(&given, message)
    }

    /// Refuses arguments by which samples are divided.
    pub(super) fn refuse_division(&self, message: impl Fn(&str) -> String) -> Result<(), Failure> {
        let given = [
            (self.split.is_some(), "--split"),
            (self.test_fraction.is_some(), "--test-fraction"),
            (self.validation_fraction.is_some(), "--validation-fraction"),
            (!self.test_data.is_empty(), "--test-data"),
            (self.folds.is_some(), "--folds"),
        ];
        refuse(&given, message)
    }

    /// Refuses shares of samples held out where cross-validation tests on every sample, unless a recipe keeps them.
    pub(super) fn refuse_unused_shares(&self) -> Result<(), Failure> {
        let is_unused = self.save_recipe.is_none();
        let given = [
            (is_unused && self.test_fraction.is_some(), "--test-fraction"),
            (is_unused && self.validation_fraction.is_some(), "--validation-fraction"),
        ];
        refuse(&given, |argument| {
            format!(
                "{argument}: a recording is analysed by cross-validation; leave it out, or keep it in a recipe with --save-recipe"
            )
        })
    }

    /// Refuses arguments that differ from the `saved` plan of a training that is resumed. File names are not compared:
    /// files may have been [moved](Self::relocated).
    pub(super) fn check_resumed(&self, saved: &Plan) -> Result<(), Failure> {
        let (division, import) = (&saved.division, &saved.import);
        check_same("split", self.split, division.by)?;
        check_same("test-fraction", self.test_fraction, division.test_fraction)?;
        check_same(
            "validation-fraction",
            self.validation_fraction,
            division.validation_fraction,
        )?;
        let given = |columns: &[String]| (!columns.is_empty()).then(|| columns.join(","));
        check_same("targets", given(&self.targets), import.targets.join(","))?;
        for (argument, column, saved) in [
            ("time", &self.time, &import.time),
            ("group", &self.group, &import.group),
            ("row-wire", &self.row_wire, &import.row_wire),
        ] {
            check_same(argument, column.as_ref(), saved.as_deref().unwrap_or("none"))?;
        }
        if let Some(memory) = self.of_memory() {
            let none = Memory::default();
            check_same("memory", Some(memory), import.memory.clone().unwrap_or(none))?;
        }
        let given = [
            (self.recipe.is_some(), "--recipe"),
            (!self.join_time.is_empty(), "--join-time"),
            (self.join_limit.is_some(), "--join-limit"),
            (!self.conditions.is_empty(), "--where"),
            (!self.derive.is_empty(), "--derive"),
            (!self.missing.is_empty(), "--missing"),
            (!self.unit.is_empty(), "--unit"),
            (self.folds.is_some(), "--folds"),
            (self.save_recipe.is_some(), "--save-recipe"),
            (self.dialect.choice() != DialectChoice::default(), "the layout of files"),
        ];
        refuse(&given, |argument| {
            format!(
                "{argument}: the checkpoint contains the columns and the split of the recording; leave it out to resume, or start \
                 a new training with another --checkpoint"
            )
        })
    }

    /// Returns the origin of the samples of a checkpoint with the file paths from the arguments. A file is recognised by
    /// its name; a file with another name is matched by its argument. Files that are still missing are searched for in
    /// the same folder.
    pub(super) fn relocated(&self, saved: &Recorded) -> Result<Recorded, Failure> {
        let mut found = saved.clone();
        for (argument, given, place) in self.files(&saved.plan) {
            let Some(place) = place else {
                let message = format!("{argument}: the checkpoint has no such file; leave it out to resume");
                return Err(Failure::Arguments(message));
            };
            let given = std::path::absolute(given).unwrap_or_else(|_| given.clone());
            let is_named = |path: &PathBuf| path.file_name() == given.file_name();
            let named = saved.plan.files().find(is_named).filter(|_| !is_named(place));
            found = found.relocated(named.as_ref().unwrap_or(place), &given);
            let missing = Vec::from_iter(found.missing().into_iter().map(Path::to_owned));
            for path in missing {
                let near = path.file_name().map(|name| given.with_file_name(name));
                if let Some(near) = near.filter(|near| *near != given && near.exists()) {
                    found = found.relocated(&path, &near);
                }
            }
        }
        Ok(found)
    }

    /// Given files, with their arguments and the corresponding files of `saved`.
    fn files<'a>(&'a self, saved: &'a Plan) -> Vec<(&'static str, &'a PathBuf, Option<&'a PathBuf>)> {
        let (import, test) = (&saved.import, saved.test.as_ref());
        let joined = import.join.iter().map(|joined| &joined.file);
        let joined = Vec::from_iter(joined.chain(import.append.iter().flat_map(|set| &set.join)));
        let test_sets = test.iter().flat_map(|test| &test.append);
        let tested = Vec::from_iter(
            test.iter()
                .map(|test| &test.data)
                .chain(test_sets.clone().map(|set| &set.data)),
        );
        let test_joined = test.iter().flat_map(|test| &test.join);
        let test_joined = Vec::from_iter(test_joined.chain(test_sets.flat_map(|set| &set.join)));
        let all = [
            ("--data", &self.data, Vec::from_iter(import.data_files())),
            ("--join", &self.join, joined),
            ("--test-data", &self.test_data, tested),
            ("--test-join", &self.test_join, test_joined),
        ];
        let given = all.into_iter().flat_map(|(argument, given, saved)| {
            let files = given.iter().enumerate();
            files.map(move |(place, file)| (argument, file, saved.get(place).copied()))
        });
        let positions = self.positions.iter();
        let positions = positions.map(|file| ("--positions", file, import.positions.as_ref()));
        given.chain(positions).collect()
    }

    /// The plan of a recording as in [`Self::plan`]; `None` if the source is a simulated array.
    pub(super) fn given(&self, inputs: &[String]) -> Result<Option<Plan>, Failure> {
        if self.is_given() {
            return self.plan(inputs).map(Some);
        }
        self.check_unused()?;
        Ok(None)
    }

    /// Source of the samples: a recording, or the simulated array of a recipe; `None` for the array of the arguments.
    pub(super) fn source(&self, inputs: &[String]) -> Result<Option<RecipeSource>, Failure> {
        if let Some(path) = &self.recipe
            && let simulated @ RecipeSource::Simulated(_) = RecipeFile::load(path)?
        {
            self.check_unused()?;
            return Ok(Some(simulated));
        }
        if self.is_given() {
            return Ok(Some(RecipeSource::Recording(self.plan(inputs)?)));
        }
        self.check_unused()?;
        Ok(None)
    }

    /// The plan described by the arguments, with paths relative to the working folder; `inputs` are the columns read.
    pub(super) fn plan(&self, inputs: &[String]) -> Result<Plan, Failure> {
        self.plan_of(inputs, &self.targets)
    }

    /// Like [`Self::plan`], with these columns as the targets.
    pub(super) fn plan_of(&self, inputs: &[String], targets: &[String]) -> Result<Plan, Failure> {
        let plan = match &self.recipe {
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
                if plan.import.has_groups() {
                    plan.division.by = SplitBy::Group;
                }
                plan
            }
        };
        self.divided(plan)
    }

    /// Returns `plan` with the given split, shares and test files.
    pub(super) fn divided(&self, mut plan: Plan) -> Result<Plan, Failure> {
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
        if !self.test_data.is_empty() {
            let (data, join) = (
                expanded("--test-data", &self.test_data)?,
                expanded("--test-join", &self.test_join)?,
            );
            plan.test = TestFiles::of(file_sets("test-", data, join)?);
        }
        if plan.division.by == SplitBy::Group && !plan.import.has_groups() {
            let message = "--split group: give the group column with --group, or several files with --data";
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
        let files = file_sets("", expanded("--data", &self.data)?, expanded("--join", &self.join)?)?;
        let mut files = files.into_iter();
        let FileSet { data, join } = files.next().unwrap_or_default();
        if self.join_time.len() > 1 && self.join_time.len() != join.len() {
            let message = "--join-time: give it once, or once for each joined file of the first --data";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let joined = |(number, file): (usize, PathBuf)| Joined {
            file,
            stem: None,
            time: self.join_time.get(number).or(self.join_time.first()).cloned(),
            limit: self.join_limit,
        };
        Ok(Recipe {
            data,
            join: join.into_iter().enumerate().map(joined).collect(),
            append: files.collect(),
            dialect: self.dialect.choice(),
            inputs: inputs.to_vec(),
            targets: targets.to_vec(),
            time: self.time.clone(),
            group: self.group.clone(),
            row_wire: self.row_wire.clone(),
            memory: self.of_memory(),
            conditions: self.conditions.clone(),
            derive: self.derive.clone(),
            missing: self.missing.clone(),
            units: self.unit.iter().cloned().collect(),
            positions: self.positions.clone(),
        })
    }

    /// Memory that a choice of settings keeps, and whether it tries some even without times.
    ///
    /// # Errors
    /// If none or auto is given together with others.
    pub(super) fn fixed_memory(&self) -> Result<(Option<Memory>, bool), Failure> {
        let has = |word: MemoryArgument| self.memory.contains(&word);
        let (is_none, is_auto) = (has(MemoryArgument::None), has(MemoryArgument::Auto));
        let is_mixed = self.memory.len() > 1 || !self.lags.is_empty() || self.differences;
        if (is_none || is_auto) && is_mixed {
            let message = "--memory: give none and auto without spans, --lags and --differences";
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok((is_none.then(Memory::default), is_auto))
    }

    /// Inputs from the past, if requested.
    fn of_memory(&self) -> Option<Memory> {
        let memory = Memory {
            lags: self.lags.clone(),
            averages: self.memory.iter().filter_map(MemoryArgument::span).collect(),
            differences: self.differences,
            interval_s: None,
        };
        (!memory.is_empty()).then_some(memory)
    }

    /// The recipe to use.
    pub(super) fn recipe(&self) -> Option<&Path> {
        self.recipe.as_deref()
    }

    /// Writes a recipe of `source`, if requested.
    pub(super) fn save_recipe(&self, source: impl Into<RecipeSource>) -> Result<(), Failure> {
        match &self.save_recipe {
            Some(path) => Ok(RecipeFile::save(source, path)?),
            None => Ok(()),
        }
    }
}
