use std::{
    cell::Cell,
    fmt,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU64, AtomicUsize, Ordering},
        mpsc::{Sender, channel},
    },
    time::Duration,
};

use decoupler_core::{
    evaluation::{Baselines, PastNetworks, Problem, Run, RunDefect, RunError, RunSettings, StartRecord, TestErrors},
    network::Networks,
    training::{EpochRecord, Stage, StopReason, StoppingRules, TrainerState, TrainingError, TrainingSettings},
};
use decoupler_files::{
    export::NetworkFile,
    import::{Progress as Reading, Recorded, Setup},
};
use ndarray::Array2;

use super::training_loop::TrainingLoop;
use crate::window::{
    job::{Job, JobError, Wake},
    test_view::{Frame, TargetCharts, TestSet, TestViewError},
};

/// Request of the window to the worker.
#[derive(Debug)]
pub enum Request {
    /// Begin a training; one in progress is dropped.
    Train(Box<Setup>),
    /// Take up the training saved in this file and hold it; one in progress is dropped.
    Open(PathBuf),
    /// Take up the training whose starts stand so, and hold it; one in progress is dropped.
    TakeUp(Box<Setup>, Vec<TrainerState>),
    /// Go on from the current weights with this method and this many epochs more.
    Continue(TrainingSettings),
    /// Step no further until told to resume.
    Pause,
    /// Go on.
    Resume,
    /// End the training; its network stays.
    Stop,
    /// Look at this training, so long as no other has taken its place.
    Inspect(RunId, Inspection),
}

/// Message of the worker to the window.
#[derive(Debug)]
pub enum Event {
    /// A training has begun, or why it cannot.
    Began(Result<Box<Began>, TestViewError>),
    /// A saved training stands where it was saved, or why it cannot.
    Opened(Result<Box<Began>, String>),
    /// A training that was cancelled while it was prepared has not begun.
    Abandoned,
    /// The training continues with these settings, or why it cannot.
    Continued(Result<Box<RunSettings>, String>),
    /// Progress of reading a file before a training.
    Reading(Reading),
    /// Progress of the training.
    Progressed(Box<Progress>),
    /// The current training has ended: what is to be kept of it, or why nothing can be.
    Finished(Result<Box<NetworkFile>, String>),
    /// The thread has ended, and why, unless it was to end.
    Died(Option<JobError>),
}

/// Takes what it needs from a training, or is informed why that is not there.
pub struct Inspection(Box<Inspect>);

type Inspect = dyn FnOnce(Result<&TrainedRun, &str>) + Send;

/// A run of the worker, and where its samples come from if they are recorded.
pub struct TrainedRun {
    /// The run.
    pub run: Run,
    /// Origin of recorded samples; `None` for a simulated array.
    pub recorded: Option<Recorded>,
}

impl Inspection {
    /// Runs `inspect` on the worker's thread.
    pub fn new(inspect: impl FnOnce(Result<&TrainedRun, &str>) + Send + 'static) -> Self {
        Self(Box::new(inspect))
    }

    /// Looks at `run`.
    pub(super) fn inspect(self, run: Result<&TrainedRun, &str>) {
        (self.0)(run);
    }
}

impl fmt::Debug for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Inspection")
    }
}

/// Tells trainings apart, also those of a worker that died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunId(u64);

impl RunId {
    /// That of no other training.
    pub fn new() -> Self {
        static BEGUN: AtomicU64 = AtomicU64::new(0);
        Self(BEGUN.fetch_add(1, Ordering::Relaxed))
    }
}

/// Facts known when a training begins.
#[derive(Debug)]
pub struct Began {
    /// Its identity.
    pub id: RunId,
    /// Setup asked for.
    pub setup: Setup,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
    /// Weights and biases of the network.
    pub weights: usize,
    /// The test set.
    pub test: TestSet,
    /// Errors of the baselines.
    pub baselines: Baselines,
}

/// State of a training.
#[derive(Debug)]
pub struct Progress {
    /// Epochs of the leader since the last report, or all where another start has taken the lead.
    pub epochs: Vec<EpochRecord>,
    /// The methods that the leader went through.
    pub stages: Vec<Stage>,
    /// State of each start, where there are several; now and then only.
    pub starts: Option<Vec<StartRecord>>,
    /// Networks of the epochs so far.
    pub past: PastNetworks,
    /// Result so far.
    pub result: RunResult,
    /// Reason for which the training has ended, if it has.
    pub stop_reason: Option<StopReason>,
}

impl Progress {
    /// Takes the place of an older one that no one saw: its epochs, and how its starts stood, are not lost.
    pub fn replace(&mut self, older: Self) {
        let newer = std::mem::replace(&mut self.epochs, older.epochs);
        append_epochs(&mut self.epochs, newer);
        self.starts = self.starts.take().or(older.starts);
    }
}

/// Adds newer epochs to a history, in the place of those that it had of another leader.
pub fn append_epochs(history: &mut Vec<EpochRecord>, newer: Vec<EpochRecord>) {
    if let Some(first) = newer.first() {
        history.retain(|record| record.epoch < first.epoch);
    }
    history.extend(newer);
}

/// Result of the best network so far on the test set, and its cost.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Decoded values of the test set: samples × targets, in their units.
    pub answers: Arc<Array2<f64>>,
    /// Charts over all test samples of a recording.
    pub charts: Option<Arc<TargetCharts>>,
    /// Remarks on the errors of a recording, once the training is paused or has ended.
    pub remarks: Vec<String>,
    /// The snapshot that was displayed, and its surface: laid through the nodes here, so that the window need not.
    pub frame: Option<(usize, Frame)>,
    /// Their errors.
    pub errors: TestErrors,
    /// The epoch of the network.
    pub best_epoch: usize,
    /// Defect of its training, once that has ended.
    pub defect: Option<RunDefect>,
    /// Epochs run by the start that is furthest.
    pub epochs_run: usize,
    /// Number of starts that have ended.
    pub starts_ended: usize,
    /// Time of the training by the clock, all starts side by side, if it is known.
    pub wall_time: Option<Duration>,
    /// Time to decode one snapshot; measured when the training pauses or ends.
    pub frame_time: Option<Duration>,
    /// True once the training is paused or has ended.
    pub is_idle: bool,
    /// The networks.
    pub networks: Arc<Networks>,
}

/// Gives `run` more epochs, counted from the start that is furthest. With the method it has, it continues as if they had
/// been given from the beginning; another method, or one that had ended for another reason, starts from the current
/// weights.
///
/// # Errors
/// A setting out of range, or networks too wide for the method; then nothing has changed.
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

/// The epoch of the start that is furthest.
pub fn furthest_epoch(run: &Run) -> usize {
    let epochs = run.trainers().iter().map(|trainer| trainer.latest().epoch);
    epochs.max().unwrap_or(0)
}

/// The window's end of the worker.
#[derive(Debug)]
pub struct Worker {
    requests: Sender<Request>,
    job: Job<Event>,
    /// Preparations of trainings asked for, and answered.
    asked: Cell<u64>,
    answered: Cell<u64>,
    /// The last of those that are cancelled; those before are too.
    cancelled: Arc<AtomicU64>,
    /// The displayed snapshot.
    snapshot: Arc<AtomicUsize>,
}

impl Worker {
    /// Starts the thread. `wake` is called after each event.
    pub fn start(wake: Wake) -> Self {
        let (requests, incoming) = channel();
        let cancelled = Arc::<AtomicU64>::default();
        let mut job = Job::new("training", wake);
        let snapshot = Arc::<AtomicUsize>::default();
        let (in_thread, shown) = (Arc::clone(&cancelled), Arc::clone(&snapshot));
        job.start(
            move |report| TrainingLoop::new(report, &in_thread, &shown).run(&incoming),
            |ended| Event::Died(ended.err()),
        );
        Self {
            requests,
            job,
            asked: Cell::default(),
            answered: Cell::default(),
            cancelled,
            snapshot,
        }
    }

    /// A worker that is dying; `wake` is called when it has died.
    #[cfg(test)]
    pub fn dying(wake: Wake) -> Self {
        let mut dead = Self::start(wake);
        dead.requests = channel().0;
        dead.job.start(|_| panic!("a test"), |ended| Event::Died(ended.err()));
        dead
    }

    /// Asks for something. Stopping cancels a training that is being prepared, too. A worker that died is told by
    /// [`Self::next_event`].
    pub fn ask(&self, request: Request) {
        match request {
            Request::Train(_) | Request::Open(_) | Request::TakeUp(..) => self.asked.set(self.asked.get() + 1),
            Request::Stop => self.cancelled.store(self.asked.get(), Ordering::Relaxed),
            _ => {}
        }
        // The other end is gone only if the worker died.
        let _ = self.requests.send(request);
    }

    /// Lays the surfaces of later results through the nodes of this snapshot.
    pub fn watch(&self, snapshot: usize) {
        self.snapshot.store(snapshot, Ordering::Relaxed);
    }

    /// Returns true while a training is being prepared and not cancelled.
    pub fn is_preparing(&self) -> bool {
        self.asked.get() > self.answered.get().max(self.cancelled.load(Ordering::Relaxed))
    }

    /// The next event, if one has come.
    pub fn next_event(&self) -> Option<Event> {
        loop {
            let event = self.job.next_event()?;
            if let Event::Began(_) | Event::Opened(_) | Event::Abandoned = event {
                self.answered.set(self.answered.get() + 1);
            }
            let is_cancelled = self.answered.get() <= self.cancelled.load(Ordering::Relaxed);
            match event {
                Event::Abandoned => {}
                // What cannot begin is of no interest any more.
                Event::Began(Err(_)) | Event::Opened(Err(_)) if is_cancelled => {}
                event => return Some(event),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Epochs of the start with this error.
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
    fn no_epoch_is_lost_where_progress_replaces_progress() {
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
        for (sentence, mut older, newer, expected) in cases {
            append_epochs(&mut older, newer);
            assert_eq!(older, expected, "{sentence}");
        }
    }
}
