use super::{CalibrationError, PressedRow};
use crate::{
    dataset::Dataset,
    numerics::median,
    scene::Scene,
    sensor::{SensorModel, short},
};

/// Tolerance beyond the limits for measurement errors of a displacement, relative to the height.
const TOLERANCE: f64 = 0.02;
/// Factor by which a reading may differ from the value that the sensor model and the other readings suggest.
const LARGEST_FACTOR: f64 = 1e3;

/// Checks the samples of `set`, known presses on a sensor like `nominal` as in [`Calibration::fit`](super::Calibration::fit), before they are used to calibrate it or to train a
/// network. A sensor whose readings all differ from those of `nominal` by the same factor passes. Nodes move as far as in
/// `scene`; without one, down as far as the column-wires, and sideways by any distance.
///
/// # Errors
/// If the nominal sensor is impossible, the samples have no row-wires, or a sample does not belong to the array, has a reading that is not a
/// resistance or is implausible, or a displacement outside these limits.
///
/// # Panics
/// If there are not 3·M2 targets.
pub fn check_presses(nominal: &SensorModel, scene: Option<&Scene>, set: &Dataset) -> Result<(), CalibrationError> {
    check(nominal, scene, &PressedRow::of(set, nominal)?)
}

pub(super) fn check(
    nominal: &SensorModel,
    scene: Option<&Scene>,
    samples: &[PressedRow],
) -> Result<(), CalibrationError> {
    nominal.check()?;
    let mut faults = samples.iter().map(|pressed| fault(nominal, scene, pressed)).enumerate();
    if let Some((sample, Some(fault))) = faults.find(|(_, fault)| fault.is_some()) {
        return Err(CalibrationError::Sample { sample, fault });
    }
    check_factors(nominal, samples)
}

/// Returns what is wrong with a sample, if anything.
fn fault(nominal: &SensorModel, scene: Option<&Scene>, pressed: &PressedRow) -> Option<String> {
    let (scale, height_mm) = (nominal.scale, nominal.geometry.height_mm);
    let counts = [
        ("displacements", pressed.displacements_mm.len(), scale.nodes_per_row()),
        ("readings", pressed.resistances_ohm.len(), scale.columns()),
    ];
    let wrong = counts.into_iter().find(|(_, found, expected)| found != expected);
    let row = ("as row-wire number", pressed.row + 1, scale.rows());
    if let Some((what, found, expected)) = wrong.or_else(|| (pressed.row >= scale.rows()).then_some(row)) {
        return Some(format!(
            ": {found} {what}, but the array {scale} has {expected}; give samples of this array"
        ));
    }
    let tolerance_mm = TOLERANCE * height_mm;
    let [largest_depth_mm, largest_shift_mm] = match scene {
        Some(scene) => [scene.stroke_mm(&nominal.geometry), scene.movement.largest_shift_mm()],
        None => [height_mm, f64::INFINITY],
    };
    for (node, displacement) in pressed.displacements_mm.iter().enumerate() {
        if !(displacement.is_finite() && displacement.z < height_mm) {
            return Some(format!(
                ", node {}: this displacement puts the node on or below the column-wires; check the unit (mm, downwards \
                 positive) and the height of the nominal sensor",
                node + 1
            ));
        }
        let shift_mm = displacement.truncate().abs().max_element();
        for (direction, mm, at_most, largest_mm) in [
            ("pressed down", displacement.z, "only 0 to", largest_depth_mm),
            ("shifted sideways", shift_mm, "at most", largest_shift_mm),
        ] {
            if mm < -tolerance_mm || mm > largest_mm + tolerance_mm {
                return Some(format!(
                    ", node {}: it is {direction} by {} mm, but {at_most} {} mm is possible; correct it, or leave this \
                     sample out",
                    node + 1,
                    rounded(mm),
                    short(largest_mm)
                ));
            }
        }
    }
    let mut readings = pressed.resistances_ohm.iter().enumerate();
    let (column, ohm) = readings.find(|(_, ohm)| !(**ohm > 0.0 && ohm.is_finite()))?;
    Some(format!(
        ", column {}: the reading {} is not a resistance; leave this sample out",
        column + 1,
        short(*ohm)
    ))
}

/// Formats as [`short`] does, with four significant digits.
fn rounded(value: f64) -> String {
    let digits = format!("{value:.3e}");
    digits.parse().map_or(digits, short)
}

/// Compares ln of each reading and of the resistance of `nominal` with the median of their differences.
fn check_factors(nominal: &SensorModel, samples: &[PressedRow]) -> Result<(), CalibrationError> {
    let mut differences = Vec::with_capacity(samples.len() * nominal.scale.columns());
    for pressed in samples {
        let resistances_ohm = nominal.row_resistances(pressed.row, &pressed.displacements_mm)?;
        let pairs = pressed.resistances_ohm.iter().zip(resistances_ohm);
        differences.extend(pairs.map(|(read_ohm, ohm)| read_ohm.ln() - ohm.ln()));
    }
    if differences.is_empty() {
        return Ok(());
    }
    let median = median(differences.clone());
    let is_absurd = |difference: &f64| (difference - median).abs() > LARGEST_FACTOR.ln();
    let Some(place) = differences.iter().position(is_absurd) else {
        return Ok(());
    };
    let (sample, column) = (place / nominal.scale.columns(), place % nominal.scale.columns());
    let ohm = samples[sample].resistances_ohm[column];
    let fault = format!(
        ", column {}: the reading {} ohm is implausible: the sensor model and the other readings suggest {} ohm; correct it, \
         or leave this sample out",
        column + 1,
        short(ohm),
        rounded(ohm / (differences[place] - median).exp())
    );
    Err(CalibrationError::Sample { sample, fault })
}
