use super::Outcome;
use crate::window::shared::{Effect, Shared};
use decoupler_files::import::{Plan, Setup};

/// Takes a cell to the Train view: its settings with the seed of its median trial, and the network of that trial. One
/// that was not kept, as none is of a cross-validation, is trained there.
pub fn open_cell(shared: &Shared, outcome: &Outcome, cell: usize, effects: &mut Vec<Effect>) {
    let cell = outcome.results.cells.get(cell).filter(|_| !shared.phase.is_busy());
    let Some(cell) = cell else { return };
    let mut settings = cell.cell.settings;
    let median = cell.median_trial();
    if let Some(trial) = median {
        settings.seed = trial.seed;
    }
    let plan = outcome.plan.clone().zip(cell.cell.division);
    let plan = plan.map(|(plan, division)| Plan { division, ..plan });
    let Some(setup) = Setup::of(settings, plan).map(Box::new) else {
        return;
    };
    match median {
        Some(trial) if !trial.states.is_empty() => effects.push(Effect::TakeUp(setup, trial.states.clone())),
        Some(_) => effects.extend([Effect::TakeSetup(setup), Effect::Train]),
        None => effects.push(Effect::TakeSetup(setup)),
    }
    effects.push(Effect::ShowTraining);
}
