use std::path::{Path, PathBuf};

use super::{
    Format, ImportError, Inspection, Meaning, Recipe, Watch,
    names::{ColumnId, Names},
};

/// A file of a recipe, looked at column by column.
#[derive(Clone, Debug)]
pub struct InspectedFile {
    /// The file, as the recipe names it.
    pub path: PathBuf,
    /// Name in front of its columns; `None` for the first file.
    pub stem: Option<String>,
    /// Kind of the file, and its layout.
    pub format: Format,
    /// Its columns in numbers. Cells that mean missing by the recipe count as missing.
    pub inspection: Inspection,
    /// Meaning of each column by the recipe.
    pub meanings: Vec<Meaning>,
}

impl InspectedFile {
    /// Full name of a column: that of a joined file has the stem in front.
    pub fn full_name(&self, column: usize) -> String {
        let name = &self.inspection.columns[column].name;
        match &self.stem {
            None => name.clone(),
            Some(stem) => format!("{stem}.{name}"),
        }
    }
}

impl Recipe {
    /// Reads the files, relative to `folder`, and looks at each column; the recipe need not be complete.
    ///
    /// # Errors
    /// If a file cannot be read, or the recipe names a column that is not there; or `watch` breaks.
    pub fn inspect(&self, folder: &Path, watch: Watch<'_>) -> Result<Vec<InspectedFile>, ImportError> {
        // Labels of groups are looked at as any other cells.
        let plain = Self {
            group: None,
            ..self.clone()
        };
        let stems = self.stems();
        let files = std::iter::once((&self.data, None));
        let files = files.chain(
            self.join
                .iter()
                .zip(&stems)
                .map(|(joined, stem)| (&joined.file, Some(stem))),
        );
        let (mut tables, mut inspected) = (Vec::new(), Vec::new());
        for (number, (path, stem)) in files.enumerate() {
            let (_, mut table) = plain.read(folder, number, path, stem, watch)?;
            inspected.push(InspectedFile {
                path: path.clone(),
                stem: stem.cloned(),
                format: table.format.clone(),
                inspection: Inspection::of(&table, None)?,
                meanings: vec![Meaning::Unused; table.columns.len()],
            });
            // Their names are all that is needed from here on.
            for column in &mut table.columns {
                column.cells = Default::default();
            }
            tables.push(table);
        }
        let names = Names::of(&Vec::from_iter(&tables), &stems);
        for (id, meaning) in self.meant(&names)? {
            inspected[id.file].meanings[id.column] = meaning;
        }
        for (number, joined) in self.join.iter().enumerate() {
            let time = joined.time.as_ref().or(self.time.as_ref());
            let columns = &tables[number + 1].columns;
            let found = time.and_then(|time| columns.iter().position(|column| column.name == time.trim()));
            if let Some(column) = found {
                inspected[number + 1].meanings[column] = Meaning::Time;
            }
        }
        Ok(inspected)
    }

    /// Columns with the meanings that the recipe gives them; times of joined files excepted.
    fn meant(&self, names: &Names) -> Result<Vec<(ColumnId, Meaning)>, ImportError> {
        let mut meant = Vec::new();
        for (one, meaning) in [
            (&self.time, Meaning::Time),
            (&self.group, Meaning::Group),
            (&self.row_wire, Meaning::RowWire),
        ] {
            if let Some(name) = one {
                meant.push((names.find(name)?, meaning));
            }
        }
        for (several, meaning) in [(&self.inputs, Meaning::Input), (&self.targets, Meaning::Target)] {
            meant.extend(names.find_all(several)?.into_iter().map(|id| (id, meaning)));
        }
        Ok(meant)
    }
}
