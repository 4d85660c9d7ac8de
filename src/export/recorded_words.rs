use super::format_number;
use crate::{
    evaluation::{
        TargetErrors,
        recorded::{Determination, Standing},
    },
    import::Channel,
};

/// Warns of targets that the readings do not tell, or hardly, by what was measured of each.
pub fn describe_standings(targets: &[Channel], told: &[Option<Determination>]) -> Vec<String> {
    let of = |(target, told): (&Channel, &Option<Determination>)| match told {
        None => Some(format!(
            "{} is constant in the test samples, or they are a single stretch: nothing can be judged",
            target.name
        )),
        Some(told) => (told.standing() != Standing::Told).then(|| told.sentence(&target.name)),
    };
    targets.iter().zip(told).filter_map(of).collect()
}

/// Warns of targets on which the network is worse than ridge.
pub fn describe_worse_than_ridge(targets: &[Channel], network: &[TargetErrors], ridge: &[TargetErrors]) -> Vec<String> {
    let errors = network.iter().zip(ridge);
    let worse = targets
        .iter()
        .zip(errors)
        .filter(|(_, (network, ridge))| network.rmse > ridge.rmse);
    let warning = |(target, (network, ridge)): (&Channel, (&TargetErrors, &TargetErrors))| {
        format!(
            "for {} the network is worse than ridge regression (RMSE {} against {}): take ridge, record more samples, or use \
             fewer hidden nodes or Bayesian regularisation",
            target.name,
            format_number(network.rmse),
            format_number(ridge.rmse)
        )
    };
    worse.map(warning).collect()
}
