use std::fmt;

use super::{Errors, StartTrainer};
use crate::training::{Method, StopReason, TrainingFlaw};

/// Defect of a run that has ended, for which its networks are worth little. Its text says what to change.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RunFlaw {
    /// Trainings of the leader came to nothing or diverged.
    Training {
        /// Number of networks: one, or one for each row-wire.
        networks: usize,
        /// Number of networks whose training has a defect.
        flawed: usize,
        /// Index of the first of them, from 0.
        first: usize,
        /// Defect of the first.
        flaw: TrainingFlaw,
    },
    /// Always answering the mean of the training set would be better.
    WorseThanMean {
        /// Reason why the training ended.
        reason: StopReason,
        /// Its method.
        method: Method,
    },
}

impl RunFlaw {
    /// Finds the defect of one restart whose trainings have all ended, given the errors of its networks and of the
    /// training mean.
    pub(super) fn of(start: &StartTrainer, network: &Errors, mean: &Errors) -> Option<Self> {
        let reason = start.stop_reason()?;
        let numbered = start.rows().iter().enumerate();
        let mut flaws = numbered.filter_map(|(index, trainer)| Some((index, TrainingFlaw::of(trainer)?)));
        if let Some((first, flaw)) = flaws.next() {
            return Some(Self::Training {
                networks: start.rows().len(),
                flawed: 1 + flaws.count(),
                first,
                flaw,
            });
        }
        let method = start.rows()[0].settings().method;
        let is_worse = network.z_mm > mean.z_mm || network.z_mm.is_nan();
        is_worse.then_some(Self::WorseThanMean { reason, method })
    }
}

impl fmt::Display for RunFlaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Training {
                networks,
                flawed,
                first,
                flaw,
            } => {
                if *networks > 1 {
                    write!(
                        f,
                        "{flawed} of {networks} networks, the first being number {}: ",
                        first + 1
                    )?;
                }
                flaw.fmt(f)
            }
            Self::WorseThanMean { reason, method } => write!(
                f,
                "always answering the mean of the training set would be better than this network: {}",
                reason.remedy(method)
            ),
        }
    }
}
