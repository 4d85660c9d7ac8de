use super::StopReason;

/// Where a method stands: at the weights it has just reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Mean squared error over samples and outputs, in scaled units.
    pub mse: f64,
    /// Euclidean length of the gradient of what the method makes small: of [`Self::mse`], plus the weights' share where
    /// the method regularises.
    pub gradient_norm: f64,
}

impl Evaluation {
    /// The evaluation, if it consists of finite numbers.
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
