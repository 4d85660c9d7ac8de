//! The import that is edited: its plan, and the inspection of its files.

use std::{
    collections::{BTreeMap, BTreeSet},
    iter::once,
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use decoupler_core::dataset::SplitBy;
use decoupler_files::import::{FileSet, Format, InspectedFile, Meaning, Plan, Recipe};
use eframe::egui::Modifiers;

/// A column by its file and its name there, which do not change when another file becomes the first.
type ColumnKey = (PathBuf, String);

/// Plan of an import, with the inspection of its files.
#[derive(Clone, Debug, Default)]
pub(super) struct Import {
    /// The plan, with absolute paths. Readers share it: an edit makes a new one.
    pub(super) plan: Arc<Plan>,
    /// The files, the first with the rows to which the others are joined, with the meanings of their columns in the plan.
    pub(super) files: Vec<InspectedFile>,
    /// Meanings that the user or a recipe gave, kept when the files are read in another way.
    chosen: BTreeMap<ColumnKey, Meaning>,
    /// File and name of a variable whose rows are to be the samples once the files are read again.
    pub(super) wanted: Option<(usize, String)>,
    /// Full names of the columns selected in the table, and of the one clicked last without Shift.
    pub(super) selected: BTreeSet<String>,
    anchor: Option<String>,
}

impl Import {
    /// The import of a suggested plan whose files have been inspected.
    pub(super) fn suggested(plan: Plan, files: Vec<InspectedFile>) -> Self {
        Self {
            plan: Arc::new(plan),
            files,
            ..Self::default()
        }
    }

    /// The import of a recipe: nothing in it is a guess.
    pub(super) fn of_recipe(plan: Plan, files: Vec<InspectedFile>) -> Self {
        let mut import = Self::suggested(plan, files);
        let given = import.columns().map(|(file, column)| {
            let file = &import.files[file];
            (key(file, column), file.meanings[column])
        });
        import.chosen = given.collect();
        import
    }

    /// Returns a plan with other files and roles, and everything else as in this import.
    pub(super) fn merged(&self, found: Plan) -> Plan {
        let (older, mut import) = (&self.plan.import, found.import);
        for joined in &mut import.join {
            if let Some(before) = older.join.iter().find(|before| before.file == joined.file) {
                joined.limit = before.limit;
                joined.stem.clone_from(&before.stem);
            }
        }
        let mut renamed = BTreeMap::new();
        for (path, stem) in paths_and_stems(&import) {
            if let Some(file) = self.files.iter().find(|file| file.path == path) {
                let mut now = file.clone();
                now.stem = stem;
                renamed.extend(names(file, |_| true).into_iter().zip(names(&now, |_| true)));
            }
        }
        let conditions = older.conditions.iter().cloned();
        let conditions = conditions.map(|condition| condition.renamed(|name| renamed.get(name).cloned()));
        let mut missing = older.missing.clone();
        for column in missing.iter_mut().filter_map(|missing| missing.column.as_mut()) {
            *column = renamed.get(column).unwrap_or(column).clone();
        }
        let units = older.units.iter();
        let units = units.filter_map(|(name, unit)| Some((renamed.get(name)?.clone(), unit.clone())));
        let paths = Vec::from_iter(paths_and_stems(&import).map(|(path, _)| path.to_owned()));
        let test = self.plan.test.as_ref().and_then(|test| self.matching(test, &paths));
        Plan {
            import: Recipe {
                conditions: conditions.collect(),
                missing,
                units: units.collect(),
                dialect: older.dialect,
                derive: older.derive.clone(),
                memory: older.memory.clone(),
                skip_damaged: older.skip_damaged,
                truncate: older.truncate,
                positions: import.positions.or_else(|| older.positions.clone()),
                ..import
            },
            test: found.test.or(test),
            division: self.plan.division,
        }
    }

    /// Returns this suggestion with the choices in an `older` import, as far as they fit the files.
    pub(super) fn keeping(mut self, older: Self) -> Self {
        self.plan = Arc::new(older.merged(Arc::unwrap_or_clone(self.plan)));
        self.chosen = older.chosen;
        let mut found = BTreeSet::new();
        for (file, column) in Vec::from_iter(self.columns()) {
            found.insert(self.files[file].full_name(column));
            if let Some(&meaning) = self.chosen.get(&key(&self.files[file], column)) {
                self.give(file, column, meaning);
            }
        }
        self.edit().import.units.retain(|name, _| found.contains(name));
        self.write_meanings(older.plan.import.has_groups());
        self
    }

    /// Full names of the columns in use; in the file with a variable that is wanted, only that.
    pub(super) fn used(&self) -> Vec<String> {
        let of_file = |(number, file): (usize, &InspectedFile)| match &self.wanted {
            Some((of_file, name)) if *of_file == number => {
                let stem = file.stem.iter().chain([name]);
                vec![Vec::from_iter(stem.map(String::as_str)).join(".")]
            }
            _ => names(file, |meaning| meaning != Meaning::Unused),
        };
        self.files.iter().enumerate().flat_map(of_file).collect()
    }

    /// Returns the layout of each text file, as a sentence.
    pub(super) fn text_formats(&self) -> Vec<String> {
        let text = self.files.iter().filter_map(|file| match &file.format {
            Format::Text(dialect) => Some(format!("{}: {dialect}.", file_name(&file.path))),
            _ => None,
        });
        text.collect()
    }

    /// Returns the files of `set`, which correspond to those of this import, for the recordings at `paths`, up to the first that
    /// has none.
    pub(super) fn matching(&self, set: &FileSet, paths: &[PathBuf]) -> Option<FileSet> {
        let own = self.paths();
        let mut files = paths.iter().map_while(|path| {
            let found = own.iter().zip(set.files()).find(|(other, _)| *other == path);
            found.map(|(_, file)| file.clone())
        });
        Some(FileSet {
            data: files.next()?,
            join: files.collect(),
            append: set.append.clone(),
        })
    }

    /// The plan, to be edited.
    pub(super) fn edit(&mut self) -> &mut Plan {
        Arc::make_mut(&mut self.plan)
    }

    /// Gives a column a meaning, and with it all that are selected with it; if only one column can have the meaning, only this
    /// one gets it, and the previous one loses it.
    pub(super) fn set_meaning(&mut self, one: (usize, usize), meaning: Meaning) {
        let had_groups = self.plan.import.has_groups();
        let name = |(file, column): (usize, usize)| self.files[file].full_name(column);
        let is_for_all = is_plain(meaning) && self.selected.contains(&name(one));
        let columns = self.columns();
        let given = columns.filter(|&of| of == one || (is_for_all && self.selected.contains(&name(of))));
        for (file, column) in Vec::from_iter(given) {
            self.give(file, column, meaning);
        }
        self.write_meanings(had_groups);
    }

    /// Selects a column alone, or no longer; with Ctrl it leaves the others selected, with Shift it selects those up to the one
    /// before.
    pub(super) fn select(&mut self, name: String, held: Modifiers) {
        let all = Vec::from_iter(self.files.iter().flat_map(|file| names(file, |_| true)));
        let place = |of: &String| all.iter().position(|other| other == of);
        let before = self.anchor.as_ref().filter(|_| held.shift).and_then(place);
        let was_selected = self.selected.contains(&name);
        if !held.command {
            self.selected.clear();
        }
        if let Some((from, to)) = before.zip(place(&name)) {
            let range = all[from.min(to)..=from.max(to)].iter();
            return self.selected.extend(range.cloned());
        }
        self.anchor = Some(name.clone());
        match was_selected {
            true => drop(self.selected.remove(&name)),
            false => drop(self.selected.insert(name)),
        }
    }

    /// Selects those of these columns of a file that can be used and have no special meaning; with Ctrl it leaves the others
    /// selected.
    pub(super) fn select_all(&mut self, file: usize, columns: Range<usize>, held: Modifiers) {
        if !held.command {
            self.selected.clear();
        }
        let file = &self.files[file];
        let can_be_used = |column: &usize| {
            let summary = &file.columns[*column];
            is_plain(file.meanings[*column]) && summary.min.is_some() && summary.texts == 0 && !summary.is_constant
        };
        let usable = columns.filter(can_be_used);
        self.selected.extend(usable.map(|column| file.full_name(column)));
    }

    /// All columns, each after the number of its file.
    pub(super) fn columns(&self) -> impl Iterator<Item = (usize, usize)> {
        let files = self.files.iter().enumerate();
        files.flat_map(|(file, of)| (0..of.columns.len()).map(move |column| (file, column)))
    }

    fn give(&mut self, file: usize, column: usize, meaning: Meaning) {
        for (number, other) in self.files.iter_mut().enumerate() {
            let is_taken = match meaning {
                Meaning::Time => number == file,
                Meaning::Group | Meaning::RowWire => true,
                Meaning::Input | Meaning::Target | Meaning::Unused => false,
            };
            for column in 0..other.meanings.len() {
                if is_taken && other.meanings[column] == meaning {
                    other.meanings[column] = Meaning::Unused;
                    self.chosen.insert(key(other, column), Meaning::Unused);
                }
            }
        }
        self.files[file].meanings[column] = meaning;
        self.chosen.insert(key(&self.files[file], column), meaning);
    }

    /// Writes the meanings of the columns into the plan. The samples are divided by group if there are groups now.
    pub(super) fn write_meanings(&mut self, had_groups: bool) {
        let of = |meaning| {
            let named = self.files.iter().flat_map(|file| names(file, |other| other == meaning));
            Vec::from_iter(named)
        };
        let (inputs, targets) = (of(Meaning::Input), of(Meaning::Target));
        let (group, row_wire) = (of(Meaning::Group).pop(), of(Meaning::RowWire).pop());
        // Without times in every file, rows belong together by their numbers.
        let times: Option<Vec<String>> = self.files.iter().map(time).collect();
        let mut times = times.into_iter().flatten();
        let Plan { import, division, .. } = self.edit();
        (import.inputs, import.targets, import.group, import.row_wire) = (inputs, targets, group, row_wire);
        import.time = times.next();
        import.join.iter_mut().for_each(|joined| joined.time = times.next());
        match (had_groups, import.has_groups()) {
            (false, true) => division.by = SplitBy::Group,
            (_, false) if division.by == SplitBy::Group => division.by = SplitBy::Time,
            _ => {}
        }
    }

    /// Returns the unit of a column, as given or in the header.
    pub(super) fn unit(&self, file: usize, column: usize) -> &str {
        let file = &self.files[file];
        let given = self.plan.import.units.get(&file.full_name(column));
        given.or(file.columns[column].unit.as_ref()).map_or("", String::as_str)
    }

    /// Gives a column a unit; none if it is empty or that of the header.
    pub(super) fn set_unit(&mut self, file: usize, column: usize, unit: String) {
        let file = &self.files[file];
        let (name, of_header) = (file.full_name(column), file.columns[column].unit.as_ref());
        let is_given = !unit.is_empty() && of_header != Some(&unit);
        let units = &mut self.edit().import.units;
        units.remove(&name);
        units.extend(is_given.then_some((name, unit)));
    }

    /// Returns the paths of the first recording and of those joined to it.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        paths_and_stems(&self.plan.import)
            .map(|(path, _)| path.to_owned())
            .collect()
    }

    /// Takes a file of test samples in the place of the last one.
    ///
    /// # Errors
    /// If it is trained on; the message says what to do.
    pub(super) fn set_test_file(&mut self, path: PathBuf) -> Result<(), String> {
        if self.plan.import.data_files().any(|trained| *trained == path) {
            return Err(format!(
                "{} is trained on, so it cannot be a test file: choose a separate recording for the test.",
                file_name(&path)
            ));
        }
        self.edit().test = Some(FileSet {
            data: path,
            ..FileSet::default()
        });
        Ok(())
    }

    /// Returns the reason why there is nothing to train on yet, with what to do.
    pub(super) fn obstacle(&self) -> Option<String> {
        let Recipe { inputs, targets, .. } = &self.plan.import;
        let needed = [(inputs, "an input"), (targets, "a target")];
        let lacking = needed.into_iter().find(|(columns, _)| columns.is_empty());
        lacking.map(|(_, what)| format!("No column is {what}: choose one in the table of columns."))
    }
}

/// Returns true for a meaning that any number of columns can have.
fn is_plain(meaning: Meaning) -> bool {
    matches!(meaning, Meaning::Input | Meaning::Target | Meaning::Unused)
}

fn key(file: &InspectedFile, column: usize) -> ColumnKey {
    (file.path.clone(), file.columns[column].name.clone())
}

/// Full names of the columns of a file with some meanings.
fn names(file: &InspectedFile, is_wanted: impl Fn(Meaning) -> bool) -> Vec<String> {
    let columns = (0..file.columns.len()).filter(|&column| is_wanted(file.meanings[column]));
    columns.map(|column| file.full_name(column)).collect()
}

/// Returns the name of the time column of a file, without its stem.
fn time(file: &InspectedFile) -> Option<String> {
    let column = file.meanings.iter().position(|meaning| *meaning == Meaning::Time)?;
    Some(file.columns[column].name.clone())
}

/// The first file of a recipe and those joined to it, each with the prefix of its columns.
fn paths_and_stems(recipe: &Recipe) -> impl Iterator<Item = (&Path, Option<String>)> {
    let joined = recipe.join.iter().zip(recipe.stems());
    let joined = joined.map(|(joined, stem)| (joined.file.as_path(), Some(stem)));
    once((recipe.data.as_path(), None)).chain(joined)
}

/// Returns the name of a file without its folder.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}
