//! Error and gradient at the current weights.

use super::StopReason;

/// Error and gradient at the weights that a method has just reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Mean squared error over samples and outputs, in scaled units.
    pub mse: f64,
    /// Euclidean norm of the gradient of the objective: of [`Self::mse`], plus the penalty on the weights where the method
    /// regularises.
    pub gradient_norm: f64,
}

impl Evaluation {
    /// Returns the evaluation if it consists of finite numbers.
    ///
    /// # Errors
    /// [`StopReason::Diverged`] if it does not.
    pub(super) fn if_finite(self) -> Result<Self, StopReason> {
        if self.mse.is_finite() && self.gradient_norm.is_finite() {
            Ok(self)
        } else {
            Err(StopReason::Diverged)
        }
    }
}
