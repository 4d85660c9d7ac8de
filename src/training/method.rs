use std::fmt;

use serde::{Deserialize, Serialize};

use super::{
    Evaluation, Examples, LevenbergMarquardt, LevenbergMarquardtSettings, Momentum, MomentumSettings, Setting,
    SettingError, StopReason,
};
use crate::network::Mlp;

/// A training method with its settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Damped Gauss-Newton steps.
    LevenbergMarquardt(LevenbergMarquardtSettings),
    /// Gradient descent with momentum, Eq. (11).
    Momentum(MomentumSettings),
}

impl Default for Method {
    fn default() -> Self {
        Self::LevenbergMarquardt(LevenbergMarquardtSettings::default())
    }
}

impl Method {
    /// Every method with its defaults, in the order offered.
    pub fn all() -> [Self; 2] {
        [Self::default(), Self::Momentum(MomentumSettings::default())]
    }

    /// The word for it in the terminal and in tables.
    pub fn short_name(&self) -> &'static str {
        match self {
            Self::LevenbergMarquardt(_) => "lm",
            Self::Momentum(_) => "gdm",
        }
    }

    /// What [`super::EpochRecord::parameter`] is.
    pub fn parameter_name(&self) -> &'static str {
        match self {
            Self::LevenbergMarquardt(_) => "mu",
            Self::Momentum(_) => "learning rate",
        }
    }

    /// The settings that this method has, to be shown and changed.
    pub fn settings(&mut self) -> Vec<Setting<'_>> {
        match self {
            Self::LevenbergMarquardt(settings) => settings.list(),
            Self::Momentum(settings) => settings.list(),
        }
    }

    /// Checks the ranges of the settings.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        let mut copy = *self;
        copy.settings().iter().try_for_each(Setting::check)
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::LevenbergMarquardt(_) => "Levenberg-Marquardt",
            Self::Momentum(_) => "Momentum, Eq. (11)",
        })
    }
}

/// A method at work.
pub(super) enum Algorithm {
    LevenbergMarquardt(Box<LevenbergMarquardt>),
    Momentum(Box<Momentum>),
}

impl Algorithm {
    /// Prepares `method` at the start of training.
    pub(super) fn new(method: &Method, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        match method {
            Method::LevenbergMarquardt(settings) => {
                let (method, evaluation) = LevenbergMarquardt::new(*settings, mlp, examples);
                (Self::LevenbergMarquardt(Box::new(method)), evaluation)
            }
            Method::Momentum(settings) => {
                let (method, evaluation) = Momentum::new(*settings, mlp, examples);
                (Self::Momentum(Box::new(method)), evaluation)
            }
        }
    }

    /// Moves `mlp` by one epoch.
    pub(super) fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        match self {
            Self::LevenbergMarquardt(method) => method.step(mlp, examples),
            Self::Momentum(method) => method.step(mlp, examples),
        }
    }

    pub(super) fn parameter(&self) -> f64 {
        match self {
            Self::LevenbergMarquardt(method) => method.mu(),
            Self::Momentum(method) => method.learning_rate(),
        }
    }
}
