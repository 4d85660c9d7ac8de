/// Quantity that a surface shows, and with it its colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Heights.
    Height,
    /// Errors, diverging about zero.
    Error,
    /// A deformation pattern without a scale of its own, diverging about zero.
    Pattern,
    /// Change of the readings with each node.
    Sensitivity,
}

impl Quantity {
    /// Name of the value axis, with its unit.
    pub fn axis_name(self) -> &'static str {
        match self {
            Self::Height => "z (mm)",
            Self::Error => "error (mm)",
            Self::Pattern => "pattern",
            Self::Sensitivity => "1/mm",
        }
    }

    /// Returns `true` if the colours diverge from zero.
    pub fn is_diverging(self) -> bool {
        matches!(self, Self::Error | Self::Pattern)
    }
}
