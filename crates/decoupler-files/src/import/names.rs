use super::{Column, ImportError, Table};
use decoupler_core::text::clean_name;

/// A column of one of the files of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct ColumnId {
    /// Number of the file: 0, or the number of the joined file from 1.
    pub(super) file: usize,
    /// Index of the column in its file.
    pub(super) column: usize,
}

/// Full names of all columns: those of a joined file have its stem in front.
pub(super) struct Names {
    names: Vec<(String, ColumnId)>,
}

/// Number of names from which only those that are like the name given are listed.
const FEW: usize = 24;

impl Names {
    /// Names the columns of the files; `stems` are those of the joined ones.
    pub(super) fn of(files: &[&Table], stems: &[String]) -> Self {
        let columns: Vec<&[Column]> = files.iter().map(|table| table.columns.as_slice()).collect();
        Self::of_columns(&columns, stems)
    }

    /// Names the columns of each file; `stems` are those of the joined files.
    pub(super) fn of_columns(files: &[&[Column]], stems: &[String]) -> Self {
        let mut names = Vec::new();
        for (file, columns) in files.iter().enumerate() {
            for (index, column) in columns.iter().enumerate() {
                let name = match file.checked_sub(1) {
                    None => column.name.clone(),
                    Some(joined) => format!("{}.{}", stems[joined], column.name),
                };
                names.push((name, ColumnId { file, column: index }));
            }
        }
        Self { names }
    }

    /// Full name of a column.
    pub(super) fn name(&self, id: ColumnId) -> &str {
        let found = self.names.iter().find(|(_, other)| *other == id);
        found.map_or("", |(name, _)| name)
    }

    /// Finds a column by its full name, with or without the unit that the header gives.
    pub(super) fn find(&self, given: &str) -> Result<ColumnId, ImportError> {
        let name = &clean_name(given.trim());
        let bare = super::table::name_and_unit(name).0;
        let with = |name: &str| -> Vec<ColumnId> {
            let found = self.names.iter().filter(|(other, _)| other == name);
            found.map(|(_, id)| *id).collect()
        };
        let mut found = with(name);
        if found.is_empty() {
            found = with(bare);
        }
        match found[..] {
            [id] => Ok(id),
            [] => Err(ImportError::Unknown {
                name: name.to_owned(),
                near: self.near(name),
            }),
            _ => Err(ImportError::Ambiguous {
                name: name.to_owned(),
                candidates: found
                    .iter()
                    .map(|id| format!("column {} of file {}", id.column + 1, id.file + 1))
                    .collect::<Vec<_>>()
                    .join(", "),
            }),
        }
    }

    /// Finds the columns of names and ranges such as `c2..c16`.
    pub(super) fn find_all(&self, given: &[String]) -> Result<Vec<ColumnId>, ImportError> {
        let mut all = Vec::new();
        for name in given {
            // A header may have two points in its name.
            match (self.find(name), name.split_once("..")) {
                (Ok(id), _) => all.push(id),
                (Err(error), None) => return Err(error),
                (Err(_), Some((first, last))) => all.extend(self.range(name, first, last)?),
            }
        }
        Ok(all)
    }

    fn range(&self, given: &str, first: &str, last: &str) -> Result<Vec<ColumnId>, ImportError> {
        let first_id = self.find(first)?;
        // `states.c2..c4` is shorter than `states.c2..states.c4`.
        let prefix = first
            .trim()
            .rsplit_once('.')
            .map(|(prefix, _)| format!("{prefix}.{}", last.trim()));
        let last_id = match (self.find(last), prefix) {
            (Ok(id), _) if id.file == first_id.file => id,
            (_, Some(prefixed)) => self.find(&prefixed)?,
            (found, None) => found?,
        };
        if first_id.file != last_id.file || first_id.column > last_id.column {
            return Err(ImportError::Range(given.to_owned()));
        }
        let file = first_id.file;
        Ok((first_id.column..=last_id.column)
            .map(|column| ColumnId { file, column })
            .collect())
    }

    /// Says which columns there are, or which names are like `name`.
    fn near(&self, name: &str) -> String {
        if self.names.len() <= FEW {
            let all: Vec<&str> = self.names.iter().map(|(name, _)| name.as_str()).collect();
            return format!("there are {}", all.join(", "));
        }
        let mut by_distance: Vec<(usize, &str)> = self
            .names
            .iter()
            .map(|(other, _)| (distance(name, other), other.as_str()))
            .collect();
        by_distance.sort_by_key(|(distance, _)| *distance);
        let near: Vec<&str> = by_distance.into_iter().take(6).map(|(_, name)| name).collect();
        format!(
            "of {} columns, these have the most similar names: {}",
            self.names.len(),
            near.join(", ")
        )
    }
}

/// Number of letters to be inserted, removed or replaced to make one name of the other, whatever their case.
fn distance(one: &str, other: &str) -> usize {
    let beginning = |text: &str| text.chars().take(64).collect::<String>().to_lowercase();
    strsim::levenshtein(&beginning(one), &beginning(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_of_names_counts_changed_letters() {
        for (one, other, expected) in [
            ("force", "force", 0),
            ("force", "Forec", 2),
            ("", "abc", 3),
            ("kitten", "sitting", 3),
        ] {
            assert_eq!(distance(one, other), expected, "{one} {other}");
        }
    }
}
