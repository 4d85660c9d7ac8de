use std::path::PathBuf;

use super::{ExperimentFile, Form, SortBy, Topic};

/// What the user meant in the Experiments view.
#[derive(Clone, Debug)]
pub enum ExperimentAction {
    /// Look at this experiment.
    Choose(Topic),
    /// Change what it is made of.
    Edit(Box<Form>),
    /// Run it.
    Run,
    /// End the one that runs; what is finished stays.
    Cancel,
    /// Mark this cell in table and picture.
    Mark(usize),
    /// Order the table so.
    Sort(SortBy),
    /// Write a file about the results.
    Save(Topic, ExperimentFile, PathBuf),
}

impl From<ExperimentAction> for crate::app::Action {
    fn from(action: ExperimentAction) -> Self {
        Self::Experiments(action)
    }
}
