//! Settings of Bayesian regularisation.

use crate::training::{
    Damping,
    normal_equations::Classes,
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
            "Groups of weights, each with its own strength of regularisation. 1: all together. 2: hidden layer and output \
             layer. 3: the biases of the hidden layer separate, too. 4: all biases separate. From 2 on, output biases are \
             drawn towards the means of the targets, not towards 0.";
        own_noise [WHOLE]: "own noise" = 0.0, in 0.0..=1.0,
            "1: every target has its own noise level, so that a noisy or jittering target does not spoil the others, if \
             there are at least as many samples as weights. 0: one noise level for all.";
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

    /// Group of each class of weights, from 0.
    pub(super) fn group_of_classes(&self) -> Classes<usize> {
        match self.groups as usize {
            ..=1 => [0, 0, 0, 0],
            2 => [0, 0, 1, 1],
            3 => [0, 1, 2, 2],
            _ => [0, 1, 2, 3],
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
            own_noise: _,
        } = self;
        Damping {
            mu,
            mu_decrease,
            mu_increase,
            mu_max,
        }
    }
}
