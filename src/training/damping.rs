//! The damping mu of the methods that take Levenberg-Marquardt steps.

use serde::{Deserialize, Serialize};

use super::{Setting, SettingError, StopReason, setting::check_limit};

/// Settings of the damping mu (Hagan and Menhaj 1994), with the field's usual defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Damping {
    /// Initial mu. A large mu gives short steps down the gradient, a small one full Gauss-Newton steps.
    pub mu: f64,
    /// Factor on mu after an accepted step.
    pub mu_decrease: f64,
    /// Factor on mu after a rejected step.
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

/// Below this, mu is lost in the rounding of any sum of squares worth damping.
const SMALLEST_MU: f64 = 1e-20;

impl Damping {
    /// The settings, to be shown and changed, given their defaults.
    pub(super) fn list(&mut self, default: Self) -> Vec<Setting<'_>> {
        vec![
            Setting {
                name: "mu",
                meaning: "Initial damping. Large: short steps down the gradient; small: full Gauss-Newton steps.",
                default: default.mu,
                range: SMALLEST_MU..=1e300,
                value: &mut self.mu,
            },
            Setting {
                name: "mu decrease",
                meaning: "Factor on mu after a step that lowers the error.",
                default: default.mu_decrease,
                range: 1e-6..=0.999,
                value: &mut self.mu_decrease,
            },
            Setting {
                name: "mu increase",
                meaning: "Factor on mu after a step that does not lower the error.",
                default: default.mu_increase,
                range: 1.001..=1e6,
                value: &mut self.mu_increase,
            },
            Setting {
                name: "largest mu",
                meaning: "Training ends when mu exceeds this: no step lowers the error any more.",
                default: default.mu_max,
                range: SMALLEST_MU..=1e300,
                value: &mut self.mu_max,
            },
        ]
    }

    /// Checks that there is a damping to try.
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_limit(("mu", self.mu), ("largest mu", self.mu_max))
    }

    /// Tries steps with growing damping until one is accepted; `mu` is then decreased for the next epoch.
    ///
    /// `attempt` returns `Some` if it accepts the step at the damping it is given, `None` if there is no such step or
    /// the step does not lower the error.
    ///
    /// # Errors
    /// [`StopReason::MuLarge`] if no step up to the largest mu is accepted.
    pub(super) fn search<T>(self, mu: &mut f64, mut attempt: impl FnMut(f64) -> Option<T>) -> Result<T, StopReason> {
        // A saved mu of 0 would never grow.
        *mu = mu.max(SMALLEST_MU);
        while *mu <= self.mu_max {
            if let Some(accepted) = attempt(*mu) {
                *mu = (*mu * self.mu_decrease).max(SMALLEST_MU);
                return Ok(accepted);
            }
            *mu *= self.mu_increase;
        }
        Err(StopReason::MuLarge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mu_grows_until_a_step_is_accepted_and_then_falls() {
        let mut mu = 1.0;
        let mut tried = Vec::new();
        let accepted = Damping::default().search(&mut mu, |mu| {
            tried.push(mu);
            (mu >= 100.0).then_some("accepted")
        });
        assert_eq!((accepted, mu), (Ok("accepted"), 10.0));
        assert_eq!(tried, [1.0, 10.0, 100.0]);
    }

    #[test]
    fn the_search_ends_above_the_largest_mu_and_mu_never_vanishes() {
        let mut mu = 1e9;
        let refused: Result<(), _> = Damping::default().search(&mut mu, |_| None);
        assert_eq!(refused, Err(StopReason::MuLarge));
        assert!(mu > 1e10);
        let mut mu = SMALLEST_MU;
        assert_eq!(Damping::default().search(&mut mu, |_| Some(())), Ok(()));
        assert_eq!(mu, SMALLEST_MU);
    }
}
