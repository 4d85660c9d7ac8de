use thiserror::Error;

use super::DecoderReport;
use crate::decoupling::Precision;

/// Why a decoder has no figures, or no residual.
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

impl DecoderReport {
    /// Tells why figures are missing, if any are.
    pub fn missing_figures(&self) -> Option<MissingFigures> {
        if !(self.errors.z_mm.is_finite() && self.errors.worst_mm.is_finite()) {
            return Some(match self.precision {
                Precision::Single => MissingFigures::SinglePrecision,
                Precision::Double => MissingFigures::Overflow,
            });
        }
        (!self.residual.is_finite()).then_some(MissingFigures::NoResistance)
    }
}
