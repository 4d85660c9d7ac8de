use std::{
    io::{Write, stderr},
    sync::atomic::{AtomicBool, Ordering},
};

use crate::export::exit_leaving_nothing;

/// The exit status of a command that Ctrl-C has ended: 128 and the number of the signal, as shells have it.
pub(super) const STATUS: u8 = 130;

/// Whether the command at work looks at [`REQUESTED`] by itself.
static GRACEFUL: AtomicBool = AtomicBool::new(false);
/// Whether Ctrl-C was pressed while it did.
static REQUESTED: AtomicBool = AtomicBool::new(false);

/// From here on Ctrl-C ends the program without leaving files in the making, at once unless a [`Graceful`] part is at
/// work.
pub(super) fn install() {
    // Where interruptions are ignored, as by a script that runs us in the background, they stay so.
    let _ = ctrlc::try_set_handler(|| {
        // Nobody is left to tell if writing fails.
        if GRACEFUL.load(Ordering::SeqCst) && !REQUESTED.swap(true, Ordering::SeqCst) {
            let _ = writeln!(stderr(), "stopping after this epoch; Ctrl-C again ends at once");
            return;
        }
        let _ = writeln!(stderr(), "interrupted");
        exit_leaving_nothing(i32::from(STATUS));
    });
}

/// While it lives, the first Ctrl-C only requests an end; the second one ends at once.
pub(super) struct Graceful(());

impl Graceful {
    pub(super) fn begin() -> Self {
        GRACEFUL.store(true, Ordering::SeqCst);
        Self(())
    }

    pub(super) fn is_end_requested(&self) -> bool {
        REQUESTED.load(Ordering::SeqCst)
    }
}

impl Drop for Graceful {
    fn drop(&mut self) {
        GRACEFUL.store(false, Ordering::SeqCst);
    }
}
