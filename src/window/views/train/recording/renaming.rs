use std::{collections::BTreeMap, path::Path};

use super::draft::{joined, missing};
use decoupler_files::import::{Condition, InspectedFile};

/// New full names of columns: the columns of a joined file have its stem in front, those of the first file have none.
#[derive(Debug)]
pub(super) struct Renaming(BTreeMap<String, String>);

impl Renaming {
    /// The names that change where `older` files are read with these stems; `None` is that of the first file.
    pub(super) fn new<'a>(older: &[InspectedFile], stems: impl Iterator<Item = (&'a Path, Option<&'a str>)>) -> Self {
        let mut names = BTreeMap::new();
        for (path, stem) in stems {
            let Some(file) = older.iter().find(|file| file.path == path) else {
                continue;
            };
            if file.stem.as_deref() == stem {
                continue;
            }
            for (column, summary) in file.inspection.columns.iter().enumerate() {
                let name = match stem {
                    None => summary.name.clone(),
                    Some(stem) => format!("{stem}.{}", summary.name),
                };
                names.insert(file.full_name(column), name);
            }
        }
        Self(names)
    }

    /// Conditions as typed, with the new names. A text that is no condition yet stays.
    pub(super) fn conditions(&self, text: &str) -> String {
        match text.parse::<Condition>() {
            Ok(condition) if !self.0.is_empty() => condition.renamed(|name| self.0.get(name).cloned()).to_string(),
            _ => text.to_owned(),
        }
    }

    /// Cells that mean missing as typed, with the new names.
    pub(super) fn missing(&self, text: &str) -> String {
        if self.0.is_empty() {
            return text.to_owned();
        }
        let mut items = missing(text);
        for column in items.iter_mut().filter_map(|item| item.column.as_mut()) {
            if let Some(name) = self.0.get(column) {
                column.clone_from(name);
            }
        }
        joined(&items, ", ")
    }
}
