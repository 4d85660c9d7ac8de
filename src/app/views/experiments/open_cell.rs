use super::Outcome;
use crate::app::{
    shared::{State, View},
    window::Action,
};

/// Takes a cell to the Train view: its settings with the seed of its median trial, and the network of that trial. One
/// that was not kept, as none is of a cross-validation, is trained there.
pub fn open_cell(state: &State, outcome: &Outcome, cell: usize) -> Vec<Action> {
    let cell = outcome.results.cells.get(cell).filter(|_| !state.phase.is_busy());
    let Some(cell) = cell else { return Vec::new() };
    let mut settings = cell.cell.settings;
    let mut actions = Vec::new();
    match cell.median_trial() {
        Some(trial) => {
            settings.seed = trial.seed;
            if trial.states.is_empty() {
                actions.extend([Action::Configure(Box::new(settings)), Action::Train]);
            } else {
                actions.push(Action::TakeUp(Box::new(settings), trial.states.clone()));
            }
        }
        None => actions.push(Action::Configure(Box::new(settings))),
    }
    actions.push(Action::ShowView(View::Train));
    actions
}
