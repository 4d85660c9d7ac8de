use serde::{Deserialize, Serialize};

use super::{PublishedErrors, RunError};
use crate::{
    dataset::{LARGEST_SAMPLES, Seed, Simulation},
    network::{InputChoice, LARGEST_HIDDEN},
    scene::{Noise, RowModel, Rows, Scene},
    text::Named,
    training::{Method, StoppingRules, TrainingSettings},
};

/// Settings of a run. The same settings (and the same sets, if measured) give the same network, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSettings {
    /// Source of the samples.
    pub source: Source,
    /// Input quantity and its scaling.
    pub inputs: InputChoice,
    /// Number of hidden nodes.
    pub hidden: usize,
    /// Number of starts: trainings from different random initialisations.
    pub starts: usize,
    /// How several starts become one network.
    #[serde(default, skip_serializing_if = "is_default")]
    pub combine: Combination,
    /// Weights with which a training begins.
    #[serde(default, skip_serializing_if = "is_default")]
    pub initialization: Initialization,
    /// Training method, its settings, and the stopping rules.
    pub training: TrainingSettings,
    /// Seed from which all randomness follows.
    pub seed: Seed,
}

/// Returns `true` for the default, which files leave out.
pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Source of the samples of a run.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one per run, and with a box the settings would not be `Copy`"
)]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Source {
    /// Samples drawn from a model of the sensor.
    Simulated(Simulation),
    /// Sets of measured samples; only the readings of the sensor are known.
    Measured {
        /// One network shared by all row-wires or one per row-wire; without row-wires the two are the same.
        rows: RowModel,
    },
}

impl From<Simulation> for Source {
    fn from(simulation: Simulation) -> Self {
        Self::Simulated(simulation)
    }
}

impl Source {
    /// Returns the row model: one network shared by all row-wires, or one per row-wire.
    pub fn row_model(&self) -> RowModel {
        match self {
            Self::Simulated(simulation) => simulation.scene.rows.model(),
            Self::Measured { rows } => *rows,
        }
    }
}

/// How several starts become the network that a run answers with.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, strum::Display, strum::IntoStaticStr,
)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case")]
pub enum Combination {
    /// The network of the start with the lowest validation error, or training error if nothing is held out.
    #[default]
    Best,
    /// A committee: the mean of the answers of all starts. Starts share their scalings, so that the mean is exactly one
    /// network with the hidden nodes of all, [`Mlp::mean`](crate::network::Mlp::mean). Its error is never larger than
    /// the mean of their errors (Krogh and Vedelsby 1995).
    Mean,
}

impl Named for Combination {
    const WHAT: &'static str = "a combination of starts";
    const ALL: &'static [Self] = &[Self::Best, Self::Mean];
}

/// Weights with which a training begins.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, strum::Display, strum::IntoStaticStr,
)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case")]
pub enum Initialization {
    /// Random weights ([Nguyen and Widrow](crate::network::nguyen_widrow)).
    #[default]
    Random,
    /// Ridge regression: one hidden node for each of its principal directions, in the linear range of tanh; random weights
    /// elsewhere.
    Ridge,
}

impl Named for Initialization {
    const WHAT: &'static str = "an initialisation";
    const ALL: &'static [Self] = &[Self::Random, Self::Ridge];
}

/// Maximum number of starts in a run: enough for the distribution of its results, and limited for memory.
pub const MAX_STARTS: usize = 100;

impl Default for RunSettings {
    /// Returns the paper's main experiment: 10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples.
    fn default() -> Self {
        Simulation::default().into()
    }
}

impl From<Simulation> for RunSettings {
    /// Returns the paper's settings for samples of this simulation.
    fn from(simulation: Simulation) -> Self {
        Self::of(simulation.into(), InputChoice::PAPER)
    }
}

impl RunSettings {
    /// Returns the settings for measured samples: raw readings scaled to [−1, 1], and 300 epochs of Bayesian
    /// regularisation for [recordings](Method::recorded_regularization) with nothing held out.
    ///
    /// Recordings are short, noisy, and vary over time, so a validation set of consecutive samples costs samples and
    /// can end the training by chance. With Levenberg-Marquardt, stopped on the last fifth of a recording of forces,
    /// errors vary twofold with the seed; with Bayesian regularisation on the whole recording they do not. It estimates
    /// the noise of each target, and regularises each class of weights with its own strength: with one strength for
    /// all, it is worse than ridge regression on 20 samples. Selecting the best of several starts by training error has no benefit.
    pub fn measured(rows: RowModel) -> Self {
        let mut settings = Self::of(Source::Measured { rows }, InputChoice::MEASURED);
        settings.training.method = Method::recorded_regularization();
        settings.training.stopping = StoppingRules::recorded(&settings.training.method);
        settings
    }

    fn of(source: Source, inputs: InputChoice) -> Self {
        Self {
            source,
            inputs,
            hidden: 12,
            starts: 1,
            combine: Combination::Best,
            initialization: Initialization::Random,
            training: TrainingSettings::default(),
            seed: Seed::default(),
        }
    }

    /// Returns the simulation from which the samples are drawn; `None` for a recording.
    pub fn simulation(&self) -> Option<&Simulation> {
        match &self.source {
            Source::Simulated(simulation) => Some(simulation),
            Source::Measured { .. } => None,
        }
    }

    /// As [`Self::simulation`], to be changed.
    pub fn simulation_mut(&mut self) -> Option<&mut Simulation> {
        match &mut self.source {
            Source::Simulated(simulation) => Some(simulation),
            Source::Measured { .. } => None,
        }
    }

    /// Returns the simulation from which samples are to be drawn.
    ///
    /// # Errors
    /// [`RunError::NotDrawn`] for a recording.
    pub fn drawn(&self) -> Result<&Simulation, RunError> {
        self.simulation().ok_or(RunError::NotDrawn)
    }

    /// Checks the numbers of hidden nodes, starts, and samples to be drawn; the other parts are checked where they are
    /// used.
    ///
    /// # Errors
    /// The first number out of range.
    pub fn check_counts(&self) -> Result<(), RunError> {
        RunError::check_count("hidden nodes", self.hidden, 1..=LARGEST_HIDDEN)?;
        RunError::check_count("starts", self.starts, 1..=MAX_STARTS)?;
        let of_all = "hidden nodes of all starts together";
        RunError::check_count(of_all, self.network_hidden(), 1..=LARGEST_HIDDEN)?;
        let Some(simulation) = self.simulation() else {
            return Ok(());
        };
        RunError::check_count("training samples", simulation.samples, 1..=LARGEST_SAMPLES)?;
        RunError::check_count("validation samples", simulation.validation_samples, 0..=LARGEST_SAMPLES)?;
        RunError::check_count("test samples", simulation.test_samples, 1..=LARGEST_SAMPLES)
    }

    /// Number of hidden nodes of the network that a run answers with: those of all starts if their mean is kept.
    pub fn network_hidden(&self) -> usize {
        match self.combine {
            Combination::Best => self.hidden,
            Combination::Mean => self.hidden.saturating_mul(self.starts),
        }
    }

    /// Default share of the training samples of a recording held out for validation: a fifth, or none if the method
    /// [needs none](Method::needs_validation).
    pub fn validation_fraction(&self) -> f64 {
        if self.training.method.needs_validation() {
            0.2
        } else {
            0.0
        }
    }

    /// Changes the method. On a recording, Bayesian regularisation with its usual settings gets [those for
    /// recordings](Method::recorded_regularization), and the [default rules](StoppingRules::recorded) of the present
    /// method become those of the new one.
    pub fn choose_method(&mut self, method: Method) {
        let before = std::mem::replace(&mut self.training.method, method);
        if self.simulation().is_some() {
            return;
        }
        if method == Method::bayesian_regularization() {
            self.training.method = Method::recorded_regularization();
        }
        let (usual, then) = (StoppingRules::recorded(&before), StoppingRules::recorded(&method));
        let rules = &mut self.training.stopping;
        if rules.epochs == usual.epochs {
            rules.epochs = then.epochs;
        }
        if rules.max_fail == usual.max_fail {
            rules.max_fail = then.max_fail;
        }
    }

    /// Returns the errors that the paper reports for this configuration, if there are any.
    pub fn published(&self) -> Option<PublishedErrors> {
        self.published_by(false)
    }

    /// Returns the errors that the paper reports for this configuration, tested by cross-validation or on a test set.
    pub(super) fn published_by(&self, cross_validation: bool) -> Option<PublishedErrors> {
        let simulation = self.simulation()?;
        let is_papers = simulation.scene == Scene::default() && self.inputs == InputChoice::PAPER;
        let is_papers = is_papers && matches!(self.training.method, Method::LevenbergMarquardt(_));
        let (array, samples) = (simulation.sensor.scale, simulation.samples);
        PublishedErrors::of(array, self.hidden, samples, cross_validation).filter(|_| is_papers)
    }
}

/// Preset settings of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Preset {
    /// As in the paper: one network for all rows, resistances scaled to [−1, 1].
    #[default]
    Paper,
    /// Best settings found in experiments: known rows, whitened conductances, more samples, and later early stopping.
    Best,
}

impl Preset {
    /// All presets, in the order offered to the user.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Best];

    /// Returns the settings of the preset, without noise.
    pub fn settings(self) -> RunSettings {
        self.settings_in(Noise::default())
    }

    /// Returns the settings of the preset for readings with `noise`. Accuracy then depends on the number of samples,
    /// and few epochs are enough.
    pub fn settings_in(self, noise: Noise) -> RunSettings {
        let mut settings = RunSettings::from(self.simulation_in(noise));
        if self == Self::Best {
            settings.inputs = InputChoice::BEST;
            settings.training.stopping = StoppingRules {
                epochs: if noise.is_none() { 1000 } else { 100 },
                max_fail: 30,
                min_gradient: 0.0,
                ..StoppingRules::default()
            };
        }
        settings
    }

    /// Returns the sensor, the scene and the numbers of samples of [`Self::settings_in`].
    pub fn simulation_in(self, noise: Noise) -> Simulation {
        let mut simulation = Simulation::default();
        simulation.scene.noise = noise;
        if self == Self::Best {
            simulation.scene.rows = Rows::Known;
            let (samples, validation) = if noise.is_none() { (5000, 1000) } else { (50_000, 5000) };
            (simulation.samples, simulation.validation_samples) = (samples, validation);
        }
        simulation
    }
}

impl Named for Preset {
    const WHAT: &'static str = "a preset";
    const ALL: &'static [Self] = &Self::ALL;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_chosen_for_a_recording_brings_its_settings_and_rules_unless_the_user_set_others() {
        let measured = || RunSettings::measured(RowModel::Shared);
        let scg = Method::scaled_conjugate_gradient(0.0);
        let mut settings = measured();
        settings.choose_method(scg);
        let rules = settings.training.stopping;
        assert_eq!((rules.epochs, rules.max_fail), (2000, 100));
        settings.choose_method(Method::bayesian_regularization());
        assert_eq!(settings, measured());
        settings.training.stopping.epochs = 50;
        settings.choose_method(scg);
        let rules = settings.training.stopping;
        assert_eq!((rules.epochs, rules.max_fail), (50, 100));
        let mut simulated = RunSettings::default();
        simulated.choose_method(scg);
        assert_eq!(simulated.training.stopping, StoppingRules::default());
    }
}
