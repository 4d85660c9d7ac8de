//! The plan of a draft, made once per change: the window asks for it several times per frame.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use decoupler_core::dataset::{DatasetError, Memory, Span, SplitBy};
use decoupler_files::import::{
    Condition, Derived, FileSet, ImportError, InspectedFile, Joined, Meaning, Missing, Plan, Recipe,
};

use super::columns_card::Renaming;

/// A column by its file and its name there, which do not change when another file becomes the first.
pub(super) type ColumnKey = (PathBuf, String);

/// The current state of an import: the files, the meaning of each column, and the division of the samples.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    /// The files, the first with the rows to which the others are joined.
    pub(super) files: Vec<InspectedFile>,
    /// Everything except the meanings and units of the columns, the conditions, the missing cells and the test files.
    pub(super) plan: Plan,
    /// Conditions as typed.
    pub(super) conditions: String,
    /// Cells that mean missing, as typed, with commas between them.
    pub(super) missing: String,
    /// Inputs from the past, as typed.
    pub(super) memory: MemoryTexts,
    /// Columns computed from others, as typed, with commas between them.
    pub(super) derived: String,
    /// Variables of files with several, such as workspaces, whose rows are the samples, each with the meaning that its columns
    /// get.
    pub(super) variables: BTreeMap<PathBuf, (String, Meaning)>,
    /// Meanings chosen by the user or a recipe, including columns hidden by the current layout.
    chosen: BTreeMap<ColumnKey, Meaning>,
    /// Units given by the user or a recipe, likewise.
    units: BTreeMap<ColumnKey, String>,
    /// Rule of division chosen by the user or a recipe; without one it follows from the groups.
    split: Option<SplitBy>,
    /// Files of test samples, by the recording that each one replaces.
    tests: BTreeMap<PathBuf, PathBuf>,
    /// Further test files, which the window does not change.
    more_tests: Vec<FileSet>,
    /// The plan of the recipe as read, and the same plan as this import writes it.
    of_recipe: Option<Box<[Plan; 2]>>,
    cache: RefCell<PlanCache>,
}

impl Draft {
    /// The import of a plan whose files have been inspected.
    pub(super) fn new(mut plan: Plan, files: Vec<InspectedFile>) -> Self {
        let import = &mut plan.import;
        let (conditions, missing) = (joined(&import.conditions, " and "), joined(&import.missing, ", "));
        let memory = MemoryTexts::from(&import.memory.take().unwrap_or_default());
        let derived = joined(&import.derive, ", ");
        let mut units = BTreeMap::new();
        for file in &files {
            for (column, summary) in file.columns.iter().enumerate() {
                if let Some(unit) = import.units.remove(&file.full_name(column)) {
                    units.insert((file.path.clone(), summary.name.clone()), unit);
                }
            }
        }
        let (of_tests, more_tests) = plan.test.take().map_or_else(Default::default, |test| {
            let first = Vec::from_iter(std::iter::once(test.data).chain(test.join));
            (first, test.append)
        });
        // The meanings of the columns are kept with the columns.
        (import.time, import.group, import.row_wire) = (None, None, None);
        (import.inputs, import.targets) = (Vec::new(), Vec::new());
        let paths = files.iter().map(|file| file.path.clone());
        Self {
            conditions,
            missing,
            memory,
            derived,
            variables: BTreeMap::new(),
            tests: paths.zip(of_tests).collect(),
            more_tests,
            files,
            plan,
            chosen: BTreeMap::new(),
            units,
            split: None,
            of_recipe: None,
            cache: RefCell::default(),
        }
    }

    /// The import of a recipe whose files have been inspected: nothing in it is a guess.
    pub(super) fn of_recipe(plan: Plan, files: Vec<InspectedFile>) -> Self {
        let mut draft = Self::new(plan.clone(), files);
        draft.split = Some(plan.division.by);
        for file in &draft.files {
            for (column, meaning) in file.columns.iter().zip(&file.meanings) {
                draft.chosen.insert((file.path.clone(), column.name.clone()), *meaning);
            }
        }
        draft.of_recipe = draft.made_plan().ok().map(|own| Box::new([plan, own]));
        draft
    }

    /// Returns this import with this share held out for validation, unless a recipe gives another.
    pub(super) fn holding_out(mut self, usual: f64) -> Self {
        let of_recipe = self.of_recipe.iter_mut().flat_map(|plans| plans.iter_mut());
        for plan in std::iter::once(&mut self.plan).chain(of_recipe) {
            plan.division.validation_fraction.get_or_insert(usual);
        }
        self
    }

    /// Returns this import with the choices of the user in an older one, as far as they fit the files.
    pub(super) fn keeping(mut self, older: &Self) -> Self {
        let stems = self
            .files
            .iter()
            .map(|file| (file.path.as_path(), file.stem.as_deref()));
        let renaming = Renaming::new(&older.files, stems);
        self.conditions = renaming.conditions(&older.conditions);
        self.missing = renaming.missing(&older.missing);
        self.memory.clone_from(&older.memory);
        self.derived.clone_from(&older.derived);
        self.variables.clone_from(&older.variables);
        for (name, unit) in &older.plan.import.units {
            self.plan
                .import
                .units
                .entry(name.clone())
                .or_insert_with(|| unit.clone());
        }
        for joined in &mut self.plan.import.join {
            let before = older.plan.import.join.iter().find(|before| before.file == joined.file);
            joined.limit = joined.limit.or(before.and_then(|before| before.limit));
        }
        if self.plan.import.positions.is_none() {
            self.plan.import.positions.clone_from(&older.plan.import.positions);
        }
        // Test files among those that were just opened come first.
        if self.tests.is_empty() {
            self.tests.clone_from(&older.tests);
            self.tests
                .retain(|recording, _| self.files.iter().any(|file| file.path == *recording));
        }
        self.units.extend(older.units.clone());
        self.chosen.clone_from(&older.chosen);
        for ((path, name), meaning) in &older.chosen {
            let file = self.files.iter().position(|file| file.path == *path);
            let columns = |file: usize| &self.files[file].columns;
            let place =
                file.and_then(|file| Some((file, columns(file).iter().position(|column| column.name == *name)?)));
            if let Some((file, column)) = place {
                self.give(file, column, *meaning);
            }
        }
        for (path, (name, meaning)) in &older.variables {
            if older
                .variable_columns(path, name)
                .is_none_or(|columns| columns.is_empty())
            {
                self.give_variable(path, name, *meaning);
            }
        }
        self.plan.division = older.plan.division;
        self.split = older.split;
        self.settle_split();
        self
    }

    /// Columns of a variable of a file; `None` if the file does not have it.
    fn variable_columns(&self, path: &Path, name: &str) -> Option<Range<usize>> {
        let file = self.files.iter().find(|file| file.path == path)?;
        let mut variables = file.variables.iter();
        Some(variables.find(|variable| variable.name == name)?.columns.clone())
    }

    fn give_variable(&mut self, path: &Path, name: &str, meaning: Meaning) {
        let file = self.files.iter().position(|file| file.path == path);
        if let (Some(file), Some(columns)) = (file, self.variable_columns(path, name)) {
            columns.for_each(|column| self.choose(file, column, meaning));
        }
    }

    /// Gives the columns of a variable this meaning. Returns true if the file must be read again, because its rows become the
    /// samples.
    pub(super) fn choose_variable(&mut self, file: usize, variable: usize, meaning: Meaning) -> bool {
        let path = self.files[file].path.clone();
        let name = self.files[file].variables[variable].name.clone();
        let is_left_out = self.files[file].variables[variable].columns.is_empty();
        if is_left_out {
            self.variables.insert(path, (name, meaning));
        } else {
            self.give_variable(&path, &name, meaning);
        }
        is_left_out
    }

    /// Full names of the variables whose rows are the samples, if files are read in this order with these stems.
    pub(super) fn variable_names(&self, recipe: &Recipe) -> Vec<String> {
        let stems = recipe.stems();
        let joined = recipe.join.iter().zip(&stems);
        let files =
            std::iter::once((&recipe.data, None)).chain(joined.map(|(joined, stem)| (&joined.file, Some(stem))));
        let named = files.filter_map(|(path, stem)| {
            let (name, _) = self.variables.get(path)?;
            Some(stem.map_or_else(|| name.clone(), |stem| format!("{stem}.{name}")))
        });
        named.collect()
    }

    /// Gives a column a meaning; if only one column can have it, the previous one loses it.
    pub(super) fn choose(&mut self, file: usize, column: usize, meaning: Meaning) {
        let had_group = self.has_groups();
        for path in self.give(file, column, meaning) {
            self.chosen.insert(path, Meaning::Unused);
        }
        let key = self.key(file, column);
        // Columns hidden by the current layout give it up too.
        for ((path, _), other) in &mut self.chosen {
            if *other == meaning && is_taken(meaning, *path == key.0) {
                *other = Meaning::Unused;
            }
        }
        self.chosen.insert(key, meaning);
        if meaning == Meaning::Group && !had_group {
            self.split = None;
        }
        self.settle_split();
    }

    /// Gives a column a meaning, and returns the columns that had to give it up.
    fn give(&mut self, file: usize, column: usize, meaning: Meaning) -> Vec<ColumnKey> {
        let mut given_up = Vec::new();
        for (number, other) in self.files.iter_mut().enumerate() {
            if !is_taken(meaning, number == file) {
                continue;
            }
            for (index, found) in other.meanings.iter_mut().enumerate() {
                if *found == meaning && (number, index) != (file, column) {
                    *found = Meaning::Unused;
                    let name = other.columns[index].name.clone();
                    given_up.push((other.path.clone(), name));
                }
            }
        }
        self.files[file].meanings[column] = meaning;
        given_up
    }

    /// Gives all inputs, targets and unused columns of a file this meaning, except for non-numeric ones.
    pub(super) fn choose_all(&mut self, file: usize, meaning: Meaning) {
        for column in 0..self.files[file].meanings.len() {
            let of_column = &self.files[file].columns[column];
            let may_be_used = of_column.min.is_some() && of_column.texts == 0 && !of_column.is_constant;
            let is_plain =
                [Meaning::Input, Meaning::Target, Meaning::Unused].contains(&self.files[file].meanings[column]);
            if is_plain && (may_be_used || meaning == Meaning::Unused) {
                self.choose(file, column, meaning);
            }
        }
    }

    /// Sets the rule of division; a division by group takes effect only if there are groups.
    pub(super) fn split_by(&mut self, by: SplitBy) {
        self.split = Some(by);
        self.settle_split();
    }

    /// Returns the rule of division: that of the user, or by group if there are any groups.
    fn settle_split(&mut self) {
        self.plan.division.by = match (self.split, self.has_groups()) {
            (Some(SplitBy::Group), false) | (None, false) => SplitBy::Time,
            (None, true) => SplitBy::Group,
            (Some(by), _) => by,
        };
    }

    /// Returns `true` if a column of any file has this meaning.
    pub(super) fn has(&self, meaning: Meaning) -> bool {
        self.files.iter().any(|file| file.meanings.contains(&meaning))
    }

    /// Returns `true` if samples belong to groups, by a column or by several files of one experiment.
    pub(super) fn has_groups(&self) -> bool {
        self.has(Meaning::Group) || !self.plan.import.append.is_empty()
    }

    /// Closes one of the files whose rows follow those of the first, with the files joined to it.
    pub(super) fn close_appended(&mut self, number: usize) {
        self.plan.import.append.remove(number);
        self.settle_split();
    }

    /// Returns the number of columns of this meaning.
    pub(super) fn count(&self, meaning: Meaning) -> usize {
        let meanings = self.files.iter().flat_map(|file| &file.meanings);
        meanings.filter(|other| **other == meaning).count()
    }

    fn key(&self, file: usize, column: usize) -> ColumnKey {
        let file = &self.files[file];
        (file.path.clone(), file.columns[column].name.clone())
    }

    /// Returns the unit of a column as typed or in the header.
    pub(super) fn unit(&self, file: usize, column: usize) -> String {
        let given = self.units.get(&self.key(file, column));
        let found = self.files[file].columns[column].unit.as_ref();
        given.or(found).cloned().unwrap_or_default()
    }

    /// Gives a column a unit; none if it is empty or that of the header.
    pub(super) fn set_unit(&mut self, file: usize, column: usize, unit: &str) {
        let key = self.key(file, column);
        let unit = unit.trim();
        let of_header = self.files[file].columns[column].unit.as_deref();
        if unit.is_empty() || of_header == Some(unit) {
            self.units.remove(&key);
        } else {
            self.units.insert(key, unit.to_owned());
        }
    }

    /// Returns the paths of the files, except for those of the test.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        self.files.iter().map(|file| file.path.clone()).collect()
    }

    /// Returns the files for the test, each with the recording that it replaces.
    pub(super) fn tests(&self) -> impl Iterator<Item = (&Path, &Path)> {
        let found = self
            .files
            .iter()
            .filter_map(|file| self.tests.get_key_value(&file.path));
        found.map(|(recording, test)| (recording.as_path(), test.as_path()))
    }

    /// Returns `true` if the test samples have their own files.
    pub(super) fn has_tests(&self) -> bool {
        !self.tests.is_empty()
    }

    /// Adds a file of test samples for the first recording that has none. With a single recording its test file is replaced.
    ///
    /// # Errors
    /// If it cannot be one; the message says what to do.
    pub(super) fn add_test_file(&mut self, path: PathBuf) -> Result<(), String> {
        let name = file_name(&path);
        let lacking = self.files.iter().find(|file| !self.tests.contains_key(&file.path));
        let recording = match (lacking, &self.files[..]) {
            (Some(file), _) | (None, [file]) => file.path.clone(),
            _ => {
                return Err(format!(
                    "{name} was not opened: each of the {} recordings already has a file for the test. To use others, \
                     close those files first.",
                    self.files.len()
                ));
            }
        };
        // The same file may be joined to both: its times distinguish its rows.
        if recording == path && self.files.first().is_some_and(|first| first.path == path) {
            return Err(format!(
                "{name} is trained on, so it cannot be a test file: choose a separate recording for the test."
            ));
        }
        self.tests.insert(recording, path);
        Ok(())
    }

    /// Closes the file that replaces this recording for the test.
    pub(super) fn close_test_file(&mut self, recording: &Path) {
        self.more_tests.clear();
        self.tests.remove(recording);
    }

    /// Returns the plan of the import with absolute paths.
    ///
    /// # Errors
    /// If a text cannot be understood, or a file for the test is missing; the message says what to do.
    pub(super) fn planned(&self) -> Result<Arc<Plan>, String> {
        self.cache.borrow_mut().planned(self)
    }

    /// As [`Self::planned`], with the paths of the draft and not cached.
    pub(super) fn made_plan(&self) -> Result<Plan, String> {
        let mut plan = self.plan.clone();
        let import = &mut plan.import;
        import.conditions = match self.conditions.trim() {
            "" => Vec::new(),
            text => vec![text.parse::<Condition>().map_err(|error| error.to_string())?],
        };
        import.missing = missing(&self.missing);
        import.memory = self.memory.parsed()?;
        let of = |meaning: Meaning| -> Vec<String> {
            let of_file = |file: &InspectedFile| -> Vec<String> {
                let columns = file.meanings.iter().enumerate().filter(|(_, other)| **other == meaning);
                columns.map(|(column, _)| file.full_name(column)).collect()
            };
            self.files.iter().flat_map(of_file).collect()
        };
        import.inputs = of(Meaning::Input);
        import.targets = of(Meaning::Target);
        import.group = of(Meaning::Group).pop();
        import.row_wire = of(Meaning::RowWire).pop();
        for file in self.files.iter().filter(|_| !self.units.is_empty()) {
            for (column, summary) in file.columns.iter().enumerate() {
                let unit = self.units.get(&(file.path.clone(), summary.name.clone()));
                import
                    .units
                    .extend(unit.map(|unit| (file.full_name(column), unit.clone())));
            }
        }
        // Without times in every file, rows belong together by their numbers.
        let times: Option<Vec<String>> = self.files.iter().map(time).collect();
        import.time = match &times {
            Some(times) => times.first().cloned(),
            None => None,
        };
        for (number, joined) in import.join.iter_mut().enumerate() {
            joined.time = times.as_ref().map(|times| times[number + 1].clone());
        }
        plan.test = self.test_files()?;
        // Unchanged parts keep their notation, such as ranges of columns.
        match self.of_recipe.as_deref() {
            Some([recipe, own]) if *own == plan => Ok(recipe.clone()),
            _ => Ok(plan),
        }
    }

    fn test_files(&self) -> Result<Option<FileSet>, String> {
        if self.tests.is_empty() {
            return Ok(None);
        }
        let mut files = Vec::new();
        for file in &self.files {
            files.push(self.tests.get(&file.path).cloned().ok_or_else(|| {
                format!(
                    "{} has no file for the test yet: choose it with “Test file…” under “Samples”, or close the other \
                     files of the test.",
                    file_name(&file.path)
                )
            })?);
        }
        let mut files = files.into_iter();
        Ok(files.next().map(|data| FileSet {
            data,
            join: files.collect(),
            append: self.more_tests.clone(),
        }))
    }

    /// Returns the parts of the draft that determine the plan and can change; the recipe and the files do not.
    pub(super) fn made_of(&self) -> MadeOf {
        MadeOf {
            plan: self.plan.clone(),
            texts: [self.conditions.clone(), self.missing.clone()],
            memory: self.memory.clone(),
            units: self.units.clone(),
            tests: self.tests.clone(),
            meanings: self.files.iter().map(|file| file.meanings.clone()).collect(),
        }
    }

    /// Returns `true` if [`Self::made_of`] is still this.
    pub(super) fn is_made_of(&self, made_of: &MadeOf) -> bool {
        let MadeOf {
            plan,
            texts,
            memory,
            units,
            tests,
            meanings,
        } = made_of;
        let [conditions, missing] = texts;
        let now = self.files.iter().map(|file| &file.meanings);
        (&self.plan, &self.conditions, &self.missing) == (plan, conditions, missing)
            && (&self.memory, &self.units, &self.tests) == (memory, units, tests)
            && now.eq(meanings)
    }

    /// Returns the reason why there is nothing to train on yet, with what to do.
    pub(super) fn obstacle(&self) -> Option<String> {
        self.planned().err().or_else(|| self.lack())
    }

    /// Returns a sentence about a required meaning that no column has yet.
    pub(super) fn lack(&self) -> Option<String> {
        let needed = [(Meaning::Input, "an input"), (Meaning::Target, "a target")];
        let lacking = needed.into_iter().find(|(meaning, _)| !self.has(*meaning));
        lacking.map(|(_, what)| format!("No column is {what}: choose one in the table of columns."))
    }

    /// Returns the joined files, with their numbers in the list of files.
    pub(super) fn joined(&mut self) -> &mut [Joined] {
        &mut self.plan.import.join
    }
}

/// Returns `true` if a column of the same file or of another one must give up a meaning that a column gets.
/// Inputs from the past, as typed: spans with commas between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MemoryTexts {
    pub(super) averages: String,
    pub(super) lags: String,
    pub(super) differences: bool,
}

impl From<&Memory> for MemoryTexts {
    fn from(memory: &Memory) -> Self {
        Self {
            averages: joined(&memory.averages, ", "),
            lags: joined(&memory.lags, ", "),
            differences: memory.differences,
        }
    }
}

impl MemoryTexts {
    /// Returns the memory; `None` if there is none.
    ///
    /// # Errors
    /// If a span cannot be understood.
    pub(super) fn parsed(&self) -> Result<Option<Memory>, String> {
        let memory = Memory {
            averages: spans(&self.averages)?,
            lags: spans(&self.lags)?,
            differences: self.differences,
            interval_s: None,
        };
        Ok(Some(memory).filter(|memory| !memory.is_empty()))
    }
}

/// Returns the spans in a text with commas between them.
pub(super) fn spans(text: &str) -> Result<Vec<Span>, String> {
    let texts = text.split(',').map(str::trim).filter(|text| !text.is_empty());
    texts
        .map(|text| text.parse().map_err(|error: DatasetError| error.to_string()))
        .collect()
}

fn is_taken(meaning: Meaning, is_same_file: bool) -> bool {
    match meaning {
        Meaning::Time => is_same_file,
        Meaning::Group | Meaning::RowWire => true,
        Meaning::Input | Meaning::Target | Meaning::Unused => false,
    }
}

/// Returns the name of the time column of a file, without its stem.
fn time(file: &InspectedFile) -> Option<String> {
    let column = file.meanings.iter().position(|meaning| *meaning == Meaning::Time)?;
    Some(file.columns[column].name.clone())
}

/// Cells that mean missing, as typed.
pub(super) fn missing(text: &str) -> Vec<Missing> {
    let texts = text.split(',').map(str::trim).filter(|text| !text.is_empty());
    texts.filter_map(|text| text.parse().ok()).collect()
}

/// Returns the columns computed from others in a text with commas between them.
///
/// # Errors
/// If one of them cannot be understood; the message says what to write.
pub(super) fn derived(text: &str) -> Result<Vec<Derived>, String> {
    let texts = text.split(',').map(str::trim).filter(|text| !text.is_empty());
    texts
        .map(|text| text.parse().map_err(|error: ImportError| error.to_string()))
        .collect()
}

/// The items as typed.
pub(super) fn joined<T: ToString>(items: &[T], separator: &str) -> String {
    items
        .iter()
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join(separator)
}

/// Returns the name of a file without its folder.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}

/// Parts of a draft that determine its plan and can change.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MadeOf {
    pub(super) plan: Plan,
    pub(super) texts: [String; 2],
    pub(super) memory: MemoryTexts,
    pub(super) units: BTreeMap<ColumnKey, String>,
    pub(super) tests: BTreeMap<PathBuf, PathBuf>,
    /// Meanings and units of the columns of each file.
    pub(super) meanings: Vec<Vec<Meaning>>,
}

/// Last plan or the reason why there is none, and the parts that it was made from.
#[derive(Clone, Debug, Default)]
pub(super) struct PlanCache(Option<(MadeOf, Result<Arc<Plan>, String>)>);

impl PlanCache {
    /// Returns the plan of `draft` with absolute paths, made again only if the draft has changed.
    pub(super) fn planned(&mut self, draft: &Draft) -> Result<Arc<Plan>, String> {
        if let Some((of, made)) = &self.0
            && draft.is_made_of(of)
        {
            return made.clone();
        }
        let made = draft.made_plan().map(|plan| Arc::new(plan.absolute()));
        self.0 = Some((draft.made_of(), made.clone()));
        made
    }
}
