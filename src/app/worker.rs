//! The worker: one named thread that draws sets, trains and writes files. Requests go in, events come out, and each
//! event wakes the window.

use std::{
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, Sender, TryRecvError, channel},
    },
    thread,
    time::{Duration, Instant},
};

use ndarray::Array2;
use thread_priority::{ThreadPriority, ThreadPriorityValue};

use super::{
    export_kind::ExportKind,
    test_view::{TestView, TestViewError},
};
use crate::{
    evaluation::{Baselines, Errors, Run, RunSettings},
    training::{EpochRecord, StopReason},
};

/// The shortest time between two reports of a training. Each makes the window draw a frame, so this leaves time
/// between them in which the user is answered at once, also where frames are drawn without a graphics card.
const REPORT_INTERVAL: Duration = Duration::from_millis(66);

/// What the window asks of the worker.
#[derive(Debug)]
pub enum Request {
    /// Draw the test set of these settings, to be looked at before training. Only the newest one counts.
    Preview(Box<RunSettings>),
    /// Begin a training; one in progress is dropped.
    Train(Box<RunSettings>),
    /// Step no further until told to resume.
    Pause,
    /// Go on.
    Resume,
    /// End the training; its network stays.
    Stop,
    /// Write a file about the present training.
    Export(ExportKind, PathBuf),
}

/// What the worker tells the window.
#[derive(Debug)]
pub enum Event {
    /// The test set of these settings.
    Previewed(Box<RunSettings>, Result<TestView, TestViewError>),
    /// A training has begun, or why it cannot.
    Began(Result<Box<Began>, TestViewError>),
    /// News of the training.
    Progressed(Box<Progress>),
    /// A file was written, or why not.
    Exported(Result<PathBuf, String>),
}

/// What is known when a training begins.
#[derive(Debug)]
pub struct Began {
    /// What was asked for.
    pub settings: RunSettings,
    /// The test set.
    pub test: TestView,
    /// What stands beside the network.
    pub baselines: Baselines,
}

/// How a training stands.
#[derive(Debug)]
pub struct Progress {
    /// Epochs since the last report.
    pub epochs: Vec<EpochRecord>,
    /// What the best network so far makes of the test set: samples × 3·M2.
    pub decoupled_mm: Arc<Array2<f64>>,
    /// Its errors.
    pub errors: Errors,
    /// The epoch of the best network.
    pub best_epoch: usize,
    /// Time spent in training.
    pub elapsed: Duration,
    /// Time to decouple one snapshot.
    pub frame_time: Duration,
    /// Why the training has ended, if it has.
    pub stop_reason: Option<StopReason>,
}

/// The window's end of the worker.
#[derive(Debug)]
pub struct Worker {
    requests: Sender<Request>,
    events: Receiver<Event>,
}

/// The worker has ended without being asked to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkerDied;

impl Worker {
    /// Starts the thread. `wake` is called after each event.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(wake: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let (requests, incoming) = channel();
        let (outgoing, events) = channel();
        let report = Report {
            outgoing,
            wake: Box::new(wake),
        };
        thread::Builder::new().name("training".to_owned()).spawn(move || {
            yield_to_window();
            Labour::new(report).run(&incoming);
        })?;
        Ok(Self { requests, events })
    }

    /// Asks for something. A worker that died is told by [`Self::next_event`].
    pub fn ask(&self, request: Request) {
        // The other end is gone only if the worker died, which the next look at the events shows.
        let _ = self.requests.send(request);
    }

    /// The next event, if one has come.
    ///
    /// # Errors
    /// The worker died.
    pub fn next_event(&self) -> Result<Option<Event>, WorkerDied> {
        match self.events.try_recv() {
            Ok(event) => Ok(Some(event)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(WorkerDied),
        }
    }
}

/// Lets this thread, and those it starts, yield a little: on a busy machine the window gets about three times its
/// share, and training is not starved by other programs.
fn yield_to_window() {
    /// Of 0 to 99, where about 50 is normal.
    const BELOW_NORMAL: u8 = 37;
    if let Ok(priority) = ThreadPriorityValue::try_from(BELOW_NORMAL) {
        // Where the system refuses, training merely competes with the window.
        let _ = ThreadPriority::Crossplatform(priority).set_for_current();
    }
}

/// Where events go. Dropping it wakes the window once more, so that it sees a worker that died.
struct Report {
    outgoing: Sender<Event>,
    wake: Box<dyn Fn() + Send>,
}

impl Report {
    fn send(&self, event: Event) {
        // Without a window there is nobody to tell, and the next request ends the thread.
        let _ = self.outgoing.send(event);
        (self.wake)();
    }
}

impl Drop for Report {
    fn drop(&mut self) {
        (self.wake)();
    }
}

/// The thread's own state.
struct Labour {
    report: Report,
    run: Option<Run>,
    is_paused: bool,
    epochs_reported: usize,
    next_report: Instant,
}

impl Labour {
    fn new(report: Report) -> Self {
        Self {
            report,
            run: None,
            is_paused: false,
            epochs_reported: 0,
            next_report: Instant::now(),
        }
    }

    fn run(&mut self, requests: &Receiver<Request>) {
        loop {
            let request = if self.is_training() {
                match requests.try_recv() {
                    Ok(request) => Some(request),
                    Err(TryRecvError::Empty) => None,
                    Err(TryRecvError::Disconnected) => return,
                }
            } else {
                match requests.recv() {
                    Ok(request) => Some(request),
                    Err(_) => return,
                }
            };
            match request {
                Some(request) => self.answer(request, requests),
                None => self.train_one_epoch(),
            }
        }
    }

    fn is_training(&self) -> bool {
        let unfinished = self.run.as_ref().is_some_and(|run| run.stop_reason().is_none());
        unfinished && !self.is_paused
    }

    fn answer(&mut self, request: Request, requests: &Receiver<Request>) {
        match request {
            Request::Preview(mut settings) => {
                // While a slider is dragged many previews queue up; draw only the newest.
                let mut other = None;
                while let Ok(next) = requests.try_recv() {
                    match next {
                        Request::Preview(newer) => settings = newer,
                        next => {
                            other = Some(next);
                            break;
                        }
                    }
                }
                let drawn = TestView::draw(&settings);
                self.report.send(Event::Previewed(settings, drawn));
                if let Some(next) = other {
                    self.answer(next, requests);
                }
            }
            Request::Train(settings) => self.begin(*settings),
            Request::Pause => {
                self.is_paused = true;
                self.report_progress();
            }
            Request::Resume => self.is_paused = false,
            Request::Stop => {
                if let Some(run) = &mut self.run {
                    run.stop();
                }
                self.report_progress();
            }
            Request::Export(kind, path) => {
                let result = match &self.run {
                    Some(run) => kind.write(run, &path).map(|()| path).map_err(|error| error.to_string()),
                    None => Err("there is no training to export: train first".to_owned()),
                };
                self.report.send(Event::Exported(result));
            }
        }
    }

    fn begin(&mut self, settings: RunSettings) {
        self.run = None;
        self.is_paused = false;
        self.epochs_reported = 0;
        self.next_report = Instant::now();
        let prepared = self.prepare(settings);
        self.report.send(Event::Began(prepared));
        self.report_progress();
    }

    fn prepare(&mut self, settings: RunSettings) -> Result<Box<Began>, TestViewError> {
        let run = Run::prepare(settings)?;
        let test = TestView::of(&settings, run.test().clone())?;
        let baselines = *run.baselines();
        self.run = Some(run);
        Ok(Box::new(Began {
            settings,
            test,
            baselines,
        }))
    }

    fn train_one_epoch(&mut self) {
        let Some(run) = &mut self.run else { return };
        let ended = run.step().is_some();
        if ended || Instant::now() >= self.next_report {
            self.report_progress();
        }
    }

    fn report_progress(&mut self) {
        let Some(run) = &self.run else { return };
        let begun = Instant::now();
        let trainer = run.leader();
        let (decoupled_mm, errors) = run.decouple_test();
        let cost = begun.elapsed();
        let snapshots = u32::try_from(run.test().snapshots()).unwrap_or(u32::MAX).max(1);
        self.report.send(Event::Progressed(Box::new(Progress {
            epochs: trainer
                .history()
                .get(self.epochs_reported..)
                .unwrap_or_default()
                .to_vec(),
            decoupled_mm: Arc::new(decoupled_mm),
            errors,
            best_epoch: trainer.best_epoch(),
            elapsed: trainer.elapsed(),
            frame_time: cost / snapshots,
            stop_reason: run.stop_reason(),
        })));
        self.epochs_reported = trainer.history().len();
        // A large test set takes long to decouple; let it take at most a fifth of the time.
        self.next_report = Instant::now() + REPORT_INTERVAL.max(4 * cost);
    }
}
