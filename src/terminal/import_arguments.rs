use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use clap::Args;

use super::{
    failure::Failure,
    file_patterns::{expanded, file_sets},
    interruption::check_same,
    output::input,
    within,
};
use decoupler_core::{
    dataset::{DatasetError, Division, Memory, Span, SplitBy},
    text::Named,
};
use decoupler_files::{
    export::RecipeFile,
    import::{
        Condition, Decimal, Derived, DialectChoice, Encoding, FileSet, Joined, Missing, Plan, Recipe, Recorded,
        Separator,
    },
};

/// A value of `--history`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum HistoryArgument {
    /// No history.
    None,
    /// Histories are tried.
    Auto,
    /// A time constant.
    Span(Span),
}

impl FromStr for HistoryArgument {
    type Err = DatasetError;

    fn from_str(text: &str) -> Result<Self, DatasetError> {
        match text {
            "none" => Ok(Self::None),
            "auto" => Ok(Self::Auto),
            _ => text.parse().map(Self::Span),
        }
    }
}

// A recording: files, roles of their columns, and the split.
#[derive(Args)]
#[command(next_help_heading = "Recording")]
pub(super) struct ImportArguments {
    /// Use the samples of this file (CSV, Excel, .npy, .npz or .mat) instead of a simulated array; several files, a pattern
    /// or a folder for one experiment; - is standard input
    ///
    /// A column is named as in the header, or c1, c2, … without one; c2..c16 is a range. --inputs and --targets name
    /// columns, separated by commas. The rows of several files with the same columns follow one another; without --group,
    /// each file is a group. What else an import needs, such as columns computed from others, is in a recipe:
    /// decoupler inspect --recipe-out writes it.
    #[arg(long, value_name = "FILE", conflicts_with = "recipe", num_args = 1.., value_parser = input)]
    pub(super) data: Vec<PathBuf>,
    /// Join this file: by time (nearest row), or row by row without --time; its columns are prefixed with its stem, as in
    /// states.c2; may be repeated. With several files in --data, first those joined to the first, then those joined to the
    /// second, and so on
    #[arg(long, value_name = "FILE", requires = "data", num_args = 1.., value_parser = input, hide_short_help = true)]
    join: Vec<PathBuf>,
    /// Columns to be predicted from the inputs
    #[arg(
        long,
        value_name = "COLUMNS",
        value_delimiter = ',',
        requires = "data",
        group = "roles"
    )]
    targets: Vec<String>,
    /// Time column
    #[arg(long, value_name = "COLUMN", requires = "data")]
    pub(super) time: Option<String>,
    /// Column that groups samples with equal values, such as one press or session
    #[arg(long, value_name = "COLUMN", requires = "roles", hide_short_help = true)]
    group: Option<String>,
    /// Column with the row number from 1
    #[arg(long, value_name = "COLUMN", requires = "roles", hide_short_help = true)]
    row_wire: Option<String>,
    /// Use only rows that meet this condition, for example "c4<145.1 and c5!=0"; may be repeated
    #[arg(long = "where", value_name = "CONDITION", requires = "roles", hide_short_help = true)]
    conditions: Vec<Condition>,
    /// Inputs from the past: exponential averages of the readings with these time constants, such as 0.1s,1s,10s, which need
    /// --time, or 20,100 samples. For a choice of settings, none tries no history, and auto tries some even without --time;
    /// otherwise it tries some with --time
    #[arg(
        long,
        value_name = "SPANS|none|auto",
        value_delimiter = ',',
        requires = "roles",
        hide_short_help = true
    )]
    history: Vec<HistoryArgument>,
    /// Use the simulated array or the recording of this recipe, written by decoupler inspect --recipe-out
    #[arg(long, value_name = "FILE", value_parser = input, hide_short_help = true)]
    recipe: Option<PathBuf>,
    /// Test samples: the last in time, whole groups, or random ones [default: group with --group, else time]
    #[arg(long, value_name = "time|group|random", value_parser = SplitBy::parse, hide_short_help = true)]
    split: Option<SplitBy>,
    /// File of the test samples, with the columns of --data; may be repeated, or be a pattern or a folder
    #[arg(long, value_name = "FILE", num_args = 1.., value_parser = input, hide_short_help = true)]
    test_data: Vec<PathBuf>,
    /// What a recipe keeps besides.
    #[arg(skip)]
    pub(super) rest: RecipeArguments,
}

// The rest of an import, which a recipe keeps.
#[derive(Args, Default)]
#[command(next_help_heading = "Recipe")]
pub(super) struct RecipeArguments {
    /// Inputs from the past: the readings this number of samples, or seconds, before each sample, such as 5,10,20 or 0.5s;
    /// within a group and across no gap in time (over fifty usual intervals)
    #[arg(long, value_name = "SPANS", value_delimiter = ',', requires = "roles")]
    lags: Vec<Span>,
    /// The past as its difference from the current reading; without --lags and --history, from the sample before
    #[arg(long, requires = "roles")]
    differences: bool,
    /// Time column of a joined file, without its stem; once, or once for each --join [default: as --time]
    #[arg(long, value_name = "COLUMN", requires = "join")]
    join_time: Vec<String>,
    /// Maximum time between matched rows [default: half the median interval of the joined file]
    #[arg(long, value_name = "TIME", requires = "join", value_parser = within(f64::MIN_POSITIVE.., "a number above 0, in the unit of the times"))]
    join_limit: Option<f64>,
    /// Add a column computed from others of the same file: a difference such as d=c1-c2, a ratio such as q=c1/c2, or either
    /// with its own mean over the first seconds or rows, such as r=c1/start(2s) or r=c1-start(100); may be repeated
    #[arg(long, value_name = "NAME=EXPRESSION", requires = "roles")]
    derive: Vec<Derived>,
    /// Number or text that marks a missing value, in all columns or in one, such as -1 or states.c5=-1; may be repeated
    #[arg(long, value_name = "[COLUMN=]VALUE", requires = "roles")]
    missing: Vec<Missing>,
    /// Leave out files of --data that cannot be read, with a warning
    #[arg(long, requires = "roles")]
    skip_damaged: bool,
    /// Leave out the last rows of files that are joined row by row and are longer than the others, with a warning
    #[arg(long, requires = "join")]
    truncate: bool,
    /// Unit of a column, such as states.c2=mm; may be repeated [default: from a header such as "x (mm)"]
    #[arg(long, value_name = "COLUMN=UNIT", value_parser = assignment, requires = "roles")]
    unit: Vec<(String, String)>,
    /// Positions of the targets on the skin, for surfaces in the window: a table with the columns target,x,y (mm)
    #[arg(long, value_name = "FILE", requires = "roles", value_parser = input)]
    positions: Option<PathBuf>,
    /// Share of the samples held out for testing [default: 0.2]
    #[arg(long, value_name = "SHARE", value_parser = share, conflicts_with = "test_data")]
    test_fraction: Option<f64>,
    /// Share of the other samples that selects the best weights and ends the training; 0 for none [default: as the method
    /// of the training needs: 0 for br, 0.2 for the others]
    #[arg(long, value_name = "SHARE", value_parser = share)]
    validation_fraction: Option<f64>,
    /// File joined to --test-data, corresponding to --join; may be repeated
    #[arg(long, value_name = "FILE", requires = "test_data", num_args = 1.., value_parser = input)]
    test_join: Vec<PathBuf>,
    /// Separator of the cells of text files [default: detected]
    #[arg(long, value_name = "comma|semicolon|tab|bar|space", value_parser = Separator::named)]
    separator: Option<Separator>,
    /// Decimal separator of text files [default: detected]
    #[arg(long, value_name = "point|comma", value_parser = Decimal::named)]
    decimal: Option<Decimal>,
    /// Whether the first row of text files has the names of the columns [default: detected]
    #[arg(long, value_name = "yes|no", value_parser = yes_or_no)]
    header: Option<bool>,
    /// Encoding of text files [default: detected]
    #[arg(long, value_name = "utf-8|latin-1|utf-16le|utf-16be", value_parser = |text: &str| Encoding::parse(&text.to_lowercase()))]
    encoding: Option<Encoding>,
    /// Number of lines of text files to skip before the table [default: 0]
    #[arg(long, value_name = "N")]
    skip_lines: Option<usize>,
}

fn yes_or_no(text: &str) -> Result<bool, String> {
    match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err("give yes or no".to_owned()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    within(0.0..1.0, "a number from 0 to below 1, for example 0.2")(text)
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

fn listed(columns: &[String]) -> Option<String> {
    (!columns.is_empty()).then(|| columns.join(","))
}

impl RecipeArguments {
    pub(super) fn dialect(&self) -> DialectChoice {
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
    /// Inputs from the past, if requested.
    fn memory(&self) -> Option<Memory> {
        let spans = self.history.iter().filter_map(|argument| match argument {
            HistoryArgument::Span(span) => Some(*span),
            HistoryArgument::None | HistoryArgument::Auto => None,
        });
        let memory = Memory {
            lags: self.rest.lags.clone(),
            averages: spans.collect(),
            differences: self.rest.differences,
            interval_s: None,
        };
        (!memory.is_empty()).then_some(memory)
    }

    /// History that a choice of settings keeps, and whether it tries some even without times.
    ///
    /// # Errors
    /// If none or auto is given together with others.
    pub(super) fn fixed_history(&self) -> Result<(Option<Memory>, bool), Failure> {
        let has = |word: HistoryArgument| self.history.contains(&word);
        let (is_none, is_auto) = (has(HistoryArgument::None), has(HistoryArgument::Auto));
        if (is_none || is_auto) && (self.history.len() > 1 || self.memory().is_some()) {
            let message = "--history: give none and auto without spans, --lags and --differences";
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok((is_none.then(Memory::default), is_auto))
    }

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
        let message = |argument: &str| format!("{argument} needs --inputs and --targets");
        refuse(&[(!self.join.is_empty(), "--join")], message)?;
        self.refuse_division(message)?;
        if self.data.is_empty() {
            let message = "--data: name the file to inspect";
            return Err(Failure::Arguments(message.to_owned()));
        }
        expanded("--data", &self.data)
    }

    /// Refuses arguments that need a recording.
    pub(super) fn check_unused(&self) -> Result<(), Failure> {
        self.refuse_division(|argument| format!("{argument} needs --data or --recipe"))
    }

    /// Refuses arguments by which samples are divided.
    pub(super) fn refuse_division(&self, message: impl Fn(&str) -> String) -> Result<(), Failure> {
        refuse(&[(self.split.is_some(), "--split")], &message)?;
        refuse(&self.held_out(), message)
    }

    /// Arguments that hold samples out, and whether they are given.
    fn held_out(&self) -> [(bool, &'static str); 3] {
        [
            (self.rest.test_fraction.is_some(), "--test-fraction"),
            (self.rest.validation_fraction.is_some(), "--validation-fraction"),
            (!self.test_data.is_empty(), "--test-data"),
        ]
    }

    /// Refuses samples held out where cross-validation tests on every sample.
    pub(super) fn refuse_held_out(&self) -> Result<(), Failure> {
        refuse(&self.held_out(), |argument| {
            format!(
                "{argument}: a recording is analysed by cross-validation; leave it out, or write a recipe with --recipe-out"
            )
        })
    }

    /// Refuses arguments that differ from the `saved` plan of a training that is resumed. File names are not compared:
    /// files may have been [moved](Self::relocated).
    pub(super) fn check_resumed(&self, saved: &Plan) -> Result<(), Failure> {
        let (division, import) = (&saved.division, &saved.import);
        let none = || "none".to_owned();
        let by = self.split.map(|split| split.to_string());
        let texts = |conditions: &[Condition]| listed(&Vec::from_iter(conditions.iter().map(Condition::to_string)));
        let [time, group, row_wire] =
            [&import.time, &import.group, &import.row_wire].map(|column| column.clone().unwrap_or_else(none));
        for (argument, given, saved) in [
            ("split", by, division.by.to_string()),
            ("targets", listed(&self.targets), import.targets.join(",")),
            ("time", self.time.clone(), time),
            ("group", self.group.clone(), group),
            ("row-wire", self.row_wire.clone(), row_wire),
            (
                "where",
                texts(&self.conditions),
                texts(&import.conditions).unwrap_or_else(none),
            ),
        ] {
            check_same(argument, given, saved)?;
        }
        check_same("history", self.memory(), import.memory.clone().unwrap_or_default())?;
        refuse(&[(self.recipe.is_some(), "--recipe")], |argument| {
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
        let (import, test) = (&saved.plan.import, saved.plan.test.iter());
        let joined = import.join.iter().map(|joined| &joined.file);
        let tested = test.flat_map(|test| std::iter::once(&test.data).chain(test.append.iter().map(|set| &set.data)));
        let all = [
            ("--data", &self.data, Vec::from_iter(import.data_files())),
            (
                "--join",
                &self.join,
                joined.chain(import.append.iter().flat_map(|set| &set.join)).collect(),
            ),
            ("--test-data", &self.test_data, tested.collect()),
        ];
        let mut found = saved.clone();
        for (argument, given, places) in all {
            for (number, given) in given.iter().enumerate() {
                let Some(place) = places.get(number) else {
                    let message = format!("{argument}: the checkpoint has no such file; leave it out to resume");
                    return Err(Failure::Arguments(message));
                };
                let given = std::path::absolute(given).unwrap_or_else(|_| given.clone());
                let is_named = |path: &PathBuf| path.file_name() == given.file_name();
                let named = saved
                    .plan
                    .files()
                    .into_iter()
                    .find(is_named)
                    .filter(|_| !is_named(place));
                found = found.relocated(named.as_ref().unwrap_or(place), &given);
                for path in Vec::from_iter(found.missing().into_iter().map(Path::to_owned)) {
                    let near = path.file_name().map(|name| given.with_file_name(name));
                    if let Some(near) = near.filter(|near| *near != given && near.exists()) {
                        found = found.relocated(&path, &near);
                    }
                }
            }
        }
        Ok(found)
    }

    /// Source of the samples: a recording, or the simulated array of a recipe; `None` for the array of the arguments.
    pub(super) fn source(&self, inputs: &[String]) -> Result<Option<RecipeFile>, Failure> {
        if let Some(path) = &self.recipe
            && let simulated @ RecipeFile::Simulated(_) = RecipeFile::load(path)?
        {
            self.check_unused()?;
            return Ok(Some(simulated));
        }
        if self.is_given() {
            return Ok(Some(RecipeFile::Recording(self.plan(inputs)?)));
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
            test_fraction: self.rest.test_fraction.unwrap_or(test_fraction),
            validation_fraction: self.rest.validation_fraction.or(validation_fraction),
        };
        if !self.test_data.is_empty() {
            let (data, join) = (
                expanded("--test-data", &self.test_data)?,
                expanded("--test-join", &self.rest.test_join)?,
            );
            plan.test = file_sets("test-", data, join)?;
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
        let rest = &self.rest;
        let files = file_sets("", expanded("--data", &self.data)?, expanded("--join", &self.join)?)?;
        let FileSet { data, join, append } = files.unwrap_or_default();
        if rest.join_time.len() > 1 && rest.join_time.len() != join.len() {
            let message = "--join-time: give it once, or once for each joined file of the first --data";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let joined = |(number, file): (usize, PathBuf)| Joined {
            file,
            stem: None,
            time: rest.join_time.get(number).or(rest.join_time.first()).cloned(),
            limit: rest.join_limit,
        };
        Ok(Recipe {
            data,
            join: join.into_iter().enumerate().map(joined).collect(),
            append,
            dialect: rest.dialect(),
            inputs: inputs.to_vec(),
            targets: targets.to_vec(),
            time: self.time.clone(),
            group: self.group.clone(),
            row_wire: self.row_wire.clone(),
            memory: self.memory(),
            conditions: self.conditions.clone(),
            derive: rest.derive.clone(),
            missing: rest.missing.clone(),
            skip_damaged: rest.skip_damaged,
            truncate: rest.truncate,
            units: rest.unit.iter().cloned().collect(),
            positions: rest.positions.clone(),
        })
    }

    /// The recipe to use.
    pub(super) fn recipe(&self) -> Option<&Path> {
        self.recipe.as_deref()
    }
}
