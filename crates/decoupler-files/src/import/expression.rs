//! The notation of derived columns, conditions and markers of missing cells: a column, an operator, and an operand.

use std::{convert::Infallible, fmt, str::FromStr};

use decoupler_core::{
    dataset::Span,
    text::{in_one_line, is_unprintable},
};
use serde::{Deserialize, Deserializer, Serializer, de};

use super::{ImportError, format::Cell};

/// A column with an operator and what it is compared or combined with; columns are given by their names or, in a table, by their
/// places.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Expression<C = String> {
    pub(super) column: C,
    pub(super) operator: Operator,
    pub(super) operand: Operand<C>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Minus,
    Over,
    AtMost,
    AtLeast,
    Other,
    Equal,
    Less,
    Greater,
}

/// What a column is compared or combined with.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Operand<C> {
    /// Another column, row by row.
    Column(C),
    Number(f64),
    /// Its own mean over the first rows or seconds.
    Start(Span),
}

/// Operators as written; one that begins with another comes before it.
const COMPARISONS: [(&str, Operator); 7] = [
    ("<=", Operator::AtMost),
    (">=", Operator::AtLeast),
    ("!=", Operator::Other),
    ("==", Operator::Equal),
    ("<", Operator::Less),
    (">", Operator::Greater),
    ("=", Operator::Equal),
];
const COMBINATIONS: [(&str, Operator); 2] = [("-", Operator::Minus), ("/", Operator::Over)];

impl Operator {
    /// Value for a number of the column and the number of the operand: 1 or 0 for a comparison.
    pub(super) fn value(self, column: f64, operand: f64) -> f64 {
        match self {
            Self::Minus => column - operand,
            Self::Over => column / operand,
            Self::AtMost => f64::from(column <= operand),
            Self::AtLeast => f64::from(column >= operand),
            Self::Other => f64::from(column != operand),
            Self::Equal => f64::from(column == operand),
            Self::Less => f64::from(column < operand),
            Self::Greater => f64::from(column > operand),
        }
    }
}

impl Expression {
    /// Returns `true` for a number of the column that meets a comparison with a number.
    pub(super) fn is_met(&self, column: f64) -> bool {
        matches!(self.operand, Operand::Number(number) if self.operator.value(column, number) > 0.0)
    }

    /// Parses a comparison with a number.
    fn comparison(text: &str) -> Result<Self, String> {
        let place = text.find(['<', '>', '=', '!']);
        let (column, rest) = text.split_at(place.ok_or_else(|| format!("'{text}' has no comparison"))?);
        let mut operators = COMPARISONS.into_iter();
        let found = operators.find_map(|(sign, operator)| Some((rest.strip_prefix(sign)?.trim(), operator)));
        let (number, operator) = found.ok_or_else(|| format!("'{rest}' does not begin with a comparison"))?;
        let column = column.trim().to_owned();
        if column.is_empty() {
            return Err(format!("'{text}' has no column"));
        }
        let operand = Operand::Number(finite(number).ok_or_else(|| format!("'{number}' is not a number"))?);
        Ok(Self {
            column,
            operator,
            operand,
        })
    }

    /// Parses a difference or a quotient. An operator between spaces comes first: a name may contain `-` or `/`.
    fn combination(text: &str) -> Result<Self, String> {
        let first = |spaces: &str| {
            let places = COMBINATIONS.into_iter().filter_map(|(sign, operator)| {
                let sign = format!("{spaces}{sign}{spaces}");
                Some((text.find(&sign)?, sign.len(), operator))
            });
            places.min_by_key(|(place, ..)| *place)
        };
        let found = first(" ").or_else(|| first(""));
        let (place, length, operator) = found.ok_or("it has neither - nor /")?;
        let (column, operand) = (text[..place].trim(), text[place + length..].trim());
        if column.is_empty() || operand.is_empty() {
            return Err("a name is missing".to_owned());
        }
        let span = operand.strip_prefix("start(").and_then(|rest| rest.strip_suffix(')'));
        let operand = match span {
            None => Operand::Column(operand.to_owned()),
            Some(span) => {
                let is_whole = |span: &Span| !matches!(span, Span::Samples(rows) if rows.fract() != 0.0);
                let reason = "start(…) needs a number of rows, or a number of seconds above 0 such as 2s";
                Operand::Start(span.parse().ok().filter(is_whole).ok_or(reason)?)
            }
        };
        Ok(Self {
            column: column.to_owned(),
            operator,
            operand,
        })
    }
}

/// Parses a finite number.
fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut signs = COMPARISONS.iter().chain(&COMBINATIONS);
        let sign = signs.find(|(_, operator)| *operator == self.operator);
        let (column, sign) = (&self.column, sign.map_or("", |(sign, _)| sign));
        match &self.operand {
            Operand::Number(number) => write!(f, "{column}{sign}{number}"),
            Operand::Column(other) => write!(f, "{column} {sign} {other}"),
            Operand::Start(span) => write!(f, "{column} {sign} start({span})"),
        }
    }
}

/// Column computed from others of the same file: a difference, a ratio, or either with the mean at the start of the file.
///
/// Written as `d=c1-c2`, `q=c1/c2`, `r=c1/start(2s)` for the mean of the first two seconds, or `r=c1-start(100)` for that of
/// the first 100 rows. Spaces around the operator are needed if a name contains `-` or `/`.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// Name of the new column.
    pub name: String,
    pub(super) expression: Expression,
}

/// Returns the error in the derived column `text`.
fn refused(text: &str, reason: &str) -> ImportError {
    let (text, reason) = (in_one_line(text), in_one_line(reason));
    ImportError::Samples(format!(
        "the derived column '{text}': {reason}; write for example \"d=c1-c2\" or \"r=c1/start(2s)\""
    ))
}

impl Derived {
    pub(super) fn refused(&self, reason: &str) -> ImportError {
        refused(&self.to_string(), reason)
    }

    /// Returns the columns from which it is computed.
    pub(super) fn columns(&self) -> impl Iterator<Item = &String> {
        let other = match &self.expression.operand {
            Operand::Column(other) => Some(other),
            _ => None,
        };
        std::iter::once(&self.expression.column).chain(other)
    }

    /// Returns `true` if it needs a time column.
    pub(super) fn needs_time(&self) -> bool {
        matches!(self.expression.operand, Operand::Start(Span::Seconds(_)))
    }
}

impl FromStr for Derived {
    type Err = ImportError;

    fn from_str(text: &str) -> Result<Self, ImportError> {
        let refuse = |reason: String| refused(text, &reason);
        // Names of columns contain no other white space, and signs are found between spaces.
        let spaced = text.replace(|c: char| c.is_whitespace() || is_unprintable(c), " ");
        let (name, expression) = spaced
            .split_once('=')
            .ok_or_else(|| refuse("it has no name".to_owned()))?;
        let expression = Expression::combination(expression).map_err(refuse)?;
        let name = name.trim().to_owned();
        if name.is_empty() {
            return Err(refuse("a name is missing".to_owned()));
        }
        Ok(Self { name, expression })
    }
}

impl fmt::Display for Derived {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.name, self.expression)
    }
}

/// Condition on the rows that are used: comparisons of columns with numbers, joined by `and`.
///
/// Written as `c4<145.1 and c5!=0`.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    pub(super) comparisons: Vec<Expression>,
}

impl Condition {
    pub(super) fn refused(text: &str, reason: &str) -> ImportError {
        let (text, reason) = (in_one_line(text), in_one_line(reason));
        ImportError::Columns(format!(
            "the condition '{text}' is not understood: {reason}; write for example \"c4<145.1 and c5!=0\""
        ))
    }

    /// Returns this condition with renamed columns: `name` returns the new name of a column, or `None` to keep it.
    #[must_use]
    pub fn renamed(mut self, name: impl Fn(&str) -> Option<String>) -> Self {
        for Expression { column, .. } in &mut self.comparisons {
            if let Some(name) = name(column) {
                *column = name;
            }
        }
        self
    }
}

impl FromStr for Condition {
    type Err = ImportError;

    fn from_str(text: &str) -> Result<Self, ImportError> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let parts = words.split(|word| word.eq_ignore_ascii_case("and") || *word == "&&");
        let comparisons = parts.map(|words| Expression::comparison(&words.join(" ")));
        let comparisons = comparisons.collect::<Result<_, _>>();
        let comparisons = comparisons.map_err(|reason: String| Self::refused(text, &reason))?;
        Ok(Self { comparisons })
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let comparisons: Vec<String> = self.comparisons.iter().map(ToString::to_string).collect();
        f.write_str(&comparisons.join(" and "))
    }
}

/// Marker of missing values: a text or number, in one column or in all.
///
/// Written as `-1` or, for one column, as `states.c5=-1`.
#[derive(Clone, Debug, PartialEq)]
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

impl FromStr for Missing {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let named = text.split_once('=').filter(|(column, _)| !column.trim().is_empty());
        let value = named.map_or(text, |(_, value)| value).trim();
        Ok(Self {
            column: named.map(|(column, _)| column.trim().to_owned()),
            number: finite(value),
            text: value.to_owned(),
        })
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

/// Lists of these notations in a file.
pub(super) mod texts {
    use super::*;

    pub(crate) fn serialize<T: fmt::Display, S: Serializer>(list: &[T], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(list.iter().map(ToString::to_string))
    }

    pub(crate) fn deserialize<'de, T, D>(deserializer: D) -> Result<Vec<T>, D::Error>
    where
        T: FromStr<Err: fmt::Display>,
        D: Deserializer<'de>,
    {
        let texts = Vec::<String>::deserialize(deserializer)?;
        texts
            .iter()
            .map(|text| text.parse().map_err(de::Error::custom))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_columns_are_read_and_written() {
        for (text, written) in [
            ("d=c1-c2", "d=c1 - c2"),
            (" r = c1 / start( 2.5s ) ", "r=c1 / start(2.5s)"),
            ("p=flow-rate - start(100)", "p=flow-rate - start(100)"),
            ("q=states.c2/states.c3", "q=states.c2 / states.c3"),
            ("r = c1\r -\t - c2", "r=c1 - - c2"),
        ] {
            let derived: Derived = text.parse().unwrap();
            assert_eq!(derived.to_string(), written);
            assert_eq!(written.parse::<Derived>().unwrap(), derived);
        }
        for (text, reason) in [
            ("c1-c2", "it has no name"),
            ("d=c1", "neither - nor /"),
            ("d=c1-", "a name is missing"),
            ("=c1-c2", "a name is missing"),
            ("d=c1-start(0)", "a number of rows"),
            ("d=c1-start(-2s)", "a number of seconds above 0"),
        ] {
            let error = text.parse::<Derived>().unwrap_err().to_string();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }

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
