use std::{collections::HashMap, fmt};

use super::{
    ImportError, Recipe,
    missing::Comparison,
    names::{ColumnId, Names},
};

/// Columns by their meaning.
pub(super) struct Meanings {
    pub(super) inputs: Vec<ColumnId>,
    pub(super) targets: Vec<ColumnId>,
    pub(super) time: Option<ColumnId>,
    pub(super) group: Option<ColumnId>,
    pub(super) row_wire: Option<ColumnId>,
    pub(super) comparisons: Vec<(ColumnId, Comparison)>,
    pub(super) units: HashMap<ColumnId, String>,
}

impl Meanings {
    pub(super) fn of(recipe: &Recipe, names: &Names) -> Result<Self, ImportError> {
        let one = |name: &Option<String>| name.as_ref().map(|name| names.find(name)).transpose();
        let comparisons = recipe.conditions.iter().flat_map(|condition| condition.comparisons());
        for missing in recipe.missing.iter().filter_map(|missing| missing.column.as_deref()) {
            names.find(missing)?;
        }
        let units = recipe
            .units
            .iter()
            .map(|(name, unit)| Ok((names.find(name)?, unit.clone())));
        let meanings = Self {
            inputs: names.find_all(&recipe.inputs)?,
            targets: names.find_all(&recipe.targets)?,
            time: one(&recipe.time)?,
            group: one(&recipe.group)?,
            row_wire: one(&recipe.row_wire)?,
            comparisons: comparisons
                .map(|comparison| Ok((names.find(&comparison.column)?, comparison.clone())))
                .collect::<Result<_, ImportError>>()?,
            units: units.collect::<Result<_, ImportError>>()?,
        };
        for (columns, what) in [(&meanings.inputs, "an input"), (&meanings.targets, "a target")] {
            if columns.is_empty() {
                return Err(ImportError::NoColumns(what));
            }
        }
        let mut seen: HashMap<ColumnId, &'static str> = HashMap::new();
        let all = [
            ("an input", meanings.inputs.clone()),
            ("a target", meanings.targets.clone()),
            ("the group", Vec::from_iter(meanings.group)),
            ("the row-wire", Vec::from_iter(meanings.row_wire)),
        ];
        for (other, columns) in all {
            for id in columns {
                if let Some(one) = seen.insert(id, other) {
                    let name = names.name(id).to_owned();
                    return Err(ImportError::TwoMeanings { name, one, other });
                }
            }
        }
        Ok(meanings)
    }

    /// Columns whose cells must be numbers.
    pub(super) fn used(&self) -> impl Iterator<Item = ColumnId> {
        let compared = self.comparisons.iter().map(|(id, _)| *id);
        let single = self.time.into_iter().chain(self.row_wire).chain(self.group);
        compared
            .chain(single)
            .chain(self.inputs.iter().copied())
            .chain(self.targets.iter().copied())
    }
}

/// Meaning of a column for a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Meaning {
    /// The sensor gives it.
    Input,
    /// Target, predicted from the inputs.
    Target,
    /// Time of the row.
    Time,
    /// Equal values belong together, as one press or one session.
    Group,
    /// Number of the row-wire, from 1.
    RowWire,
    /// Nothing.
    #[default]
    Unused,
}

impl Meaning {
    /// Every meaning, in the order offered.
    pub const ALL: [Self; 6] = [
        Self::Input,
        Self::Target,
        Self::Time,
        Self::Group,
        Self::RowWire,
        Self::Unused,
    ];
}

impl fmt::Display for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Input => "input",
            Self::Target => "target",
            Self::Time => "time",
            Self::Group => "group",
            Self::RowWire => "row-wire",
            Self::Unused => "unused",
        })
    }
}
