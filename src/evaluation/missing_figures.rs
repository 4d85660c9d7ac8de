use thiserror::Error;

use super::Errors;
use crate::decoupling::Precision;

/// Reasons for which a decoder has no figures, or no residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MissingFigures {
    /// Readings or answers beyond the numbers of single precision.
    #[error(
        "no figures, since readings or answers exceed single precision (3.4e38): decode in double precision, or lower \
         the noise"
    )]
    SinglePrecision,
    /// Answers beyond all numbers.
    #[error("no figures, since its answers overflow: lower the noise")]
    Overflow,
    /// The sensor has no resistance at the answers.
    #[error("no residual, since the sensor has no resistances at some answers: they are too far off")]
    NoResistance,
}

impl MissingFigures {
    /// Tells why figures are missing, given the errors of a decoder and the residual of its answers; `None` if none is.
    pub(super) fn of(precision: Precision, errors: &Errors, residual: f64) -> Option<Self> {
        if !(errors.z_mm.is_finite() && errors.worst_mm.is_finite()) {
            return Some(Self::overflow(precision));
        }
        (!residual.is_finite()).then_some(Self::NoResistance)
    }

    /// Reason why answers in this precision are no numbers.
    pub(super) fn overflow(precision: Precision) -> Self {
        match precision {
            Precision::Single => Self::SinglePrecision,
            Precision::Double => Self::Overflow,
        }
    }
}
