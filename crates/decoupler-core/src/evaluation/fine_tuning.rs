use super::{RunError, Simulation, sets::check_networks};
use crate::{
    dataset::{Dataset, PerRow, Split},
    network::{DecouplingNetwork, Networks},
    sensor::PressLimits,
    training::{Examples, Problem, Trainer, TrainingSettings},
};

/// Displacements for which a network of this simulated scene is made: samples of others are no presses, or ask for answers
/// that it was never trained to give.
pub fn press_limits(simulation: &Simulation) -> PressLimits {
    PressLimits {
        largest_depth_mm: simulation.stroke_mm(),
        largest_shift_mm: simulation.scene.movement.largest_shift_mm(),
    }
}

/// Continues the training of `networks` on other samples, such as the frames of the real sensor after a training on its
/// calibrated model; returns `None` if cancelled. Scalings stay as they are. The weights of the lowest validation error
/// are returned, which may be those given: with a validation set, fine-tuning cannot make it worse.
///
/// # Errors
/// If the samples do not have the channels, targets or rows of the networks, or a setting is out of range.
pub fn fine_tune(
    networks: &Networks,
    split: &Split,
    training: TrainingSettings,
    is_cancelled: &dyn Fn() -> bool,
) -> Result<Option<Networks>, RunError> {
    check_networks(networks, split)?;
    let mut tuned = Vec::with_capacity(networks.values().len());
    for (index, network) in networks.values().iter().enumerate() {
        let examples = |set: &Dataset| {
            let set = if networks.only().is_some() {
                set.clone()
            } else {
                set.of_row(index)
            };
            let inputs = network.inputs().of(set.readings());
            Examples::new(inputs.view(), network.outputs().scale(set.targets()).view())
        };
        let problem = Problem {
            training: examples(&split.training),
            validation: split.validation.as_ref().map(examples),
            test: None,
        };
        let mut trainer = Trainer::new(network.mlp().clone(), problem, training)?;
        while trainer.step().is_none() {
            if is_cancelled() {
                return Ok(None);
            }
        }
        tuned.push(DecouplingNetwork::new(
            network.inputs().clone(),
            trainer.best().clone(),
            network.outputs().clone(),
        ));
    }
    Ok(Some(PerRow::each(tuned)))
}
