//! Numbers, counts and names as text.

mod format;

pub use format::{
    begins_formula, capitalised, clean_name, counted, format_below_one, format_duration, format_number, format_percent,
    format_r2, in_one_line, inert, is_unprintable, original_name, printable,
};
pub(crate) use format::{cleaned, cleaned_if_any, escaped_if_any};

use thiserror::Error;

/// An enum whose variants have names, as typed by users and written in files and tables.
pub trait Named: Copy + PartialEq + Into<&'static str> + 'static {
    /// What a variant is, with its article: "a scaling".
    const WHAT: &'static str;
    /// All variants, in the order offered to the user.
    const ALL: &'static [Self];

    /// Returns the name.
    fn name(self) -> &'static str {
        self.into()
    }

    /// Returns the variant of this name, without surrounding blanks.
    ///
    /// # Errors
    /// If there is none.
    fn parse(name: &str) -> Result<Self, UnknownName> {
        let mut all = Self::ALL.iter().copied();
        all.find(|one| one.name() == name.trim()).ok_or_else(|| UnknownName {
            name: name.to_owned(),
            what: Self::WHAT,
            known: Self::ALL.iter().map(|one| one.name()).collect(),
        })
    }
}

/// Error for a name that nothing has.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{name}' is not {what}: give {}", list(.known))]
pub struct UnknownName {
    /// The name given.
    pub name: String,
    /// What it should name, with its article.
    pub what: &'static str,
    /// The names that there are.
    pub known: Vec<&'static str>,
}

/// Returns `a`, `a or b`, or `a, b or c`.
fn list(names: &[&str]) -> String {
    match names {
        [] => "none".to_owned(),
        [name] => (*name).to_owned(),
        [names @ .., last] => format!("{} or {last}", names.join(", ")),
    }
}
