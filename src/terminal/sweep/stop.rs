use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use crate::terminal::interruption::{Graceful, STATUS};

/// Exit status after SIGTERM: 128 plus the number of the signal, as in shells.
const TERMINATED: u8 = 143;

/// Requests to stop: Ctrl-C, SIGTERM (by which clusters announce that a job must end), or a failure of another thread.
pub(super) struct Stop {
    graceful: Graceful,
    terminated: Arc<AtomicBool>,
    failed: AtomicBool,
}

impl Stop {
    pub(super) fn begin() -> Self {
        let terminated = Arc::new(AtomicBool::new(false));
        #[cfg(unix)]
        {
            // Without it SIGTERM ends the program at once, which loses no more than the time since the last checkpoint.
            let _ = signal_hook::flag::register(signal_hook::consts::SIGTERM, Arc::clone(&terminated));
        }
        Self {
            graceful: Graceful::begin(),
            terminated,
            failed: AtomicBool::new(false),
        }
    }

    /// Has every thread stop because one of them cannot go on.
    pub(super) fn fail(&self) {
        self.failed.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_requested(&self) -> bool {
        self.failed.load(Ordering::Relaxed) || self.signal_status().is_some()
    }

    /// Exit status for the signal that has come, if one has.
    pub(super) fn signal_status(&self) -> Option<u8> {
        if self.terminated.load(Ordering::Relaxed) {
            return Some(TERMINATED);
        }
        self.graceful.is_end_requested().then_some(STATUS)
    }
}
