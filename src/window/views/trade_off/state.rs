use std::{
    collections::BTreeMap,
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{Preset, RunSettings, TradeOffLevel, TradeOffLimits, TradeOffPoint},
    training::Method,
};
use decoupler_files::{
    export::NetworkFile,
    figure::point_name,
    import::{Recorded, Setup},
};

use super::{
    TradeOffForm,
    worker::{self, TradeOffEvent},
};
use crate::window::{
    job::{Job, Wake},
    shared::{DecoderSource, Effect, FileTask, Matter, NetworkSource, Shared, View as _},
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
    pub(super) job: Job<TradeOffEvent>,
}

/// What the user wants to do with a point.
#[derive(Debug)]
pub(super) enum PointWish {
    /// Load its configuration into the Train view.
    Load(usize),
    /// Write its decoder to a file.
    Export(Box<FileTask>),
}

/// State of the display of a measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TradeOffLook {
    /// The displayed level of noise.
    pub level: usize,
    /// The point marked in charts and table, by its place in the displayed level.
    pub marked: Option<usize>,
    /// The limits of the two questions.
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
    /// Every point is there.
    Complete,
    /// By the user, or by an accident that was told.
    Cut,
}

/// Results of a measurement so far.
#[derive(Clone, Debug)]
pub struct TradeOffOutcome {
    /// Plan that is measured.
    pub plan: TradeOffPlan,
    /// One for each level of noise, or a single one of a recording.
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
}

impl TradeOffOutcome {
    /// Points measured or refused, and points asked for.
    pub fn points(&self) -> (usize, usize) {
        let measured: usize = self.levels.iter().map(|level| level.points.len()).sum();
        (measured + self.refused.len(), self.plan.points())
    }

    /// Setup with which a point of a level was measured, to be trained.
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

    /// Samples and network from which the decoder of a point can be exported.
    pub(super) fn source_of(&self, level: usize, point: usize) -> Option<DecoderSource> {
        let setup = self.setup_of(level, point)?;
        Some(match self.networks.get(&(level, point)) {
            Some(file) => {
                let name = point_name(self.levels.get(level)?.points.get(point)?);
                DecoderSource::Run(NetworkSource::Kept(name, Arc::clone(file)))
            }
            None => DecoderSource::Samples(Box::new(setup), self.recorded.clone()),
        })
    }
}

impl TradeOffView {
    /// Nothing measured yet. `wake` is called when there is events.
    pub fn new(wake: Wake) -> Self {
        Self {
            form: TradeOffForm::default(),
            running: None,
            outcome: None,
            look: TradeOffLook::default(),
            job: Job::new("trade-off", wake),
        }
    }

    /// Returns true if nothing else of this program computes, which would distort the times.
    pub(super) fn is_quiet(&self, shared: &Shared) -> bool {
        !shared.phase.is_busy() && shared.working.iter().all(|&name| name == self.name())
    }

    /// Returns true if the form can be measured now.
    pub(super) fn can_measure(&self, shared: &Shared) -> bool {
        self.running.is_none() && self.is_quiet(shared) && self.plan(shared).is_ok()
    }

    /// Measures what the form says.
    pub(super) fn measure(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let Ok(plan) = self.plan(shared) else { return };
        effects.push(Effect::Settle(Matter::TradeOff));
        self.begin(plan.clone());
        worker::measure(&mut self.job, plan);
    }

    /// Ends the measurement; what is measured stays.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.end(Instant::now());
    }

    /// Returns the plan to be measured on the source of the Train view.
    ///
    /// # Errors
    /// If the recording is incomplete or the form is not a possible measurement, with what to do.
    pub fn plan(&self, shared: &Shared) -> Result<TradeOffPlan, String> {
        self.form.plan(&shared.setup()?).map_err(|error| error.to_string())
    }

    /// Makes room for the points of `plan`.
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

    /// The measurement has ended.
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

    /// The displayed level.
    pub fn shown(&self) -> Option<&TradeOffLevel> {
        self.outcome
            .as_ref()
            .and_then(|outcome| outcome.levels.get(self.look.level))
    }
}

/// A measurement as it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffPlan {
    /// Levels, one after the other: those of noise of a simulated array, or a single one of a recording.
    pub levels: Vec<PlannedLevel>,
    /// Numbers of hidden nodes of the networks.
    pub hidden: Vec<usize>,
}

/// Runs of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedLevel {
    /// Relative error of a reading, if it is simulated.
    pub noise: Option<f64>,
    /// Runs by which its decoders are fitted.
    pub runs: Vec<PlannedRun>,
}

/// A run by which decoders are fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedRun {
    /// Preset from which its settings were derived, if they were.
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

    /// Name of the source.
    pub fn source_name(&self) -> String {
        let run = self.levels.iter().flat_map(|level| &level.runs).next();
        run.map_or(String::new(), |run| run.setup.source_name())
    }

    /// Training methods of its networks on a recording; empty for an array, whose presets have theirs.
    pub fn methods(&self) -> Vec<Method> {
        let runs = self.levels.iter().flat_map(|level| &level.runs);
        let recorded = runs.filter(|run| run.setup.plan().is_some());
        recorded.map(|run| run.setup.settings().training.method).collect()
    }
}
