use std::fmt;

/// Stopping rules of the Gauss-Newton method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonRules {
    /// Largest number of steps. A step that is rejected and shortened counts as one.
    pub steps: usize,
    /// Step length in millimetres below which the method has converged.
    pub tolerance_mm: f64,
}

impl Default for NewtonRules {
    /// Returns a limit of 50 steps and a tolerance of a tenth of a picometre, where rounding of the readings begins to
    /// show in the least visible pattern of the paper's largest array (singular value 1e-5 per mm).
    fn default() -> Self {
        Self {
            steps: 50,
            tolerance_mm: 1e-10,
        }
    }
}

/// Reason for stopping the Gauss-Newton method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewtonStop {
    /// The last step was shorter than the tolerance.
    Converged,
    /// All allowed steps were taken.
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

/// Outcome of solving a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonReport {
    /// Reason for stopping.
    pub stop: NewtonStop,
    /// Number of steps taken.
    pub steps: usize,
    /// Root mean square over readings of the relative misfit m/R − 1.
    pub residual: f64,
}
