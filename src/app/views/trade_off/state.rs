use std::time::{Duration, Instant};

use super::{
    TradeOffForm, TradeOffFormError, TradeOffPlan,
    worker::{self, TradeOffEvent},
};
use crate::{
    app::{
        job::{Job, Wake},
        shared::{Effect, Matter, Shared, View as _},
    },
    evaluation::{SimulatedSettings, TradeOffLevel, TradeOffLimits, TradeOffPoint},
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

/// State of the display of a measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TradeOffLook {
    /// The level of noise on show.
    pub level: usize,
    /// The point marked in charts and table, by its place in the level on show.
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
    /// One for each level of noise.
    pub levels: Vec<TradeOffLevel>,
    /// Ending of the measurement, once it has ended.
    pub ending: Option<TradeOffEnding>,
    /// Time it took, once it has ended.
    pub took: Option<Duration>,
}

impl TradeOffOutcome {
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
        self.running.is_none() && self.is_quiet(shared) && self.plan(&shared.draft).is_ok()
    }

    /// Measures what the form says.
    pub(super) fn measure(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let Ok(plan) = self.plan(&shared.draft) else { return };
        effects.push(Effect::Settle(Matter::TradeOff));
        self.begin(plan.clone());
        worker::measure(&mut self.job, plan);
    }

    /// Ends the measurement; what is measured stays.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.end(Instant::now());
    }

    /// Returns the plan to be measured in the scene of these settings.
    ///
    /// # Errors
    /// If the form is not a possible measurement.
    pub fn plan(&self, base: &SimulatedSettings) -> Result<TradeOffPlan, TradeOffFormError> {
        self.form.plan(base)
    }

    /// Makes room for the points of `plan`.
    fn begin(&mut self, plan: TradeOffPlan) {
        let level = |&noise: &f64| TradeOffLevel {
            noise: Some(noise),
            points: Vec::new(),
        };
        self.look.level = self.look.level.min(plan.noises.len() - 1);
        self.look.marked = None;
        self.running = Some(TradeOffRunning { begun: Instant::now() });
        self.outcome = Some(TradeOffOutcome {
            levels: plan.noises.iter().map(level).collect(),
            plan,
            ending: None,
            took: None,
        });
    }

    /// Adds a point to a level.
    pub fn record(&mut self, level: usize, point: TradeOffPoint) {
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
                TradeOffEnding::Complete
            } else {
                TradeOffEnding::Cut
            });
        }
    }

    /// The level on show.
    pub fn shown(&self) -> Option<&TradeOffLevel> {
        self.outcome
            .as_ref()
            .and_then(|outcome| outcome.levels.get(self.look.level))
    }
}
