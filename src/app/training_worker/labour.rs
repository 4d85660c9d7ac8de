use std::{
    collections::VecDeque,
    path::Path,
    sync::{
        Arc,
        mpsc::{Receiver, TryRecvError},
    },
    time::{Duration, Instant},
};

use super::{
    Began, Event, Progress, Request, RunId, RunResult,
    continuation::{continue_run, furthest_epoch},
};
use crate::{
    app::{
        test_view::{TestView, TestViewError},
        threads::Report,
    },
    evaluation::{Baselines, Run, SimulatedSettings, network_frame_time},
    export::{CheckpointFile, NetworkFile},
    training::{GradientDescentSettings, Method, TrainingSettings},
};

/// The shortest time between two reports of a training. Each makes the window draw a frame, so this leaves time
/// between them in which the user is answered at once, also where frames are drawn without a graphics card.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// The shortest time between two looks at all starts, each of which costs a decoupling of the test set.
const STARTS_INTERVAL: Duration = Duration::from_millis(500);

/// The thread's own state.
pub(super) struct Labour {
    report: Report<Event>,
    run: Option<Run>,
    /// Which training `run` is.
    id: Option<RunId>,
    is_paused: bool,
    /// Whether the window was told what is to be kept of the run.
    is_kept: bool,
    /// Time spent in training, all starts side by side.
    elapsed: Duration,
    /// The start last reported, and how many of its epochs.
    reported: (usize, usize),
    next_report: Instant,
    next_starts: Instant,
}

impl Labour {
    pub(super) fn new(report: Report<Event>) -> Self {
        Self {
            report,
            run: None,
            id: None,
            is_paused: false,
            is_kept: false,
            elapsed: Duration::ZERO,
            reported: (0, 0),
            next_report: Instant::now(),
            next_starts: Instant::now(),
        }
    }

    /// Answers requests and trains until there is no window.
    pub(super) fn run(&mut self, requests: &Receiver<Request>) {
        let mut queue = VecDeque::new();
        loop {
            if queue.is_empty() && !self.is_training() {
                match requests.recv() {
                    Ok(request) => enqueue(&mut queue, request),
                    Err(_) => return,
                }
            }
            let is_window_closed = loop {
                match requests.try_recv() {
                    Ok(request) => enqueue(&mut queue, request),
                    Err(reason) => break reason == TryRecvError::Disconnected,
                }
            };
            match queue.pop_front() {
                Some(request) => self.answer(request),
                None if is_window_closed => return,
                None => self.train_one_epoch(),
            }
        }
    }

    fn is_training(&self) -> bool {
        let unfinished = self.run.as_ref().is_some_and(|run| run.stop_reason().is_none());
        unfinished && !self.is_paused
    }

    fn answer(&mut self, request: Request) {
        match request {
            Request::Preview(settings) => {
                let drawn = TestView::draw(&settings);
                self.report.send(Event::Previewed(settings, drawn));
            }
            Request::Baselines(settings) => {
                let baselines = baselines(&settings);
                self.report.send(Event::Compared(settings, baselines));
            }
            Request::Train(settings) => match Run::prepare(*settings).map_err(TestViewError::from).and_then(begun) {
                Ok((run, began)) => self.begin(run, began.id, false, Event::Began(Ok(began))),
                Err(error) => self.report.send(Event::Began(Err(error))),
            },
            Request::Open(path) => match opened(&path) {
                Ok((run, began)) => self.begin(run, began.id, true, Event::Opened(Ok(began))),
                Err(error) => self.report.send(Event::Opened(Err(error))),
            },
            Request::TakeUp(settings, states) => {
                let resumed = Run::resume(*settings, states).map_err(TestViewError::from);
                match resumed.and_then(begun) {
                    Ok((run, began)) => self.begin(run, began.id, true, Event::Opened(Ok(began))),
                    Err(error) => self.report.send(Event::Opened(Err(error.to_string()))),
                }
            }
            Request::Continue(training) => self.go_on(training),
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
            Request::Export(id, write, path) => {
                let result = match &self.run {
                    Some(run) if self.id == Some(id) => write(run, &path).map(|()| path),
                    Some(_) => Err(REPLACED.to_owned()),
                    // The window offers no export before a training, so there was one.
                    None => Err(LOST.to_owned()),
                };
                self.report.send(Event::Exported(result));
            }
        }
    }

    /// Puts a new run in the place of an older one, which stays, with its files, where the new one is impossible.
    fn begin(&mut self, run: Run, id: RunId, is_paused: bool, event: Event) {
        self.elapsed = run.leader().elapsed();
        // What had ended before it was saved was kept when it ended.
        self.is_kept = run.stop_reason().is_some();
        (self.run, self.id) = (Some(run), Some(id));
        self.is_paused = is_paused;
        self.reported = (0, 0);
        self.next_starts = Instant::now();
        self.report.send(event);
        self.report_progress();
    }

    fn go_on(&mut self, training: TrainingSettings) {
        let continued = match &mut self.run {
            Some(run) => continue_run(run, training)
                .map_err(|error| error.to_string())
                .and_then(|()| run.settings().simulated().ok_or_else(|| LOST.to_owned())),
            None => Err(LOST.to_owned()),
        };
        let has_failed = continued.is_err();
        self.report.send(Event::Continued(continued.map(Box::new)));
        if !has_failed {
            (self.is_paused, self.is_kept) = (false, false);
            self.report_progress();
        }
    }

    fn train_one_epoch(&mut self) {
        let Some(run) = &mut self.run else { return };
        let begun = Instant::now();
        let ended = run.step().is_some();
        self.elapsed += begun.elapsed();
        if ended || Instant::now() >= self.next_report {
            self.report_progress();
        }
    }

    fn report_progress(&mut self) {
        let Some(run) = &self.run else { return };
        let begun = Instant::now();
        let number = run.leader_number();
        let trainer = &run.trainers()[number];
        let decoupled_mm = run.decouple_test();
        // Every training of the window is simulated.
        let Some(errors) = run.errors_of(&decoupled_mm) else {
            return;
        };
        let cost = begun.elapsed();
        let has_several = run.trainers().len() > 1;
        let is_standing = self.is_paused || run.stop_reason().is_some();
        let starts = (has_several && (is_standing || begun >= self.next_starts)).then(|| run.starts());
        if starts.is_some() {
            // At most a tenth of the time.
            self.next_starts = Instant::now() + STARTS_INTERVAL.max(9 * (begun.elapsed() - cost));
        }
        let reported = match self.reported {
            (leader, epochs) if leader == number => epochs,
            _ => 0,
        };
        self.report.send(Event::Progressed(Box::new(Progress {
            epochs: trainer.history().get(reported..).unwrap_or_default().to_vec(),
            stages: trainer.stages().to_vec(),
            starts,
            result: RunResult {
                decoupled_mm: Arc::new(decoupled_mm),
                errors,
                best_epoch: trainer.best_epoch(),
                flaw: run.flaw(&errors),
                epochs_run: furthest_epoch(run),
                starts_ended: run
                    .trainers()
                    .iter()
                    .filter(|start| start.stop_reason().is_some())
                    .count(),
                elapsed: self.elapsed,
                frame_time: is_standing.then(|| network_frame_time(run)).flatten(),
                networks: is_standing.then(|| Arc::new(run.network())),
            },
            stop_reason: run.stop_reason(),
        })));
        self.reported = (number, trainer.history().len());
        // A large test set takes long to decouple; let it take at most a fifth of the time.
        self.next_report = Instant::now() + REPORT_INTERVAL.max(4 * cost);
        self.report_finished();
    }

    /// Hands over, once, what is to be kept of a run that has ended.
    fn report_finished(&mut self) {
        let Some(run) = self.run.as_ref().filter(|run| run.stop_reason().is_some()) else {
            return;
        };
        if std::mem::replace(&mut self.is_kept, true) {
            return;
        }
        let file = NetworkFile::from_run(run).map_err(|error| error.to_string());
        let sound = file.and_then(|file| file.flaw().map_or(Ok(Box::new(file)), Err));
        let finished = sound.map_err(|flaw| format!("This training is not kept in the run list: {flaw}"));
        self.report.send(Event::Finished(finished));
    }
}

/// What the window says where the training it shows is not in the worker: only a worker that died lost it.
const LOST: &str = "the network was lost when the training thread ended: train again";

/// What the window says where a file was asked for before another training began.
const REPLACED: &str = "another training has taken the place of the one this file was asked for: nothing is written; \
                        finished trainings are in the run list of the Compare view";

/// A run, and what the window is to know of it.
fn begun(run: Run) -> Result<(Run, Box<Began>), TestViewError> {
    let simulated = run.settings().simulated().zip(run.baselines().copied());
    let (settings, baselines) = simulated.ok_or(TestViewError::Measured)?;
    let test = TestView::of(&settings, run.test().clone())?;
    let began = Began {
        id: RunId::new(),
        settings,
        weights: run.leader().weights(),
        test,
        baselines,
    };
    Ok((run, Box::new(began)))
}

fn opened(path: &Path) -> Result<(Run, Box<Began>), String> {
    let file = CheckpointFile::load(path).map_err(|error| error.to_string())?;
    let resumed = file.resume().map_err(TestViewError::from).and_then(begun);
    resumed.map_err(|error| format!("'{}': {error}", path.display()))
}

/// Puts a request at the end of the queue. While a slider is dragged many pictures are asked for; only the newest
/// counts.
fn enqueue(queue: &mut VecDeque<Request>, request: Request) {
    match request {
        Request::Preview(_) => queue.retain(|older| !matches!(older, Request::Preview(_) | Request::Baselines(_))),
        Request::Baselines(_) => queue.retain(|older| !matches!(older, Request::Baselines(_))),
        _ => {}
    }
    queue.push_back(request);
}

/// What stands beside the network, without one; nothing where it would keep the next request waiting.
fn baselines(settings: &SimulatedSettings) -> Option<Baselines> {
    /// About a tenth of a second.
    const MOST_TERMS: usize = 50_000_000;
    let scale = settings.source.sensor.scale;
    let samples = settings.source.samples + settings.source.validation_samples + settings.source.test_samples;
    let resistances = scale.nodes_per_row() * scale.nodes_per_column() * scale.columns();
    let linear_map = scale.columns() * (scale.columns() + scale.coordinates_per_row());
    if samples.saturating_mul(resistances + linear_map) > MOST_TERMS {
        return None;
    }
    // They depend on neither the network nor its method, so the cheapest ones do.
    let training = TrainingSettings {
        method: Method::GradientDescent(GradientDescentSettings::default()),
        ..TrainingSettings::default()
    };
    let cheapest = SimulatedSettings {
        hidden: 1,
        starts: 1,
        training,
        ..*settings
    };
    Run::prepare(cheapest).ok()?.baselines().copied()
}
