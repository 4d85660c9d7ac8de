//! List of training methods with their settings and states, and the interface that each method implements.
//!
//! To add a method, implement [`Algorithm`] in the file of its family or in a new one, add one entry to the list below,
//! and export its settings in `mod.rs`.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{
    AdaptiveDescentSettings, Damping, Evaluation, Examples, GradientDescentSettings, MomentumSettings,
    RegularizationSettings, ResilientSettings, ScaledConjugateGradientSettings, Setting, SettingError,
    StepMomentumSettings, StopReason,
    bayesian_regularization::{BayesianRegularization, BayesianState},
    gradient_descent::{
        AdaptiveDescent, AdaptiveState, GradientDescent, Momentum, Resilient, ResilientState, StepMomentum,
    },
    levenberg_marquardt::{DampedState, LevenbergMarquardt},
    scaled_conjugate_gradient::{ConjugateState, ScaledConjugateGradient},
    setting::Settings,
};
use crate::{
    network::{Mlp, Shape},
    sensor::short,
};

/// Defines [`Method`], [`MethodState`] and [`Running`] from the list of methods: the name of each method's
/// [`Algorithm`], its settings and, unless it has none, its state.
macro_rules! methods {
    ($($(#[doc = $doc:literal])* $name:ident($Settings:ty) $(with $state:ident: $State:ty)?,)*) => {
        /// A training method with its settings.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Method {
            $($(#[doc = $doc])* $name($Settings),)*
        }

        /// State that a method carries from epoch to epoch in addition to the weights. A training resumed from it gives
        /// bit-identical results.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum MethodState {
            $(#[doc = concat!("State of [`Method::", stringify!($name), "`].")] $name $(($State))?,)*
        }

        /// Running method.
        pub(super) enum Running {
            $($name(Box<$name>),)*
        }

        impl Method {
            /// Returns every method with its defaults, in the order offered to the user.
            pub fn all() -> [Self; [$(stringify!($name)),*].len()] {
                [$(Self::$name($name::default_settings())),*]
            }

            fn check_together(&self) -> Result<(), SettingError> {
                match self {
                    $(Self::$name(settings) => $name::check(settings),)*
                }
            }

            fn details(&self) -> Description {
                match self {
                    $(Self::$name(_) => $name::DESCRIPTION,)*
                }
            }

            /// Returns the settings of this method, for display and editing.
            pub fn settings(&mut self) -> Vec<Setting<'_>> {
                match self {
                    $(Self::$name(settings) => settings.list($name::default_settings()),)*
                }
            }

            /// Approximate memory in bytes of the method's equations for a network of this shape and this many samples.
            pub fn equations_bytes(&self, shape: Shape, samples: usize) -> usize {
                match self {
                    $(Self::$name(_) => $name::equations_bytes(shape, samples),)*
                }
            }

            /// Approximate number of multiplications per epoch for a network of this shape and this many samples.
            pub fn epoch_multiplications(&self, shape: Shape, samples: usize) -> f64 {
                match self {
                    $(Self::$name(_) => $name::epoch_multiplications(shape, samples),)*
                }
            }

            /// Starts the method from the weights of `mlp`.
            pub(super) fn start(&self, mlp: &Mlp, examples: &Examples) -> (Running, Evaluation) {
                match *self {
                    $(Self::$name(settings) => {
                        let (method, evaluation) = $name::new(settings, mlp, examples);
                        (Running::$name(Box::new(method)), evaluation)
                    })*
                }
            }
        }

        impl MethodState {
            fn vectors(&self) -> Vec<&[f64]> {
                match self {
                    $(Self::$name $(($state))? => methods!(@vectors $($state)?),)*
                }
            }
        }

        impl Running {
            /// Restores the state of an interrupted training; returns `false` if it is the state of another method.
            fn restore(&mut self, state: MethodState) -> bool {
                match (self, state) {
                    $((Self::$name(_method), MethodState::$name $(($state))?) => {
                        $(_method.restore($state);)?
                        true
                    })*
                    _ => false,
                }
            }

            /// See [`Algorithm::step`].
            pub(super) fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
                match self {
                    $(Self::$name(method) => method.step(mlp, examples),)*
                }
            }

            /// See [`Algorithm::parameter`].
            pub(super) fn parameter(&self) -> f64 {
                match self {
                    $(Self::$name(method) => method.parameter(),)*
                }
            }

            /// See [`Algorithm::effective_parameters`].
            pub(super) fn effective_parameters(&self) -> Option<f64> {
                match self {
                    $(Self::$name(method) => method.effective_parameters(),)*
                }
            }

            /// Returns the state for saving.
            pub(super) fn state(&self) -> MethodState {
                match self {
                    $(Self::$name(_method) => MethodState::$name $(({
                        let $state: $State = _method.state();
                        $state
                    }))?,)*
                }
            }
        }
    };
    (@vectors) => { Vec::new() };
    (@vectors $state:ident) => { $state.vectors() };
}

methods! {
    /// Damped Gauss-Newton steps (`trainlm`). The normal equations are factored or, where factoring costs more (for
    /// wide networks, depending on their shape and the number of samples), solved by conjugate gradients to a relative
    /// residual of 1e-8. After 500 iterations a residual of 1e-3 is accepted; with a larger one the step is rejected.
    LevenbergMarquardt(Damping) with state: DampedState,
    /// Levenberg-Marquardt that keeps the weights as small as the data permit (`trainbr`). The normal equations are
    /// always factored, since the method needs the trace of their inverse.
    BayesianRegularization(RegularizationSettings) with state: BayesianState,
    /// Møller's scaled conjugate gradient (`trainscg`).
    ScaledConjugateGradient(ScaledConjugateGradientSettings) with state: ConjugateState,
    /// Resilient back-propagation (`trainrp`).
    Resilient(ResilientSettings) with state: ResilientState,
    /// Gradient descent with momentum and an adaptive learning rate (`traingdx`).
    AdaptiveDescent(AdaptiveDescentSettings) with state: AdaptiveState,
    /// Gradient descent with momentum of steps (`traingdm`).
    StepMomentum(StepMomentumSettings) with state: Vec<f64>,
    /// Gradient descent with momentum of gradients, Eq. (11).
    Momentum(MomentumSettings) with state: Vec<f64>,
    /// Conventional back-propagation, Eq. (5)-(10) (`traingd`).
    GradientDescent(GradientDescentSettings),
}

impl Default for Method {
    fn default() -> Self {
        Self::LevenbergMarquardt(Damping::default())
    }
}

impl Method {
    /// Returns Bayesian regularisation with its defaults.
    pub fn bayesian_regularization() -> Self {
        Self::BayesianRegularization(BayesianRegularization::default_settings())
    }

    /// Returns Bayesian regularisation with the settings for recordings.
    pub fn recorded_regularization() -> Self {
        Self::BayesianRegularization(RegularizationSettings::recorded())
    }

    /// Returns `true` for a method whose steps follow gradients: it needs many short epochs, and its validation error
    /// does not fall in every one of them.
    pub fn follows_gradients(&self) -> bool {
        match self {
            Self::LevenbergMarquardt(_) | Self::BayesianRegularization(_) => false,
            Self::ScaledConjugateGradient(_)
            | Self::Resilient(_)
            | Self::AdaptiveDescent(_)
            | Self::StepMomentum(_)
            | Self::Momentum(_)
            | Self::GradientDescent(_) => true,
        }
    }

    /// Returns `false` for Bayesian regularisation, which balances the fit against the size of the weights by itself:
    /// samples held out for validation are better used for training.
    pub fn needs_validation(&self) -> bool {
        !matches!(self, Self::BayesianRegularization(_))
    }

    /// Short name for the terminal and tables.
    pub fn short_name(&self) -> &'static str {
        self.details().short_name
    }

    /// Full name.
    pub fn name(&self) -> &'static str {
        self.details().name
    }

    /// Description of the method in one sentence.
    pub fn description(&self) -> &'static str {
        self.details().summary
    }

    /// Name of the value recorded as [`super::EpochRecord::parameter`].
    pub fn parameter_name(&self) -> &'static str {
        self.details().parameter_name
    }

    /// Checks that the settings are in range and consistent.
    ///
    /// # Errors
    /// The first setting out of range, or two that contradict each other.
    pub fn check(&self) -> Result<(), SettingError> {
        let mut copy = *self;
        copy.settings().iter().try_for_each(Setting::check)?;
        self.check_together()
    }

    /// Returns advice for a training of this method that diverged or did not lower the error: resetting the settings
    /// that differ from their defaults, and what else may help.
    pub fn remedy(&self) -> String {
        let mut copy = *self;
        let changed = copy
            .settings()
            .into_iter()
            .filter(|setting| *setting.value != setting.default);
        let changed: Vec<String> = changed
            .map(|setting| {
                let Setting {
                    name, default, value, ..
                } = setting;
                format!("{name} to {} (now {})", short(default), short(*value))
            })
            .collect();
        if changed.is_empty() {
            return self.details().remedy.to_owned();
        }
        format!("reset {}; or {}", changed.join(", "), self.details().remedy)
    }

    /// Resumes the method from the state of an interrupted training; `None` if `state` belongs to another method.
    pub(super) fn resume(&self, state: MethodState, mlp: &Mlp, examples: &Examples) -> Option<Running> {
        let (mut running, _) = self.start(mlp, examples);
        running.restore(state).then_some(running)
    }
}

impl MethodState {
    /// Returns `true` if the state has finite values for this many weights.
    pub(super) fn fits(&self, weights: usize) -> bool {
        let fits = |vector: &&[f64]| vector.len() == weights && vector.iter().all(|value| value.is_finite());
        self.vectors().iter().all(fits)
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Training method running on one network.
pub(super) trait Algorithm: Sized + Send + Sync {
    /// Settings, chosen before training.
    type Settings: Settings;
    /// State carried from epoch to epoch in addition to the weights.
    type State;

    /// Name and description for menus, tables and the terminal.
    const DESCRIPTION: Description;

    /// Returns the field's usual settings.
    fn default_settings() -> Self::Settings {
        Self::Settings::default()
    }

    /// Checks that settings, each in its own range, are consistent.
    ///
    /// # Errors
    /// If two settings contradict each other.
    fn check(_settings: &Self::Settings) -> Result<(), SettingError> {
        Ok(())
    }

    /// Approximate memory in bytes of the method's equations for a network of this shape and this many samples.
    fn equations_bytes(_shape: Shape, _samples: usize) -> usize {
        0
    }

    /// Approximate number of multiplications per epoch: one run of the network over the samples and the gradient.
    fn epoch_multiplications(shape: Shape, samples: usize) -> f64 {
        3.0 * samples as f64 * shape.weights() as f64
    }

    /// Starts from the weights of `mlp`.
    fn new(settings: Self::Settings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation);

    /// Restores the state of an interrupted training.
    fn restore(&mut self, state: Self::State);

    /// Moves `mlp` by one epoch.
    ///
    /// # Errors
    /// The reason why there is no further epoch; the weights of `mlp` are then unspecified.
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason>;

    /// Value recorded as [`super::EpochRecord::parameter`].
    fn parameter(&self) -> f64;

    /// Number of weights that the data determine, for a method that estimates it.
    fn effective_parameters(&self) -> Option<f64> {
        None
    }

    /// Returns the state for saving.
    fn state(&self) -> Self::State;
}

/// Name and description of a method.
pub(super) struct Description {
    /// Name in the terminal and in tables.
    pub(super) short_name: &'static str,
    pub(super) name: &'static str,
    /// Description in one sentence.
    pub(super) summary: &'static str,
    /// Name of [`Algorithm::parameter`].
    pub(super) parameter_name: &'static str,
    /// Advice for a training that diverged or did not lower the error, in the imperative.
    pub(super) remedy: &'static str,
}

/// State of a method, as read from a file.
pub(super) trait Checked {
    /// Vectors with one entry for each weight.
    fn vectors(&self) -> Vec<&[f64]>;
}

impl Checked for Vec<f64> {
    fn vectors(&self) -> Vec<&[f64]> {
        vec![self]
    }
}

/// Sets `candidate` to the weights of `mlp` plus `step`; weights beyond the end of `step` are those of `mlp`.
pub(super) fn add_step(candidate: &mut Mlp, mlp: &Mlp, step: &[f64]) {
    let candidate = candidate.weights_mut();
    candidate.copy_from_slice(mlp.weights());
    for (weight, step) in candidate.iter_mut().zip(step) {
        *weight += step;
    }
}
