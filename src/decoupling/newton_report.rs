use std::fmt;

use thiserror::Error;

/// When to end Newton's method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonRules {
    /// Most steps. A step that was rejected and shortened counts as one.
    pub steps: usize,
    /// Length of a step, in millimetres, below which the deformation is known.
    pub tolerance_mm: f64,
}

impl Default for NewtonRules {
    /// A tenth of a picometre: where rounding of the readings begins to show in the worst-seen pattern of the paper's
    /// largest array (singular value 1e-5 per mm).
    fn default() -> Self {
        Self {
            steps: 50,
            tolerance_mm: 1e-10,
        }
    }
}

/// Why Newton's method ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewtonStop {
    /// The last step was shorter than the tolerance.
    Converged,
    /// All steps were taken.
    StepsTaken,
    /// No damping gives a step that lowers the misfit.
    NoStepHelps,
}

impl fmt::Display for NewtonStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Converged => "converged",
            Self::StepsTaken => "all steps taken",
            Self::NoStepHelps => {
                "no step lowers the misfit: readings do not come from this sensor, or leave it undetermined"
            }
        })
    }
}

/// How a row was solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonReport {
    /// Why it ended.
    pub stop: NewtonStop,
    /// Steps taken.
    pub steps: usize,
    /// rms over readings of the relative misfit m/R − 1.
    pub residual: f64,
}

/// Readings or sizes that cannot be solved.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NewtonError {
    /// A reading is not a resistance.
    #[error("reading {column} is {value} ohm: give finite numbers above 0")]
    Reading {
        /// Column-wire, from 0.
        column: usize,
        /// The reading.
        value: f64,
    },
}

impl NewtonError {
    /// Refuses readings that are not above 0 and finite.
    pub(super) fn check(readings_ohm: &[f64]) -> Result<(), Self> {
        let bad = |&(_, value): &(usize, &f64)| !(*value > 0.0 && value.is_finite());
        match readings_ohm.iter().enumerate().find(bad) {
            Some((column, &value)) => Err(Self::Reading { column, value }),
            None => Ok(()),
        }
    }
}
