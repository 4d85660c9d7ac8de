use std::{
    cell::RefCell,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, AtomicUsize, Ordering},
        mpsc::{Receiver, Sender, TryRecvError},
    },
    time::{Duration, Instant},
};

use ndarray::Array2;

use super::{
    Began, Event, Inspection, Progress as Advance, Request, RunId, RunResult, TrainedRun,
    calibration::Calibration,
    keeping::{Keeping, Kept},
    message::{continue_run, furthest_epoch},
    past_networks::PastNetworks,
};
use crate::window::{
    job::Report,
    test_view::{TestSet, TestViewError},
};
use decoupler_core::{
    dataset::SplitBy,
    evaluation::{
        Run, Scores, TestErrors,
        auto::{AutoFixed, DEFAULT_BUDGET_S},
        frame_us,
        recorded::Determination,
    },
    job::Job,
    training::{TrainerState, TrainingSettings},
};
use decoupler_files::{
    export::{
        CheckpointFile, CheckpointPlace, NetworkFile, describe_coverage, describe_determinacy, describe_samples,
        describe_worse_than_ridge,
    },
    import::{ChoosingProgress, Plan, Progress, Setup, SetupError, SetupSets},
    machine::system_cause,
};

/// Minimum time between two progress reports. Each makes the window draw a frame; the time in between keeps the window
/// responsive, even if frames are drawn without a graphics card.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// Minimum time between two evaluations of all starts, each of which decodes the test set.
const STARTS_INTERVAL: Duration = Duration::from_millis(500);

/// State of the thread.
pub(super) struct TrainingLoop<'a> {
    report: &'a Report<Event>,
    /// Number of the last cancelled preparation.
    cancelled: &'a AtomicU64,
    /// Displayed snapshot.
    snapshot: &'a AtomicUsize,
    /// Number of preparations so far.
    preparations: u64,
    run: Option<TrainedRun>,
    /// Its test set, ready to be drawn.
    test: Option<TestSet>,
    /// Networks of its past epochs.
    past: PastNetworks,
    /// Identity of the training `run`.
    id: Option<RunId>,
    is_paused: bool,
    is_calibrating: bool,
    /// Reason why the training that has ended has no intervals.
    no_intervals: Option<String>,
    /// True if the result of a finished run has been sent to the window.
    is_kept: bool,
    keeping: Keeping,
    /// Start of the last report, and its number of reported epochs.
    reported: (usize, usize),
    next_report: Instant,
    next_starts: Instant,
}

impl<'a> TrainingLoop<'a> {
    pub(super) fn new(
        report: &'a Report<Event>,
        cancelled: &'a AtomicU64,
        snapshot: &'a AtomicUsize,
        kept: Kept,
    ) -> Self {
        Self {
            report,
            cancelled,
            snapshot,
            preparations: 0,
            run: None,
            test: None,
            past: PastNetworks::default(),
            id: None,
            is_paused: false,
            is_calibrating: false,
            no_intervals: None,
            is_kept: false,
            keeping: Keeping::new(kept),
            reported: (0, 0),
            next_report: Instant::now(),
            next_starts: Instant::now(),
        }
    }

    /// Handles requests and trains until the window is closed.
    pub(super) fn run(&mut self, requests: &Receiver<Request>) {
        while !self.report.is_cancelled() {
            let request = if self.is_training() {
                requests.try_recv()
            } else {
                requests.recv().map_err(TryRecvError::from)
            };
            match request {
                Ok(request) => self.answer(request),
                Err(TryRecvError::Empty) => self.train_one_epoch(requests),
                Err(TryRecvError::Disconnected) => return,
            }
        }
    }

    fn is_training(&self) -> bool {
        self.unfinished().is_some() && !self.is_paused
    }

    /// The training that has not ended, or whose result has not been sent to the window.
    fn unfinished(&self) -> Option<&TrainedRun> {
        let unfinished = self.run.as_ref();
        unfinished.filter(|trained| trained.run.stop_reason().is_none() || !self.is_kept)
    }

    fn answer(&mut self, request: Request) {
        match request {
            Request::Train(setup) => {
                let prepared = self.prepare_setup(&setup, None);
                self.begin(prepared, None, Event::Began);
            }
            Request::Choose(setup) => {
                let prepared = self.choose(&setup).map(|(trained, began)| {
                    let asked = Setup::clone(&setup);
                    (trained, Box::new(Began { asked, ..*began }))
                });
                self.begin(prepared, None, Event::Began);
            }
            Request::Open(path) => {
                let prepared = self.open(&path);
                self.begin(prepared, None, Event::Opened);
            }
            Request::TakeUp(setup, states) => {
                let prepared = self.prepare_setup(&setup, Some(states));
                self.begin(prepared.map_err(|error| error.to_string()), None, Event::Opened);
            }
            Request::Continue(training) => self.continue_training(training),
            Request::Pause => {
                self.is_paused = true;
                self.report_progress();
            }
            Request::Resume => self.is_paused = false,
            Request::Stop => {
                if let Some(trained) = self.run.as_mut().filter(|trained| trained.run.stop_reason().is_none()) {
                    trained.run.stop();
                    // Nothing is calibrated for it.
                    self.end(&|_| true);
                }
            }
            Request::Inspect(id, inspection) => self.inspect(id, inspection),
            Request::Keep(folder, interval) => match self.keeping.open(&folder, interval) {
                Ok(()) => self.offer_left(),
                Err(error) => self.unkept(format!("'{}': {}", folder.display(), system_cause(&error))),
            },
            Request::ResumeLeft => {
                match self.keeping.take_left() {
                    Some(left) => {
                        let prepared = self.open(left.path());
                        self.begin(prepared, Some(left), Event::Resumed);
                    }
                    None => {
                        self.preparations += 1;
                        self.report.send(Event::Abandoned);
                    }
                }
                self.offer_left();
            }
            Request::DiscardLeft => {
                if let Some(left) = self.keeping.take_left() {
                    left.clear();
                }
                self.offer_left();
            }
            Request::Save(done) => self.save(&done),
        }
    }

    /// Saves the running training and answers.
    fn save(&self, done: &Sender<()>) {
        if let Some(trained) = self.unfinished() {
            self.keeping.save(&trained.run);
        }
        // The program ends meanwhile.
        let _ = done.send(());
    }

    fn offer_left(&self) {
        self.report.send(Event::Left(self.keeping.offer()));
    }

    fn unkept(&self, reason: String) {
        self.report.send(Event::Unkept(reason));
    }

    /// Restores the training saved in the checkpoint at `path`.
    fn open(&self, path: &Path) -> Result<(TrainedRun, Box<Began>), String> {
        let file = CheckpointFile::load(path).map_err(|error| error.to_string())?;
        let prepared = self.prepare(|job, on_progress| {
            let (run, sets) = file.resume(job, on_progress)?;
            Ok(TrainedRun::new(run, &sets))
        });
        prepared.map_err(|error| format!("'{}': {error}", path.display()))
    }

    fn inspect(&self, id: RunId, inspection: Inspection) {
        inspection.inspect(match &self.run {
            Some(run) if self.id == Some(id) => Ok(run),
            Some(_) => Err(REPLACED),
            // The window offers no export before the first training, so a training was lost.
            None => Err(LOST),
        });
    }

    /// Draws or reads the samples of `setup` and begins its trainings.
    fn prepare_setup(
        &self,
        setup: &Setup,
        states: Option<Vec<TrainerState>>,
    ) -> Result<(TrainedRun, Box<Began>), TestViewError> {
        self.prepare(|job, on_progress| {
            let sets = setup.sets(Path::new(""), job, on_progress)?;
            let run = sets.run(setup, states, job)?;
            Ok(TrainedRun::new(run, &sets))
        })
    }

    /// Reads the recording of `setup`, chooses its settings and initialises the networks.
    fn choose(&self, setup: &Setup) -> Result<(TrainedRun, Box<Began>), TestViewError> {
        let report = self.report;
        self.prepare(|job, on_progress| {
            let mut on_choosing = |progress| match progress {
                ChoosingProgress::Reading(progress) => on_progress(progress),
                ChoosingProgress::Trying(progress) => {
                    report.progress(Event::Choosing(Box::new(progress)), |_, _| ());
                }
            };
            let (fixed, folder) = (AutoFixed::default(), Path::new(""));
            let (setup, sets) = setup.choose(&fixed, DEFAULT_BUDGET_S, folder, job, &mut on_choosing)?;
            let run = sets.run(&setup, None, job)?;
            Ok(TrainedRun::new(run, &sets))
        })
    }

    /// Prepares a run with `get`, which can be cancelled and reports the progress of reading a recording.
    fn prepare(
        &self,
        get: impl FnOnce(&Job<'_>, &mut dyn FnMut(Progress)) -> Result<TrainedRun, TestViewError>,
    ) -> Result<(TrainedRun, Box<Began>), TestViewError> {
        let (number, cancelled, report) = (self.preparations + 1, self.cancelled, self.report);
        let is_cancelled = || cancelled.load(Ordering::Relaxed) >= number || report.is_cancelled();
        let job = Job::new(&is_cancelled);
        let trained = get(&job, &mut |progress| {
            report.progress(Event::Reading(progress), |_, _| ());
        })?;
        let begun = begun(trained)?;
        job.check().map_err(SetupError::from)?;
        Ok(begun)
    }

    /// Replaces the current run by a new one; the current run and its files stay if the new one is invalid. A run resumed from
    /// the checkpoint `left` is kept there.
    fn begin<X>(
        &mut self,
        prepared: Result<(TrainedRun, Box<Began>), X>,
        left: Option<CheckpointPlace>,
        event: fn(Result<Box<Began>, X>) -> Event,
    ) {
        self.preparations += 1;
        let (trained, began) = match prepared {
            Ok(prepared) => prepared,
            Err(error) => {
                if let Some(left) = left {
                    self.keeping.put_back(left);
                }
                return self.report.send(event(Err(error)));
            }
        };
        let has_ended = trained.run.stop_reason().is_some();
        // A run that had ended before it was saved was kept when it ended, unless its intervals were being calibrated.
        self.is_kept = has_ended && left.is_none();
        self.is_calibrating = has_ended && left.is_some();
        self.keeping.begin(left, trained.recorded.as_ref());
        self.past = PastNetworks::default();
        self.past.record(&trained.run);
        (self.run, self.id, self.test) = (Some(trained), Some(began.id), Some(began.test.clone()));
        self.no_intervals = None;
        self.reported = (0, 0);
        self.next_starts = Instant::now();
        let event = event(Ok(began));
        self.is_paused = matches!(event, Event::Opened(_));
        self.report.send(event);
        self.report_progress();
    }

    fn continue_training(&mut self, training: TrainingSettings) {
        let continued = match &mut self.run {
            Some(TrainedRun {
                run,
                recorded,
                calibration,
                ..
            }) => continue_run(run, training)
                .map(|()| {
                    if let (Some(recorded), Some(calibration)) = (recorded, calibration) {
                        recorded.forget_choice();
                        run.set_combined(None);
                        calibration.forget_choice();
                    }
                    *run.settings()
                })
                .map_err(|error| error.to_string()),
            None => Err(LOST.to_owned()),
        };
        let has_failed = continued.is_err();
        self.report.send(Event::Continued(continued.map(Box::new)));
        if !has_failed {
            (self.is_paused, self.is_kept, self.no_intervals) = (false, false, None);
            self.report_progress();
        }
    }

    fn train_one_epoch(&mut self, requests: &Receiver<Request>) {
        let Some(TrainedRun { run, .. }) = &mut self.run else {
            return;
        };
        let ended = run.step().is_some();
        self.past.record(run);
        let unkept = self.keeping.save_if_due(run);
        if ended {
            self.calibrate(requests);
        } else if Instant::now() >= self.next_report {
            self.report_progress();
        }
        if let Some(reason) = unkept {
            self.unkept(reason);
        }
    }

    /// Calibrates the intervals of the training that has ended, and reports its end. A request for something else ends the
    /// calibration and is answered.
    fn calibrate(&mut self, requests: &Receiver<Request>) {
        let calibrated = self.run.as_ref().filter(|trained| trained.calibration.is_some());
        self.is_calibrating = calibrated.is_some();
        if let Some(trained) = calibrated {
            self.keeping.save(&trained.run);
            self.report_progress();
        }
        let pending = RefCell::new(None);
        let is_cancelled = |worker: &Self| {
            while pending.borrow().is_none() {
                match requests.try_recv() {
                    Ok(Request::Inspect(id, inspection)) => worker.inspect(id, inspection),
                    Ok(Request::Save(done)) => worker.save(&done),
                    // Sent before the window knew that no epoch is left.
                    Ok(Request::Pause | Request::Resume) => {}
                    Ok(request) => *pending.borrow_mut() = Some(request),
                    Err(TryRecvError::Empty) => return worker.report.is_cancelled(),
                    Err(TryRecvError::Disconnected) => return true,
                }
            }
            true
        };
        self.end(&is_cancelled);
        if let Some(request) = pending.into_inner() {
            self.answer(request);
        }
    }

    /// Reports the end of the training, with intervals unless `is_cancelled`.
    fn end(&mut self, is_cancelled: &dyn Fn(&Self) -> bool) {
        let calibrated = self.run.as_ref().and_then(|TrainedRun { run, calibration, .. }| {
            let calibration = calibration.as_ref()?;
            let calibrated = calibration.calibrate(run, &Job::new(&|| is_cancelled(self)));
            Some(calibrated)
        });
        self.no_intervals = None;
        if let (Some(trained), Some(calibrated)) = (&mut self.run, calibrated) {
            match calibrated {
                Ok(intervals) => trained.run.set_intervals(intervals),
                Err(reason) => self.no_intervals = Some(reason),
            }
        }
        self.is_calibrating = false;
        self.report_progress();
    }

    fn report_progress(&mut self) {
        let Some(TrainedRun { run, .. }) = &self.run else {
            return;
        };
        let begun = Instant::now();
        let number = run.leader_number();
        let trainer = &run.trainers()[number];
        let networks = run.network();
        let scores = run.scores();
        let answers = run.decouple_test();
        let errors = run.errors_of(&answers);
        let network_alone = scores.and_then(|scores| scores.network_alone);
        let test = self.test.as_ref();
        let frame = test.and_then(TestSet::array).map(|test| {
            let snapshot = test.nearest_snapshot(self.snapshot.load(Ordering::Relaxed));
            (snapshot, test.frame(answers.view(), snapshot))
        });
        let charts = test
            .and_then(TestSet::recording)
            .map(|test| Arc::new(test.charts(&answers)));
        let cost = begun.elapsed();
        let has_several = run.trainers().len() > 1;
        let stop_reason = run.stop_reason().filter(|_| !self.is_calibrating);
        let is_idle = self.is_paused || stop_reason.is_some();
        let starts = (has_several && (is_idle || begun >= self.next_starts)).then(|| run.starts());
        if starts.is_some() {
            // Uses at most a tenth of the time.
            self.next_starts = Instant::now() + STARTS_INTERVAL.max(9 * (begun.elapsed() - cost));
        }
        let reported = match self.reported {
            (leader, epochs) if leader == number => epochs,
            _ => 0,
        };
        let progress = Box::new(Advance {
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
                frame,
                errors,
                network_alone,
                coverage: run.coverage().to_vec(),
                best_epoch: trainer.best_epoch(),
                defect: run.defect(),
                epochs_run: furthest_epoch(run),
                starts_ended: run
                    .trainers()
                    .iter()
                    .filter(|start| start.stop_reason().is_some())
                    .count(),
                wall_time: run.wall_time(),
                frame_time: Some(run.test())
                    .filter(|_| is_idle)
                    .and_then(|test| frame_us(&mut networks.decoder(), test).ok())
                    .map(|microseconds| Duration::from_secs_f64(1e-6 * microseconds)),
                is_idle,
                networks: Arc::new(networks),
            },
            is_calibrating: self.is_calibrating,
            stop_reason,
        });
        self.report.progress(Event::Progressed(progress), |older, newer| {
            if let (Event::Progressed(older), Event::Progressed(newer)) = (older, newer) {
                newer.replace(*older);
            }
        });
        self.reported = (number, trainer.history().len());
        // Decoding a large test set takes long; it may use at most a fifth of the time.
        self.next_report = Instant::now() + REPORT_INTERVAL.max(4 * cost);
        if !self.is_calibrating {
            self.report_finished();
        }
    }

    /// Returns the remarks on the decoded test samples of a recording.
    fn remarks(&self, answers: &Array2<f64>, errors: &TestErrors) -> Vec<String> {
        let recorded = self
            .run
            .as_ref()
            .and_then(|trained| Some((trained, trained.recorded.as_ref()?)));
        let Some((trained, recorded)) = recorded else {
            return Vec::new();
        };
        let run = &trained.run;
        let determined = Determination::measure(run.test(), answers.view(), recorded.plan.division.by);
        let mut remarks = trained.of_samples.clone();
        remarks.extend(describe_determinacy(
            &run.problem().targets,
            &determined,
            run.combined().is_some(),
        ));
        if let Some(baselines) = run.baselines() {
            let scores = Scores {
                network: errors.clone(),
                network_alone: run.combined().is_some().then(|| errors.clone()),
                baselines: baselines.clone(),
                coverage: Vec::new(),
            };
            remarks.extend(describe_worse_than_ridge(run.problem(), &scores));
        }
        remarks.extend(describe_coverage(&run.problem().targets, run.coverage()));
        remarks.extend(self.no_intervals.clone());
        remarks
    }

    /// Sends the result of a finished run, once.
    fn report_finished(&mut self) {
        let Some(trained) = self.run.as_ref().filter(|trained| trained.run.stop_reason().is_some()) else {
            return;
        };
        if std::mem::replace(&mut self.is_kept, true) {
            return;
        }
        // The end of the program is not that of the training, whose intervals are then missing.
        if !self.report.is_cancelled() {
            self.keeping.clear();
        }
        let file = trained.network_file();
        let checked = file.and_then(|file| file.check().map(|()| Box::new(file)));
        let finished = checked.map_err(|defect| format!("This training was not added to the run list: {defect}"));
        self.report.send(Event::Finished(finished));
    }
}

/// Message if the worker does not have the current training, which happens only after an earlier worker died.
pub const LOST: &str = "the network was lost when the training thread ended; train again";

/// Message if a file was requested before another training began.
const REPLACED: &str = "the file was not written, because another training has replaced the one to be saved; finished \
                        trainings are in the run list of the Compare view";

/// Returns a run with the data that the window needs.
fn begun(trained: TrainedRun) -> Result<(TrainedRun, Box<Began>), TestViewError> {
    let run = &trained.run;
    let plan = trained.recorded.as_ref().map(|recorded| recorded.plan.clone());
    let order = plan.as_ref().map_or(SplitBy::Time, Plan::test_order);
    let setup = Setup::of(*run.settings(), plan).expect("a recorded run has its plan");
    let began = Began {
        id: RunId::new(),
        asked: setup.clone(),
        setup,
        search: trained.recorded.as_ref().and_then(|recorded| recorded.search.clone()),
        problem: Arc::clone(run.problem()),
        weights: run.leader().weights(),
        test: TestSet::of(run, order)?,
        baselines: run
            .baselines()
            .cloned()
            .expect("the baselines of a whole run are measured"),
    };
    Ok((trained, Box::new(began)))
}

impl TrainedRun {
    fn new(run: Run, sets: &SetupSets) -> Self {
        Self {
            run,
            recorded: sets.recorded().cloned(),
            drift: sets.drift_reference(),
            of_samples: describe_samples(sets),
            calibration: Calibration::of(sets),
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

    /// Returns the current state, to be resumed later.
    pub fn checkpoint_file(&self) -> Result<CheckpointFile, String> {
        CheckpointFile::from_run(&self.run, self.recorded.as_ref()).map_err(|error| error.to_string())
    }
}
