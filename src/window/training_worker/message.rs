use std::{
    cell::Cell,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Sender, channel},
    },
    time::Duration,
};

use decoupler_core::{
    evaluation::{Coverage, Intervals, Run, RunError, RunSettings, StartRecord, TestErrors},
    live::{DriftReference, LiveError},
    network::Networks,
    training::{EpochRecord, Stage, StopReason, StoppingRules, TrainerState, TrainingError, TrainingSettings},
};
use decoupler_files::{
    export::NetworkFile,
    import::{Recorded, Setup},
};
use ndarray::Array2;

use super::{
    calibration::Calibration, keeping::Keeping, past_networks::PastNetworks, run_view::RunView,
    training_loop::TrainingLoop,
};
use crate::window::{
    job::{Background, JobError, Jobs},
    test_view::TestCharts,
    timeline::Timeline,
};

/// Request from the window to the worker.
pub enum Request {
    /// Begin a training; one in progress is discarded.
    Begin(RunId, Origin),
    /// Continue from the current weights with this method and this many additional epochs.
    Continue(TrainingSettings),
    /// Pause.
    Pause,
    /// Resume.
    Resume,
    /// End the training and keep its network.
    Stop,
    /// Answer with ridge regression in place of the network of the ended training.
    UseRidge,
    /// Inspect this training, unless another one has replaced it.
    Inspect(RunId, Inspection),
    /// Keep checkpoints of running trainings in this folder from now on, saved at this interval.
    Keep(PathBuf, Duration),
    /// Remove the checkpoint that was offered.
    DiscardLeft,
    /// Save the checkpoint of the running training now, and answer.
    Save(Sender<()>),
}

/// What a training begins with.
#[derive(Debug)]
pub enum Origin {
    /// New networks with these settings.
    New(Box<Setup>),
    /// New networks with settings that are chosen for this recording.
    Chosen(Box<Setup>),
    /// These states of its starts; it is paused.
    States(Box<Setup>, Vec<TrainerState>),
    /// A checkpoint; it is paused.
    File(PathBuf),
    /// The training that was cut short and is offered.
    Left,
}

/// How a training begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// With new networks.
    New,
    /// From a checkpoint or states, paused.
    Paused,
    /// From the checkpoint of a training that was cut short.
    Resumed,
}

/// Message from the worker to the window.
#[derive(Debug)]
pub enum Event {
    /// A training has begun, or an error.
    Began(RunId, Start, Result<Box<RunView>, String>),
    /// Question about a training that was cut short, if there is one.
    Left(Option<String>),
    /// The running training cannot be kept, with the reason.
    Unkept(String),
    /// The training continues with these settings, or an error.
    Continued(Result<Box<RunSettings>, String>),
    /// Progress of reading a recording or of choosing settings before a training.
    Preparing(Preparing),
    /// Progress of the training.
    Progressed(Box<Progress>),
    /// The current training has ended: the network file to keep, or the reason why there is none.
    Finished(Result<Box<NetworkFile>, String>),
    /// The thread has ended, with the reason unless it was asked to end.
    Died(Option<JobError>),
}

/// Progress of the work before a training.
#[derive(Clone, Debug)]
pub struct Preparing {
    /// Name of the work.
    pub work: &'static str,
    /// The work in a few words.
    pub text: String,
    /// Share that is done, if known.
    pub share: Option<f32>,
}

/// Function called on the thread of the worker with a training, or with the reason why it is not available.
pub type Inspection = Box<dyn FnOnce(Result<&TrainedRun, &str>) + Send>;

/// Run of the worker, with the origin of recorded samples.
pub struct TrainedRun {
    /// Run.
    pub run: Run,
    /// Origin of recorded samples; `None` for a simulated array.
    pub recorded: Option<Recorded>,
    /// Places of the test samples of a recording on an axis of time.
    pub timeline: Option<Arc<Timeline>>,
    /// Training readings of a recording, by which a later drift is detected, or the reason why they are not monitored.
    pub drift: Result<DriftReference, LiveError>,
    /// Remarks on the samples of a recording.
    pub of_samples: Vec<String>,
    /// Calibration of its intervals when it has ended; `None` for a simulated array.
    pub calibration: Option<Calibration>,
}

/// Identity of a training, unique also across workers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunId(pub(super) u64);

impl RunId {
    /// Returns a new, unique identity.
    pub fn new() -> Self {
        static BEGUN: AtomicU64 = AtomicU64::new(1);
        Self(BEGUN.fetch_add(1, Ordering::Relaxed))
    }
}

/// State of a training.
#[derive(Debug)]
pub struct Progress {
    /// Epochs of the leading start since the last report, or all of them if another start has taken the lead.
    pub epochs: Vec<EpochRecord>,
    /// Methods of the leading start so far.
    pub stages: Vec<Stage>,
    /// State of each start, if there are several.
    pub starts: Vec<StartRecord>,
    /// Networks of the epochs so far.
    pub past: PastNetworks,
    /// Result so far.
    pub result: RunResult,
    /// True if the training has run its epochs, and its intervals are being calibrated.
    pub is_calibrating: bool,
    /// Reason why the training has ended, if it has.
    pub stop_reason: Option<StopReason>,
}

impl Progress {
    /// Merges in an older report that was not received, so that its epochs are not lost.
    pub fn replace(&mut self, older: Self) {
        let newer = std::mem::replace(&mut self.epochs, older.epochs);
        append_epochs(&mut self.epochs, newer);
    }
}

/// Appends newer epochs to a history; older records of the same epochs, which are those of another start, are removed.
pub fn append_epochs(history: &mut Vec<EpochRecord>, newer: Vec<EpochRecord>) {
    if let Some(first) = newer.first() {
        history.retain(|record| record.epoch < first.epoch);
    }
    history.extend(newer);
}

/// Result of the best network so far on the test set, with its cost.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Decoded values of the test set: samples × targets, in their units.
    pub answers: Arc<Array2<f64>>,
    /// Charts of all test samples.
    pub charts: Arc<TestCharts>,
    /// Remarks on the errors of a recording, when the training is paused or has ended.
    pub remarks: Vec<String>,
    /// Errors of the decoded values.
    pub errors: TestErrors,
    /// Errors of the network alone, if a combination is used.
    pub network_alone: Option<TestErrors>,
    /// Coverage of the intervals on the test set, if they were calibrated.
    pub coverage: Vec<Option<Coverage>>,
    /// Intervals of the decoded values, if they were calibrated.
    pub intervals: Option<Intervals>,
    /// Epoch of the network.
    pub best_epoch: usize,
    /// Problem of the training, when it has ended.
    pub defect: Option<String>,
    /// Number of epochs of the start that is furthest ahead.
    pub epochs_run: usize,
    /// Wall-clock time of the training, with all starts in parallel, if known.
    pub wall_time: Option<Duration>,
    /// Decoding time of one snapshot, measured when the training pauses or ends.
    pub frame_time: Option<Duration>,
    /// True if the training is paused or has ended.
    pub is_idle: bool,
    /// Networks.
    pub networks: Arc<Networks>,
}

/// Continues `run` for additional epochs, counted from the start that is furthest ahead. With the same method, the result is
/// the same as if all epochs had been requested from the beginning; another method, or a training that ended for another
/// reason, starts from the current weights.
///
/// # Errors
/// If a setting is out of range, or the networks are too wide for the method; the run is unchanged.
pub fn continue_run(run: &mut Run, training: TrainingSettings) -> Result<(), RunError> {
    training.check().map_err(TrainingError::from)?;
    let stopping = StoppingRules {
        epochs: (furthest_epoch(run) + training.stopping.epochs).min(StoppingRules::MAX_EPOCHS),
        ..training.stopping
    };
    let is_other = training.method != run.settings().training.method;
    if is_other {
        run.continue_with(training.method)?;
    }
    run.set_stopping(stopping).map_err(TrainingError::from)?;
    if !is_other && run.stop_reason().is_some() {
        run.continue_with(training.method)?;
    }
    Ok(())
}

/// Returns the epoch of the start that is furthest ahead.
pub fn furthest_epoch(run: &Run) -> usize {
    let epochs = run.trainers().iter().map(|trainer| trainer.latest().epoch);
    epochs.max().unwrap_or(0)
}

/// Handle of the worker, used by the window.
#[derive(Debug)]
pub struct Worker {
    // Dropped first: a thread that finds no one to send requests must know that it is cancelled.
    job: Background<Event>,
    requests: Sender<Request>,
    keeping: Keeping,
    /// The training that is being prepared.
    awaited: Cell<Option<RunId>>,
    /// Number of the training last asked for: the preparations of others are cancelled.
    newest: Arc<AtomicU64>,
}

impl Worker {
    /// Starts the thread.
    pub fn start(jobs: &Jobs) -> Self {
        let (requests, incoming) = channel();
        let mut job = Background::new("training", jobs);
        let (newest, keeping) = (Arc::<AtomicU64>::default(), Keeping::default());
        let (in_thread, keeps) = (Arc::clone(&newest), keeping.clone());
        job.start(
            move |report| TrainingLoop::new(report, &in_thread, keeps).run(&incoming),
            |ended| Event::Died(ended.err()),
        );
        Self {
            requests,
            job,
            keeping,
            awaited: Cell::default(),
            newest,
        }
    }

    /// Returns true if the thread has ended.
    pub fn has_died(&self) -> bool {
        !self.job.is_under_way()
    }

    /// Removes the checkpoint of the running training, which the user leaves unfinished, and keeps none from now on.
    pub fn forget(&self) {
        self.keeping.forget();
    }

    /// Saves the running training and waits until it is saved.
    pub fn save(&self) {
        /// An epoch may take longer; its training is then as old as the last checkpoint.
        const LONGEST_SAVE: Duration = Duration::from_secs(5);
        let (done, saved) = channel();
        self.ask(Request::Save(done));
        let _ = saved.recv_timeout(LONGEST_SAVE);
    }

    /// Begins a training. Others that are being prepared are cancelled.
    pub fn begin(&self, origin: Origin) {
        let id = RunId::new();
        self.awaited.set(Some(id));
        self.newest.store(id.0, Ordering::Relaxed);
        self.ask(Request::Begin(id, origin));
    }

    /// Sends a request. Stopping also cancels a training that is being prepared. If the worker has died,
    /// [`Self::next_event`] reports it.
    pub fn ask(&self, request: Request) {
        if matches!(request, Request::Stop) && self.awaited.take().is_some() {
            self.newest.store(RunId::new().0, Ordering::Relaxed);
        }
        // The receiver is dropped only if the worker died.
        let _ = self.requests.send(request);
    }

    /// Returns true while a training is being prepared and not cancelled.
    pub fn is_preparing(&self) -> bool {
        self.awaited.get().is_some()
    }

    /// Returns the next event, if one has arrived.
    pub fn next_event(&self) -> Option<Event> {
        loop {
            match self.job.next_event()? {
                // Errors of a cancelled preparation are ignored.
                Event::Began(id, _, Err(_)) if self.awaited.get() != Some(id) => {}
                event => {
                    if matches!(event, Event::Began(id, ..) if self.awaited.get() == Some(id)) {
                        self.awaited.set(None);
                    }
                    return Some(event);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Worker {
        /// Returns a worker whose thread panics.
        pub fn dying(jobs: &Jobs) -> Self {
            let mut dead = Self::start(jobs);
            dead.requests = channel().0;
            dead.job.start(|_| panic!("a test"), |ended| Event::Died(ended.err()));
            dead
        }
    }

    /// Returns epochs of a start with this error.
    fn epochs(start: f64, numbers: std::ops::Range<usize>) -> Vec<EpochRecord> {
        let record = |epoch| EpochRecord {
            epoch,
            training_mse: start,
            validation_mse: None,
            test_mse: None,
            gradient_norm: 0.0,
            parameter: 0.0,
            effective_parameters: None,
            validation_failures: 0,
        };
        numbers.map(record).collect()
    }

    #[test]
    fn no_epoch_is_lost_when_progress_is_replaced() {
        let [a, b] = [1.0, 2.0];
        let cases = [
            (
                "the leader continues",
                epochs(a, 0..3),
                epochs(a, 3..5),
                epochs(a, 0..5),
            ),
            ("nothing is new", epochs(a, 0..3), epochs(a, 3..3), epochs(a, 0..3)),
            ("another start leads", epochs(a, 0..3), epochs(b, 0..5), epochs(b, 0..5)),
            (
                "it has run fewer epochs",
                epochs(a, 0..5),
                epochs(b, 0..3),
                epochs(b, 0..3),
            ),
            (
                "the older starts later",
                epochs(a, 7..9),
                epochs(a, 9..12),
                epochs(a, 7..12),
            ),
        ];
        for (case, mut older, newer, expected) in cases {
            append_epochs(&mut older, newer);
            assert_eq!(older, expected, "{case}");
        }
    }
}
