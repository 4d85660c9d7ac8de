use std::{
    fmt,
    io::Write,
    path::PathBuf,
    sync::atomic::{AtomicBool, AtomicU8, Ordering},
    time::Duration,
};

use clap::Args;
use decoupler_core::evaluation::Run;
pub use decoupler_files::export::exit_leaving_nothing;
use decoupler_files::{export::Checkpointing, import::Recorded};

use super::{
    failure::Failure,
    output::{messages, warn},
    settings_arguments::RARELY,
    within,
};
use crate::signals::on_termination;

/// Exit status of a command ended by Ctrl-C: 128 plus the number of the signal, as in shells.
const CTRL_C: u8 = 130;

/// True while the running command checks [`REQUESTED`] itself.
static GRACEFUL: AtomicBool = AtomicBool::new(false);
/// Exit status for the first signal that came while [`GRACEFUL`] was set; 0 before.
static REQUESTED: AtomicU8 = AtomicU8::new(0);

/// Handles Ctrl-C, SIGTERM and SIGHUP: they end the program without leaving temporary files, at once unless a [`Graceful`]
/// part is running.
pub(super) fn install() {
    // If interruptions are ignored, for example in a background job of a script, they remain ignored.
    let _ = ctrlc::try_set_handler(|| {
        // There is no one to report to if writing fails.
        if GRACEFUL.load(Ordering::SeqCst) && request(CTRL_C) {
            let _ = writeln!(messages(), "stopping; press Ctrl-C again to end at once");
            return;
        }
        let _ = writeln!(messages(), "interrupted");
        exit_leaving_nothing(i32::from(CTRL_C));
    });
    on_termination(|status| {
        // At log-out both signals are sent, or one of them twice.
        if GRACEFUL.load(Ordering::SeqCst) {
            request(status);
        } else if REQUESTED.load(Ordering::SeqCst) == 0 {
            exit_leaving_nothing(i32::from(status));
        }
    });
}

/// Requests the end with this exit status; returns false if it was requested before.
fn request(status: u8) -> bool {
    let requested = REQUESTED.compare_exchange(0, status, Ordering::SeqCst, Ordering::SeqCst);
    requested.is_ok()
}

/// Exit status of a command that was interrupted.
pub(super) fn status() -> u8 {
    match REQUESTED.load(Ordering::SeqCst) {
        0 => CTRL_C,
        status => status,
    }
}

/// Guard: while it exists, the first Ctrl-C, SIGTERM or SIGHUP only requests the end; a second Ctrl-C ends the program at
/// once.
pub(super) struct Graceful(());

impl Graceful {
    pub(super) fn begin() -> Self {
        GRACEFUL.store(true, Ordering::SeqCst);
        Self(())
    }

    pub(super) fn is_end_requested(&self) -> bool {
        REQUESTED.load(Ordering::SeqCst) != 0
    }
}

impl Drop for Graceful {
    fn drop(&mut self) {
        GRACEFUL.store(false, Ordering::SeqCst);
    }
}

#[derive(Args)]
pub(super) struct CheckpointArguments {
    /// File in which the training is saved at intervals and at its end, so that it can be resumed
    #[arg(long, value_name = "FILE", hide_short_help = true, help_heading = "Output")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Resume the training saved in --checkpoint, with bit-identical results
    ///
    /// All settings come from the file. --epochs and --set goal, max-fail and min-gradient change when to stop; another
    /// --method (or its --set) continues from the current weights with that method. All other arguments must be as in
    /// the file.
    #[arg(long, requires = "checkpoint", hide_short_help = true, help_heading = "Output")]
    pub(super) resume: bool,
    /// Seconds between two checkpoints
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = within(0.0..=86_400.0, "a number of seconds from 0 to 86400"), requires = "checkpoint", hide_short_help = true, help_heading = RARELY)]
    checkpoint_interval: f64,
}

/// Refuses an argument that differs from the checkpoint. Used for every argument that a checkpoint fixes.
pub(super) fn check_same<T: fmt::Display>(
    argument: &str,
    given: Option<T>,
    saved: impl fmt::Display,
) -> Result<(), Failure> {
    let saved = saved.to_string();
    match given.map(|given| given.to_string()).filter(|given| *given != saved) {
        Some(given) => Err(Failure::Arguments(format!(
            "--{argument} {given}: the checkpoint has {saved}; leave it out to resume, or start a new training with another \
             --checkpoint"
        ))),
        None => Ok(()),
    }
}

impl CheckpointArguments {
    /// The requested checkpoints; `recorded` is the origin of recorded samples.
    pub(super) fn checkpointing(&self, recorded: Option<&Recorded>) -> Option<Checkpointing> {
        let interval = Duration::from_secs_f64(self.checkpoint_interval);
        Some(Checkpointing::every(interval, self.checkpoint.clone()?, recorded).from_now())
    }

    /// Refuses to overwrite an existing file unless its training is resumed.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let Some(path) = &self.checkpoint else { return Ok(()) };
        if !self.resume && path.symlink_metadata().is_ok() {
            let path = path.display();
            return Err(Failure::Arguments(format!(
                "--checkpoint '{path}' exists: add --resume to resume it, or give another name"
            )));
        }
        Ok(())
    }
}

/// Saves `run` if due. A failure is only reported, and training continues until the next attempt.
pub(super) fn save_if_due(checkpointing: &mut Checkpointing, run: &Run) {
    if let Some(error) = checkpointing.save_if_due(run) {
        warn(format_args!("{error}; training continues"));
    }
}
