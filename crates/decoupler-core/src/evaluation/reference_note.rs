use std::fmt;

use super::{Baselines, NoReference, TestErrors};

/// Reasons for which the Bayesian reference of an error table is no bound for decoders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReferenceNote {
    /// There is none.
    Missing(NoReference),
    /// Its error is above that of the training mean.
    AboveMean,
}

impl ReferenceNote {
    /// The note on the reference of these baselines; `None` if it is a bound.
    pub fn of(baselines: &Baselines) -> Option<Self> {
        match &baselines.reference {
            None => baselines.no_reference.map(Self::Missing),
            Some(reference) if is_above(reference, &baselines.mean) => Some(Self::AboveMean),
            Some(_) => None,
        }
    }
}

fn is_above(reference: &TestErrors, mean: &TestErrors) -> bool {
    reference
        .nodes()
        .zip(mean.nodes())
        .is_some_and(|(reference, mean)| reference.z_mm > mean.z_mm)
}

impl fmt::Display for ReferenceNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing(NoReference::NotConverged) => {
                "There is no Bayesian reference: the posterior of some row did not converge. Lower the compression, or let \
                 nodes move along z only."
            }
            Self::Missing(NoReference::Rounding) => {
                "There is no Bayesian reference: the deformation shows in the last digits of the readings only, so that their \
                 rounding decides what can be known. Raise the compression or the height, or let nodes move along z only; \
                 with noise of 1e-12 or more there is one."
            }
            Self::Missing(NoReference::Sampling) => {
                "There is no Bayesian reference: too few of the deformations sampled from the loading explain the readings \
                 to estimate their posterior. Raise the noise, or let nodes move along z only."
            }
            Self::Missing(NoReference::TooLarge) => {
                "There is no Bayesian reference: sampling the posteriors of that many or such large rows would take many \
                 minutes. Lower the number of test samples, or the size of the array."
            }
            Self::AboveMean => {
                "The Bayesian reference is no bound here, for it is above the training mean: the readings determine next \
                 to nothing, and both differ by chance. Lower the noise, or draw more test samples."
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        evaluation::Errors,
        scene::Scene,
        sensor::SensorModel,
    };

    #[test]
    fn a_reference_above_the_mean_is_no_bound() {
        let model = SensorModel::new("2x2_2x6".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 4, &mut Seed(0).rng(Stream::Test)).unwrap();
        let off = |by_mm: f64| {
            let answers = set.targets().mapv(|value| value + by_mm);
            TestErrors::Nodes(Errors::measure(&set, &answers, 1.0))
        };
        let baselines = |reference: Option<TestErrors>| Baselines {
            mean: off(0.25),
            linear: off(0.1),
            no_reference: reference.is_none().then_some(NoReference::NotConverged),
            reference,
        };
        assert_eq!(ReferenceNote::of(&baselines(Some(off(0.2)))), None);
        assert_eq!(
            ReferenceNote::of(&baselines(Some(off(0.26)))),
            Some(ReferenceNote::AboveMean)
        );
        let missing = ReferenceNote::of(&baselines(None)).unwrap().to_string();
        assert!(missing.contains("converge") && missing.contains("Lower"), "{missing}");
    }
}
