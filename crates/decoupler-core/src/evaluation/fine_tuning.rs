use super::{RunError, run_sets::check_networks};
use crate::{
    dataset::{Dataset, PerRow, Split},
    job::Job,
    machine::MemoryBudget,
    network::{DecouplingNetwork, Networks},
    training::{ExampleSets, Examples, Trainer, TrainingSettings, check_width},
};

/// Continues the training of `networks` on other samples, such as frames of the real sensor after training on its
/// calibrated model. Scalings do not change. The weights with the lowest validation error
/// are returned, possibly the initial ones: with a validation set, fine-tuning cannot increase the validation error.
///
/// # Errors
/// If the samples do not have the channels, targets or rows of the networks, a setting is out of range, or the
/// networks are too wide for `memory`, or the job is cancelled.
pub fn fine_tune(
    networks: &Networks,
    split: &Split,
    training: TrainingSettings,
    memory: MemoryBudget,
    job: &Job<'_>,
) -> Result<Networks, RunError> {
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
        let problem = ExampleSets {
            training: examples(&split.training),
            validation: split.validation.as_ref().map(examples),
            test: None,
        };
        let (shape, samples) = (network.mlp().shape(), problem.training.samples());
        check_width(&training.method, shape, samples, 1, memory)?;
        let mut trainer = Trainer::new(network.mlp().clone(), problem, training)?;
        while trainer.step().is_none() {
            job.check()?;
        }
        tuned.push(DecouplingNetwork::new(
            network.inputs().clone(),
            trainer.best().clone(),
            network.outputs().clone(),
        ));
    }
    Ok(PerRow::each(tuned))
}
