use std::fmt::Display;

use glam::DVec3;

use super::NetworkFile;
use crate::import::Recorded;
use decoupler_core::{
    evaluation::{Problem, RunSettings, Scores, SimulatedSettings, StartRecord, TargetPosition, TestErrors},
    network::{DecouplingNetwork, Networks},
};

/// Describes the first defect of a network file and its field. Checked before writing and after reading, so
/// that every file that is written can be read.
pub(super) fn defect(file: &NetworkFile) -> Option<String> {
    let NetworkFile {
        program: _,
        settings,
        recorded,
        problem,
        row_wires,
        network,
        training,
        scores: Scores {
            network: errors,
            baselines,
        },
    } = file;
    let weight = |network: &DecouplingNetwork| {
        let weights = network.mlp().weights();
        weights.iter().position(|weight| !weight.is_finite())
    };
    let last_epoch = training.history.last().map(|record| record.epoch);
    let simulated = settings.simulated();
    let defects = [
        (network.values().iter().find_map(weight))
            .map(|index| format!("network: weight {index} is not a finite number")),
        number_defect(network, settings, row_wires.as_deref()),
        (network.values().iter()).find_map(|network| mismatch(network, problem, settings.hidden)),
        simulated.and_then(|settings| place_defect(network, &settings)),
        last_epoch.is_none().then(|| "training.history: it is empty".to_owned()),
        last_epoch
            .filter(|&last| training.best_epoch > last)
            .map(|last| format!("training.best_epoch: {} is after the last, {last}", training.best_epoch)),
        (!(training.seconds >= 0.0 && training.seconds.is_finite()))
            .then(|| format!("training.seconds: {} is not a time", training.seconds)),
        starts_defect(file),
        unmeasured("scores.network", errors, problem),
        unmeasured("scores.baselines.mean", &baselines.mean, problem),
        unmeasured("scores.baselines.linear", &baselines.linear, problem),
        (baselines.reference.as_ref())
            .and_then(|reference| unmeasured("scores.baselines.reference", reference, problem)),
    ];
    let is_placed = |position: &TargetPosition| position.target < problem.targets.len();
    let problem_defect = match simulated {
        Some(settings) if *problem != settings.source.problem() => Some("problem: it is not that of the array"),
        None if problem.has_nodes => Some("problem: the targets of a recording are not nodes"),
        None if !problem.positions.iter().all(is_placed) => Some("problem.positions: a target does not exist"),
        _ => None,
    };
    settings_defect(settings, recorded.as_ref())
        .or(problem_defect.map(str::to_owned))
        .or_else(|| defects.into_iter().flatten().next())
}

/// Describes the first impossible value of the settings in a file, and its field.
pub(super) fn settings_defect(settings: &RunSettings, recorded: Option<&Recorded>) -> Option<String> {
    let at = |field: &str, defect: &dyn Display| format!("{field}: {defect}");
    let training = settings
        .training
        .check()
        .map_err(|defect| at("settings.training", &defect));
    let source = match settings.simulated() {
        Some(settings) => [
            settings.check_counts().map_err(|defect| at("settings", &defect)),
            (settings.source.sensor.check()).map_err(|defect| at("settings.source.sensor", &defect)),
            (settings.source.scene.check()).map_err(|defect| at("settings.source.scene", &defect)),
        ],
        None => [
            settings.check_network().map_err(|defect| at("settings", &defect)),
            Ok(()),
            Ok(()),
        ],
    };
    let is_recording = settings.source.simulation().is_none();
    let recorded = match recorded {
        Some(_) if !is_recording => Err("recorded: the source is a simulated array".to_owned()),
        None if is_recording => Err("recorded: it is missing".to_owned()),
        _ => Ok(()),
    };
    let checks = source.into_iter().chain([training, recorded]);
    checks.into_iter().find_map(Result::err)
}

fn starts_defect(file: &NetworkFile) -> Option<String> {
    let starts = &file.training.starts;
    if !starts.is_empty() && starts.len() != file.settings.starts {
        let (found, expected) = (starts.len(), file.settings.starts);
        return Some(format!(
            "training.starts: {found} of them, but the settings ask for {expected}"
        ));
    }
    let infinite = |start: &StartRecord| {
        let figures = [Some(start.train_mse), start.validation_mse, start.percent()];
        figures.into_iter().flatten().any(|figure| !figure.is_finite())
    };
    let place = starts.iter().position(infinite)?;
    Some(format!(
        "training.starts: an error of number {place} is not a finite number"
    ))
}

fn number_defect(network: &Networks, settings: &RunSettings, row_wires: Option<&[usize]>) -> Option<String> {
    let found = network.values().len();
    match settings.simulated().map(|settings| settings.source) {
        Some(source) => match source.model_size() {
            Ok(size) if size.networks == found => None,
            Ok(size) => Some(format!(
                "network: {found} of them, but rows {} of {} need {}",
                source.scene.rows, source.sensor.scale, size.networks
            )),
            Err(defect) => Some(format!("settings.source.scene.rows: {defect}")),
        },
        None => {
            let rows = row_wires.map_or(1, <[usize]>::len);
            (found != 1 && found != rows).then(|| format!("network: {found} of them for {rows} row-wires"))
        }
    }
}

fn mismatch(network: &DecouplingNetwork, problem: &Problem, hidden: usize) -> Option<String> {
    let sizes = [
        ("reads", network.inputs().channels(), problem.inputs.len(), "readings"),
        ("gives", network.outputs().channels(), problem.targets.len(), "targets"),
        ("has", network.mlp().shape().hidden, hidden, "hidden nodes"),
    ];
    let (verb, found, expected, what) = sizes.into_iter().find(|(_, found, expected, _)| found != expected)?;
    Some(format!(
        "network: it {verb} {found} {what}, but the settings need {expected}"
    ))
}

/// Describes the first coordinate of a training whose range no node of the scene reaches, even with a stroke to spare.
/// Expects networks whose sizes and number fit the settings, and says nothing of others.
fn place_defect(networks: &Networks, settings: &SimulatedSettings) -> Option<String> {
    let source = &settings.source;
    let (sensor, scene) = (&source.sensor, &source.scene);
    let rows = scene.rows.read(sensor.scale.rows()).ok()?;
    let spare_mm = source.stroke_mm() + scene.movement.largest_shift_mm();
    for (index, network) in networks.values().iter().enumerate() {
        let outputs = network.outputs();
        let rows = match networks.only() {
            Some(_) => &rows[..],
            None => rows.get(index..=index)?,
        };
        if outputs.channels() != sensor.scale.coordinates_per_row() {
            return None;
        }
        for channel in 0..outputs.channels() {
            let (node, axis) = (channel / 3, channel % 3);
            let rest_mm = rows
                .iter()
                .map(|&row| sensor.displaced_mm(row, node, DVec3::ZERO).to_array()[axis]);
            let (low, high) = rest_mm.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), rest_mm| {
                (low.min(rest_mm), high.max(rest_mm))
            });
            let rounding_mm = 1e-9 * (low.abs().max(high.abs()) + spare_mm);
            let possible = low - spare_mm - rounding_mm..=high + spare_mm + rounding_mm;
            let (least, most) = outputs.extremes(channel);
            if !(possible.contains(&least) && possible.contains(&most)) {
                return Some(format!(
                    "network: node {} was trained from {least:e} to {most:e} mm, but lies from {low} to {high} mm",
                    node + 1
                ));
            }
        }
    }
    None
}

fn unmeasured(place: &str, errors: &TestErrors, problem: &Problem) -> Option<String> {
    match errors {
        TestErrors::Nodes(_) if !problem.has_nodes => return Some(format!("{place}: the targets are not nodes")),
        TestErrors::Targets(_) if problem.has_nodes => return Some(format!("{place}: the targets are nodes")),
        TestErrors::Targets(targets) if targets.len() != problem.targets.len() => {
            let (found, expected) = (targets.len(), problem.targets.len());
            return Some(format!("{place}: {found} of them for {expected} targets"));
        }
        _ => {}
    }
    let name = errors.infinite_figure()?;
    Some(format!("{place}.{name}: it is not a finite number"))
}
