//! Conventional back-propagation (`traingd`).

use super::{
    Evaluation, Examples, StopReason,
    algorithm::{Algorithm, Description},
    backpropagation::Backpropagation,
    setting::settings,
};
use crate::network::Mlp;

settings! {
    /// Settings of gradient descent, with the field's usual default (`traingd`).
    pub struct GradientDescentSettings {
        learning_rate: "learning rate" = 0.01, in f64::MIN_POSITIVE..=1e300,
            "Step length relative to the length of the gradient.";
    }
}

/// Conventional back-propagation of the paper, Eq. (5)-(10), in batch form: `v(N+1) = v(N) + α g(N)`, g the negative
/// gradient of the mean squared error over all samples. The derivative that Eq. (8)-(9) write for a sigmoid is here that
/// of our layers: 1 − h² for the tanh nodes and 1 for the linear outputs.
pub(super) struct GradientDescent {
    settings: GradientDescentSettings,
    backpropagation: Backpropagation,
}

impl Algorithm for GradientDescent {
    type Settings = GradientDescentSettings;
    type State = ();

    const DESCRIPTION: Description = Description {
        short_name: "gd",
        name: "Gradient descent",
        summary: "Conventional back-propagation, Eq. (5)-(10): a step down the gradient each epoch.",
        parameter_name: "learning rate",
        cure: "change the learning rate, run more epochs, or take another method",
    };

    fn new(settings: GradientDescentSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let evaluation = backpropagation.evaluate(mlp, examples);
        let method = Self {
            settings,
            backpropagation,
        };
        (method, evaluation)
    }

    fn restore(&mut self, (): ()) {}

    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        for (weight, slope) in mlp.weights_mut().iter_mut().zip(&self.backpropagation.gradient) {
            *weight -= self.settings.learning_rate * slope;
        }
        self.backpropagation.evaluate(mlp, examples).if_finite()
    }

    fn parameter(&self) -> f64 {
        self.settings.learning_rate
    }

    fn state(&self) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::examples::tests::{random_examples, random_mlp};

    #[test]
    fn a_step_goes_down_the_gradient_by_the_learning_rate() {
        let (mut mlp, examples) = (random_mlp(3, 2, 2, 1), random_examples(50, 3, 2, 2));
        let start = mlp.clone();
        let mut backpropagation = Backpropagation::new(&mlp);
        backpropagation.evaluate(&mlp, &examples);
        let (mut method, _) = GradientDescent::new(GradientDescentSettings { learning_rate: 0.5 }, &mlp, &examples);
        method.step(&mut mlp, &examples).unwrap();
        for ((moved, weight), slope) in mlp.weights().iter().zip(start.weights()).zip(&backpropagation.gradient) {
            assert_eq!(*moved, weight - 0.5 * slope);
        }
    }
}
