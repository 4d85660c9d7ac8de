use crate::decoupling::newton_report::{NewtonReport, Solution};

/// Result of a row's posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorReport {
    /// Linearisations.
    pub steps: usize,
    /// rms over readings of the relative misfit m/R − 1 at the answer.
    pub residual: f64,
    /// rms over unknowns of the posterior standard deviation; `None` if the equations decided alone, without noise.
    pub spread_mm: Option<f64>,
    /// True if no unknown has a posterior standard deviation above
    /// [`LARGEST_ERROR`](crate::decoupling::LARGEST_ERROR) of its range.
    pub determined: bool,
    /// True if the answer can be relied on: expectation propagation converged in a last linearisation that was as good as
    /// the readings, or the equations decided alone.
    pub converged: bool,
}

impl PosteriorReport {
    /// Report of equations that decided alone.
    pub(super) fn of_equations(report: NewtonReport) -> Self {
        Self {
            steps: report.steps,
            residual: report.residual,
            spread_mm: None,
            determined: report.solution != Solution::Undetermined,
            converged: report.solution != Solution::None,
        }
    }
}
