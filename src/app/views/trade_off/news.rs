//! The one place that changes the state of the Trade-off view.

use std::time::Instant;

use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

use super::{TradeAction, TradeEvent, TradeState, worker};
use crate::{
    app::{
        files::Files,
        job::Job,
        shared::{Notice, State},
        window::Action,
    },
    evaluation::SimulatedSettings,
};

/// Takes what the threads have to tell.
pub fn take_news(state: &mut State, job: &Job<TradeEvent>) {
    while let Some(event) = job.next_event() {
        match event {
            TradeEvent::Measured(level, point) => state.trade.record(level, *point),
            TradeEvent::Ended(result) => {
                state.trade.end(Instant::now());
                if let Err(reason) = result {
                    state.notice = Some(Notice::Failed(reason));
                }
            }
        }
    }
}

/// Does what the user meant; returns the settings of the next training, if they are to change.
pub fn apply(
    action: TradeAction,
    state: &mut State,
    job: &mut Job<TradeEvent>,
    files: &mut Files,
) -> Option<SimulatedSettings> {
    let trade = &mut state.trade;
    match action {
        TradeAction::Edit(form) => trade.form = *form,
        TradeAction::Measure => measure(state, job),
        TradeAction::Cancel => {
            job.abandon();
            trade.end(Instant::now());
        }
        TradeAction::ShowLevel(level) => {
            trade.level = level;
            trade.marked = None;
        }
        TradeAction::Mark(point) => trade.marked = point,
        TradeAction::Load(point) => {
            trade.marked = Some(point);
            return settings_of(trade, point).filter(|_| !state.phase.is_busy());
        }
        TradeAction::SetLimits(limits) => trade.limits = limits,
        TradeAction::Save(file, path) => {
            state.typed = state.saving.take();
            let trade = &state.trade;
            if let Some(outcome) = &trade.outcome {
                let (levels, shown) = (outcome.levels.clone(), trade.level);
                files.write(path, move |path| file.write(&levels, shown, path));
            }
        }
    }
    None
}

fn settings_of(trade: &TradeState, point: usize) -> Option<SimulatedSettings> {
    Some(trade.shown()?.points.get(point)?.settings)
}

fn measure(state: &mut State, job: &mut Job<TradeEvent>) {
    if !can_measure(state) {
        return;
    }
    let plan = match state.trade.plan(&state.draft) {
        Ok(plan) => plan,
        Err(error) => {
            state.notice = Some(Notice::Failed(error.to_string()));
            return;
        }
    };
    state.notice = None;
    state.trade.begin(plan.clone());
    worker::measure(job, plan);
}

/// Whether nothing else of this program computes, which would disturb the times.
pub fn is_quiet(state: &State) -> bool {
    !state.phase.is_busy() && state.experiments.running.is_none()
}

/// Whether the form can be measured now.
pub fn can_measure(state: &State) -> bool {
    state.trade.running.is_none() && is_quiet(state) && state.trade.plan(&state.draft).is_ok()
}

/// What the keys of this frame mean in this view.
pub fn pressed_shortcuts(ctx: &Context, state: &State) -> Vec<Action> {
    // The question for a path is to be answered first.
    if state.saving.is_some() {
        return Vec::new();
    }
    let pressed =
        |modifiers, key| ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)));
    let mut actions = Vec::new();
    if pressed(Modifiers::COMMAND, Key::Enter) && can_measure(state) {
        actions.push(TradeAction::Measure.into());
    }
    if pressed(Modifiers::COMMAND, Key::Period) && state.trade.running.is_some() {
        actions.push(TradeAction::Cancel.into());
    }
    actions
}
