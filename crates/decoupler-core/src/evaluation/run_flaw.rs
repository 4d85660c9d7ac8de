use std::fmt;

use super::StartTrainer;
use crate::training::TrainingFlaw;

/// Defect of a run that has ended: trainings of its leader came to nothing or diverged. Its text says what to change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunFlaw {
    /// Number of networks: one, or one for each row-wire.
    pub networks: usize,
    /// Number of networks whose training has a defect.
    pub flawed: usize,
    /// Index of the first of them, from 0.
    pub first: usize,
    /// Defect of the first.
    pub flaw: TrainingFlaw,
}

impl RunFlaw {
    /// Finds the defect of one start whose trainings have all ended.
    pub(super) fn of(start: &StartTrainer) -> Option<Self> {
        start.stop_reason()?;
        let numbered = start.rows().iter().enumerate();
        let mut flaws = numbered.filter_map(|(index, trainer)| Some((index, TrainingFlaw::of(trainer)?)));
        let (first, flaw) = flaws.next()?;
        Some(Self {
            networks: start.rows().len(),
            flawed: 1 + flaws.count(),
            first,
            flaw,
        })
    }
}

impl fmt::Display for RunFlaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            networks,
            flawed,
            first,
            flaw,
        } = self;
        if *networks > 1 {
            write!(
                f,
                "{flawed} of {networks} networks, the first being number {}: ",
                first + 1
            )?;
        }
        flaw.fmt(f)
    }
}
