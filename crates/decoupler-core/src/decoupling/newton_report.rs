use std::fmt;

/// Stopping rules of the Gauss-Newton method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonRules {
    /// Largest number of steps from one start. A step that is rejected and shortened counts as one.
    pub steps: usize,
    /// Step length, in proportion to the range of the unknown, below which the method has converged. Plain steps also end
    /// where another could only lower residuals within their rounding.
    pub tolerance: f64,
    /// Largest number of starts; another is tried where one does not lead to a solution.
    pub starts: usize,
}

impl Default for NewtonRules {
    /// Returns limits of 50 steps and 16 starts, and a tolerance of a tenth of a picometre for a stroke of a millimetre,
    /// where rounding of the readings begins to show in the least visible pattern of the paper's largest array (singular
    /// value 1e-5 per mm).
    fn default() -> Self {
        Self {
            steps: 50,
            tolerance: 1e-10,
            starts: 16,
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

/// Standing of an answer to the equations of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solution {
    /// The readings are explained, and leave no other answer within [`LARGEST_ERROR`] of the range.
    Unique,
    /// The readings are not explained: the answer is a minimum of the misfit, but no solution.
    None,
    /// The readings are explained to rounding, and so would others be: they do not determine the answer.
    Undetermined,
}

impl Solution {
    /// Judges an answer by the largest error that what is left of its misfit can hide; `is_explained` reports that rounding
    /// explains the misfit, and `is_only` that no other answer would be as good.
    pub(super) fn of(largest_error: f64, is_explained: bool, is_only: impl FnOnce() -> bool) -> Self {
        if largest_error <= LARGEST_ERROR {
            if is_only() { Self::Unique } else { Self::Undetermined }
        } else if is_explained {
            Self::Undetermined
        } else {
            Self::None
        }
    }
}

/// Largest rounding of a residual: of the resistance that was read and of the one that the model computes (4 units in the
/// last place each), of the reading and of the residual itself.
pub(super) const ROUNDING: f64 = 10.0 * f64::EPSILON;
/// Largest error of an unknown, in proportion to its range, of an answer that counts as the solution.
pub const LARGEST_ERROR: f64 = 1e-6;

/// Outcome of solving a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonReport {
    /// Reason for stopping.
    pub stop: NewtonStop,
    /// Number of steps taken, from all starts.
    pub steps: usize,
    /// Root mean square over readings of the relative misfit m/R − 1.
    pub residual: f64,
    /// Standing of the answer.
    pub solution: Solution,
    /// Largest error of an unknown, in proportion to its range, that the misfit and rounding make to first order.
    pub largest_error: f64,
}
