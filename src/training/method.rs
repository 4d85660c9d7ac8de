use std::{fmt, ops::RangeInclusive};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{
    Evaluation, Examples, LevenbergMarquardt, LevenbergMarquardtSettings, Momentum, MomentumSettings, StopReason,
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

/// A setting out of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{name} is {value}: it must be from {} to {}", .range.start(), .range.end())]
pub struct SettingError {
    /// Which setting.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// What is allowed.
    pub range: RangeInclusive<f64>,
}

/// Checks one setting; NaN is in no range.
pub(super) fn in_range(name: &'static str, value: f64, range: RangeInclusive<f64>) -> Result<(), SettingError> {
    if range.contains(&value) {
        Ok(())
    } else {
        Err(SettingError { name, value, range })
    }
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

    /// Checks the ranges of the settings.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        match self {
            Self::LevenbergMarquardt(settings) => settings.check(),
            Self::Momentum(settings) => settings.check(),
        }
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
    Momentum(Momentum),
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
                (Self::Momentum(method), evaluation)
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
