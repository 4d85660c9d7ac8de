//! Settings of a training: the method with its settings, and the rules that end it.

use serde::{Deserialize, Serialize};

use super::{Damping, Field, Kind, Method, Setting, SettingError};

/// Method and stopping rules of a training.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingSettings {
    /// Method with its settings.
    pub method: Method,
    /// Stopping rules.
    pub stopping: StoppingRules,
}

impl TrainingSettings {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.method.check()?;
        self.stopping.check()
    }
}

/// Rules that end a training by themselves, with the field's usual defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoppingRules {
    /// Maximum number of epochs.
    pub epochs: usize,
    /// Training error (mean squared, in scaled units) at which training ends.
    pub goal_mse: f64,
    /// Length of the gradient at which training ends.
    pub min_gradient: f64,
    /// Maximum number of validation failures: epochs since the last new best validation error at which the error was
    /// above the best. An error equal to the best is neither a failure nor a new best.
    pub max_fail: usize,
}

impl Default for StoppingRules {
    fn default() -> Self {
        Self {
            epochs: 1000,
            goal_mse: 0.0,
            min_gradient: 1e-7,
            max_fail: 6,
        }
    }
}

impl StoppingRules {
    /// Largest number of epochs that can be set.
    pub const MAX_EPOCHS: usize = 1_000_000;

    /// Returns the default rules for a training on a recording with this method.
    ///
    /// Methods that [follow gradients](Method::follows_gradients) get more epochs and more patience: their validation
    /// error rises for some epochs long before the end, and 6 failures stop them far from any minimum.
    pub fn recorded(method: &Method) -> Self {
        let (epochs, max_fail) = if method.follows_gradients() {
            (2000, 100)
        } else {
            (300, 6)
        };
        Self {
            epochs,
            max_fail,
            ..Self::default()
        }
    }

    /// Checks that the rules are in range.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        STOPPING.iter().try_for_each(|setting| setting.check(self))
    }
}

const COUNT: Kind = Kind::Integer(1, StoppingRules::MAX_EPOCHS as u64);
const NOT_NEGATIVE: Kind = Kind::Number(0.0, f64::MAX);

/// Rows of the rules that end a training.
pub(crate) const STOPPING: [Setting<StoppingRules>; 4] = [
    EPOCHS,
    Setting::new(
        "goal",
        NOT_NEGATIVE,
        "Training error (mean squared, in scaled units) at which training ends.",
        |rules| Some(Field::Number(&mut rules.goal_mse)),
    ),
    Setting::new(
        "smallest gradient",
        NOT_NEGATIVE,
        "Length of the gradient at which training ends.",
        |rules| Some(Field::Number(&mut rules.min_gradient)),
    ),
    Setting::new(
        "validation failures",
        COUNT,
        "Training ends after this many epochs whose validation error is above the best since the last new best.",
        |rules| Some(Field::Count(&mut rules.max_fail)),
    ),
];

/// Row of the maximum number of epochs.
pub const EPOCHS: Setting<StoppingRules> = Setting::new("epochs", COUNT, "Maximum number of epochs.", |rules| {
    Some(Field::Count(&mut rules.epochs))
});

/// Maximum share of the previous step in each step. At 1 the gradient has no share, and no weight ever moves.
const MAX_MOMENTUM: f64 = 0.999_999;
/// Smaller values of mu are lost in rounding when added to the diagonal.
pub(crate) const MIN_MU: f64 = 1e-20;

const LENGTH: Kind = Kind::Number(f64::MIN_POSITIVE, 1e300);
const GROWTH: Kind = Kind::Number(1.0, 1e3);
const REDUCTION: Kind = Kind::Number(1e-6, 0.999);
const MU: Kind = Kind::Number(MIN_MU, 1e300);

/// Rows of the methods; the rows of each method are in the order in which it is offered.
pub(super) static METHOD: &[Setting<Method>] = &[
    Setting::new(
        "mu",
        MU,
        "Initial damping. Large: short steps down the gradient; small: full Gauss-Newton steps.",
        |method| Some(Field::Number(&mut damping(method)?.mu)),
    ),
    Setting::new(
        "mu decrease",
        REDUCTION,
        "Factor on mu after a step that lowers the error.",
        |method| Some(Field::Number(&mut damping(method)?.mu_decrease)),
    ),
    Setting::new(
        "mu increase",
        Kind::Number(1.001, 1e6),
        "Factor on mu after a step that does not lower the error.",
        |method| Some(Field::Number(&mut damping(method)?.mu_increase)),
    ),
    Setting::new(
        "largest mu",
        MU,
        "Training ends when mu exceeds this: no step lowers the error any more.",
        |method| Some(Field::Number(&mut damping(method)?.mu_max)),
    ),
    Setting::new(
        "groups of weights",
        Kind::Integer(1, 4),
        "Groups of weights, each with its own strength of regularisation. 1: all together. 2: hidden layer and output \
         layer. 3: the biases of the hidden layer separate, too. 4: all biases separate. From 2 on, output biases are \
         drawn towards the means of the targets, not towards 0.",
        |method| Some(Field::Number(&mut method.try_as_bayesian_regularization_mut()?.groups)),
    ),
    Setting::new(
        "own noise",
        Kind::Integer(0, 1),
        "1: every target has its own noise level, so that a noisy or jittering target does not spoil the others, if \
         there are at least as many samples as weights. 0: one noise level for all.",
        |method| {
            Some(Field::Number(
                &mut method.try_as_bayesian_regularization_mut()?.own_noise,
            ))
        },
    ),
    Setting::new(
        "sigma",
        Kind::Number(1e-12, 1.0),
        "Length of the finite difference from which the curvature is estimated.",
        |method| Some(Field::Number(&mut method.try_as_scaled_conjugate_gradient_mut()?.sigma)),
    ),
    Setting::new(
        "lambda",
        LENGTH,
        "Initial scale of the curvature: it shortens steps where the error is not convex.",
        |method| {
            Some(Field::Number(
                &mut method.try_as_scaled_conjugate_gradient_mut()?.lambda,
            ))
        },
    ),
    Setting::new(
        "weight decay",
        Kind::Number(0.0, 1e12),
        "Penalty on large weights: this times the sum of the squared weights is added to the sum of the squared errors.",
        |method| Some(Field::Number(&mut method.try_as_scaled_conjugate_gradient_mut()?.decay)),
    ),
    Setting::new(
        "first step length",
        LENGTH,
        "Step length of every weight in the first epoch (delta0).",
        |method| Some(Field::Number(&mut method.try_as_resilient_mut()?.first_length)),
    ),
    Setting::new(
        "length increase",
        GROWTH,
        "Factor on a weight's step length while its slope keeps its sign.",
        |method| Some(Field::Number(&mut method.try_as_resilient_mut()?.length_increase)),
    ),
    Setting::new(
        "length decrease",
        REDUCTION,
        "Factor on a weight's step length when its slope changes sign.",
        |method| Some(Field::Number(&mut method.try_as_resilient_mut()?.length_decrease)),
    ),
    Setting::new(
        "largest step length",
        LENGTH,
        "Largest step of a weight in one epoch (deltamax).",
        |method| Some(Field::Number(&mut method.try_as_resilient_mut()?.largest_length)),
    ),
    Setting::new(
        "learning rate",
        LENGTH,
        "Initial step length relative to the length of the gradient; it adapts from there.",
        |method| Some(Field::Number(&mut method.try_as_adaptive_descent_mut()?.learning_rate)),
    ),
    Setting::new(
        "learning rate",
        LENGTH,
        "Step length relative to the length of the gradient (alpha).",
        |method| Some(Field::Number(&mut method.try_as_momentum_mut()?.learning_rate)),
    ),
    Setting::new(
        "learning rate",
        LENGTH,
        "Step length relative to the length of the gradient.",
        |method| match method {
            Method::GradientDescent { learning_rate } => Some(Field::Number(learning_rate)),
            Method::StepMomentum(settings) => Some(Field::Number(&mut settings.learning_rate)),
            _ => None,
        },
    ),
    Setting::new(
        "momentum",
        Kind::Number(0.0, 1.0),
        "Share of the previous gradient in each step (eta), from 0 to 1.",
        |method| Some(Field::Number(&mut method.try_as_momentum_mut()?.momentum)),
    ),
    Setting::new(
        "momentum",
        Kind::Number(0.0, MAX_MOMENTUM),
        "Share of the previous step in each step, from 0 to below 1: at 1 the gradient would have none.",
        |method| match method {
            Method::AdaptiveDescent(settings) => Some(Field::Number(&mut settings.momentum)),
            Method::StepMomentum(settings) => Some(Field::Number(&mut settings.momentum)),
            _ => None,
        },
    ),
    Setting::new(
        "rate increase",
        GROWTH,
        "Factor on the learning rate after a step that lowers the error.",
        |method| Some(Field::Number(&mut method.try_as_adaptive_descent_mut()?.rate_increase)),
    ),
    Setting::new(
        "rate decrease",
        REDUCTION,
        "Factor on the learning rate after a rejected step.",
        |method| Some(Field::Number(&mut method.try_as_adaptive_descent_mut()?.rate_decrease)),
    ),
    Setting::new(
        "largest error increase",
        Kind::Number(1.0, 1e6),
        "A step that raises the error by more than this factor is rejected.",
        |method| {
            Some(Field::Number(
                &mut method.try_as_adaptive_descent_mut()?.largest_error_increase,
            ))
        },
    ),
];

fn damping(method: &mut Method) -> Option<&mut Damping> {
    match method {
        Method::LevenbergMarquardt(damping) => Some(damping),
        Method::BayesianRegularization(settings) => Some(&mut settings.damping),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{RegularizationSettings, Value};

    #[test]
    fn integer_settings_reject_fractions() {
        for (groups, is_valid) in [(2.0, true), (2.5, false), (4.0, true), (f64::NAN, false)] {
            let settings = RegularizationSettings {
                groups,
                ..RegularizationSettings::default()
            };
            let checked = Method::BayesianRegularization(settings).check();
            assert_eq!(checked.is_ok(), is_valid, "{groups}: {checked:?}");
        }
        let settings = RegularizationSettings {
            groups: 2.5,
            ..RegularizationSettings::default()
        };
        let message = Method::BayesianRegularization(settings)
            .check()
            .unwrap_err()
            .to_string();
        assert_eq!(message, "groups of weights is 2.5: it must be a whole number");
    }

    /// Sets each number of a method to another value, and looks for these values in its file.
    #[test]
    fn the_rows_reach_every_number_of_every_method() {
        let numbers = |method: Method| {
            let file = serde_json::to_value(method).unwrap();
            let settings = file.as_object().unwrap().values().next().unwrap().clone();
            let values = settings
                .as_object()
                .unwrap()
                .values()
                .map(|value| value.as_f64().unwrap());
            let mut values = Vec::from_iter(values);
            values.sort_by(f64::total_cmp);
            values
        };
        for mut method in Method::all() {
            method.check().unwrap();
            let rows = Vec::from_iter(method.settings());
            let expected = Vec::from_iter((0..rows.len()).map(|index| index as f64));
            for (setting, value) in rows.iter().zip(&expected) {
                setting.set(&mut method, &Value::Number(*value)).unwrap();
            }
            assert_eq!(numbers(method), expected, "{method}");
        }
    }
}
