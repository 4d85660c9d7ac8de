//! The reasons why a training ends, and defects of a training that has ended.

use serde::{Deserialize, Serialize};

use super::{EpochRecord, Method, Trainer};
use crate::text::counted;

/// Relative decrease of the selection error (validation error, or training error if nothing is held out) from the start at
/// which the network counts as trained.
const MIN_GAIN: f64 = 0.01;

impl Trainer {
    /// Describes the defect of a training that has ended, with its remedy: it diverged, or its best network is hardly better
    /// than the random start. `None` if it has no defect or has not ended.
    pub fn defect(&self) -> Option<String> {
        let (reason, method) = (self.stop_reason()?, self.settings().method);
        let start = self.history().first()?;
        let start_mse = start.validation_mse.unwrap_or(start.training_mse);
        let enough = (1.0 - MIN_GAIN) * start_mse;
        // False if the start has no error, which nothing can improve; true if its error is NaN.
        let is_at_start = start_mse != 0.0 && (self.best_mse() >= enough || enough.is_nan());
        let diverged_in = diverged_in(self.history(), reason);
        let (epochs, best_epoch) = (counted(self.latest().epoch, "epoch"), self.best_epoch());
        let problem = match (diverged_in, is_at_start) {
            (Some(epoch), true) => {
                format!("training diverged in epoch {epoch}, and the network is no better than its random start")
            }
            (Some(epoch), false) => {
                format!(
                    "training diverged in epoch {epoch}; the network is the best before that, of epoch {best_epoch}"
                )
            }
            (None, true) => format!("the network is no better than its random start after {epochs} ({reason})"),
            (None, false) => return None,
        };
        let remedy = match reason {
            StopReason::GoalReached => "set a lower goal".to_owned(),
            StopReason::GradientSmall if diverged_in.is_none() => {
                format!("set a lower smallest gradient; or {}", method.remedy())
            }
            StopReason::Stopped if diverged_in.is_none() => "let it run longer".to_owned(),
            _ => method.remedy(),
        };
        Some(format!("{problem}: {remedy}"))
    }
}

/// Returns the first epoch from which on the training error is above its initial value; an epoch whose error was NaN is
/// not in the history.
fn diverged_in(history: &[EpochRecord], reason: StopReason) -> Option<usize> {
    let start_mse = history.first()?.training_mse;
    let is_below = |record: &EpochRecord| record.training_mse <= start_mse;
    let after = history.iter().rposition(is_below).map_or(0, |last| last + 1);
    (after < history.len() || reason == StopReason::Diverged).then_some(after)
}

/// Reason why a training ended: a result, not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, strum::Display)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The maximum number of epochs was run.
    #[strum(to_string = "all epochs done")]
    EpochsReached,
    /// The training error reached the goal.
    #[strum(to_string = "goal reached")]
    GoalReached,
    /// The length of the gradient reached its lower limit.
    #[strum(to_string = "gradient below its limit: no further progress possible")]
    GradientSmall,
    /// No step with a damping mu up to its limit lowers the error.
    #[strum(to_string = "mu above its limit: no step lowers the error")]
    MuLarge,
    /// The scale lambda of the scaled conjugate gradient overflowed: no step along its direction lowers the error.
    #[strum(to_string = "lambda above its limit: no step lowers the error")]
    LambdaLarge,
    /// The validation error did not reach a new best for [`StoppingRules::max_fail`](super::StoppingRules::max_fail) epochs.
    #[strum(to_string = "validation error no longer falls")]
    ValidationRose,
    /// The error or its gradient was no longer finite, or the training error was above its initial value when the
    /// validation failures reached their limit. The best weights before that are kept.
    #[strum(to_string = "diverged: the error grew above that of the start")]
    Diverged,
    /// The user stopped the training.
    #[strum(to_string = "stopped by you")]
    Stopped,
}

impl StopReason {
    /// Returns `true` if the training did not diverge.
    pub fn was_successful(self) -> bool {
        self != Self::Diverged
    }

    /// Returns advice for a training of this method that ended for this reason with a network that is not good enough.
    pub fn remedy(self, method: &Method) -> String {
        match self {
            Self::Diverged => method.remedy(),
            Self::EpochsReached | Self::Stopped => "train for more epochs, or with more hidden nodes".to_owned(),
            Self::ValidationRose => {
                "draw more training samples, or try another seed or another number of hidden nodes".to_owned()
            }
            Self::GoalReached => "set a lower goal".to_owned(),
            Self::GradientSmall | Self::MuLarge | Self::LambdaLarge => {
                "the training is stuck: try another seed, or more hidden nodes".to_owned()
            }
        }
    }

    /// Returns `true` if other stopping rules could have let the training continue, and `false` if the user stopped it
    /// or the method found no further step.
    pub(super) fn depends_on_rules(self) -> bool {
        !matches!(self, Self::Stopped | Self::Diverged | Self::MuLarge | Self::LambdaLarge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stop_reasons_have_fixed_names_in_files() {
        let table = [
            ("epochs_reached", StopReason::EpochsReached),
            ("goal_reached", StopReason::GoalReached),
            ("gradient_small", StopReason::GradientSmall),
            ("mu_large", StopReason::MuLarge),
            ("lambda_large", StopReason::LambdaLarge),
            ("validation_rose", StopReason::ValidationRose),
            ("diverged", StopReason::Diverged),
            ("stopped", StopReason::Stopped),
        ];
        for (name, reason) in table {
            let text = format!("\"{name}\"");
            assert_eq!(serde_json::from_str::<StopReason>(&text).unwrap(), reason);
            assert_eq!(serde_json::to_string(&reason).unwrap(), text);
        }
    }
}
