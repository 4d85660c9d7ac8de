//! The one place that changes the state of the Experiments view.

use std::{sync::Arc, time::Instant};

use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

use super::{ExperimentAction, ExperimentEvent, worker};
use crate::app::{
    files::Files,
    job::Job,
    shared::{Notice, State},
    window::Action,
};

/// Takes what the threads have to tell.
pub fn take_news(state: &mut State, job: &Job<ExperimentEvent>) {
    let mut finished = Vec::new();
    while let Some(event) = job.next_event() {
        match event {
            ExperimentEvent::Finished(trial) => finished.push(*trial),
            ExperimentEvent::Ended(result) => {
                state.experiments.record(std::mem::take(&mut finished));
                state.experiments.end(Instant::now());
                if let Err(reason) = result {
                    state.notice = Some(Notice::Failed(reason));
                }
            }
        }
    }
    if !finished.is_empty() {
        state.experiments.record(finished);
    }
}

/// Does what the user meant.
pub fn apply(action: ExperimentAction, state: &mut State, job: &mut Job<ExperimentEvent>, files: &mut Files) {
    let experiments = &mut state.experiments;
    match action {
        ExperimentAction::Choose(topic) => experiments.choose(topic),
        ExperimentAction::Edit(form) => experiments.edit(*form),
        ExperimentAction::Run => run(state, job),
        ExperimentAction::Cancel => {
            job.abandon();
            experiments.end(Instant::now());
        }
        ExperimentAction::Mark(cell) => experiments.marked = Some(cell),
        ExperimentAction::Sort(sort) => experiments.sort = sort,
        ExperimentAction::Save(topic, file, path) => {
            state.typed = state.saving.take();
            if let Some(outcome) = state.experiments.outcome_of(topic) {
                let results = Arc::clone(&outcome.results);
                files.write(path, move |path| file.write(topic, &results, path));
            }
        }
    }
}

fn run(state: &mut State, job: &mut Job<ExperimentEvent>) {
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
    state.notice = None;
    state.experiments.begin(experiment.clone());
    worker::run(job, experiment);
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
