//! Training methods with their settings.

#![expect(missing_docs, reason = "strum derives methods without documentation")]

use std::fmt;

use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumProperty};

use super::{METHOD, Setting, SettingError};
use crate::{sensor::short, text::UnknownName};

/// A training method with its settings. Its texts: short name, full name and a sentence; the name of the value recorded as
/// [`EpochRecord::parameter`](crate::training::EpochRecord::parameter); and advice, in the imperative, for a training that
/// diverged or did not lower the error.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Serialize,
    Deserialize,
    strum::EnumMessage,
    strum::EnumProperty,
    strum::EnumTryAs,
    strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Method {
    /// Damped Gauss-Newton steps (`trainlm`). The normal equations are factored or, where factoring costs more (for
    /// wide networks, depending on their shape and the number of samples), solved by conjugate gradients to a relative
    /// residual of 1e-8. After 500 iterations a residual of 1e-3 is accepted; with a larger one the step is rejected.
    #[strum(serialize = "lm", message = "Levenberg-Marquardt", props(parameter = "mu"))]
    #[strum(
        detailed_message = "Damped Gauss-Newton steps: the fewest epochs, and here also the shortest training time."
    )]
    #[strum(props(remedy = "try another seed, more samples, or fewer hidden nodes"))]
    LevenbergMarquardt(Damping),
    /// Levenberg-Marquardt that keeps the weights as small as the data permit (`trainbr`). The normal equations are
    /// always factored, since the method needs the trace of their inverse.
    #[strum(serialize = "br", message = "Bayesian regularisation", props(parameter = "mu"))]
    #[strum(
        detailed_message = "Levenberg-Marquardt with a penalty on the weights whose strength is estimated from the data: for few or noisy samples."
    )]
    #[strum(props(remedy = "try another seed, more samples, or Levenberg-Marquardt (lm)"))]
    BayesianRegularization(RegularizationSettings),
    /// Møller's scaled conjugate gradient (`trainscg`).
    #[strum(serialize = "scg", message = "Scaled conjugate gradient")]
    #[strum(props(parameter = "lambda"))]
    #[strum(
        detailed_message = "Conjugate directions, step length from the curvature: little memory, for very large networks."
    )]
    #[strum(props(remedy = "try another seed, or Levenberg-Marquardt (lm)"))]
    ScaledConjugateGradient(ConjugateSettings),
    /// Resilient back-propagation (`trainrp`).
    #[strum(serialize = "rp", message = "Resilient back-propagation")]
    #[strum(props(parameter = "mean step length"))]
    #[strum(detailed_message = "Each weight has its own step length and uses only the sign of its slope.")]
    #[strum(props(remedy = "lower the first and the largest step length, or try another seed"))]
    Resilient(ResilientSettings),
    /// Gradient descent with momentum and an adaptive learning rate (`traingdx`).
    #[strum(serialize = "gdx", message = "Adaptive rate with momentum")]
    #[strum(props(parameter = "learning rate"))]
    #[strum(detailed_message = "Gradient descent with momentum whose learning rate grows while the error falls.")]
    #[strum(props(remedy = "lower the learning rate, run more epochs, or try another seed"))]
    AdaptiveDescent(AdaptiveSettings),
    /// Gradient descent with momentum of steps (`traingdm`).
    #[strum(serialize = "gdms", message = "Momentum of steps")]
    #[strum(props(parameter = "learning rate"))]
    #[strum(detailed_message = "Gradient descent that mixes the previous step into each step, as traingdm does.")]
    #[strum(props(remedy = "change the learning rate, run more epochs, or try another method"))]
    StepMomentum(MomentumSettings),
    /// Gradient descent with momentum of gradients, Eq. (11).
    #[strum(serialize = "gdm", message = "Momentum, Eq. (11)")]
    #[strum(props(parameter = "learning rate"))]
    #[strum(
        detailed_message = "Gradient descent that mixes the previous gradient into each step, as the paper's Eq. (11) does."
    )]
    #[strum(props(remedy = "change the learning rate, run more epochs, or try another method"))]
    Momentum(MomentumSettings),
    /// Conventional back-propagation, Eq. (5)-(10) (`traingd`).
    #[strum(serialize = "gd", message = "Gradient descent", props(parameter = "learning rate"))]
    #[strum(detailed_message = "Conventional back-propagation, Eq. (5)-(10): a step down the gradient each epoch.")]
    #[strum(props(remedy = "change the learning rate, run more epochs, or try another method"))]
    GradientDescent {
        /// Step length relative to the length of the gradient.
        learning_rate: f64,
    },
}

/// Settings of the damping mu (Hagan and Menhaj 1994), with the field's usual defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Damping {
    /// Initial damping.
    pub mu: f64,
    /// Factor on mu after a step that lowers the error.
    pub mu_decrease: f64,
    /// Factor on mu after a step that does not lower the error.
    pub mu_increase: f64,
    /// Training ends when mu exceeds this.
    pub mu_max: f64,
}

impl Default for Damping {
    fn default() -> Self {
        Self {
            mu: 1e-3,
            mu_decrease: 0.1,
            mu_increase: 10.0,
            mu_max: 1e10,
        }
    }
}

/// Settings of Bayesian regularisation. Those of version 0.1.0 had another, which is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RegularizationSettings {
    /// Damping mu.
    #[serde(flatten)]
    pub damping: Damping,
    /// Number of groups of weights with their own strength of regularisation, an integer from 1 to 4.
    pub groups: f64,
    /// 1 if every target has its own noise level, otherwise 0.
    pub own_noise: f64,
}

impl Default for RegularizationSettings {
    fn default() -> Self {
        Self {
            damping: Damping {
                mu: 0.005,
                ..Damping::default()
            },
            groups: 1.0,
            own_noise: 0.0,
        }
    }
}

impl RegularizationSettings {
    /// Settings for recordings, whose samples are few for the number of weights and whose targets have any units and
    /// noise.
    ///
    /// The correlation of errors is not measured: in a recording it is mostly a systematic error, such as hysteresis,
    /// which a raster scan or a slow press makes look like lost samples. On recordings of five sensors the correction
    /// never lowered the test error by more than the difference between two seeds, and raised it by up to 20 %.
    pub fn recorded() -> Self {
        Self {
            groups: 4.0,
            own_noise: 1.0,
            ..Self::default()
        }
    }
}

/// Settings of the scaled conjugate gradient.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConjugateSettings {
    /// Length of the finite difference from which the curvature is estimated.
    pub sigma: f64,
    /// Initial scale of the curvature.
    pub lambda: f64,
    /// Factor on the sum of the squared weights, which is added to the sum of the squared errors. Files from before
    /// this setting existed lack it.
    #[serde(default)]
    pub decay: f64,
}

/// Settings of resilient back-propagation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResilientSettings {
    /// Step length of every weight in the first epoch (delta0).
    pub first_length: f64,
    /// Factor on a weight's step length while its slope keeps its sign.
    pub length_increase: f64,
    /// Factor on a weight's step length when its slope changes sign.
    pub length_decrease: f64,
    /// Largest step of a weight in one epoch (deltamax).
    pub largest_length: f64,
}

/// Settings of gradient descent with momentum and an adaptive learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdaptiveSettings {
    /// Initial step length relative to the length of the gradient.
    pub learning_rate: f64,
    /// Share of the previous step in each step, below 1.
    pub momentum: f64,
    /// Factor on the learning rate after a step that lowers the error.
    pub rate_increase: f64,
    /// Factor on the learning rate after a rejected step.
    pub rate_decrease: f64,
    /// A step that raises the error by more than this factor is rejected.
    pub largest_error_increase: f64,
}

/// Settings of gradient descent with momentum, of steps or of gradients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MomentumSettings {
    /// Step length relative to the length of the gradient (alpha).
    pub learning_rate: f64,
    /// Share of the previous step, below 1, or of the previous gradient (eta) in each step.
    pub momentum: f64,
}

impl Default for Method {
    fn default() -> Self {
        Self::LevenbergMarquardt(Damping::default())
    }
}

impl Method {
    /// Momentum of gradients with the field's usual defaults.
    pub const MOMENTUM: Self = Self::Momentum(MomentumSettings {
        learning_rate: 0.01,
        momentum: 0.9,
    });

    /// Returns every method with its defaults, in the order offered to the user.
    pub fn all() -> [Self; 8] {
        [
            Self::default(),
            Self::bayesian_regularization(),
            Self::scaled_conjugate_gradient(0.0),
            Self::Resilient(ResilientSettings {
                first_length: 0.07,
                length_increase: 1.2,
                length_decrease: 0.5,
                largest_length: 50.0,
            }),
            Self::AdaptiveDescent(AdaptiveSettings {
                learning_rate: 0.01,
                momentum: 0.9,
                rate_increase: 1.05,
                rate_decrease: 0.7,
                largest_error_increase: 1.04,
            }),
            Self::StepMomentum(MomentumSettings {
                learning_rate: 0.01,
                momentum: 0.9,
            }),
            Self::MOMENTUM,
            Self::GradientDescent { learning_rate: 0.01 },
        ]
    }

    /// Returns the method of this short name with its defaults.
    ///
    /// # Errors
    /// If no method has this name.
    pub fn named(short_name: &str) -> Result<Self, UnknownName> {
        let found = Self::all().into_iter().find(|method| method.short_name() == short_name);
        found.ok_or_else(|| UnknownName {
            name: short_name.to_owned(),
            what: "a training method",
            known: Self::all().map(|method| method.short_name()).to_vec(),
        })
    }

    /// Returns Bayesian regularisation with its defaults.
    pub fn bayesian_regularization() -> Self {
        Self::BayesianRegularization(RegularizationSettings::default())
    }

    /// Returns Bayesian regularisation with the settings for recordings.
    pub fn recorded_regularization() -> Self {
        Self::BayesianRegularization(RegularizationSettings::recorded())
    }

    /// Returns the scaled conjugate gradient with this weight decay and the field's usual defaults.
    pub fn scaled_conjugate_gradient(decay: f64) -> Self {
        Self::ScaledConjugateGradient(ConjugateSettings {
            sigma: 5e-5,
            lambda: 5e-7,
            decay,
        })
    }

    /// Returns the settings of this method.
    pub fn settings(&self) -> impl Iterator<Item = &'static Setting<Self>> + use<> {
        let method = *self;
        METHOD.iter().filter(move |setting| setting.applies(&method))
    }

    /// Returns this method with its defaults.
    pub fn with_defaults(&self) -> Self {
        Self::named(self.short_name()).unwrap_or(*self)
    }

    /// Short name for the terminal and tables.
    pub fn short_name(&self) -> &'static str {
        self.into()
    }

    /// Full name.
    pub fn name(&self) -> &'static str {
        self.get_message().unwrap_or_default()
    }

    /// Description of the method in one sentence.
    pub fn summary(&self) -> &'static str {
        self.get_detailed_message().unwrap_or_default()
    }

    /// Name of the value recorded as [`EpochRecord::parameter`](crate::training::EpochRecord::parameter).
    pub fn parameter_name(&self) -> &'static str {
        self.get_str("parameter").unwrap_or_default()
    }

    /// Returns `true` for a method whose steps follow gradients: it needs many short epochs, and its validation error
    /// does not fall in every one of them.
    pub fn follows_gradients(&self) -> bool {
        !matches!(self, Self::LevenbergMarquardt(_) | Self::BayesianRegularization(_))
    }

    /// Returns `false` for Bayesian regularisation, which balances the fit against the size of the weights by itself:
    /// samples held out for validation are better used for training.
    pub fn needs_validation(&self) -> bool {
        !matches!(self, Self::BayesianRegularization(_))
    }

    /// Checks that the settings are in range and consistent.
    ///
    /// # Errors
    /// The first setting out of range, or two that contradict each other.
    pub fn check(&self) -> Result<(), SettingError> {
        const LIMITS: [(&str, &str); 2] = [("mu", "largest mu"), ("first step length", "largest step length")];
        METHOD.iter().try_for_each(|setting| setting.check(self))?;
        let number = |name| self.settings().find(|setting| setting.name == name)?.number(self);
        for (name, limit_name) in LIMITS {
            if let (Some(value), Some(limit)) = (number(name), number(limit_name))
                && value > limit
            {
                return Err(SettingError::AboveLimit(name, value, limit_name, limit));
            }
        }
        Ok(())
    }

    /// Returns advice for a training of this method that diverged or did not lower the error: resetting the settings
    /// that differ from their defaults, and what else may help.
    pub fn remedy(&self) -> String {
        let usual = self.with_defaults();
        let changes = METHOD.iter().filter_map(|setting| {
            let (value, default) = (setting.number(self)?, setting.number(&usual)?);
            let name = setting.name;
            (value != default).then(|| format!("{name} to {} (now {})", short(default), short(value)))
        });
        let (changes, remedy) = (
            Vec::from_iter(changes).join(", "),
            self.get_str("remedy").unwrap_or_default(),
        );
        if changes.is_empty() {
            return remedy.to_owned();
        }
        format!("reset {changes}; or {remedy}")
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
