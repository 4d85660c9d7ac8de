use std::time::{Duration, Instant};

use super::{
    TradeForm, TradeFormError, TradePlan,
    worker::{self, TradeEvent},
};
use crate::{
    app::{
        job::{Job, Wake},
        shared::{Effect, Shared, View as _},
    },
    evaluation::{SimulatedSettings, TradeLevel, TradeLimits, TradePoint},
};

/// The Trade-off view.
#[derive(Debug)]
pub struct TradeOffView {
    /// What is to be measured.
    pub form: TradeForm,
    /// What runs.
    pub running: Option<TradeRunning>,
    /// What is measured.
    pub outcome: Option<TradeOutcome>,
    /// How it is looked at.
    pub look: TradeLook,
    pub(super) job: Job<TradeEvent>,
}

/// How a measurement is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TradeLook {
    /// The level of noise on show.
    pub level: usize,
    /// The point marked in charts and table, by its place in the level on show.
    pub marked: Option<usize>,
    /// The limits of the two questions.
    pub limits: TradeLimits,
}

/// A measurement under way.
#[derive(Clone, Copy, Debug)]
pub struct TradeRunning {
    /// When it began.
    pub begun: Instant,
}

/// How a measurement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TradeEnding {
    /// Every point is there.
    Complete,
    /// By the user, or by an accident that was told.
    Cut,
}

/// What is measured.
#[derive(Clone, Debug)]
pub struct TradeOutcome {
    /// What was asked for.
    pub plan: TradePlan,
    /// One for each level of noise.
    pub levels: Vec<TradeLevel>,
    /// How it ended, once it has.
    pub ending: Option<TradeEnding>,
    /// How long it took, once it has ended.
    pub took: Option<Duration>,
}

impl TradeOutcome {
    /// Points measured and points asked for.
    pub fn points(&self) -> (usize, usize) {
        let done = self.levels.iter().map(|level| level.points.len()).sum();
        (done, self.plan.points())
    }
}

impl TradeOffView {
    /// Nothing measured yet. `wake` is called when there is news.
    pub fn new(wake: Wake) -> Self {
        Self {
            form: TradeForm::default(),
            running: None,
            outcome: None,
            look: TradeLook::default(),
            job: Job::new("trade-off", wake),
        }
    }

    /// Whether nothing else of this program computes, which would disturb the times.
    pub(super) fn is_quiet(&self, shared: &Shared) -> bool {
        !shared.phase.is_busy() && shared.working.iter().all(|&name| name == self.name())
    }

    /// Whether the form can be measured now.
    pub(super) fn can_measure(&self, shared: &Shared) -> bool {
        self.running.is_none() && self.is_quiet(shared) && self.plan(&shared.draft).is_ok()
    }

    /// Measures what the form says.
    pub(super) fn measure(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let Ok(plan) = self.plan(&shared.draft) else { return };
        effects.push(Effect::DismissNotice);
        self.begin(plan.clone());
        worker::measure(&mut self.job, plan);
    }

    /// Ends the measurement; what is measured stays.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.end(Instant::now());
    }

    /// What would be measured in the scene of these settings, or why nothing can be.
    ///
    /// # Errors
    /// What is wrong with the form.
    pub fn plan(&self, base: &SimulatedSettings) -> Result<TradePlan, TradeFormError> {
        self.form.plan(base)
    }

    /// Makes room for the points of `plan`.
    fn begin(&mut self, plan: TradePlan) {
        let level = |&noise: &f64| TradeLevel {
            noise,
            points: Vec::new(),
        };
        self.look.level = self.look.level.min(plan.noises.len() - 1);
        self.look.marked = None;
        self.running = Some(TradeRunning { begun: Instant::now() });
        self.outcome = Some(TradeOutcome {
            levels: plan.noises.iter().map(level).collect(),
            plan,
            ending: None,
            took: None,
        });
    }

    /// Adds a point to a level.
    pub fn record(&mut self, level: usize, point: TradePoint) {
        let level = self.outcome.as_mut().and_then(|outcome| outcome.levels.get_mut(level));
        if let Some(level) = level {
            level.points.push(point);
        }
    }

    /// The measurement has ended.
    pub fn end(&mut self, at: Instant) {
        let Some(running) = self.running.take() else { return };
        if let Some(outcome) = &mut self.outcome {
            let (done, all) = outcome.points();
            outcome.took = Some(at - running.begun);
            outcome.ending = Some(if done == all {
                TradeEnding::Complete
            } else {
                TradeEnding::Cut
            });
        }
    }

    /// The level on show.
    pub fn shown(&self) -> Option<&TradeLevel> {
        self.outcome
            .as_ref()
            .and_then(|outcome| outcome.levels.get(self.look.level))
    }
}
