use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::{
    dataset::SplitBy,
    import::{Condition, InspectedFile, Joined, Meaning, Missing, Plan, TestFiles},
};

/// An import as the user has it now: the files, what each column means, and how the samples are divided.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    /// The files, the first with the rows to which the others are joined.
    pub(super) files: Vec<InspectedFile>,
    /// Everything but the meanings of the columns, the conditions and the missing cells.
    pub(super) plan: Plan,
    /// Conditions as typed.
    pub(super) conditions: String,
    /// Cells that mean missing, as typed, with commas between them.
    pub(super) missing: String,
    /// Meanings that the user or a recipe has chosen, by file and column.
    chosen: BTreeMap<(PathBuf, String), Meaning>,
    /// The plan of the recipe in its own words, and the same plan as this import writes it.
    of_recipe: Option<Box<[Plan; 2]>>,
}

impl Draft {
    /// The import of a plan, whose files were looked at.
    pub(super) fn new(plan: Plan, files: Vec<InspectedFile>) -> Self {
        let import = &plan.import;
        Self {
            conditions: joined(&import.conditions, " and "),
            missing: joined(&import.missing, ", "),
            files,
            plan,
            chosen: BTreeMap::new(),
            of_recipe: None,
        }
    }

    /// The import of a recipe, whose files were looked at: nothing in it is a guess.
    pub(super) fn of_recipe(plan: Plan, files: Vec<InspectedFile>) -> Self {
        let mut draft = Self::new(plan.clone(), files);
        for file in &draft.files {
            for (column, meaning) in file.inspection.columns.iter().zip(&file.meanings) {
                draft.chosen.insert((file.path.clone(), column.name.clone()), *meaning);
            }
        }
        draft.of_recipe = draft.plan().ok().map(|own| Box::new([plan, own]));
        draft
    }

    /// This import with what the user has chosen in an older one, as far as it fits the files.
    pub(super) fn keeping(mut self, older: &Self) -> Self {
        self.conditions.clone_from(&older.conditions);
        self.missing.clone_from(&older.missing);
        self.plan.import.units.clone_from(&older.plan.import.units);
        let (division, before) = (&mut self.plan.division, &older.plan.division);
        division.test_fraction = before.test_fraction;
        division.validation_fraction = before.validation_fraction;
        if before.by == SplitBy::Random {
            division.by = before.by;
        }
        if self.plan.import.positions.is_none() {
            self.plan.import.positions.clone_from(&older.plan.import.positions);
        }
        if older.plan.test.is_some() {
            self.plan.test.clone_from(&older.plan.test);
        }
        for ((path, name), meaning) in &older.chosen {
            for file in 0..self.files.len() {
                let columns = &self.files[file].inspection.columns;
                let column = columns.iter().position(|column| column.name == *name);
                if let Some(column) = column.filter(|_| self.files[file].path == *path) {
                    self.choose(file, column, *meaning);
                }
            }
        }
        self
    }

    /// Gives a column a meaning; another column that had it gives it up where only one can have it.
    pub(super) fn choose(&mut self, file: usize, column: usize, meaning: Meaning) {
        for (number, other) in self.files.iter_mut().enumerate() {
            let is_taken = match meaning {
                Meaning::Time => number == file,
                Meaning::Group | Meaning::RowWire => true,
                Meaning::Input | Meaning::Target | Meaning::Unused => false,
            };
            if is_taken {
                other
                    .meanings
                    .iter_mut()
                    .filter(|other| **other == meaning)
                    .for_each(|other| *other = Meaning::Unused);
            }
        }
        let chosen = &mut self.files[file];
        chosen.meanings[column] = meaning;
        let name = chosen.inspection.columns[column].name.clone();
        self.chosen.insert((chosen.path.clone(), name), meaning);
        let has_group = self.has(Meaning::Group);
        if meaning == Meaning::Group {
            self.plan.division.by = SplitBy::Group;
        } else if self.plan.division.by == SplitBy::Group && !has_group {
            self.plan.division.by = SplitBy::Time;
        }
    }

    /// Gives all inputs, targets and unused columns of a file this meaning, but for those that hold no numbers.
    pub(super) fn choose_all(&mut self, file: usize, meaning: Meaning) {
        for column in 0..self.files[file].meanings.len() {
            let of_column = &self.files[file].inspection.columns[column];
            let may_be_used = of_column.min.is_some() && of_column.texts == 0 && !of_column.is_constant;
            let is_plain =
                [Meaning::Input, Meaning::Target, Meaning::Unused].contains(&self.files[file].meanings[column]);
            if is_plain && (may_be_used || meaning == Meaning::Unused) {
                self.choose(file, column, meaning);
            }
        }
    }

    /// Tells whether a column of any file has this meaning.
    pub(super) fn has(&self, meaning: Meaning) -> bool {
        self.files.iter().any(|file| file.meanings.contains(&meaning))
    }

    /// Number of columns of this meaning.
    pub(super) fn count(&self, meaning: Meaning) -> usize {
        let meanings = self.files.iter().flat_map(|file| &file.meanings);
        meanings.filter(|other| **other == meaning).count()
    }

    /// Unit of a column as typed or in the header.
    pub(super) fn unit(&self, file: usize, column: usize) -> String {
        let file = &self.files[file];
        let given = self.plan.import.units.get(&file.full_name(column));
        let found = file.inspection.columns[column].unit.as_ref();
        given.or(found).cloned().unwrap_or_default()
    }

    /// Gives a column a unit; none if it is empty or that of the header.
    pub(super) fn set_unit(&mut self, file: usize, column: usize, unit: &str) {
        let name = self.files[file].full_name(column);
        let unit = unit.trim();
        let of_header = self.files[file].inspection.columns[column].unit.as_deref();
        if unit.is_empty() || of_header == Some(unit) {
            self.plan.import.units.remove(&name);
        } else {
            self.plan.import.units.insert(name, unit.to_owned());
        }
    }

    /// Paths of the files, but for those of the test.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        self.files.iter().map(|file| file.path.clone()).collect()
    }

    /// Paths of the files for the test.
    pub(super) fn test_paths(&self) -> Vec<PathBuf> {
        let test = self.plan.test.iter();
        test.flat_map(|test| std::iter::once(&test.data).chain(&test.join))
            .cloned()
            .collect()
    }

    /// Adds a file of test samples: in the place of the first file, then in those of the joined ones.
    pub(super) fn add_test_file(&mut self, path: PathBuf) {
        match &mut self.plan.test {
            None => {
                self.plan.test = Some(TestFiles {
                    data: path,
                    join: Vec::new(),
                });
            }
            Some(test) => test.join.push(path),
        }
    }

    /// The import as it stands, to be read anew.
    ///
    /// # Errors
    /// If a text cannot be understood; with what to write.
    pub(super) fn plan(&self) -> Result<Plan, String> {
        let mut plan = self.plan.clone();
        let import = &mut plan.import;
        import.conditions = match self.conditions.trim() {
            "" => Vec::new(),
            text => vec![text.parse::<Condition>().map_err(|error| error.to_string())?],
        };
        import.missing = missing(&self.missing);
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
        // Without times in every file, rows belong together by their numbers.
        let times: Option<Vec<String>> = self.files.iter().map(time).collect();
        import.time = match &times {
            Some(times) => times.first().cloned(),
            None => None,
        };
        for (number, joined) in import.join.iter_mut().enumerate() {
            joined.time = times.as_ref().map(|times| times[number + 1].clone());
        }
        // What has not changed keeps its words, such as ranges of columns.
        match self.of_recipe.as_deref() {
            Some([recipe, own]) if *own == plan => Ok(recipe.clone()),
            _ => Ok(plan),
        }
    }

    /// Reason for which there is nothing to train on yet, with what to do.
    pub(super) fn obstacle(&self) -> Option<String> {
        self.plan().err().or_else(|| self.lack())
    }

    /// Says which meaning no column has yet.
    pub(super) fn lack(&self) -> Option<String> {
        let needed = [(Meaning::Input, "an input"), (Meaning::Target, "a target")];
        let lacking = needed.into_iter().find(|(meaning, _)| !self.has(*meaning));
        lacking.map(|(_, what)| format!("No column is {what}: choose one in the table of columns."))
    }

    /// The files joined, with their number in the list of files.
    pub(super) fn joined(&mut self) -> &mut [Joined] {
        &mut self.plan.import.join
    }
}

/// Name of the column of times of a file, without its stem.
fn time(file: &InspectedFile) -> Option<String> {
    let column = file.meanings.iter().position(|meaning| *meaning == Meaning::Time)?;
    Some(file.inspection.columns[column].name.clone())
}

/// Cells that mean missing, as typed.
pub(super) fn missing(text: &str) -> Vec<Missing> {
    let texts = text.split(',').map(str::trim).filter(|text| !text.is_empty());
    texts.map(|text| Missing::from(text.to_owned())).collect()
}

fn joined<T: ToString>(items: &[T], separator: &str) -> String {
    items
        .iter()
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join(separator)
}

/// Name of a file without its folder.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}
