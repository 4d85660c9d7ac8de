//! Eq. (2) of a row-wire, and the estimator that solves it.

mod bounded;
mod estimator;
mod lanes;
mod priors;
mod reading_noise;
mod row_problem;
mod side_by_side;
mod symmetry;
#[cfg(test)]
mod tests;
mod triangle;
mod upper;

pub use estimator::Estimator;
pub(crate) use priors::GaussianPrior;
pub(crate) use row_problem::{Range, RowProblem};

/// Result of estimating the deformation of a row-wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// `true` if the last step was shorter than the tolerance; otherwise all allowed steps were taken, or none raises the
    /// probability.
    pub has_converged: bool,
    /// Number of steps, over all starts.
    pub steps: usize,
    /// Root mean square over readings of the relative misfit m/(γR) − 1, with the gain γ of [`Self::drift`].
    pub residual: f64,
    /// Gain error of the snapshot, in standard deviations of the scene's drift; 0 without drift.
    pub drift: f64,
    /// Largest standard deviation of an unknown in the linearised posterior, relative to its range. For exact readings
    /// that determine the answer, the largest error caused by misfit and rounding, to first order.
    pub spread: f64,
    /// Status of the answer.
    pub solution: Solution,
    /// −2 ln p(readings | row), up to a constant that all row-wires share, by Laplace's approximation (MacKay 2003,
    /// section 28.1); NaN if the prior was not needed.
    pub surprise: f64,
}

impl Estimate {
    /// True if exact readings leave open which of the answers that explain them is the true one.
    pub(in crate::decoupling) fn is_open(&self) -> bool {
        self.solution == Solution::Undetermined && self.spread > LARGEST_ERROR
    }
}

/// Status of an answer to the equations of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solution {
    /// The answer explains the readings. Without noise, no other one does: its error is at most [`LARGEST_ERROR`] of the
    /// range.
    Unique,
    /// The answer does not explain the readings: it is a local minimum of the misfit, not a solution.
    None,
    /// The answer explains exact readings, but others do as well: the readings do not determine it.
    Undetermined,
}

impl Solution {
    fn of(is_explained: bool, is_only: impl FnOnce() -> bool) -> Self {
        match is_explained {
            false => Self::None,
            true if is_only() => Self::Unique,
            true => Self::Undetermined,
        }
    }
}

/// Maximum rounding error of a residual: of the true resistance and the modelled one (4 units in the last place each),
/// of the reading and of the residual itself.
const ROUNDING: f64 = 10.0 * f64::EPSILON;
/// Largest error of an unknown, relative to its range, of an answer that counts as the solution.
pub const LARGEST_ERROR: f64 = 1e-6;

/// Misfits of exact readings compared with their rounding.
#[derive(Clone, Copy, Default)]
struct Misfits {
    squares: f64,
    rounding_squares: f64,
    exceed_rounding: bool,
}

impl Misfits {
    /// Adds a residual whose unknowns, relative to their ranges, have these derivatives.
    fn add(&mut self, residual: f64, slopes: impl Iterator<Item = f64>) {
        // Unknowns are rounded too, which matters where a node nearly touches an electrode.
        let rounding = ROUNDING + f64::EPSILON * slopes.map(f64::abs).sum::<f64>();
        self.squares += residual * residual;
        self.rounding_squares += rounding * rounding;
        // Written so that NaN exceeds it.
        let is_within = residual.abs() <= rounding;
        self.exceed_rounding |= !is_within;
    }

    /// Norm of the errors of the readings that explain the misfits, at least their rounding. To first order, they cause
    /// errors of the unknowns of up to this times the largest norm of a row of J⁺.
    fn norm(self) -> f64 {
        f64::max(self.squares, self.rounding_squares).sqrt()
    }

    /// True if the answer explains the readings: by rounding, or nearly enough for an error of at most
    /// [`LARGEST_ERROR`].
    fn are_explained(self, largest_error: f64) -> bool {
        !self.exceed_rounding || largest_error <= LARGEST_ERROR
    }

    /// Root mean square of `count` residuals.
    fn residual(self, count: usize) -> f64 {
        (self.squares / count as f64).sqrt()
    }
}
