use std::sync::Arc;

use super::ready::ReadyNetwork;
use crate::{
    app::shared::{RunResult, Shared},
    evaluation::SimulatedSettings,
    network::Networks,
};

/// The network that answers the finger.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The network, or one for each row.
    pub networks: Arc<Networks>,
    /// Settings that it was trained with.
    pub settings: SimulatedSettings,
    /// True for the small one that was not asked for.
    pub is_ready_made: bool,
    /// True once it changes no more.
    pub is_standing: bool,
}

impl Subject {
    /// The network on show, whose result is `result`; before there is one, the ready-made one.
    pub(super) fn of(shared: &Shared, result: Option<&RunResult>, ready: &ReadyNetwork) -> Option<Self> {
        match shared.shown_run().zip(result) {
            Some((run, result)) => Some(Self {
                networks: Arc::clone(&result.networks),
                settings: run.settings,
                is_ready_made: false,
                is_standing: result.is_standing,
            }),
            None => ready.subject(shared),
        }
    }

    pub(super) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.networks, &other.networks)
    }
}
