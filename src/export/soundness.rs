use std::fmt::Display;

use glam::DVec3;

use super::NetworkFile;
use crate::{
    evaluation::{Baselines, Errors, SimulatedSettings, StartRecord},
    network::{DecouplingNetwork, Networks},
    sensor::ArrayScale,
};

/// Describes the first defect of a network file and its field. Checked before writing and after reading, so
/// that every file that is written can be read.
pub(super) fn flaw(file: &NetworkFile) -> Option<String> {
    let NetworkFile {
        program: _,
        version: _,
        settings,
        network,
        training,
        errors,
        baselines:
            Baselines {
                mean,
                linear,
                reference,
                no_reference: _,
            },
    } = file;
    let weight = |network: &DecouplingNetwork| {
        let weights = network.mlp().weights();
        weights.iter().position(|weight| !weight.is_finite())
    };
    let last_epoch = training.history.last().map(|record| record.epoch);
    let flaws = [
        (network.values().iter().find_map(weight))
            .map(|index| format!("network: weight {index} is not a finite number")),
        number_flaw(network, settings),
        (network.values().iter()).find_map(|network| mismatch(network, settings.source.sensor.scale, settings.hidden)),
        place_flaw(network, settings),
        last_epoch.is_none().then(|| "training.history: it is empty".to_owned()),
        last_epoch
            .filter(|&last| training.best_epoch > last)
            .map(|last| format!("training.best_epoch: {} is after the last, {last}", training.best_epoch)),
        (!(training.seconds >= 0.0 && training.seconds.is_finite()))
            .then(|| format!("training.seconds: {} is not a time", training.seconds)),
        starts_flaw(file),
        unmeasured("errors", errors),
        unmeasured("baselines.mean", mean),
        unmeasured("baselines.linear", linear),
        reference
            .as_ref()
            .and_then(|reference| unmeasured("baselines.reference", reference)),
    ];
    settings_flaw(settings).or_else(|| flaws.into_iter().flatten().next())
}

/// Describes the first impossible value of the settings in a file, and its field.
pub(super) fn settings_flaw(settings: &SimulatedSettings) -> Option<String> {
    let at = |field: &str, flaw: &dyn Display| format!("{field}: {flaw}");
    let checks = [
        settings.check_counts().map_err(|flaw| at("settings", &flaw)),
        settings
            .source
            .sensor
            .check()
            .map_err(|flaw| at("settings.source.sensor", &flaw)),
        settings
            .source
            .scene
            .check()
            .map_err(|flaw| at("settings.source.scene", &flaw)),
        settings.training.check().map_err(|flaw| at("settings.training", &flaw)),
    ];
    checks.into_iter().find_map(Result::err)
}

fn starts_flaw(file: &NetworkFile) -> Option<String> {
    let starts = &file.training.starts;
    if !starts.is_empty() && starts.len() != file.settings.starts {
        let (found, expected) = (starts.len(), file.settings.starts);
        return Some(format!(
            "training.starts: {found} of them, but the settings ask for {expected}"
        ));
    }
    let infinite = |start: &StartRecord| {
        let figures = [Some(start.train_mse), start.validation_mse, start.z_percent];
        figures.into_iter().flatten().any(|figure| !figure.is_finite())
    };
    let place = starts.iter().position(infinite)?;
    Some(format!(
        "training.starts: an error of number {place} is not a finite number"
    ))
}

fn number_flaw(network: &Networks, settings: &SimulatedSettings) -> Option<String> {
    let (found, rows) = (network.values().len(), settings.source.scene.rows);
    match settings.source.model_size() {
        Ok(size) if size.networks == found => None,
        Ok(size) => Some(format!(
            "network: {found} of them, but rows {rows} of {} need {}",
            settings.source.sensor.scale, size.networks
        )),
        Err(flaw) => Some(format!("settings.source.scene.rows: {flaw}")),
    }
}

fn mismatch(network: &DecouplingNetwork, scale: ArrayScale, hidden: usize) -> Option<String> {
    let sizes = [
        ("reads", network.inputs().channels(), scale.columns(), "resistances"),
        (
            "gives",
            network.outputs().channels(),
            scale.coordinates_per_row(),
            "coordinates",
        ),
        ("has", network.mlp().shape().hidden, hidden, "hidden nodes"),
    ];
    let (verb, found, expected, what) = sizes.into_iter().find(|(_, found, expected, _)| found != expected)?;
    Some(format!(
        "network: it {verb} {found} {what}, but array {scale} with {hidden} hidden nodes needs {expected}"
    ))
}

/// Describes the first coordinate of a training whose range no node of the scene reaches, even with a stroke to spare.
/// Expects networks whose sizes and number fit the settings, and says nothing of others.
fn place_flaw(networks: &Networks, settings: &SimulatedSettings) -> Option<String> {
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

fn unmeasured(place: &str, errors: &Errors) -> Option<String> {
    let Errors {
        z_percent,
        x_percent,
        y_percent,
        z_mm,
        z_full_scale_percent,
        worst_mm,
        worst_node: _,
    } = *errors;
    let figures = [
        ("z_percent", z_percent),
        ("x_percent", x_percent),
        ("y_percent", y_percent),
        ("z_mm", Some(z_mm)),
        ("z_full_scale_percent", Some(z_full_scale_percent)),
        ("worst_mm", Some(worst_mm)),
    ];
    let infinite = |(_, figure): &(_, Option<f64>)| figure.is_some_and(|figure| !figure.is_finite());
    let (name, _) = figures.into_iter().find(infinite)?;
    Some(format!("{place}.{name}: it is not a finite number"))
}
