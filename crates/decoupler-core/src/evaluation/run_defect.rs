use std::fmt;

use super::StartTrainer;
use crate::training::TrainingDefect;

/// Defect of a run that has ended: trainings of its leader came to nothing or diverged. Its text says what to change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunDefect {
    /// Number of networks: one, or one for each row-wire.
    pub networks: usize,
    /// Number of networks whose training has a defect.
    pub defective: usize,
    /// Index of the first of them, from 0.
    pub first: usize,
    /// Defect of the first.
    pub defect: TrainingDefect,
}

impl RunDefect {
    /// Finds the defect of one start whose trainings have all ended.
    pub(super) fn of(start: &StartTrainer) -> Option<Self> {
        start.stop_reason()?;
        let numbered = start.rows().iter().enumerate();
        let mut defects = numbered.filter_map(|(index, trainer)| Some((index, TrainingDefect::of(trainer)?)));
        let (first, defect) = defects.next()?;
        Some(Self {
            networks: start.rows().len(),
            defective: 1 + defects.count(),
            first,
            defect,
        })
    }
}

impl fmt::Display for RunDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            networks,
            defective,
            first,
            defect,
        } = self;
        if *networks > 1 {
            write!(
                f,
                "{defective} of {networks} networks, the first being number {}: ",
                first + 1
            )?;
        }
        defect.fmt(f)
    }
}
