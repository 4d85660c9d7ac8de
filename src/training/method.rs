use std::fmt;

use serde::{Deserialize, Serialize};

use super::{
    AdaptiveDescentSettings, BayesianRegularizationSettings, Evaluation, Examples, GradientDescentSettings,
    LevenbergMarquardtSettings, MethodState, MomentumSettings, ResilientSettings, ScaledConjugateGradientSettings,
    Setting, SettingError, StepMomentumSettings, VariableProjectionSettings, adaptive_descent::AdaptiveDescent,
    algorithm::Algorithm, bayesian_regularization::BayesianRegularization, gradient_descent::GradientDescent,
    levenberg_marquardt::LevenbergMarquardt, momentum::Momentum, normal_equations::Way, resilient::Resilient,
    scaled_conjugate_gradient::ScaledConjugateGradient, step_momentum::StepMomentum,
    variable_projection::VariableProjection,
};
use crate::network::{Mlp, Shape};

/// A training method with its settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Damped Gauss-Newton steps (`trainlm`). Their equations are factored, or where it is cheaper, which is for wide
    /// networks and decided by their shape and the number of samples, solved by conjugate gradients to a relative
    /// residual of 1e-8: the same steps to about as many digits.
    LevenbergMarquardt(LevenbergMarquardtSettings),
    /// Levenberg-Marquardt that keeps the weights small, as much as the data ask for (`trainbr`). Its equations are
    /// always factored, since it needs the trace of their inverse.
    BayesianRegularization(BayesianRegularizationSettings),
    /// The output layer solved exactly, Gauss-Newton steps on the hidden layer. Its equations are always factored: its
    /// damping falls so low that conjugate gradients would need thousands of iterations.
    VariableProjection(VariableProjectionSettings),
    /// Møller's scaled conjugate gradient (`trainscg`).
    ScaledConjugateGradient(ScaledConjugateGradientSettings),
    /// Resilient back-propagation (`trainrp`).
    Resilient(ResilientSettings),
    /// Gradient descent with momentum and an adaptive learning rate (`traingdx`).
    AdaptiveDescent(AdaptiveDescentSettings),
    /// Gradient descent with momentum of steps (`traingdm`).
    StepMomentum(StepMomentumSettings),
    /// Gradient descent with momentum of gradients, Eq. (11).
    Momentum(MomentumSettings),
    /// Conventional back-propagation, Eq. (5)-(10) (`traingd`).
    GradientDescent(GradientDescentSettings),
}

impl Default for Method {
    fn default() -> Self {
        Self::LevenbergMarquardt(LevenbergMarquardtSettings::default())
    }
}

impl Method {
    /// Every method with its defaults, in the order offered.
    pub fn all() -> [Self; 9] {
        [
            Self::default(),
            Self::BayesianRegularization(BayesianRegularizationSettings::default()),
            Self::VariableProjection(VariableProjectionSettings::default()),
            Self::ScaledConjugateGradient(ScaledConjugateGradientSettings::default()),
            Self::Resilient(ResilientSettings::default()),
            Self::AdaptiveDescent(AdaptiveDescentSettings::default()),
            Self::StepMomentum(StepMomentumSettings::default()),
            Self::Momentum(MomentumSettings::default()),
            Self::GradientDescent(GradientDescentSettings::default()),
        ]
    }

    /// The word for it in the terminal and in tables.
    pub fn short_name(&self) -> &'static str {
        self.words().0
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.words().1
    }

    /// What it does, in a sentence.
    pub fn description(&self) -> &'static str {
        self.words().2
    }

    /// What [`super::EpochRecord::parameter`] is.
    pub fn parameter_name(&self) -> &'static str {
        self.words().3
    }

    /// Short name, name, description, and what its parameter is.
    fn words(&self) -> (&'static str, &'static str, &'static str, &'static str) {
        match self {
            Self::LevenbergMarquardt(_) => (
                "lm",
                "Levenberg-Marquardt",
                "Damped Gauss-Newton steps: the fewest epochs, and here also the least time.",
                "mu",
            ),
            Self::BayesianRegularization(_) => (
                "br",
                "Bayesian regularisation",
                "Levenberg-Marquardt that keeps weights small, weighing them against the error by what the data can \
                 determine: for few or noisy samples.",
                "mu",
            ),
            Self::VariableProjection(_) => (
                "varpro",
                "Variable projection",
                "Solves the linear output layer exactly and takes Levenberg-Marquardt steps on the hidden layer only.",
                "mu",
            ),
            Self::ScaledConjugateGradient(_) => (
                "scg",
                "Scaled conjugate gradient",
                "Conjugate directions with the step length from the curvature: little memory, for very large networks.",
                "lambda",
            ),
            Self::Resilient(_) => (
                "rp",
                "Resilient back-propagation",
                "Each weight keeps a step length of its own and follows only the sign of its slope.",
                "mean step length",
            ),
            Self::AdaptiveDescent(_) => (
                "gdx",
                "Adaptive rate with momentum",
                "Gradient descent with momentum whose learning rate grows while the error falls.",
                "learning rate",
            ),
            Self::StepMomentum(_) => (
                "gdms",
                "Momentum of steps",
                "Gradient descent that mixes the previous step into each step, as traingdm does.",
                "learning rate",
            ),
            Self::Momentum(_) => (
                "gdm",
                "Momentum, Eq. (11)",
                "Gradient descent that mixes the previous gradient into each step, as the paper's Eq. (11) does.",
                "learning rate",
            ),
            Self::GradientDescent(_) => (
                "gd",
                "Gradient descent",
                "Conventional back-propagation, Eq. (5)-(10): a step down the gradient each epoch.",
                "learning rate",
            ),
        }
    }

    /// The settings that this method has, to be shown and changed.
    pub fn settings(&mut self) -> Vec<Setting<'_>> {
        match self {
            Self::LevenbergMarquardt(settings) => settings.list(),
            Self::BayesianRegularization(settings) => settings.list(),
            Self::VariableProjection(settings) => settings.list(),
            Self::ScaledConjugateGradient(settings) => settings.list(),
            Self::Resilient(settings) => settings.list(),
            Self::AdaptiveDescent(settings) => settings.list(),
            Self::StepMomentum(settings) => settings.list(),
            Self::Momentum(settings) => settings.list(),
            Self::GradientDescent(settings) => settings.list(),
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

    /// How it solves the normal equations for a network of this shape and so many samples, if it has any.
    fn equations(&self, shape: Shape, samples: usize) -> Option<Way> {
        match self {
            Self::LevenbergMarquardt(_) => Some(Way::cheaper(shape, samples)),
            Self::BayesianRegularization(_) | Self::VariableProjection(_) => Some(Way::Factored),
            _ => None,
        }
    }

    /// About how many bytes its equations take for a network of this shape and so many samples.
    pub fn equations_bytes(&self, shape: Shape, samples: usize) -> usize {
        self.equations(shape, samples).map_or(0, |way| way.bytes(shape))
    }

    /// Puts the method to work from the weights of `mlp`.
    pub(super) fn start(&self, mlp: &Mlp, examples: &Examples) -> (Box<dyn Algorithm>, Evaluation) {
        fn boxed<A: Algorithm + 'static>((method, now): (A, Evaluation)) -> (Box<dyn Algorithm>, Evaluation) {
            (Box::new(method), now)
        }
        match *self {
            Self::LevenbergMarquardt(settings) => boxed(LevenbergMarquardt::new(settings, mlp, examples)),
            Self::BayesianRegularization(settings) => boxed(BayesianRegularization::new(settings, mlp, examples)),
            Self::VariableProjection(settings) => boxed(VariableProjection::new(settings, mlp, examples)),
            Self::ScaledConjugateGradient(settings) => boxed(ScaledConjugateGradient::new(settings, mlp, examples)),
            Self::Resilient(settings) => boxed(Resilient::new(settings, mlp, examples)),
            Self::AdaptiveDescent(settings) => boxed(AdaptiveDescent::new(settings, mlp, examples)),
            Self::StepMomentum(settings) => boxed(StepMomentum::new(settings, mlp, examples)),
            Self::Momentum(settings) => boxed(Momentum::new(settings, mlp, examples)),
            Self::GradientDescent(settings) => boxed(GradientDescent::new(settings, mlp, examples)),
        }
    }

    /// Puts the method to work where an interrupted training left it; `None` if `state` is another method's.
    pub(super) fn resume(&self, state: MethodState, mlp: &Mlp, examples: &Examples) -> Option<Box<dyn Algorithm>> {
        Some(match (*self, state) {
            (Self::LevenbergMarquardt(settings), MethodState::LevenbergMarquardt { mu }) => {
                Box::new(LevenbergMarquardt::new(settings, mlp, examples).0.resume(mu))
            }
            (Self::BayesianRegularization(settings), MethodState::BayesianRegularization(state)) => {
                Box::new(BayesianRegularization::new(settings, mlp, examples).0.resume(state))
            }
            (Self::VariableProjection(settings), MethodState::VariableProjection(state)) => {
                Box::new(VariableProjection::new(settings, mlp, examples).0.resume(state))
            }
            (Self::ScaledConjugateGradient(settings), MethodState::ScaledConjugateGradient(state)) => {
                Box::new(ScaledConjugateGradient::new(settings, mlp, examples).0.resume(state))
            }
            (
                Self::Resilient(settings),
                MethodState::Resilient {
                    previous_gradient,
                    lengths,
                },
            ) => Box::new(
                Resilient::new(settings, mlp, examples)
                    .0
                    .resume(previous_gradient, lengths),
            ),
            (Self::AdaptiveDescent(settings), MethodState::AdaptiveDescent(state)) => {
                Box::new(AdaptiveDescent::new(settings, mlp, examples).0.resume(state))
            }
            (Self::StepMomentum(settings), MethodState::StepMomentum(step)) => {
                Box::new(StepMomentum::new(settings, mlp, examples).0.resume(step))
            }
            (Self::Momentum(settings), MethodState::Momentum(gradient)) => {
                Box::new(Momentum::new(settings, mlp, examples).0.resume(gradient))
            }
            (Self::GradientDescent(settings), MethodState::GradientDescent) => {
                Box::new(GradientDescent::new(settings, mlp, examples).0)
            }
            _ => return None,
        })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
