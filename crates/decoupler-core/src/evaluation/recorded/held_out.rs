use ndarray::Array2;

use super::super::{CrossValidated, RunError, RunSettings, baselines::fit_baselines, cross_validation::scatter};
use crate::{
    dataset::{Dataset, Folds},
    decoupling::decode_set,
};

/// Model that is fitted again and again to find out what the readings determine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FittedModel {
    /// Ridge regression: a fit takes milliseconds, but it sees only what is linear.
    #[default]
    Ridge,
    /// The network of the settings: each fit is a training.
    Network,
}

impl FittedModel {
    /// Returns held-out answers for every sample of `set`, each by a model fitted without its fold; `None` if cancelled.
    pub(super) fn held_out(
        self,
        settings: &RunSettings,
        set: &Dataset,
        folds: &Folds,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Array2<f64>>, RunError> {
        if self == Self::Network {
            let validated = CrossValidated::on_folds(settings, set, folds.clone(), is_cancelled)?;
            return Ok(validated.map(|validated| validated.network));
        }
        let mut answers = Array2::zeros(set.targets().dim());
        for fold in 0..folds.count() {
            if is_cancelled() {
                return Ok(None);
            }
            let (_, mut ridge) = fit_baselines(&set.select(&folds.without(&[fold])), settings)?;
            let of_fold = decode_set(&mut ridge, &set.select(folds.test(fold)))?;
            scatter(&mut answers, folds.test(fold), &of_fold);
        }
        Ok(Some(answers))
    }
}
