use super::{RunError, RunSettings, Source};
use crate::{
    dataset::{Dataset, PerRow, Split},
    network::{Inputs, MinMax, Shape},
    scene::{NoisySets, RowModel},
    training::{Examples, Problem},
};

/// Training problem of one network, for one row-wire or for all.
pub(super) struct Task {
    pub(super) problem: Problem,
    pub(super) shape: Shape,
    pub(super) scaling: (Inputs, MinMax),
}

impl Task {
    /// Scales the sets into a training problem.
    pub(super) fn new(
        settings: &RunSettings,
        training: &Dataset,
        validation: Option<&Dataset>,
        test: &Dataset,
    ) -> Result<Self, RunError> {
        let inputs = Inputs::fit(settings.inputs, training.readings(), unseen_noise(&settings.source))?;
        let outputs = MinMax::fit(training.targets())?;
        let examples = |set: &Dataset| {
            let scaled = inputs.of(set.readings());
            Examples::new(scaled.view(), outputs.scale(set.targets()).view())
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

/// Returns the tasks of a run: one, or one per row-wire.
pub(super) fn tasks(settings: &RunSettings, split: &Split, test: &Dataset) -> Result<PerRow<Task>, RunError> {
    let Split { training, validation } = split;
    match settings.source.row_model() {
        RowModel::Shared => Ok(PerRow::shared(Task::new(
            settings,
            training,
            validation.as_ref(),
            test,
        )?)),
        RowModel::Each => {
            let of_row = |row| {
                let validation = validation.as_ref().map(|set| set.of_row(row));
                Task::new(settings, &training.of_row(row), validation.as_ref(), &test.of_row(row))
            };
            let tasks = (0..training.row_count()).map(of_row);
            Ok(PerRow::each(tasks.collect::<Result<_, _>>()?))
        }
    }
}

/// Relative noise that readings have and the training set lacks: the noise level assumed by whitening.
pub(super) fn unseen_noise(source: &Source) -> f64 {
    let Source::Simulated(simulation) = source else {
        return 0.0;
    };
    let noise = simulation.scene.noise;
    if noise.sets == NoisySets::Test {
        noise.relative
    } else {
        0.0
    }
}
