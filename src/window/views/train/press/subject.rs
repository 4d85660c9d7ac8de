use std::sync::Arc;

use decoupler_core::{evaluation::SimulatedSettings, network::Networks};

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
    pub is_idle: bool,
}

impl Subject {
    pub(super) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.networks, &other.networks)
    }
}
