use super::{
    Damping,
    normal_equations::PerClass,
    setting::{WHOLE, settings},
};

settings! {
    /// Settings of Bayesian regularisation: the damping mu, as in [`Damping`], and the correlation of errors.
    #[serde(default)]
    pub struct RegularizationSettings {
        mu: "mu" = 0.005, in 1e-20..=1e300,
            "Initial damping. Large: short steps down the gradient; small: full Gauss-Newton steps.";
        mu_decrease: "mu decrease" = 0.1, in 1e-6..=0.999,
            "Factor on mu after a step that lowers the error.";
        mu_increase: "mu increase" = 10.0, in 1.001..=1e6,
            "Factor on mu after a step that does not lower the error.";
        mu_max: "largest mu" = 1e10, in 1e-20..=1e300,
            "Training ends when mu exceeds this: no step lowers the error any more.";
        correlation_epoch [WHOLE]: "correlation epoch" = 0.0, in 0.0..=1e6,
            "Epoch after which the correlation of neighbouring errors is measured, as in a recording: from then on fewer \
             errors count as independent, and weights are smaller. 0: never.";
        groups [WHOLE]: "groups of weights" = 1.0, in 1.0..=4.0,
            "Groups of weights, each with its own strength of regularisation. 1: all. 2: hidden layer and output layer. 3: \
             the hidden layer's biases apart too. 4: all biases apart. From 2 on, output biases are drawn towards the means \
             of the targets, not towards 0.";
    }
}

impl RegularizationSettings {
    /// Before it, what is not yet learnt makes errors look more correlated than they are.
    const EPOCH_OF_RECORDINGS: f64 = 200.0;

    /// Settings for samples in the order in which they were recorded: few for the number of weights, and of any units.
    pub fn recorded() -> Self {
        Self {
            correlation_epoch: Self::EPOCH_OF_RECORDINGS,
            groups: 4.0,
            ..Self::default()
        }
    }

    /// Group of each class of weights, from 0.
    pub(super) fn group_of_classes(&self) -> PerClass<usize> {
        let [hidden_weights, hidden_biases, output_weights, output_biases] = match self.groups as usize {
            ..=1 => [0, 0, 0, 0],
            2 => [0, 0, 1, 1],
            3 => [0, 1, 2, 2],
            _ => [0, 1, 2, 3],
        };
        PerClass {
            hidden_weights,
            hidden_biases,
            output_weights,
            output_biases,
        }
    }

    pub(super) fn damping(&self) -> Damping {
        let &Self {
            mu,
            mu_decrease,
            mu_increase,
            mu_max,
            correlation_epoch: _,
            groups: _,
        } = self;
        Damping {
            mu,
            mu_decrease,
            mu_increase,
            mu_max,
        }
    }
}
