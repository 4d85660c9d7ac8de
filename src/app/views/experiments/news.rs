//! The one place that changes the state of the Experiments view.

use std::{sync::Arc, time::Instant};

use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

use super::{ExperimentAction, ExperimentEvent, ExperimentWorker};
use crate::app::{
    shared::{Notice, State},
    window::Action,
};

/// Takes what the threads have to tell.
pub fn take_news(state: &mut State, worker: &ExperimentWorker) {
    let mut finished = Vec::new();
    let present = state.experiments.running.map(|running| running.number);
    while let Some(event) = worker.next_event() {
        match event {
            // Of one that was cancelled.
            ExperimentEvent::Finished(number, _) | ExperimentEvent::Ended(number, _) if Some(number) != present => {}
            ExperimentEvent::Finished(_, trial) => finished.push(*trial),
            ExperimentEvent::Ended(_, result) => {
                state.experiments.record(std::mem::take(&mut finished));
                state.experiments.end(Instant::now());
                if let Err(reason) = result {
                    state.notice = Some(Notice::Failed(reason));
                }
            }
            ExperimentEvent::Written(Ok(path)) => {
                state.typed = None;
                state.notice = Some(Notice::Done(format!("Saved {}", path.display())));
            }
            ExperimentEvent::Written(Err(reason)) => state.notice = Some(Notice::Failed(reason)),
        }
    }
    if !finished.is_empty() {
        state.experiments.record(finished);
    }
}

/// Does what the user meant.
pub fn apply(action: ExperimentAction, state: &mut State, worker: &mut ExperimentWorker) {
    let experiments = &mut state.experiments;
    match action {
        ExperimentAction::Choose(topic) => experiments.choose(topic),
        ExperimentAction::Edit(form) => experiments.edit(*form),
        ExperimentAction::Run => run(state, worker),
        ExperimentAction::Cancel => {
            worker.cancel();
            experiments.end(Instant::now());
        }
        ExperimentAction::Mark(cell) => experiments.marked = Some(cell),
        ExperimentAction::Sort(sort) => experiments.sort = sort,
        ExperimentAction::Save(topic, file, path) => {
            state.typed = state.saving.take();
            if let Some(outcome) = state.experiments.outcome_of(topic) {
                worker.write(topic, file, Arc::clone(&outcome.results), path);
            }
        }
    }
}

fn run(state: &mut State, worker: &mut ExperimentWorker) {
    if state.experiments.running.is_some() {
        return;
    }
    let experiment = match state.experiments.form().experiment() {
        Ok(experiment) => experiment,
        Err(error) => {
            state.notice = Some(Notice::Failed(error.to_string()));
            return;
        }
    };
    match worker.run(experiment.clone()) {
        Ok(number) => {
            state.notice = None;
            state.experiments.begin(experiment, number);
        }
        Err(error) => state.notice = Some(Notice::Failed(format!("No thread could be started: {error}"))),
    }
}

/// What the keys of this frame mean in this view.
pub fn pressed_shortcuts(ctx: &Context, state: &State) -> Vec<Action> {
    // The question for a path is to be answered first.
    if state.saving.is_some() {
        return Vec::new();
    }
    let experiments = &state.experiments;
    let pressed =
        |modifiers, key| ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)));
    let mut actions = Vec::new();
    if pressed(Modifiers::COMMAND, Key::Enter) && experiments.can_run() {
        actions.push(ExperimentAction::Run.into());
    }
    if pressed(Modifiers::COMMAND, Key::Period) && experiments.running.is_some() {
        actions.push(ExperimentAction::Cancel.into());
    }
    actions
}
