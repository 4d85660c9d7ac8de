use std::fmt;

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
