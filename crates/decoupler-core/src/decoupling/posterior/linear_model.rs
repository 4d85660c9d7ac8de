use super::factor::Factor;
use crate::decoupling::row_problem::Range;

/// A linear model whose unknowns, and some of whose readings, are known to lie in ranges:
/// `p(x) ∝ exp(−½ ‖A x − b‖² + cᵀ x)` for x within its ranges, times `P(fₖ·x + εₖ in range k)` for each rounded reading, with
/// standard normal ε.
///
/// Its moments have no closed form in several dimensions. They are found by expectation propagation (Minka 2001;
/// Cunningham, Hennig and Lacoste-Julien 2011 for ranges): each range is replaced by a Gaussian factor such that its
/// marginal keeps mean and variance. Tests compare with sampling.
#[derive(Clone, Debug, Default)]
pub(super) struct LinearModel {
    /// `[A, b]`, row by row.
    pub(super) equations: Vec<f64>,
    /// c, one for each unknown.
    pub(super) linear: Vec<f64>,
    /// Ranges of the unknowns, possibly open to one side or both.
    pub(super) ranges: Vec<Range>,
    /// The rounded readings.
    pub(super) rounded: Vec<RoundedReading>,
    /// Factors with which those of the unknowns begin; empty if they begin with the moments of their ranges.
    pub(super) first_factors: Vec<Factor>,
    /// Change of a mean, relative to the range, below which the factors have converged.
    pub(super) tolerance: f64,
}

/// A reading of which only the interval is known.
#[derive(Clone, Debug)]
pub(super) struct RoundedReading {
    /// f, one coefficient for each unknown.
    pub(super) form: Vec<f64>,
    /// Middle of the interval less the reading expected at x = 0, in standard deviations of ε.
    pub(super) misfit: f64,
    /// The interval, in standard deviations of ε.
    pub(super) range: Range,
}
