use thiserror::Error;

use super::TestErrors;
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
    /// Returns the reason for which figures are missing, given the errors of a decoder and the residual of its answers, if
    /// there is a model of the sensor; `None` if none is.
    pub(super) fn of(precision: Precision, errors: &TestErrors, residual: Option<f64>) -> Option<Self> {
        let is_complete = match errors {
            TestErrors::Nodes(errors) => errors.z_mm.is_finite() && errors.worst_mm.is_finite(),
            TestErrors::Targets(targets) => targets.iter().all(|target| target.mae.is_finite()),
        };
        match precision {
            _ if is_complete => residual
                .is_some_and(|residual| !residual.is_finite())
                .then_some(Self::NoResistance),
            Precision::Single => Some(Self::SinglePrecision),
            Precision::Double => Some(Self::Overflow),
        }
    }
}
