use std::{
    cell::RefCell,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, TryRecvError},
    },
    time::{Duration, Instant},
};

use decoupler_core::{
    evaluation::{
        Intervals, Run, Scores, TestErrors,
        auto::{AutoFixed, DEFAULT_BUDGET_S},
        frame_us,
    },
    job::Job,
    training::TrainingSettings,
};
use decoupler_files::{
    export::{CheckpointFile, CheckpointPlace, NetworkFile, describe_samples, format_duration},
    import::{ChoosingProgress, Progress as Reading, Setup, SetupSets},
    machine::system_cause,
};
use ndarray::Array2;

use super::{
    Event, Origin, Progress, Request, RunId, RunResult, RunView, Start, TrainedRun,
    calibration::Calibration,
    keeping::{Keeping, question},
    message::{Preparing, continue_run, furthest_epoch},
    past_networks::PastNetworks,
    run_view::describe,
};
use crate::window::{
    job::Report,
    test_view::{TestView, TestViewError},
    timeline::Timeline,
};

/// Minimum time between two progress reports. Each makes the window draw a frame; the time in between keeps the window
/// responsive, even if frames are drawn without a graphics card.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// State of the thread.
pub(super) struct TrainingLoop<'a> {
    report: &'a Report<Event>,
    /// Number of the training last asked for.
    newest: &'a AtomicU64,
    keeping: Keeping,
    /// Checkpoints of trainings that were cut short; the last is offered first.
    left: Vec<CheckpointPlace>,
    current: Option<Training>,
}

/// The current training.
struct Training {
    id: RunId,
    trained: TrainedRun,
    /// Its test set, ready to be drawn.
    test: TestView,
    past: PastNetworks,
    stage: Stage,
    /// Reason why the training that has ended has no intervals.
    no_intervals: Option<String>,
    /// Start of the last report, and its number of reported epochs.
    reported: (usize, usize),
    next_report: Instant,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    Training,
    Paused,
    /// Its epochs have been run.
    Calibrating,
    /// Its result has been sent to the window.
    Done,
}

impl<'a> TrainingLoop<'a> {
    pub(super) fn new(report: &'a Report<Event>, newest: &'a AtomicU64, keeping: Keeping) -> Self {
        Self {
            report,
            newest,
            keeping,
            left: Vec::new(),
            current: None,
        }
    }

    /// Handles requests and trains until the window is closed.
    pub(super) fn run(&mut self, requests: &Receiver<Request>) {
        while !self.report.is_cancelled() {
            let stage = self.current.as_ref().map(|current| current.stage);
            let request = match stage {
                Some(Stage::Training | Stage::Calibrating) => requests.try_recv(),
                _ => self.report.waiting(|| requests.recv()).map_err(TryRecvError::from),
            };
            match request {
                Ok(request) => self.answer(request),
                Err(TryRecvError::Empty) if stage == Some(Stage::Calibrating) => self.calibrate(requests),
                Err(TryRecvError::Empty) => self.step(),
                Err(TryRecvError::Disconnected) => return,
            }
        }
    }

    fn answer(&mut self, request: Request) {
        match (request, &mut self.current) {
            (Request::Begin(id, origin), _) => self.begin(id, origin),
            (Request::Continue(training), _) => self.continue_training(training),
            (Request::Pause, Some(current)) if current.stage == Stage::Training => {
                current.stage = Stage::Paused;
                self.publish();
            }
            (Request::Resume, Some(current)) if current.stage == Stage::Paused => current.stage = Stage::Training,
            (Request::Stop, Some(current)) if matches!(current.stage, Stage::Training | Stage::Paused) => {
                current.trained.run.stop();
                // Nothing is calibrated for it.
                let calibrated = current.calibrated(&|| true);
                self.end(calibrated);
            }
            (Request::UseRidge, Some(current)) if current.stage == Stage::Done => {
                let calibrated = current.trained.use_ridge();
                self.end(Some(calibrated));
            }
            (Request::Pause | Request::Resume | Request::Stop | Request::UseRidge, _) => {}
            (Request::Inspect(id, inspection), Some(current)) if current.id == id => {
                inspection(Ok(&current.trained));
            }
            (Request::Inspect(_, inspection), Some(_)) => inspection(Err(REPLACED)),
            // The window offers no export before the first training, so a training was lost.
            (Request::Inspect(_, inspection), None) => inspection(Err(LOST)),
            (Request::Keep(folder, interval), _) => match self.keeping.open(&folder, interval) {
                Ok(left) => {
                    self.left = left;
                    self.offer_left();
                }
                Err(error) => {
                    let reason = format!("'{}': {}", folder.display(), system_cause(&error));
                    self.report.send(Event::Unkept(reason));
                }
            },
            (Request::DiscardLeft, _) => {
                if let Some(left) = self.left.pop() {
                    left.clear();
                }
                self.offer_left();
            }
            (Request::Save(done), current) => {
                if let Some(current) = current.as_ref().filter(|current| current.stage != Stage::Done) {
                    self.keeping.save(&current.trained.run);
                }
                // The program ends meanwhile.
                let _ = done.send(());
            }
        }
    }

    fn offer_left(&self) {
        self.report.send(Event::Left(self.left.last().map(question)));
    }

    /// Replaces the current training by a new one; the current one and its files stay if the new one is invalid.
    fn begin(&mut self, id: RunId, origin: Origin) {
        let start = match origin {
            Origin::New(_) | Origin::Chosen(_) => Start::New,
            Origin::States(..) | Origin::File(_) => Start::Paused,
            Origin::Left => Start::Resumed,
        };
        match self.prepare(id, origin) {
            Err(reason) => self.report.send(Event::Began(id, start, Err(reason))),
            Ok((trained, began)) => {
                let left = self.left.pop_if(|_| start == Start::Resumed);
                let has_ended = trained.run.stop_reason().is_some();
                let stage = match start {
                    // Its intervals were being calibrated.
                    Start::Resumed if has_ended => Stage::Calibrating,
                    // It was kept when it ended.
                    _ if has_ended => Stage::Done,
                    Start::Paused => Stage::Paused,
                    Start::New | Start::Resumed => Stage::Training,
                };
                self.keeping.begin(left, trained.recorded.as_ref());
                let mut past = PastNetworks::default();
                past.record(&trained.run);
                self.current = Some(Training {
                    id,
                    trained,
                    test: began.test.clone(),
                    past,
                    stage,
                    no_intervals: None,
                    reported: (0, 0),
                    next_report: Instant::now(),
                });
                self.report.send(Event::Began(id, start, Ok(Box::new(began))));
                self.publish();
            }
        }
        if start == Start::Resumed {
            self.offer_left();
        }
    }

    /// Draws or reads the samples of a training, chooses its settings if they are to be chosen, and initialises or restores
    /// its networks.
    fn prepare(&self, id: RunId, origin: Origin) -> Result<(TrainedRun, RunView), String> {
        let report = self.report;
        let is_cancelled = || self.newest.load(Ordering::Relaxed) != id.0 || report.is_cancelled();
        let job = Job::new(&is_cancelled);
        let on_work = |work, text, share| {
            report.progress(Event::Preparing(Preparing { work, text, share }), |_, _| ());
        };
        let mut on_reading = |Reading { bytes, of }: Reading| {
            let share = of.map(|of| bytes as f32 / of.max(1) as f32);
            on_work("Reading", "Reading the recording".to_owned(), share);
        };
        let here = Path::new("");
        let mut asked = None;
        let mut draw = |setup: &Setup, states| -> Result<TrainedRun, TestViewError> {
            let sets = setup.sets(here, &job, &mut on_reading)?;
            Ok(TrainedRun::new(sets.run(setup, states, &job)?, &sets))
        };
        let trained = match origin {
            Origin::New(setup) => draw(&setup, None).map_err(|error| error.to_string())?,
            Origin::States(setup, states) => draw(&setup, Some(states)).map_err(|error| error.to_string())?,
            Origin::Chosen(setup) => {
                let mut begun = None;
                let mut on_choosing = |progress| match progress {
                    ChoosingProgress::Reading(progress) => on_reading(progress),
                    ChoosingProgress::Trying(progress) => {
                        let (mut text, share) = (progress.text, progress.share);
                        let elapsed = begun.get_or_insert_with(Instant::now).elapsed();
                        if share > 0.05 {
                            let left = elapsed.mul_f64(1.0 / share - 1.0);
                            text += &format!(", about {} left", format_duration(left));
                        }
                        on_work("Choosing settings", text, Some(share as f32));
                    }
                };
                let fixed = AutoFixed::default();
                let chosen = setup.choose(&fixed, DEFAULT_BUDGET_S, here, &job, &mut on_choosing);
                let (chosen, sets) = chosen.map_err(|error| error.to_string())?;
                let run = sets.run(&chosen, None, &job).map_err(|error| error.to_string())?;
                asked = Some(*setup);
                TrainedRun::new(run, &sets)
            }
            Origin::File(path) => restored(&path, &job, &mut on_reading)?,
            Origin::Left => {
                let left = self.left.last().ok_or("There is no training to resume")?;
                restored(left.path(), &job, &mut on_reading)?
            }
        };
        let began = RunView::begun(id, &trained, asked).map_err(|error| error.to_string())?;
        job.check().map_err(|error| error.to_string())?;
        Ok((trained, began))
    }

    fn continue_training(&mut self, training: TrainingSettings) {
        let continued = match &mut self.current {
            None => Err(LOST.to_owned()),
            Some(current) => {
                let TrainedRun {
                    run,
                    recorded,
                    calibration,
                    ..
                } = &mut current.trained;
                continue_run(run, training)
                    .map(|()| {
                        if let (Some(recorded), Some(calibration)) = (recorded, calibration) {
                            recorded.forget_choice();
                            run.set_combined(None);
                            calibration.forget_choice();
                        }
                        (current.stage, current.no_intervals) = (Stage::Training, None);
                        Box::new(*run.settings())
                    })
                    .map_err(|error| error.to_string())
            }
        };
        let has_failed = continued.is_err();
        self.report.send(Event::Continued(continued));
        if !has_failed {
            self.publish();
        }
    }

    /// Trains one epoch.
    fn step(&mut self) {
        let Some(current) = &mut self.current else { return };
        let run = &mut current.trained.run;
        let has_ended = run.step().is_some();
        current.past.record(run);
        let unkept = self.keeping.save_if_due(run);
        if has_ended && current.trained.calibration.is_some() {
            current.stage = Stage::Calibrating;
            self.keeping.save(run);
            self.publish();
        } else if has_ended {
            self.end(None);
        } else if Instant::now() >= current.next_report {
            self.publish();
        }
        if let Some(reason) = unkept {
            self.report.send(Event::Unkept(reason));
        }
    }

    /// Calibrates the intervals of the training that has ended. A request for something else ends the calibration and is
    /// answered.
    fn calibrate(&mut self, requests: &Receiver<Request>) {
        let Some(current) = &self.current else { return };
        let pending = RefCell::new(None);
        let is_cancelled = || {
            while pending.borrow().is_none() {
                match requests.try_recv() {
                    Ok(Request::Inspect(id, inspection)) if current.id == id => inspection(Ok(&current.trained)),
                    Ok(Request::Save(done)) => {
                        self.keeping.save(&current.trained.run);
                        let _ = done.send(());
                    }
                    // Sent before the window knew that no epoch is left.
                    Ok(Request::Pause | Request::Resume) => {}
                    Ok(request) => *pending.borrow_mut() = Some(request),
                    Err(TryRecvError::Empty) => return self.report.is_cancelled(),
                    Err(TryRecvError::Disconnected) => return true,
                }
            }
            true
        };
        let calibrated = current.calibrated(&is_cancelled);
        self.end(calibrated);
        if let Some(request) = pending.into_inner() {
            self.answer(request);
        }
    }

    /// Ends the training that has run its epochs or was stopped: reports it, and sends its network.
    fn end(&mut self, calibrated: Option<Result<Intervals, String>>) {
        let Some(current) = &mut self.current else { return };
        match calibrated {
            Some(Ok(intervals)) => current.trained.run.set_intervals(intervals),
            Some(Err(reason)) => current.no_intervals = Some(reason),
            None => {}
        }
        current.stage = Stage::Done;
        self.publish();
        // The end of the program is not that of the training, whose intervals are then missing.
        if !self.report.is_cancelled() {
            self.keeping.clear();
        }
        let file = self.current.as_ref().map(|current| current.trained.network_file());
        let checked = file.map(|file| file.and_then(|file| file.check().map(|()| Box::new(file))));
        if let Some(finished) = checked {
            let finished = finished.map_err(|defect| format!("This training was not added to the run list: {defect}"));
            self.report.send(Event::Finished(finished));
        }
    }

    /// Reports the progress of the training.
    fn publish(&mut self) {
        let Some(current) = &mut self.current else { return };
        let progress = current.progress();
        self.report
            .progress(Event::Progressed(Box::new(progress)), |older, newer| {
                if let (Event::Progressed(older), Event::Progressed(newer)) = (older, newer) {
                    newer.replace(*older);
                }
            });
    }
}

impl Training {
    /// Returns the intervals of a recording, or the reason why there are none; nothing for a simulated array.
    fn calibrated(&self, is_cancelled: &dyn Fn() -> bool) -> Option<Result<Intervals, String>> {
        let calibration = self.trained.calibration.as_ref()?;
        Some(calibration.calibrate(&self.trained.run, &Job::new(is_cancelled)))
    }

    /// Returns its state, with the epochs since the last report.
    fn progress(&mut self) -> Progress {
        let begun = Instant::now();
        let run = &self.trained.run;
        let leader = run.leader_number();
        let trainer = &run.trainers()[leader];
        let networks = run.network();
        let answers = run.decouple_test();
        let errors = run.errors_of(&answers);
        let network_alone = run.scores().and_then(|scores| scores.network_alone);
        let charts = Arc::new(self.test.charts(&answers));
        let has_several = run.trainers().len() > 1;
        let starts = if has_several { run.starts() } else { Vec::new() };
        let cost = begun.elapsed();
        let is_calibrating = self.stage == Stage::Calibrating;
        let stop_reason = run.stop_reason().filter(|_| !is_calibrating);
        let is_idle = self.stage == Stage::Paused || stop_reason.is_some();
        let reported = if self.reported.0 == leader { self.reported.1 } else { 0 };
        let frame_time = is_idle
            .then(|| frame_us(&mut networks.decoder(), run.test()).ok())
            .flatten();
        let progress = Progress {
            epochs: trainer.history().get(reported..).unwrap_or_default().to_vec(),
            stages: trainer.stages().to_vec(),
            starts,
            past: self.past.clone(),
            result: RunResult {
                remarks: if is_idle {
                    self.remarks(&answers, &errors)
                } else {
                    Vec::new()
                },
                answers: Arc::new(answers),
                charts,
                errors,
                network_alone,
                coverage: run.coverage().to_vec(),
                intervals: run.intervals().cloned(),
                best_epoch: trainer.best_epoch(),
                defect: run.defect(),
                epochs_run: furthest_epoch(run),
                wall_time: run.wall_time(),
                frame_time: frame_time.map(|microseconds| Duration::from_secs_f64(1e-6 * microseconds)),
                is_idle,
                networks: Arc::new(networks),
            },
            is_calibrating,
            stop_reason,
        };
        self.reported = (leader, trainer.history().len());
        // Decoding a large test set takes long; it may use at most a fifth of the time.
        self.next_report = Instant::now() + REPORT_INTERVAL.max(4 * cost);
        progress
    }

    /// Returns the remarks on the decoded test samples of a recording.
    fn remarks(&self, answers: &Array2<f64>, errors: &TestErrors) -> Vec<String> {
        let run = &self.trained.run;
        let Some(recorded) = &self.trained.recorded else {
            return Vec::new();
        };
        let mut remarks = self.trained.of_samples.clone();
        if let Some(baselines) = run.baselines() {
            let scores = Scores {
                network: errors.clone(),
                network_alone: run.combined().map(|_| errors.clone()),
                baselines: baselines.clone(),
                coverage: run.coverage().to_vec(),
            };
            remarks.extend(describe(
                run.problem(),
                run.test(),
                answers,
                &scores,
                recorded.plan.division.by,
            ));
        }
        remarks.extend(self.no_intervals.clone());
        remarks
    }
}

/// Message if the worker does not have the current training, which happens only after an earlier worker died.
pub const LOST: &str = "the network was lost when the training thread ended; train again";

/// Message if a file was requested before another training began.
const REPLACED: &str = "the file was not written, because another training has replaced the one to be saved; finished \
                        trainings are in the run list of the Compare view";

/// Restores the training saved in the checkpoint at `path`.
fn restored(path: &Path, job: &Job<'_>, on_reading: &mut dyn FnMut(Reading)) -> Result<TrainedRun, String> {
    let file = CheckpointFile::load(path).map_err(|error| error.to_string())?;
    let resumed = file.resume(job, on_reading);
    let (run, sets) = resumed.map_err(|error| format!("'{}': {error}", path.display()))?;
    Ok(TrainedRun::new(run, &sets))
}

impl TrainedRun {
    fn new(run: Run, sets: &SetupSets) -> Self {
        let recordings = sets.recordings.as_ref();
        Self {
            recorded: sets.recorded().cloned(),
            timeline: recordings.map(|recordings| Arc::new(Timeline::of(recordings, run.settings().seed))),
            drift: sets.drift_reference(),
            of_samples: describe_samples(sets),
            calibration: Calibration::of(sets),
            run,
        }
    }

    /// Returns the best network so far, with its history and errors.
    pub fn network_file(&self) -> Result<NetworkFile, String> {
        let file = NetworkFile::from_run(&self.run, self.recorded.as_ref()).map_err(|error| error.to_string())?;
        Ok(NetworkFile {
            drift: self.drift.clone(),
            ..file
        })
    }

    /// Answers with ridge regression in place of the network from now on; returns its intervals, or why there are none.
    fn use_ridge(&mut self) -> Result<Intervals, String> {
        let calibration = self.calibration.as_ref().ok_or(LOST)?;
        let (combined, intervals) = calibration.ridge(&self.run).map_err(|error| error.to_string())?;
        if let Some(recorded) = &mut self.recorded {
            recorded.combined = Some(combined.clone());
            recorded.chosen_intervals = intervals.clone().ok();
        }
        self.run.set_combined(Some(combined));
        intervals.map_err(|reason| format!("no 90 % intervals: {reason}"))
    }

    /// Returns the current state, to be resumed later.
    pub fn checkpoint_file(&self) -> Result<CheckpointFile, String> {
        CheckpointFile::from_run(&self.run, self.recorded.as_ref()).map_err(|error| error.to_string())
    }
}
