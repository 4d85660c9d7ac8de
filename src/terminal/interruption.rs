use std::{
    io::{Write, stderr},
    sync::atomic::{AtomicBool, Ordering},
};

pub use decoupler_files::export::exit_leaving_nothing;

/// Exit status of a command ended by Ctrl-C: 128 plus the number of the signal, as in shells.
pub(super) const STATUS: u8 = 130;

/// True while the running command checks [`REQUESTED`] itself.
static GRACEFUL: AtomicBool = AtomicBool::new(false);
/// True once Ctrl-C was pressed while [`GRACEFUL`] was set.
static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Installs the Ctrl-C handler: it ends the program without leaving temporary files, at once unless a [`Graceful`] part
/// is running.
pub(super) fn install() {
    // Where interruptions are ignored, as by a script that runs us in the background, they stay so.
    let _ = ctrlc::try_set_handler(|| {
        // There is no one to report to if writing fails.
        if GRACEFUL.load(Ordering::SeqCst) && !REQUESTED.swap(true, Ordering::SeqCst) {
            let _ = writeln!(stderr(), "stopping; press Ctrl-C again to end at once");
            return;
        }
        let _ = writeln!(stderr(), "interrupted");
        exit_leaving_nothing(i32::from(STATUS));
    });
}

/// Guard: while it lives, the first Ctrl-C only requests an end; the second one ends the program at once.
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
