use super::{RunError, RunSettings};
use crate::{
    dataset::Dataset,
    network::{Inputs, MinMax, Shape},
    scene::{NoisySets, RelativeNoise},
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
        let inputs = Inputs::fit(
            settings.inputs,
            training.resistances_ohm.view(),
            unseen_noise(settings)?,
        )?;
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

/// The noise level assumed by whitening: the relative noise that readings have and the training set lacks, from all
/// sources of the scene, for nodes half way down. At most 1, where it is as large as the reading.
///
/// Whitening takes the error of each reading as independent: an error common to all of them hides less than this says.
pub(super) fn unseen_noise(settings: &RunSettings) -> Result<f64, RunError> {
    let RunSettings { sensor, scene, .. } = settings;
    if scene.noise.sets != NoisySets::Test {
        return Ok(0.0);
    }
    let rows = scene.rows.read(sensor.scale.rows())?;
    let noise = RelativeNoise::of(scene.noise, sensor, &rows, 0.5 * settings.stroke_mm())?;
    Ok(noise.total().min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{evaluation::Run, network::InputChoice, scene::Noise};

    fn inputs(noise: Noise) -> Inputs {
        let mut settings = RunSettings {
            samples: 40,
            inputs: InputChoice::BEST,
            ..RunSettings::default()
        };
        settings.scene.noise = Noise {
            sets: NoisySets::Test,
            ..noise
        };
        let (split, test) = Run::draw(&settings).unwrap();
        let task = Task::new(&settings, &split.training, None, &test).unwrap();
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
