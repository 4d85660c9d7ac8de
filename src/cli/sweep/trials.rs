use std::{collections::HashMap, path::Path};

use super::{
    specification::Specification,
    train_options::{TrainOptions, canonical, in_order},
};
use crate::{
    cli::{failure::Failure, specification_error::SpecificationError, training_arguments::TrainingArguments},
    decoupling::DecoderKind,
    evaluation::{SimulatedSettings, Workload},
    export::{PlanAxis, SweepPlan, Trial, TrialId, TrialOptions},
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
        let decoders = in_order(&arguments.scene.decoders());
        let options = canonical(&settings, &decoders);
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
