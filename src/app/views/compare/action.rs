use crate::app::shared::RightCard;

/// What the user meant in the Compare view.
#[derive(Clone, Debug)]
pub enum RunsAction {
    /// Call the run with this number so.
    Rename(u64, String),
    /// Show this run in one of the two places, or nothing.
    Pin(usize, Option<u64>),
    /// Ask whether this run is really to be removed, or ask no more.
    AskToRemove(Option<u64>),
    /// Remove this run.
    Remove(u64),
    /// Take the settings of this run for the next training.
    TakeSettings(u64),
    /// Show this snapshot of both test sets.
    ShowSnapshot(usize),
    /// Show this of both networks.
    ShowCard(RightCard),
}

impl From<RunsAction> for crate::app::Action {
    fn from(action: RunsAction) -> Self {
        Self::Runs(action)
    }
}
