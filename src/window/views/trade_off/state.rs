//! Measures speed against accuracy in the background. A measurement begins only after the previous one has released the
//! processor, because it would distort the times.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{Preset, Run, RunSettings, TradeOffPoint, Workload, decoded_unit, measure_trade_off},
    job::Job,
    training::Method,
};
use decoupler_files::{
    export::NetworkFile,
    figure::{TradeOffLevel, TradeOffLimits, point_name},
    import::{Recorded, Setup, SetupSets},
    machine::memory_budget,
};

use super::TradeOffForm;
use crate::window::{
    job::{Background, Report, Wake},
    shared::{Effect, Exporting, Matter, NetworkSource, Shared, ViewKind},
};

/// The Trade-off view.
#[derive(Debug)]
pub struct TradeOffView {
    /// Form of the next measurement.
    pub form: TradeOffForm,
    /// Measurement that is running.
    pub running: Option<TradeOffRunning>,
    /// Results measured so far.
    pub outcome: Option<TradeOffOutcome>,
    /// Level, limits and marked point of the display.
    pub look: TradeOffLook,
    pub(super) job: Background<TradeOffEvent>,
}

/// Action on a point that the user has chosen.
#[derive(Debug)]
pub(super) enum PointWish {
    /// Load its configuration into the Train view.
    Load(usize),
    /// Write its decoder to a file.
    Export(Box<Exporting>),
}

/// State of the display of a measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TradeOffLook {
    /// The displayed noise level.
    pub level: usize,
    /// The point marked in charts and table, as an index in the displayed level.
    pub marked: Option<usize>,
    /// Limits of error and time for the recommended decoders.
    pub limits: TradeOffLimits,
}

/// A measurement under way.
#[derive(Clone, Copy, Debug)]
pub struct TradeOffRunning {
    /// When it began.
    pub begun: Instant,
}

/// Ending of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TradeOffEnding {
    /// Every point was measured or refused.
    Complete,
    /// Ended early by the user, or by an error that was reported.
    Cut,
}

/// Results of a measurement so far.
#[derive(Clone, Debug)]
pub struct TradeOffOutcome {
    /// Plan that is measured.
    pub plan: TradeOffPlan,
    /// One for each noise level, or a single one for a recording.
    pub levels: Vec<TradeOffLevel>,
    /// Files of the trained networks, by level and point.
    pub networks: BTreeMap<(usize, usize), Arc<NetworkFile>>,
    /// Decoders that cannot be used, each with its level and the reason.
    pub refused: Vec<(usize, String)>,
    /// Origin of the samples of a recording, once they are read.
    pub recorded: Option<Box<Recorded>>,
    /// Unit that is decoded at a time, such as "a sample", once it is known.
    pub decoded: Option<String>,
    /// Ending of the measurement, once it has ended.
    pub ending: Option<TradeOffEnding>,
    /// Time it took, once it has ended.
    pub took: Option<Duration>,
    /// True once its table has been saved.
    pub is_saved: Arc<AtomicBool>,
}

impl TradeOffOutcome {
    /// Returns the number of points measured or refused, and the number of planned points.
    pub fn points(&self) -> (usize, usize) {
        let measured: usize = self.levels.iter().map(|level| level.points.len()).sum();
        (measured + self.refused.len(), self.plan.points())
    }

    /// Returns the setup with which a point of a level was measured, to be trained.
    pub fn setup_of(&self, level: usize, point: usize) -> Option<Setup> {
        let point = self.levels.get(level)?.points.get(point)?;
        let is_of = |setup: &Setup| {
            let hidden = point.settings.hidden;
            RunSettings {
                hidden,
                ..*setup.settings()
            } == point.settings
        };
        let run = self.plan.levels.get(level)?.runs.iter();
        let run = run
            .filter(|run| run.preset == point.preset)
            .find(|run| is_of(&run.setup))?;
        Some(run.setup.with_settings(point.settings))
    }

    /// Returns the samples and the network from which the decoder of a point can be exported.
    pub(super) fn source_of(&self, level: usize, point: usize) -> Option<NetworkSource> {
        let setup = self.setup_of(level, point)?;
        Some(match self.networks.get(&(level, point)) {
            Some(file) => {
                let name = point_name(self.levels.get(level)?.points.get(point)?);
                NetworkSource::Kept(name, Arc::clone(file))
            }
            None => NetworkSource::Samples(Box::new(setup), self.recorded.clone()),
        })
    }
}

impl TradeOffView {
    /// Creates the view without results; `wake` is called when there are events.
    pub fn new(wake: Wake) -> Self {
        Self {
            form: TradeOffForm::default(),
            running: None,
            outcome: None,
            look: TradeOffLook::default(),
            job: Background::new("trade-off", wake),
        }
    }

    /// Returns true if no other computation of this program is running, which would distort the times.
    pub(super) fn is_quiet(&self, shared: &Shared) -> bool {
        !shared.phase.is_busy() && shared.working.iter().all(|&view| view == ViewKind::TradeOff)
    }

    /// Returns true if the form can be measured now.
    pub(super) fn can_measure(&self, shared: &Shared) -> bool {
        self.running.is_none() && self.is_quiet(shared) && self.plan(shared).is_ok()
    }

    /// Starts the measurement that the form describes.
    pub(super) fn measure(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let Ok(plan) = self.plan(shared) else { return };
        effects.push(Effect::Settle(Matter::TradeOff));
        self.begin(plan.clone());
        measure(&mut self.job, plan);
    }

    /// Cancels the measurement; measured points are kept.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.end(Instant::now());
    }

    /// Returns the plan of the form on the source of the Train view.
    ///
    /// # Errors
    /// If the recording is incomplete or the form is not valid, with what to do.
    pub fn plan(&self, shared: &Shared) -> Result<TradeOffPlan, String> {
        self.form.plan(&shared.setup()?).map_err(|error| error.to_string())
    }

    /// Prepares empty results for `plan`.
    fn begin(&mut self, plan: TradeOffPlan) {
        let level = |planned: &PlannedLevel| TradeOffLevel {
            noise: planned.noise,
            points: Vec::new(),
        };
        self.look.level = self.look.level.min(plan.levels.len().saturating_sub(1));
        self.look.marked = None;
        self.running = Some(TradeOffRunning { begun: Instant::now() });
        self.outcome = Some(TradeOffOutcome {
            levels: plan.levels.iter().map(level).collect(),
            networks: BTreeMap::new(),
            refused: Vec::new(),
            recorded: None,
            decoded: None,
            plan,
            ending: None,
            took: None,
            is_saved: Arc::default(),
        });
    }

    /// Adds a point to a level, with the file of its network if it has one.
    pub(super) fn record(&mut self, level: usize, point: TradeOffPoint, file: Option<Arc<NetworkFile>>) {
        let Some(outcome) = &mut self.outcome else { return };
        let Some(points) = outcome.levels.get_mut(level).map(|level| &mut level.points) else {
            return;
        };
        outcome.networks.extend(file.map(|file| ((level, points.len()), file)));
        points.push(point);
    }

    /// Records the end of the measurement.
    pub fn end(&mut self, at: Instant) {
        let Some(running) = self.running.take() else { return };
        if let Some(outcome) = &mut self.outcome {
            let (done, all) = outcome.points();
            outcome.took = Some(at - running.begun);
            outcome.ending = Some(if done == all {
                TradeOffEnding::Complete
            } else {
                TradeOffEnding::Cut
            });
        }
    }

    /// Returns the displayed level.
    pub fn shown(&self) -> Option<&TradeOffLevel> {
        self.outcome
            .as_ref()
            .and_then(|outcome| outcome.levels.get(self.look.level))
    }
}

/// Plan of a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffPlan {
    /// Levels, in order: the noise levels of a simulated array, or a single one for a recording.
    pub levels: Vec<PlannedLevel>,
    /// Numbers of hidden nodes of the networks.
    pub hidden: Vec<usize>,
}

/// Runs of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedLevel {
    /// Relative noise of a reading, if it is simulated.
    pub noise: Option<f64>,
    /// Runs that fit its decoders.
    pub runs: Vec<PlannedRun>,
}

/// A run that fits decoders.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedRun {
    /// Preset from which its settings were derived, if any.
    pub preset: Option<Preset>,
    /// Setup, except for the hidden nodes.
    pub setup: Setup,
    /// Decoders to be measured.
    pub decoders: Vec<DecoderKind>,
}

impl TradeOffPlan {
    /// Returns the number of points.
    pub fn points(&self) -> usize {
        let of_decoder = |kind: &DecoderKind| {
            let networks = if kind.needs_network() { self.hidden.len() } else { 1 };
            networks * kind.precisions().len()
        };
        let runs = self.levels.iter().flat_map(|level| &level.runs);
        runs.flat_map(|run| &run.decoders).map(of_decoder).sum()
    }

    /// Returns the name of the source.
    pub fn source_name(&self) -> String {
        let run = self.levels.iter().flat_map(|level| &level.runs).next();
        run.map_or(String::new(), |run| run.setup.source_name())
    }

    /// Returns the training methods of its networks on a recording; empty for an array, whose presets define them.
    pub fn methods(&self) -> Vec<Method> {
        let runs = self.levels.iter().flat_map(|level| &level.runs);
        let recorded = runs.filter(|run| run.setup.plan().is_some());
        recorded.map(|run| run.setup.settings().training.method).collect()
    }
}

/// Event of the most recent measurement.
#[derive(Debug)]
pub enum TradeOffEvent {
    /// The samples of a run are ready.
    Samples {
        /// Unit for which decoding is timed, such as "a sample".
        decoded: String,
        /// Origin of recorded samples.
        recorded: Option<Box<Recorded>>,
    },
    /// A point of a level, with the file of its network if it has one.
    Measured(usize, Box<TradeOffPoint>, Option<Arc<NetworkFile>>),
    /// A decoder cannot be used with the samples of a level, with the reason.
    Refused(usize, String),
    /// The measurement has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// Measures `plan`; a running measurement is cancelled.
pub fn measure(job: &mut Background<TradeOffEvent>, plan: TradeOffPlan) {
    job.start(
        move |report| report.unless_cancelled(measure_all(&plan, report)),
        |ended| {
            let ended = ended.map_err(|error| format!("{error}; the points measured so far are kept"));
            TradeOffEvent::Ended(ended.and_then(|measured| measured))
        },
    );
}

/// Measures level by level and run by run, and reports each point as it is measured.
fn measure_all(plan: &TradeOffPlan, report: &Report<TradeOffEvent>) -> Result<(), String> {
    let is_cancelled = || report.is_cancelled();
    let job = Job::new(&is_cancelled);
    let mut last: Option<(&Setup, SetupSets)> = None;
    for (level, planned) in plan.levels.iter().enumerate() {
        for run in &planned.runs {
            if run.setup.plan().is_none() {
                let workload = Workload::of_trade_off(run.setup.settings(), &plan.hidden, &run.decoders);
                let checked = workload.and_then(|workload| workload.check_memory(memory_budget()));
                checked.map_err(|error| error.to_string())?;
            }
            let sets = match last.take() {
                // The samples of a recording are read only once.
                Some((of, sets)) if of.plan().is_some() && of.plan() == run.setup.plan() => sets,
                _ => {
                    let sets = run.setup.sets(Path::new(""), &job, &mut |_| ());
                    sets.map_err(|error| error.to_string())?
                }
            };
            let recorded = sets.recorded();
            report.send(TradeOffEvent::Samples {
                decoded: decoded_unit(&sets.sets.test),
                recorded: recorded.cloned().map(Box::new),
            });
            // Several decoders share a network.
            let mut last_file: Option<Arc<NetworkFile>> = None;
            let measured = measure_trade_off(
                run.setup.settings(),
                &sets.sets,
                &plan.hidden,
                &run.decoders,
                &job,
                |kind, point, trained: Option<&Run>| {
                    report.send(match point {
                        Ok(point) => {
                            let point = TradeOffPoint {
                                preset: run.preset,
                                ..point
                            };
                            last_file = trained.and_then(|trained| {
                                let last = last_file.take().filter(|file| file.settings == *trained.settings());
                                last.or_else(|| NetworkFile::from_run(trained, recorded).ok().map(Arc::new))
                            });
                            TradeOffEvent::Measured(level, Box::new(point), last_file.clone())
                        }
                        Err(error) => TradeOffEvent::Refused(level, format!("{kind}: {error}")),
                    });
                },
            );
            measured.map_err(|error| error.to_string())?;
            last = Some((&run.setup, sets));
        }
    }
    Ok(())
}
