//! The damping mu of the methods that take Levenberg-Marquardt steps.

use super::{
    SettingError, StopReason,
    setting::{check_limit, settings},
};

settings! {
    /// Settings of the damping mu (Hagan and Menhaj 1994), with the field's usual defaults.
    pub struct Damping {
        mu: "mu" = 1e-3, in SMALLEST_MU..=1e300,
            "Initial damping. Large: short steps down the gradient; small: full Gauss-Newton steps.";
        mu_decrease: "mu decrease" = 0.1, in 1e-6..=0.999,
            "Factor on mu after a step that lowers the error.";
        mu_increase: "mu increase" = 10.0, in 1.001..=1e6,
            "Factor on mu after a step that does not lower the error.";
        mu_max: "largest mu" = 1e10, in SMALLEST_MU..=1e300,
            "Training ends when mu exceeds this: no step lowers the error any more.";
    }
}

/// Below this, mu is lost in the rounding of any sum of squares worth damping.
const SMALLEST_MU: f64 = 1e-20;

impl Damping {
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
