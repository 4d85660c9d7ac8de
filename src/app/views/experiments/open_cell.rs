use super::Outcome;
use crate::app::shared::{Effect, Shared};

/// Takes a cell to the Train view: its settings with the seed of its median trial, and the network of that trial. One
/// that was not kept, as none is of a cross-validation, is trained there.
pub fn open_cell(shared: &Shared, outcome: &Outcome, cell: usize, effects: &mut Vec<Effect>) {
    let cell = outcome.results.cells.get(cell).filter(|_| !shared.phase.is_busy());
    let Some(cell) = cell else { return };
    let mut settings = cell.cell.settings;
    match cell.median_trial() {
        Some(trial) => {
            settings.seed = trial.seed;
            if trial.states.is_empty() {
                effects.extend([Effect::Configure(Box::new(settings)), Effect::Train]);
            } else {
                effects.push(Effect::TakeUp(Box::new(settings.into()), trial.states.clone()));
            }
        }
        None => effects.push(Effect::Configure(Box::new(settings))),
    }
    effects.push(Effect::ShowTraining);
}
