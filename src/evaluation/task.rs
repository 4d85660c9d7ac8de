use super::{RunError, RunSettings};
use crate::{
    dataset::Dataset,
    network::{Inputs, MinMax, Shape},
    scene::NoisySets,
    training::{Examples, Problem},
};

/// What a network of the run is to learn: of one row-wire, or of all.
pub(super) struct Task {
    pub(super) problem: Problem,
    pub(super) shape: Shape,
    pub(super) scaling: (Inputs, MinMax),
}

impl Task {
    /// From the sets, unscaled.
    pub(super) fn new(
        settings: &RunSettings,
        training: &Dataset,
        validation: Option<&Dataset>,
        test: &Dataset,
    ) -> Result<Self, RunError> {
        let inputs = Inputs::fit(settings.inputs, training.resistances_ohm.view(), unseen_noise(settings))?;
        let outputs = MinMax::fit(training.coordinates_mm.view())?;
        let examples = |set: &Dataset| {
            let scaled = inputs.of(set.resistances_ohm.view());
            Examples::new(scaled.view(), outputs.scale(set.coordinates_mm.view()).view())
        };
        let problem = Problem {
            training: examples(training),
            validation: validation.map(examples),
            test: Some(examples(test)),
        };
        let shape = Shape {
            inputs: problem.training.inputs(),
            hidden: settings.hidden,
            outputs: problem.training.outputs(),
        };
        Ok(Self {
            problem,
            shape,
            scaling: (inputs, outputs),
        })
    }
}

/// The relative noise that readings have and the training set lacks, with which whitening reckons.
pub(super) fn unseen_noise(settings: &RunSettings) -> f64 {
    let noise = settings.scene.noise;
    if noise.sets == NoisySets::Test {
        noise.relative
    } else {
        0.0
    }
}
