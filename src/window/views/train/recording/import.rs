//! The import that is edited: its plan, and the inspection of its files.

use std::{
    collections::{BTreeMap, HashMap},
    path::{Path, PathBuf},
    sync::Arc,
};

use decoupler_core::dataset::SplitBy;
use decoupler_files::import::{FileSet, InspectedFile, Joined, Meaning, Plan, Recipe};

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
    /// Units, likewise.
    units: BTreeMap<ColumnKey, String>,
}

impl Import {
    /// The import of a recipe whose files have been inspected: nothing in it is a guess.
    pub(super) fn of_recipe(plan: Plan, files: Vec<InspectedFile>) -> Self {
        let (mut chosen, mut units) = (BTreeMap::new(), BTreeMap::new());
        for file in &files {
            for (column, meaning) in file.meanings.iter().enumerate() {
                chosen.insert(key(file, column), *meaning);
                let unit = plan.import.units.get(&file.full_name(column));
                units.extend(unit.map(|unit| (key(file, column), unit.clone())));
            }
        }
        Self {
            plan: Arc::new(plan),
            files,
            chosen,
            units,
        }
    }

    /// The import of a suggested plan, which names each column in full. `files` are inspected in any order.
    pub(super) fn suggested(plan: Plan, mut files: Vec<InspectedFile>) -> Self {
        let Recipe { inputs, targets, .. } = &plan.import;
        let several = [(inputs, Meaning::Input), (targets, Meaning::Target)];
        let several = several.into_iter().flat_map(|(names, meaning)| names.iter().map(move |name| (name, meaning)));
        let single = [(&plan.import.group, Meaning::Group), (&plan.import.row_wire, Meaning::RowWire)];
        let single = single.into_iter().filter_map(|(name, meaning)| Some((name.as_ref()?, meaning)));
        let meanings: HashMap<&String, Meaning> = several.chain(single).collect();
        let times = std::iter::once(&plan.import.time).chain(plan.import.join.iter().map(|joined| &joined.time));
        let mut ordered = Vec::new();
        for ((path, stem), time) in paths_and_stems(&plan.import).zip(times) {
            let Some(place) = files.iter().position(|file| file.path == path) else {
                continue;
            };
            let mut file = InspectedFile {
                stem,
                ..files.remove(place)
            };
            for column in 0..file.columns.len() {
                let is_time = time.as_ref() == Some(&file.columns[column].name);
                let named = meanings.get(&file.full_name(column)).copied().unwrap_or_default();
                file.meanings[column] = if is_time { Meaning::Time } else { named };
            }
            ordered.push(file);
        }
        Self {
            plan: Arc::new(plan),
            files: ordered,
            ..Self::default()
        }
    }

    /// Returns this suggestion with the choices in an `older` import, as far as they fit the files.
    pub(super) fn keeping(mut self, older: Self) -> Self {
        let Plan {
            import: found,
            test: found_test,
            ..
        } = Plan::clone(&self.plan);
        let renamed = older.renamed(&found);
        let mut import = Recipe {
            data: found.data,
            join: found.join,
            append: found.append,
            inputs: found.inputs,
            targets: found.targets,
            time: found.time,
            group: found.group,
            row_wire: found.row_wire,
            positions: found.positions.or_else(|| older.plan.import.positions.clone()),
            ..older.plan.import.clone()
        };
        rename(&mut import, &renamed);
        for joined in &mut import.join {
            let mut before = older.plan.import.join.iter();
            joined.limit = before.find(|before| before.file == joined.file).and_then(|before| before.limit);
        }
        for file in &older.files {
            (0..file.columns.len()).for_each(|column| drop(import.units.remove(&file.full_name(column))));
        }
        let test = older.plan.test.as_ref().map(|test| older.matching(test, &self.paths()));
        self.plan = Arc::new(Plan {
            import,
            test: found_test.or(test).filter(is_given),
            division: older.plan.division,
        });
        (self.chosen, self.units) = (older.chosen, older.units);
        for file in 0..self.files.len() {
            for column in 0..self.files[file].columns.len() {
                let key = key(&self.files[file], column);
                if let Some(&meaning) = self.chosen.get(&key) {
                    self.give(file, column, meaning);
                }
                if let Some(unit) = self.units.get(&key).cloned() {
                    let name = self.files[file].full_name(column);
                    self.edit().import.units.insert(name, unit);
                }
            }
        }
        self.write_meanings(older.plan.import.has_groups());
        self
    }

    /// Returns the recipe for inspecting the recordings at `paths`, whose columns have no meaning yet.
    pub(super) fn to_inspect(&self, paths: &[PathBuf]) -> Recipe {
        let import = &self.plan.import;
        let stem = |file: &PathBuf| {
            let mut joined = import.join.iter();
            joined.find(|joined| joined.file == *file)?.stem.clone()
        };
        let joined = |file: &PathBuf| Joined {
            file: file.clone(),
            stem: stem(file),
            ..Joined::default()
        };
        let mut recipe = Recipe {
            data: paths.first().cloned().unwrap_or_default(),
            join: paths.iter().skip(1).map(joined).collect(),
            dialect: import.dialect,
            derive: import.derive.clone(),
            missing: import.missing.clone(),
            time: import.time.clone().filter(|_| !import.derive.is_empty()),
            ..Recipe::default()
        };
        let renamed = self.renamed(&recipe);
        rename(&mut recipe, &renamed);
        recipe
    }

    /// Full names of the columns in use. In the file with a `variable` whose rows are to be the samples, only that is.
    pub(super) fn used(&self, variable: Option<(usize, &str)>) -> Vec<String> {
        let mut used = Vec::new();
        for (number, file) in self.files.iter().enumerate() {
            match variable {
                Some((of_file, name)) if of_file == number => used.push(match &file.stem {
                    None => name.to_owned(),
                    Some(stem) => format!("{stem}.{name}"),
                }),
                _ => {
                    let columns = (0..file.columns.len()).filter(|&column| file.meanings[column] != Meaning::Unused);
                    used.extend(columns.map(|column| file.full_name(column)));
                }
            }
        }
        used
    }

    /// Returns the full names that change if the files are read by `recipe`: those of a joined file have its stem in front,
    /// those of the first file have none.
    fn renamed(&self, recipe: &Recipe) -> BTreeMap<String, String> {
        let mut names = BTreeMap::new();
        for (path, stem) in paths_and_stems(recipe) {
            let mut files = self.files.iter();
            let Some(file) = files.find(|file| file.path == path && file.stem != stem) else {
                continue;
            };
            for (column, summary) in file.columns.iter().enumerate() {
                let name = match &stem {
                    None => summary.name.clone(),
                    Some(stem) => format!("{stem}.{}", summary.name),
                };
                names.insert(file.full_name(column), name);
            }
        }
        names
    }

    /// Returns the files of `set`, which correspond to those of this import, for the recordings at `paths`; an empty path
    /// where there is none.
    pub(super) fn matching(&self, set: &FileSet, paths: &[PathBuf]) -> FileSet {
        let own = self.paths();
        let mut files = paths.iter().map(|path| {
            let place = own.iter().position(|other| other == path);
            place.and_then(|place| set.files().nth(place)).cloned().unwrap_or_default()
        });
        FileSet {
            data: files.next().unwrap_or_default(),
            join: files.collect(),
            append: set.append.clone(),
        }
    }

    /// The plan, to be edited.
    pub(super) fn edit(&mut self) -> &mut Plan {
        Arc::make_mut(&mut self.plan)
    }

    /// Gives these columns of a file a meaning; if only one column can have it, the previous one loses it. Several columns get
    /// it only if they can be used and have no special meaning.
    pub(super) fn set_meanings(&mut self, file: usize, columns: impl ExactSizeIterator<Item = usize>, meaning: Meaning) {
        let had_groups = self.plan.import.has_groups();
        let is_single = columns.len() == 1;
        for column in columns {
            let (summary, before) = (&self.files[file].columns[column], self.files[file].meanings[column]);
            let may_be_used = summary.min.is_some() && summary.texts == 0 && !summary.is_constant;
            let is_plain = [Meaning::Input, Meaning::Target, Meaning::Unused].contains(&before);
            if is_single || (is_plain && (may_be_used || meaning == Meaning::Unused)) {
                self.give(file, column, meaning);
            }
        }
        self.write_meanings(had_groups);
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
    fn write_meanings(&mut self, had_groups: bool) {
        let of = |meaning: Meaning| -> Vec<String> {
            let of_file = |file: &InspectedFile| {
                let columns = (0..file.columns.len()).filter(|&column| file.meanings[column] == meaning);
                Vec::from_iter(columns.map(|column| file.full_name(column)))
            };
            self.files.iter().flat_map(of_file).collect()
        };
        let [inputs, targets, group, row_wire] =
            [Meaning::Input, Meaning::Target, Meaning::Group, Meaning::RowWire].map(of);
        // Without times in every file, rows belong together by their numbers.
        let times: Option<Vec<String>> = self.files.iter().map(time).collect();
        let mut times = times.into_iter().flatten();
        let Plan { import, division, .. } = self.edit();
        (import.inputs, import.targets) = (inputs, targets);
        (import.group, import.row_wire) = (group.into_iter().next(), row_wire.into_iter().next());
        import.time = times.next();
        import.join.iter_mut().for_each(|joined| joined.time = times.next());
        match (had_groups, import.has_groups()) {
            (false, true) => division.by = SplitBy::Group,
            (_, false) if division.by == SplitBy::Group => division.by = SplitBy::Time,
            _ => {}
        }
    }

    /// Returns `true` if a column of any file has this meaning.
    pub(super) fn has(&self, meaning: Meaning) -> bool {
        self.count(meaning) > 0
    }

    /// Returns the number of columns of this meaning.
    pub(super) fn count(&self, meaning: Meaning) -> usize {
        let meanings = self.files.iter().flat_map(|file| &file.meanings);
        meanings.filter(|other| **other == meaning).count()
    }

    /// Returns the unit of a column, as given or in the header.
    pub(super) fn unit(&self, file: usize, column: usize) -> String {
        let given = self.units.get(&key(&self.files[file], column));
        let found = self.files[file].columns[column].unit.as_ref();
        given.or(found).cloned().unwrap_or_default()
    }

    /// Gives a column a unit; none if it is empty or that of the header.
    pub(super) fn set_unit(&mut self, file: usize, column: usize, unit: &str) {
        let file = &self.files[file];
        let (key, name) = (key(file, column), file.full_name(column));
        let unit = Some(unit.trim()).filter(|unit| !unit.is_empty() && file.columns[column].unit.as_deref() != Some(*unit));
        self.units.remove(&key);
        self.units.extend(unit.map(|unit| (key, unit.to_owned())));
        let units = &mut self.edit().import.units;
        units.remove(&name);
        units.extend(unit.map(|unit| (name, unit.to_owned())));
    }

    /// Returns the paths of the first recording and of those joined to it.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        paths_and_stems(&self.plan.import).map(|(path, _)| path.to_owned()).collect()
    }

    /// Returns the files for the test, each with the recording that it replaces and its number.
    pub(super) fn tests(&self) -> Vec<(usize, PathBuf, PathBuf)> {
        let tests = self.plan.test.iter().flat_map(FileSet::files).enumerate();
        let tests = tests.zip(self.paths()).filter(|((_, test), _)| !test.as_os_str().is_empty());
        tests.map(|((number, test), recording)| (number, recording, test.clone())).collect()
    }

    /// Adds a file of test samples for the first recording that has none. With a single recording its test file is replaced.
    ///
    /// # Errors
    /// If it cannot be one; the message says what to do.
    pub(super) fn add_test_file(&mut self, path: PathBuf) -> Result<(), String> {
        let (name, recordings, tests) = (file_name(&path), self.paths(), self.tests());
        let mut numbers = 0..recordings.len();
        let lacking = numbers.find(|number| tests.iter().all(|(other, ..)| other != number));
        let Some(number) = lacking.or((recordings.len() == 1).then_some(0)) else {
            return Err(format!(
                "{name} was not opened: each of the {} recordings already has a file for the test. To use others, close \
                 those files first.",
                recordings.len()
            ));
        };
        // The same file may be joined to both: its times distinguish its rows.
        if number == 0 && recordings[0] == path {
            return Err(format!(
                "{name} is trained on, so it cannot be a test file: choose a separate recording for the test."
            ));
        }
        self.set_test_file(number, path);
        Ok(())
    }

    /// Sets the file that replaces this recording for the test; with an empty path, closes it.
    pub(super) fn set_test_file(&mut self, number: usize, path: PathBuf) {
        let recordings = self.paths().len();
        let plan = self.edit();
        let mut test = plan.test.take().unwrap_or_default();
        if path.as_os_str().is_empty() {
            test.append.clear();
        }
        test.join.resize(recordings - 1, PathBuf::new());
        match number.checked_sub(1) {
            None => test.data = path,
            Some(joined) => test.join[joined] = path,
        }
        plan.test = Some(test).filter(is_given);
    }

    /// Closes one of the files whose rows follow those of the first, with the files joined to it.
    pub(super) fn close_appended(&mut self, number: usize) {
        self.edit().import.append.remove(number);
        self.write_meanings(true);
    }

    /// Returns the reason why there is nothing to train on yet, with what to do.
    pub(super) fn obstacle(&self) -> Option<String> {
        if let Some(test) = &self.plan.test
            && let Some(number) = test.files().position(|path| path.as_os_str().is_empty())
        {
            return Some(format!(
                "{} has no file for the test yet: choose it with “Test file…” under “Samples”, or close the other files of \
                 the test.",
                file_name(&self.paths()[number])
            ));
        }
        let needed = [(Meaning::Input, "an input"), (Meaning::Target, "a target")];
        let lacking = needed.into_iter().find(|(meaning, _)| !self.has(*meaning));
        lacking.map(|(_, what)| format!("No column is {what}: choose one in the table of columns."))
    }
}

fn key(file: &InspectedFile, column: usize) -> ColumnKey {
    (file.path.clone(), file.columns[column].name.clone())
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
    std::iter::once((recipe.data.as_path(), None)).chain(joined)
}

/// Gives the columns of conditions and of markers of missing cells their new names.
fn rename(recipe: &mut Recipe, renamed: &BTreeMap<String, String>) {
    let conditions = std::mem::take(&mut recipe.conditions).into_iter();
    let conditions = conditions.map(|condition| condition.renamed(|name| renamed.get(name).cloned()));
    recipe.conditions = conditions.collect();
    for column in recipe.missing.iter_mut().filter_map(|missing| missing.column.as_mut()) {
        if let Some(name) = renamed.get(column) {
            column.clone_from(name);
        }
    }
}

/// Returns `true` if a set has any file.
fn is_given(set: &FileSet) -> bool {
    set.files().any(|path| !path.as_os_str().is_empty())
}

/// Returns the name of a file without its folder.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}
