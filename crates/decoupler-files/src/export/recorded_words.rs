use super::format_number;
use decoupler_core::{
    evaluation::{
        Channel, Problem, Scores, TargetPosition,
        recorded::{Determinacy, Determination, Findings, TargetFindings, Undetermined},
    },
    training::Method,
};

/// Warns of targets that the readings explain little of or that could not be judged; `measured` has an entry for each target.
pub fn describe_determinacy(targets: &[Channel], measured: &[Result<Determination, Undetermined>]) -> Vec<String> {
    let of = |(target, measured): (&Channel, &Result<Determination, Undetermined>)| match measured {
        Err(cause) => Some(format!("{}: {cause}", target.name)),
        Ok(measured) => (measured.determinacy() != Determinacy::Determined).then(|| measured.sentence(&target.name)),
    };
    targets.iter().zip(measured).filter_map(of).collect()
}

/// Describes the positions of targets: their number, and the grid if they are one; `None` if no target has a position.
pub fn describe_positions(positions: &[TargetPosition]) -> Option<String> {
    let count = match positions.len() {
        0 => return None,
        1 => "1 target has a position".to_owned(),
        count => format!("{count} targets have positions"),
    };
    Some(match TargetPosition::lattice(positions) {
        Some(lattice) => format!("{count}: a grid of {} × {}", lattice.x_mm().len(), lattice.y_mm().len()),
        None => format!("{count}, scattered over the skin"),
    })
}

/// Describes how much of a target the readings explain, by the better of network and ridge.
pub fn describe_target(name: &str, found: &TargetFindings) -> String {
    match found.best() {
        Some((_, best)) if found.network.is_some() => best.sentence(name),
        Some((_, best)) => format!("{}, as far as a linear map goes", best.sentence(name)),
        None => {
            let cause = found.ridge.err();
            let cause = cause.map_or_else(|| "nothing can be judged".to_owned(), |cause| cause.to_string());
            format!("{name}: {cause}")
        }
    }
}

/// Warns of channels that carry less information than they should, and of targets for which a network is no better than
/// ridge.
pub fn describe_warnings(inputs: &[Channel], targets: &[Channel], findings: &Findings) -> Vec<String> {
    let name = |channel: usize| inputs[channel].name.clone();
    let mut warnings: Vec<String> = findings.remarks.iter().map(|remark| remark.sentence(name)).collect();
    for (target, found) in targets.iter().zip(&findings.targets) {
        warnings.extend(found.gain.and_then(|gain| gain.remark(&target.name)));
    }
    warnings
}

/// Warns of the targets on which the network is worse than ridge, or no better to three digits; `None` if there are none.
pub fn describe_worse_than_ridge(problem: &Problem, scores: &Scores, method: Method) -> Option<String> {
    /// Targets that are named; of a skin there can be hundreds.
    const NAMED: usize = 3;
    let errors = scores.network.targets().iter().zip(scores.baselines.linear.targets());
    let all = problem.targets.iter().zip(errors);
    // R² is undefined for a target that is constant in the test samples.
    let worse = all.filter(|(_, (network, ridge))| network.r2.is_some() && network.rmse > ridge.rmse);
    let mut comparison = "no better than";
    let mut targets = Vec::new();
    for (target, (network, ridge)) in worse {
        let (of_network, of_ridge) = (format_number(network.rmse), format_number(ridge.rmse));
        targets.push(if of_network == of_ridge {
            format!("{} (RMSE {of_ridge} for both)", target.name)
        } else {
            comparison = "worse than";
            format!("{} (RMSE {of_network}, ridge {of_ridge})", target.name)
        });
    }
    let more = match targets.len() {
        0 => return None,
        count if count > NAMED + 1 => format!(" and {} more", count - NAMED),
        _ => String::new(),
    };
    if !more.is_empty() {
        targets.truncate(NAMED);
    }
    let cure = match method {
        Method::BayesianRegularization(_) => "record more samples, or use fewer hidden nodes",
        _ => "record more samples, or use fewer hidden nodes or Bayesian regularisation",
    };
    let targets = targets.join(", ");
    Some(format!(
        "the network is {comparison} ridge regression for {targets}{more}: take ridge, {cure}"
    ))
}
