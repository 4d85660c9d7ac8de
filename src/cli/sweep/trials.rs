use std::{collections::HashMap, path::Path};

use super::{specification::Specification, train_options::TrainOptions};
use crate::{
    cli::{failure::Failure, specification_error::SpecificationError, training_arguments::TrainingArguments},
    decoupling::DecoderKind,
    evaluation::{SimulatedSettings, Workload},
    export::{PlanAxis, SweepPlan, Trial, TrialId, TrialOptions, decoders_in_order, train_options},
};

/// All trials of a specification, each of which `train` accepts and none of which is there twice.
pub(super) struct Trials {
    specification: Specification,
    plan: SweepPlan,
}

/// A trial to be trained.
pub(super) struct PlannedTrial {
    pub(super) id: TrialId,
    pub(super) settings: SimulatedSettings,
    pub(super) decoders: Vec<DecoderKind>,
    pub(super) options: TrialOptions,
}

impl Trials {
    /// Reads the specification at `path`.
    pub(super) fn read(path: &Path) -> Result<Self, SpecificationError> {
        let mut train = TrainOptions::new();
        let specification = Specification::read(path, &mut train)?;
        let axes = specification.axes.iter().map(|axis| PlanAxis {
            option: axis.option.clone(),
            values: axis.values.iter().map(|value| value.value.clone()).collect(),
        });
        let mut trials = Self {
            plan: SweepPlan {
                axes: axes.collect(),
                trials: Vec::new(),
            },
            specification,
        };
        let mut positions = HashMap::new();
        for position in 0..trials.specification.count()? {
            let trial = trials.parsed(position, &mut train);
            let trial = trial.map_err(|failure| trials.error(position, failure.to_string()))?;
            if let Some(first) = positions.insert(trial.id, position) {
                let first = trials.describe(first);
                let message = format!("the same options as {first}; leave one of the values out");
                return Err(trials.error(position, message));
            }
            trials.plan.trials.push(trial.id);
        }
        Ok(trials)
    }

    fn parsed(&self, position: usize, train: &mut TrainOptions) -> Result<PlannedTrial, Failure> {
        let words = self.specification.words_at(position);
        let arguments: TrainingArguments = train.parse(words).map_err(Failure::Arguments)?;
        let settings = arguments.settings()?;
        // The array has the rows of the scene.
        Workload::of(&settings)?;
        let decoders = decoders_in_order(&arguments.scene.decoders());
        let options = train_options(&settings, &decoders);
        Ok(PlannedTrial {
            id: Trial::id_of(&options),
            settings,
            decoders,
            options,
        })
    }

    /// The trial at `position`.
    pub(super) fn get(&self, position: usize, train: &mut TrainOptions) -> Result<PlannedTrial, SpecificationError> {
        let trial = self.parsed(position, train);
        trial.map_err(|failure| self.error(position, failure.to_string()))
    }

    pub(super) fn count(&self) -> usize {
        self.plan.trials.len()
    }

    pub(super) fn plan(&self) -> &SweepPlan {
        &self.plan
    }

    /// Number of a trial, from 1, and what is special about it.
    pub(super) fn describe(&self, position: usize) -> String {
        format!("trial {} ({})", position + 1, self.plan.describe(position))
    }

    fn error(&self, position: usize, message: String) -> SpecificationError {
        self.specification.error(self.describe(position), message)
    }
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, fs};

    use super::*;
    use crate::{
        dataset::Seed,
        evaluation::experiments::{Axis, Experiment, PaperTable},
        export::sweep_specification,
        scene::Noise,
        training::Method,
    };

    /// The trials of a specification that the window writes are those that the window runs.
    #[test]
    fn an_experiment_of_the_window_is_specified_trial_by_trial() {
        let mut template = PaperTable::HiddenNodes.experiment();
        template.base.source.scene.noise = Noise::relative(1e-3);
        template.base.seed = Seed(7);
        let experiments = [
            (Axis::Hidden(vec![3, 5]), Some(Axis::Samples(vec![40, 60]))),
            (
                Axis::Method(Method::all()[..3].to_vec()),
                Some(Axis::Epochs(vec![2, 3])),
            ),
            (Axis::Array(vec!["4x3_2x6".parse().unwrap()]), None),
            (Axis::Seed(vec![Seed(1), Seed(u64::MAX)]), None),
        ];
        for (axis, second_axis) in experiments {
            let experiment = Experiment {
                axis,
                second_axis,
                seeds: 2,
                ..template.clone()
            };
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("sweep.json");
            fs::write(&path, sweep_specification(&experiment).unwrap().to_string()).unwrap();
            let trials = Trials::read(&path).unwrap();
            let mut train = TrainOptions::new();
            let specified = (0..trials.count()).map(|position| trials.get(position, &mut train).unwrap().settings);
            let specified: Vec<_> = specified.collect();
            let run: Vec<_> = experiment
                .cells()
                .into_iter()
                .flat_map(|cell| {
                    let seeds = experiment.seeds_of(&cell.settings);
                    seeds.map(move |seed| SimulatedSettings { seed, ..cell.settings })
                })
                .collect();
            let texts = |settings: &[SimulatedSettings]| -> BTreeSet<String> {
                settings.iter().map(|settings| format!("{settings:?}")).collect()
            };
            assert_eq!(specified.len(), run.len());
            assert_eq!(texts(&specified), texts(&run), "{:?}", experiment.axis);
        }
    }

    #[test]
    fn experiments_that_the_terminal_cannot_sweep_say_why() {
        let folds = sweep_specification(&PaperTable::CrossValidation.experiment());
        assert!(folds.unwrap_err().to_string().contains("no cross-validation"));
        let mut squeezed = PaperTable::HiddenNodes.experiment();
        squeezed.base.source.scene.largest_compression = 0.3;
        let message = sweep_specification(&squeezed).unwrap_err().to_string();
        assert!(message.contains("the largest compression"), "{message}");
    }
}
