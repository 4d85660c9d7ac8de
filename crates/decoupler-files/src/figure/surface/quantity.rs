use std::{borrow::Cow, sync::Arc};

/// Quantity that a surface shows, and with it its colours.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Heights.
    Height,
    /// Errors, diverging about zero.
    Error,
    /// A deformation pattern without a scale of its own, diverging about zero.
    Pattern,
    /// Change of the readings with each node.
    Sensitivity,
    /// Values of measured targets in their unit, if that is known.
    Target(Option<Arc<str>>),
    /// Errors of measured targets in their unit, diverging about zero.
    TargetError(Option<Arc<str>>),
}

impl Quantity {
    /// Name of the value axis, with its unit.
    pub fn axis_name(&self) -> Cow<'static, str> {
        let with_unit = |name: &'static str, unit: &Option<Arc<str>>| match unit {
            Some(unit) => format!("{name} ({unit})").into(),
            None => name.into(),
        };
        match self {
            Self::Height => "z (mm)".into(),
            Self::Error => "error (mm)".into(),
            Self::Pattern => "pattern".into(),
            Self::Sensitivity => "1/mm".into(),
            Self::Target(unit) => with_unit("value", unit),
            Self::TargetError(unit) => with_unit("error", unit),
        }
    }

    /// The range from `low` to `high` in words, with the unit; `height` writes heights and errors in millimetres, `number`
    /// all others.
    pub fn range_text(
        &self,
        (low, high): (f64, f64),
        height: impl Fn(f64) -> String,
        number: impl Fn(f64) -> String,
    ) -> String {
        let with_unit = |name: &str, unit: &Option<Arc<str>>| {
            let unit = unit.as_ref().map_or_else(String::new, |unit| format!(" {unit}"));
            format!("{name} {} to {}{unit}", number(low), number(high))
        };
        match self {
            Self::Height => format!("z {} to {} mm", height(low), height(high)),
            Self::Error => format!("error {} to {} mm", height(low), height(high)),
            Self::Pattern => format!("pattern {} to {}", number(low), number(high)),
            Self::Sensitivity => format!("sensitivity {} to {} per mm", number(low), number(high)),
            Self::Target(unit) => with_unit("value", unit),
            Self::TargetError(unit) => with_unit("error", unit),
        }
    }

    /// Returns `true` if the colours diverge from zero.
    pub fn is_diverging(&self) -> bool {
        matches!(self, Self::Error | Self::Pattern | Self::TargetError(_))
    }
}
