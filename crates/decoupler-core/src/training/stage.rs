//! The stages of a training, each under one method.

use serde::{Deserialize, Serialize};

use super::Method;

/// The epochs of a training under one method; [`super::Trainer::continue_with`] begins the next stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// The first epoch under this method; 0 for the first stage.
    pub first_epoch: usize,
    /// The method and its settings.
    pub method: Method,
}
