use std::path::Path;

use decoupler_core::dataset::SplitBy;

use super::{ColumnKind, ColumnSummary, FileSet, Format, InspectedFile, Joined, Plan, Recipe, table::stem};

/// Words in names of columns and files that suggest a target, by their weights.
const TARGET_WORDS: [(i32, &str); 2] = [
    (3, "force torque target label truth load moment"),
    (
        2,
        "state probe robot pose position pos depth displacement deflection indentation angle roll pitch yaw weight stiffness \
         fx fy fz output",
    ),
];
/// Words that suggest an input.
const INPUT_WORDS: &str = "sensor reading readings taxel tactile skin channel ch adc raw mag magnetometer hall resistance \
                           voltage capacitance input feature pixel";
/// Typical units of targets, and of sensor readings, with commas between them.
const TARGET_UNITS: &str = "m,mm,cm,µm,um,n,mn,kn,nm,n·m,n m,nmm,n·mm,mnm,kg,g,deg,°,rad,kpa,pa,mrad";
const INPUT_UNITS: &str = "v,mv,µv,uv,ω,ohm,kω,kohm,mω,t,mt,µt,ut,gauss,pf,nf,a,ma,µa,counts,lsb,adc";
/// Names of group columns.
const GROUP_NAMES: &str = "file experiment participant grasp group session trial press run episode subject block recording \
                           take touch";

/// Words that suggest a target, with their weights.
fn target_words() -> impl Iterator<Item = (i32, &'static str)> {
    let weighted = |(weight, words): (i32, &'static str)| words.split_whitespace().map(move |word| (weight, word));
    TARGET_WORDS.into_iter().flat_map(weighted)
}

fn is_one_of(word: &str, words: &str) -> bool {
    words.split_whitespace().any(|other| other == word)
}

/// Guesses a plan from the names, units and values in inspected files: which file has the readings, how the others are
/// joined to it, which are test files, and what each column means. The guess should be checked: names may be misleading.
///
/// Constant columns, text and copies of other columns are not used.
pub fn suggested_plan(files: &[InspectedFile]) -> Plan {
    let is_test = |file: &&InspectedFile| stem(&file.path).to_lowercase().contains("test");
    let (tests, training): (Vec<_>, Vec<_>) = files.iter().partition(is_test);
    if !tests.is_empty() && tests.len() == training.len() {
        let plan = plan_of_series(&training);
        // Each training file has one for the test, such as `trainPose` and `testPose`.
        let mut test = plan.import.files();
        let has_tests = test.files_mut().into_iter().all(|path| {
            let mut tests = tests.iter().map(|test| &test.path);
            let found = tests.find(|test| without_part(test) == without_part(path));
            found.map(|found| path.clone_from(found)).is_some()
        });
        if has_tests {
            return Plan {
                test: Some(test),
                ..plan
            };
        }
    }
    plan_of_series(&Vec::from_iter(files))
}

fn plan_of_series(files: &[&InspectedFile]) -> Plan {
    let mut series = series(files);
    // The file with the readings first: the one that looks least like targets; of equal ones, the widest.
    series.sort_by_key(|files| (score_of_file(&files[0].path), usize::MAX - numeric(files[0]).count()));
    let mut plan = plan_of(&Vec::from_iter(series.iter().map(|files| files[0])));
    let path = |files: &Vec<&InspectedFile>, number: usize| files[number].path.clone();
    plan.import.append = Vec::from_iter((1..series.first().map_or(1, Vec::len)).map(|number| FileSet {
        data: path(&series[0], number),
        join: series[1..].iter().map(|files| path(files, number)).collect(),
        append: Vec::new(),
    }));
    if plan.import.has_groups() {
        plan.division.by = SplitBy::Group;
    }
    plan
}

/// Divides files into those of the same kind, such as one per session; all of them single unless there are as many of each
/// kind.
fn series<'a>(files: &[&'a InspectedFile]) -> Vec<Vec<&'a InspectedFile>> {
    let mut series: Vec<Vec<&InspectedFile>> = Vec::new();
    for &file in files {
        match series.iter_mut().find(|files| are_alike(files[0], file)) {
            Some(files) => files.push(file),
            None => series.push(vec![file]),
        }
    }
    if series.windows(2).all(|pair| pair[0].len() == pair[1].len()) {
        return series;
    }
    files.iter().map(|&file| vec![file]).collect()
}

/// Returns `true` if two files have the same columns and are of the same kind: their names differ in numbers only, or they
/// have a header and different numbers of rows, so that they cannot be joined row by row.
fn are_alike(one: &InspectedFile, other: &InspectedFile) -> bool {
    let [names, others] = [one, other].map(|file| file.columns.iter().map(|column| &column.name));
    let letters = |file: &InspectedFile| {
        let name = stem(&file.path).to_lowercase();
        name.chars().filter(|letter| letter.is_alphabetic()).collect::<String>()
    };
    let has_header = matches!(&one.format, Format::Text(dialect) if dialect.header);
    names.eq(others)
        && score_of_file(&one.path) == score_of_file(&other.path)
        && (letters(one) == letters(other) || (has_header && one.rows != other.rows))
}

/// As [`suggested_plan`], if the first file is known to have the readings and the others are joined to it.
pub fn suggested_plan_in_order(files: &[InspectedFile]) -> Plan {
    plan_of(&Vec::from_iter(files))
}

/// Guesses the meanings of the columns of the file with the readings and of the joined files.
fn plan_of(order: &[&InspectedFile]) -> Plan {
    let Some((first, joined)) = order.split_first() else {
        return Plan::default();
    };
    let by_time = joined.iter().all(|file| share_time(first, file));
    let time_of = |file: &InspectedFile| time(file).filter(|_| by_time).map(|time| time.name.clone());
    let mut plan = Plan::default();
    let recipe = &mut plan.import;
    recipe.data.clone_from(&first.path);
    let with_time = |file: &&InspectedFile| Joined {
        file: file.path.clone(),
        stem: own_stem(file),
        time: time_of(file),
        limit: None,
    };
    recipe.join = joined.iter().map(with_time).collect();
    recipe.time = time_of(first);
    // A single file contains both inputs and targets.
    let is_alone = joined.is_empty();
    let is_target = |name: &str, unit: Option<&str>| is_alone && looks_like_target(name, unit);
    add(recipe, first, None, is_target);
    for (file, stem) in joined.iter().zip(recipe.stems()) {
        // Columns of joined files are targets, whatever their names.
        add(recipe, file, Some(&stem), |_, _| true);
    }
    let Recipe { inputs, targets, .. } = recipe;
    // If the names do not distinguish them, the last column is the target, as in most tables of samples.
    if inputs.is_empty() {
        std::mem::swap(inputs, targets);
    }
    if targets.is_empty() && inputs.len() > 1 {
        targets.extend(inputs.pop());
    }
    if recipe.group.is_some() {
        plan.division.by = SplitBy::Group;
    }
    plan
}

/// Returns the prefix of the columns of a joined file, if it is not derived from the name of the file.
fn own_stem(file: &InspectedFile) -> Option<String> {
    let of_file = stem(&file.path);
    let is_own = |given: &&String| given.split_once('#').map_or(given.as_str(), |(before, _)| before) != of_file;
    file.stem.as_ref().filter(is_own).cloned()
}

/// Returns the name of a file without "training", "train" or "test".
fn without_part(path: &Path) -> String {
    let mut name = stem(path).to_lowercase();
    for part in ["training", "train", "test"] {
        name = name.replace(part, "");
    }
    name.chars().filter(|letter| letter.is_alphanumeric()).collect()
}

fn numeric(file: &InspectedFile) -> impl Iterator<Item = &ColumnSummary> {
    file.columns.iter().filter(|column| is_numeric(column))
}

fn is_numeric(column: &ColumnSummary) -> bool {
    matches!(column.kind, ColumnKind::Number | ColumnKind::Integer) && column.texts == 0
}

/// Returns the time column, if its name or unit suggests a time or it has no name: an input may increase steadily, too.
fn time(file: &InspectedFile) -> Option<&ColumnSummary> {
    let name = &file.time.as_ref()?.column;
    let column = file.columns.iter().find(|column| column.name == *name)?;
    let name = column.name.to_lowercase();
    let is_named = ["time", "stamp", "clock", "date", "index", "frame", "sample", "second"];
    let has_unit = |unit: &String| ["s", "ms", "µs", "us", "min", "h"].contains(&unit.trim());
    let is_time = is_named.iter().any(|word| name.contains(word))
        || ["t", "c1"].contains(&name.as_str())
        || column.unit.as_ref().is_some_and(has_unit);
    is_time.then_some(column)
}

/// Returns `true` if both files have times and the times overlap.
fn share_time(one: &InspectedFile, other: &InspectedFile) -> bool {
    let range = |file| time(file).and_then(|column| Some([column.min?, column.max?]));
    let overlap = |([from, to], [start, end]): ([f64; 2], [f64; 2])| from <= end && start <= to;
    range(one).zip(range(other)).is_some_and(overlap)
}

/// Returns the score of a file name: positive for targets, negative for readings.
fn score_of_file(path: &Path) -> i32 {
    let name = stem(path).to_lowercase();
    let targets = target_words().filter(|(_, word)| word.len() > 3 && name.contains(word));
    let mut inputs = INPUT_WORDS.split_whitespace();
    let has_input = inputs.any(|word| word.len() > 2 && name.contains(word));
    targets.map(|(weight, _)| weight).max().unwrap_or(0) - 4 * i32::from(has_input)
}

/// Returns `true` if a column of this name looks like a group, such as `trial`, `Session_ID` or `press number`.
pub fn is_group_name(name: &str) -> bool {
    let name = name.trim().to_lowercase();
    let words = Vec::from_iter(name.split(|letter: char| !letter.is_alphanumeric()));
    is_one_of(words[0], GROUP_NAMES)
        && words[1..]
            .iter()
            .all(|word| ["", "id", "no", "nr", "number"].contains(word))
}

fn looks_like_target(name: &str, unit: Option<&str>) -> bool {
    if let Some(unit) = unit.map(|unit| unit.trim().to_lowercase()) {
        let is_in = |units: &str| units.split(',').any(|other| other == unit);
        if is_in(INPUT_UNITS) {
            return false;
        }
        if is_in(TARGET_UNITS) {
            return true;
        }
    }
    let words = || {
        let words = name.split(|letter: char| !letter.is_alphanumeric());
        words.map(|word| word.trim_end_matches(|letter: char| letter.is_ascii_digit()))
    };
    if words().any(|word| is_one_of(word, INPUT_WORDS)) {
        return false;
    }
    ["x", "y", "z"].contains(&name) || words().any(|word| target_words().any(|(_, target)| target == word))
}

/// Adds the columns of a file to a recipe by their full names, with guesses of their meanings; `is_target` distinguishes targets
/// from inputs by the name and the unit.
fn add(recipe: &mut Recipe, file: &InspectedFile, stem: Option<&str>, is_target: impl Fn(&str, Option<&str>) -> bool) {
    let time = time(file).map(|time| time.name.as_str());
    let mut has_group = false;
    for column in &file.columns {
        let full_name = || match stem {
            None => column.name.clone(),
            Some(stem) => format!("{stem}.{}", column.name),
        };
        let name = column.name.trim().to_lowercase();
        let is_row_wire = ["row_wire", "row-wire", "row wire", "rowwire", "row"].contains(&name.as_str())
            && column.kind == ColumnKind::Integer
            && column.min >= Some(1.0);
        if time == Some(column.name.as_str()) {
            // Only the first file has a time here, if the files are joined by time.
            if stem.is_none() && recipe.join.is_empty() {
                recipe.time = Some(full_name());
            }
        } else if !has_group && is_group_name(&name) {
            has_group = true;
            recipe.group.get_or_insert_with(full_name);
        } else if column.is_constant || column.duplicate_of.is_some() || !is_numeric(column) {
            // Such columns are not used.
        } else if is_row_wire {
            recipe.row_wire.get_or_insert_with(full_name);
        } else if !is_target(&name, column.unit.as_deref()) {
            recipe.inputs.push(full_name());
        } else if !column.is_rounding {
            recipe.targets.push(full_name());
        }
    }
}

/// Meaning of a column in a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, strum::Display, strum::VariantArray)]
#[strum(serialize_all = "kebab-case")]
pub enum Meaning {
    /// Reading of the sensor.
    Input,
    /// Target, predicted from the inputs.
    Target,
    /// Time of the row.
    Time,
    /// Group: rows with equal values belong together, such as one press or one session.
    Group,
    /// Number of the row-wire, from 1.
    RowWire,
    /// Not used.
    #[default]
    Unused,
}

impl Meaning {
    /// All meanings, in the order offered to the user.
    pub const ALL: &[Self] = <Self as strum::VariantArray>::VARIANTS;

    /// Returns the meaning in a sentence.
    pub(super) fn with_article(self) -> String {
        match self {
            Self::Input => "an input".to_owned(),
            Self::Target => "a target".to_owned(),
            one_column => format!("the {one_column}"),
        }
    }
}
