use std::{
    fmt,
    io::Write,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use clap::Args;
use decoupler_core::evaluation::Run;
pub use decoupler_files::export::exit_leaving_nothing;
use decoupler_files::{
    export::{CheckpointFile, DocumentError},
    import::Recorded,
};

use super::{failure::Failure, output::messages};

/// Exit status of a command ended by Ctrl-C: 128 plus the number of the signal, as in shells.
pub(super) const STATUS: u8 = 130;

/// Exit status after SIGTERM: 128 plus the number of the signal, as in shells.
pub(super) const TERMINATED: u8 = 143;

/// True while the running command checks [`REQUESTED`] itself.
static GRACEFUL: AtomicBool = AtomicBool::new(false);
/// True once Ctrl-C was pressed while [`GRACEFUL`] was set.
static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Installs the Ctrl-C handler: it ends the program without leaving temporary files, at once unless a [`Graceful`] part
/// is running.
pub(super) fn install() {
    // If interruptions are ignored, for example in a background job of a script, they remain ignored.
    let _ = ctrlc::try_set_handler(|| {
        // There is no one to report to if writing fails.
        if GRACEFUL.load(Ordering::SeqCst) && !REQUESTED.swap(true, Ordering::SeqCst) {
            let _ = writeln!(messages(), "stopping; press Ctrl-C again to end at once");
            return;
        }
        let _ = writeln!(messages(), "interrupted");
        exit_leaving_nothing(i32::from(STATUS));
    });
}

/// Guard: while it exists, the first Ctrl-C only requests the end; the second ends the program at once.
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

/// Reciprocal of the largest share of the time spent on saving.
const LARGEST_SHARE: u32 = 20;

#[derive(Args)]
pub(super) struct CheckpointArguments {
    /// File in which the training is saved at intervals and at its end, so that it can be resumed
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Resume the training saved in --checkpoint, with bit-identical results
    ///
    /// All settings come from the file. --epochs, --goal, --max-fail and --min-gradient change when to stop; another
    /// --method (or --set) continues from the current weights with that method. All other arguments must be as in
    /// the file.
    #[arg(long, requires = "checkpoint")]
    pub(super) resume: bool,
    /// Seconds between two checkpoints
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds, requires = "checkpoint")]
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

fn seconds(text: &str) -> Result<f64, String> {
    /// A day.
    const LONGEST: f64 = 86_400.0;
    let seconds = text.parse().ok().filter(|seconds| (0.0..=LONGEST).contains(seconds));
    seconds.ok_or_else(|| format!("give a number of seconds from 0 to {LONGEST}"))
}

/// File in which a training is saved, and time of the next save.
pub(super) struct Checkpointing {
    path: PathBuf,
    interval: Duration,
    next: Instant,
    has_warned: bool,
    /// Origin of recorded samples.
    recorded: Option<Recorded>,
}

impl CheckpointArguments {
    /// The requested checkpoints; `recorded` is the origin of recorded samples.
    pub(super) fn checkpointing(&self, recorded: Option<&Recorded>) -> Option<Checkpointing> {
        Some(Checkpointing {
            path: self.checkpoint.clone()?,
            interval: Duration::from_secs_f64(self.checkpoint_interval),
            next: Instant::now(),
            has_warned: false,
            recorded: recorded.cloned(),
        })
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

impl Checkpointing {
    /// Saves to `path` every `interval`, first after one interval; `recorded` is the origin of recorded samples.
    pub(super) fn every(interval: Duration, path: PathBuf, recorded: Option<&Recorded>) -> Self {
        Self {
            path,
            interval,
            next: Instant::now() + interval,
            has_warned: false,
            recorded: recorded.cloned(),
        }
    }

    /// Saves `run` if due. A failure is only reported, and training continues until the next attempt.
    pub(super) fn save_if_due(&mut self, run: &Run) {
        let begun = Instant::now();
        if begun < self.next {
            return;
        }
        if let Err(error) = self.save(run)
            && !self.has_warned
        {
            self.has_warned = true;
            // There is no one to report to if this fails.
            let _ = writeln!(messages(), "warning: {error}; training continues");
        }
        self.next = Instant::now() + self.interval.max(LARGEST_SHARE * begun.elapsed());
    }

    pub(super) fn save(&self, run: &Run) -> Result<(), DocumentError> {
        CheckpointFile::from_run(run, self.recorded.as_ref())?.save(&self.path)
    }
}
