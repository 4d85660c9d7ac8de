use std::path::PathBuf;

use super::{TradeFile, TradeForm, TradeLimits};

/// What the user meant in the Trade-off view.
#[derive(Clone, Debug)]
pub enum TradeAction {
    /// Change what is measured.
    Edit(Box<TradeForm>),
    /// Measure it in the scene of the Train view.
    Measure,
    /// End the measurement; what is measured stays.
    Cancel,
    /// Show this level of noise.
    ShowLevel(usize),
    /// Mark this point of the level on show, or none.
    Mark(Option<usize>),
    /// Take this point of the level on show over into the Train view.
    Load(usize),
    /// Change the limits of the two questions.
    SetLimits(TradeLimits),
    /// Write a file about the points.
    Save(TradeFile, PathBuf),
}

impl From<TradeAction> for crate::app::Action {
    fn from(action: TradeAction) -> Self {
        Self::Trade(action)
    }
}
