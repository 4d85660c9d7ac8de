/// Result of a row's posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorReport {
    /// Linearisations.
    pub steps: usize,
    /// Rounds of expectation propagation over all unknowns, in all linearisations.
    pub rounds: usize,
    /// rms over readings of the relative misfit m/(γR) − 1 at the answer, with the gain γ of [`Self::drift`].
    pub residual: f64,
    /// Mean of the gain error of the snapshot, in standard deviations of the scene's drift; 0 without drift.
    pub drift: f64,
    /// rms over unknowns of the posterior standard deviation.
    pub spread_mm: f64,
    /// True if no unknown has a posterior standard deviation above
    /// [`LARGEST_ERROR`](crate::decoupling::LARGEST_ERROR) of its range.
    pub determined: bool,
    /// True if the answer can be relied on: expectation propagation converged in a last linearisation that was as good as
    /// the readings.
    pub converged: bool,
}
