use std::{convert::Infallible, fmt, str::FromStr};

use decoupler_core::text::in_one_line;
use serde::{Deserialize, Serialize};

use super::{ImportError, format::Cell};

/// Marker of missing values: a text or number, in one column or in all.
///
/// Written as `-1` or, for one column, as `states.c5=-1`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub struct Missing {
    /// Column; `None` for all.
    pub column: Option<String>,
    /// Text of the cell.
    pub text: String,
    /// The text as a number; any other spelling of the number is a marker, too.
    number: Option<f64>,
}

impl Missing {
    /// Returns `true` for a cell with this marker.
    pub(super) fn is(&self, cell: &[u8], found: Cell) -> bool {
        match (found, self.number) {
            (Cell::Number(found), Some(number)) => found == number,
            _ => cell == self.text.as_bytes(),
        }
    }

    /// Returns `true` for a number equal to this marker.
    pub(super) fn is_number(&self, found: f64) -> bool {
        self.number == Some(found)
    }
}

impl From<String> for Missing {
    fn from(text: String) -> Self {
        let (column, value) = match text.split_once('=') {
            Some((column, value)) if !column.trim().is_empty() => (Some(column.trim().to_owned()), value),
            _ => (None, text.as_str()),
        };
        let value = value.trim().to_owned();
        Self {
            column,
            number: value.parse().ok().filter(|number: &f64| number.is_finite()),
            text: value,
        }
    }
}

impl FromStr for Missing {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(text.to_owned().into())
    }
}

impl From<Missing> for String {
    fn from(missing: Missing) -> Self {
        missing.to_string()
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.column {
            Some(column) => write!(f, "{column}={}", self.text),
            None => f.write_str(&self.text),
        }
    }
}

/// Condition on the rows that are used: comparisons of columns with numbers, joined by `and`.
///
/// Written as `c4<145.1 and c5!=0`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Condition {
    comparisons: Vec<Comparison>,
}

/// Comparison of a column with a number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Comparison {
    pub(super) column: String,
    pub(super) relation: Relation,
    pub(super) number: f64,
}

/// Relation of a cell to the number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    Less,
    AtMost,
    Greater,
    AtLeast,
    Equal,
    Other,
}

/// Relations and their operators; an operator that begins with another one comes before it.
const WRITTEN: [(&str, Relation); 7] = [
    ("<=", Relation::AtMost),
    (">=", Relation::AtLeast),
    ("!=", Relation::Other),
    ("==", Relation::Equal),
    ("<", Relation::Less),
    (">", Relation::Greater),
    ("=", Relation::Equal),
];

impl Condition {
    pub(super) fn comparisons(&self) -> &[Comparison] {
        &self.comparisons
    }

    /// Returns this condition with renamed columns: `name` returns the new name of a column, or `None` to keep it.
    #[must_use]
    pub fn renamed(&self, name: impl Fn(&str) -> Option<String>) -> Self {
        let renamed = |comparison: &Comparison| Comparison {
            column: name(&comparison.column).unwrap_or_else(|| comparison.column.clone()),
            ..comparison.clone()
        };
        Self {
            comparisons: self.comparisons.iter().map(renamed).collect(),
        }
    }
}

impl Comparison {
    /// Returns `true` for a cell that meets the comparison.
    pub(super) fn is_met(&self, cell: f64) -> bool {
        match self.relation {
            Relation::Less => cell < self.number,
            Relation::AtMost => cell <= self.number,
            Relation::Greater => cell > self.number,
            Relation::AtLeast => cell >= self.number,
            Relation::Equal => cell == self.number,
            Relation::Other => cell != self.number,
        }
    }
}

impl FromStr for Condition {
    type Err = ImportError;

    fn from_str(text: &str) -> Result<Self, ImportError> {
        let wrong = |reason: String| ImportError::Condition {
            text: in_one_line(text),
            reason: in_one_line(&reason),
        };
        let words: Vec<&str> = text.split_whitespace().collect();
        let parts = words.split(|word| word.eq_ignore_ascii_case("and") || *word == "&&");
        let comparison = |words: &[&str]| {
            let part = words.join(" ");
            let place = part
                .find(['<', '>', '=', '!'])
                .ok_or_else(|| wrong(format!("'{part}' has no comparison")))?;
            let (column, rest) = part.split_at(place);
            let found = WRITTEN
                .iter()
                .find_map(|(written, relation)| Some((rest.strip_prefix(written)?, *relation)));
            let (number, relation) =
                found.ok_or_else(|| wrong(format!("'{rest}' does not begin with a comparison")))?;
            if column.trim().is_empty() {
                return Err(wrong(format!("'{part}' has no column")));
            }
            let finite = number.trim().parse().ok().filter(|number: &f64| number.is_finite());
            Ok(Comparison {
                column: column.trim().to_owned(),
                relation,
                number: finite.ok_or_else(|| wrong(format!("'{}' is not a number", number.trim())))?,
            })
        };
        Ok(Self {
            comparisons: parts.map(comparison).collect::<Result<_, _>>()?,
        })
    }
}

impl TryFrom<String> for Condition {
    type Error = ImportError;

    fn try_from(text: String) -> Result<Self, ImportError> {
        text.parse()
    }
}

impl From<Condition> for String {
    fn from(condition: Condition) -> Self {
        condition.to_string()
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let written = WRITTEN.iter().find(|(_, relation)| *relation == self.relation);
        write!(
            f,
            "{}{}{}",
            self.column,
            written.map_or("", |(written, _)| written),
            self.number
        )
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let comparisons: Vec<String> = self.comparisons.iter().map(ToString::to_string).collect();
        f.write_str(&comparisons.join(" and "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_read_and_written() {
        let cases = [
            ("states.c4<145.1", "states.c4<145.1"),
            (" c4 <= 1e2 AND c5 != -1 && c6>0", "c4<=100 and c5!=-1 and c6>0"),
            ("probe height>=.5", "probe height>=0.5"),
            ("a=1 and b==2", "a==1 and b==2"),
        ];
        for (text, written) in cases {
            let condition: Condition = text.parse().unwrap();
            assert_eq!(condition.to_string(), written);
            assert_eq!(written.parse::<Condition>().unwrap(), condition);
        }
        for (text, reason) in [
            ("", "has no comparison"),
            ("c4", "has no comparison"),
            ("<3", "has no column"),
            ("c4<x", "'x' is not a number"),
            ("c4<1 and", "has no comparison"),
            ("c4!3", "does not begin with a comparison"),
            ("c4<inf", "'inf' is not a number"),
        ] {
            let error = text.parse::<Condition>().unwrap_err().to_string();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }

    #[test]
    fn columns_are_renamed_and_nothing_else() {
        let condition: Condition = "c4<145.1 and c5!=0 and c4>1".parse().unwrap();
        let renamed = condition.renamed(|name| (name == "c4").then(|| "states.c4".to_owned()));
        assert_eq!(renamed.to_string(), "states.c4<145.1 and c5!=0 and states.c4>1");
    }

    #[test]
    fn cells_are_compared_with_the_number() {
        let met = |text: &str| {
            let condition: Condition = text.parse().unwrap();
            [0.0, 1.0, 2.0].map(|cell| condition.comparisons[0].is_met(cell))
        };
        assert_eq!(met("x<1"), [true, false, false]);
        assert_eq!(met("x<=1"), [true, true, false]);
        assert_eq!(met("x>1"), [false, false, true]);
        assert_eq!(met("x>=1"), [false, true, true]);
        assert_eq!(met("x=1"), [false, true, false]);
        assert_eq!(met("x!=1"), [true, false, true]);
    }
}
