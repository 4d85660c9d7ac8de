use super::{RunError, RunSettings, Simulation, Source};
use crate::{
    dataset::{Dataset, PerRow, Split},
    network::{Inputs, MinMax, Shape},
    scene::{NoiseSource, NoisySets, RowModel},
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
        let inputs = Inputs::fit(settings.inputs, training.readings(), unseen_noise(&settings.source)?)?;
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
                let (training, test) = (training.of_row(row), test.of_row(row));
                Task::new(settings, &training, validation.as_ref(), &test)
            };
            let tasks = (0..training.row_count()).map(of_row);
            Ok(PerRow::each(tasks.collect::<Result<_, _>>()?))
        }
    }
}

/// The noise that readings have and the training set lacks.
pub(super) fn unseen_noise(source: &Source) -> Result<NoiseSource, RunError> {
    match source {
        Source::Simulated(Simulation { sensor, scene, .. }) if scene.noise.sets == NoisySets::Test => {
            Ok(scene.noise.source(sensor)?)
        }
        _ => Ok(NoiseSource::default()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{evaluation::SimulatedSettings, network::InputChoice, scene::Noise};

    fn inputs(noise: Noise) -> Inputs {
        let mut settings = SimulatedSettings {
            inputs: InputChoice::BEST,
            ..SimulatedSettings::default()
        };
        settings.source.samples = 40;
        settings.source.scene.noise = Noise {
            sets: NoisySets::Test,
            ..noise
        };
        let (split, test) = settings.draw().unwrap();
        let task = Task::new(&settings.into(), &split.training, None, &test).unwrap();
        task.scaling.0
    }

    #[test]
    fn whitening_allows_for_every_kind_of_noise_that_the_training_set_lacks() {
        let clean = inputs(Noise::default());
        let noises = [
            Noise::relative(1e-2),
            Noise {
                additive_ohm: 1.0,
                ..Noise::default()
            },
            Noise {
                converter_bits: Some(6),
                ..Noise::default()
            },
            Noise {
                drift: 1e-2,
                ..Noise::default()
            },
        ];
        for noise in noises {
            let sum = |inputs: &Inputs| inputs.affine().1.iter().map(|value| value.abs()).sum::<f64>();
            assert!(sum(&inputs(noise)) < 0.9 * sum(&clean), "{noise:?}");
        }
    }
}
