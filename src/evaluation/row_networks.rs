use rayon::prelude::*;

use super::RunError;
use crate::{
    dataset::{Dataset, Seed, Stream},
    network::{DecouplingNetwork, InputChoice, Inputs, MinMax, Mlp, Shape, nguyen_widrow},
    training::{Examples, Problem, Trainer, TrainingSettings},
};

/// How networks for known rows are trained: one small network for each row-wire, side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowTraining {
    /// How resistances become inputs.
    pub inputs: InputChoice,
    /// Relative noise that whitening reckons with beyond what the training set holds.
    pub unseen_noise: f64,
    /// Hidden nodes of each network.
    pub hidden: usize,
    /// Method, its settings, and when to stop.
    pub training: TrainingSettings,
    /// Of the random starts.
    pub seed: Seed,
}

/// Trains a network for each row-wire of `training`, on all threads; `validation`, of the same rows, chooses the best
/// weights and the end. The same bits on any number of threads.
///
/// # Errors
/// Samples that cannot be scaled, or a training that cannot begin.
pub fn train_row_networks(
    training: &Dataset,
    validation: Option<&Dataset>,
    how: &RowTraining,
) -> Result<Vec<DecouplingNetwork>, RunError> {
    let mut rng = how.seed.rng(Stream::Start);
    let mut prepared = Vec::new();
    for row in 0..training.rows() {
        let fitted = training.of_row(row);
        let inputs = Inputs::fit(how.inputs, fitted.resistances_ohm.view(), how.unseen_noise)?;
        let outputs = MinMax::fit(fitted.coordinates_mm.view())?;
        let shape = Shape {
            inputs: inputs.count(),
            hidden: how.hidden,
            outputs: outputs.varying().len(),
        };
        prepared.push((row, inputs, outputs, nguyen_widrow(shape, &mut rng)));
    }
    let train = |(row, inputs, outputs, start): (usize, Inputs, MinMax, Mlp)| {
        let examples = |set: &Dataset| {
            let set = set.of_row(row);
            Examples::new(
                inputs.of(set.resistances_ohm.view()).view(),
                outputs.scale(set.coordinates_mm.view()).view(),
            )
        };
        let problem = Problem {
            training: examples(training),
            validation: validation.map(examples),
            test: None,
        };
        let mut trainer = Trainer::new(start, problem, how.training)?;
        while trainer.step().is_none() {}
        Ok(DecouplingNetwork::new(inputs, trainer.best().clone(), outputs))
    };
    prepared.into_par_iter().map(train).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        decoupling::{CompiledNetworks, decode_set},
        evaluation::Errors,
        scene::Scene,
        sensor::SensorModel,
        training::StoppingRules,
    };

    #[test]
    fn knowing_the_row_makes_small_networks_exact() {
        let model = SensorModel::new("3x4_2x12".parse().unwrap());
        let draw =
            |stream, samples| Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(stream)).unwrap();
        let (training, test) = (draw(Stream::Training, 900), draw(Stream::Test, 60));
        let how = RowTraining {
            inputs: InputChoice::BEST,
            unseen_noise: 0.0,
            hidden: 6,
            training: TrainingSettings {
                stopping: StoppingRules {
                    epochs: 60,
                    ..StoppingRules::default()
                },
                ..TrainingSettings::default()
            },
            seed: Seed(0),
        };
        let networks = train_row_networks(&training, None, &how).unwrap();
        let decoded = decode_set(&mut CompiledNetworks::<f64>::each(&networks), &test).unwrap();
        let errors = Errors::measure(&test, &decoded, 1.0);
        assert!(errors.z_percent.unwrap() < 0.05, "{errors:?}");
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = one_thread
            .install(|| train_row_networks(&training, None, &how))
            .unwrap();
        assert_eq!(again, networks);
    }
}
