use glam::DVec3;
use ndarray::Array2;

use super::RunError;
use crate::{
    dataset::Dataset,
    sensor::{PressedRow, SensorModel},
};

/// Returns the samples of `set` as readings of known deformations, for [`Calibration::fit`](crate::sensor::Calibration::fit).
/// Its targets are the absolute coordinates of the row's nodes in millimetres, as `sensor` places its nodes at rest.
///
/// # Errors
/// If the samples do not know their row-wire.
///
/// # Panics
/// If the targets are not 3·M2, or a row-wire is not one of the array.
pub fn pressed_rows(set: &Dataset, sensor: &SensorModel) -> Result<Vec<PressedRow>, RunError> {
    let pressed = |sample: usize| {
        let row = set.row_wire(sample).ok_or(RunError::NoRowWires)?;
        Ok(PressedRow {
            frame: set.groups()[sample],
            row,
            displacements_mm: displacements_mm(set, sample, row, sensor),
            resistances_ohm: set.sample_readings(sample).to_vec(),
        })
    };
    (0..set.samples()).map(pressed).collect()
}

/// Returns `set` with its targets, coordinates in millimetres as `from` places its nodes at rest, replaced by those that
/// the same displacements give in `to`: so that a network trained on one model of a sensor can be judged by, or trained
/// on, samples described by another.
///
/// # Errors
/// If the samples do not know their row-wire.
///
/// # Panics
/// If the targets are not 3·M2, or a row-wire is not one of both arrays.
pub fn rebased(set: &Dataset, from: &SensorModel, to: &SensorModel) -> Result<Dataset, RunError> {
    let rows = (0..set.samples()).map(|sample| set.row_wire(sample));
    let rows: Vec<usize> = rows.collect::<Option<_>>().ok_or(RunError::NoRowWires)?;
    let mut targets = Array2::zeros(set.targets().dim());
    for (sample, (&row, mut moved)) in rows.iter().zip(targets.rows_mut()).enumerate() {
        let displacements = displacements_mm(set, sample, row, from).into_iter().enumerate();
        let coordinates =
            displacements.flat_map(|(node, displacement)| to.displaced_mm(row, node, displacement).to_array());
        moved.iter_mut().zip(coordinates).for_each(|(to, value)| *to = value);
    }
    let read = set.row_wires_read().unwrap_or_default();
    let moved = Dataset::new(set.readings().to_owned(), targets, Some(&rows), set.groups().to_vec());
    let moved = moved.and_then(|moved| moved.among_rows(read));
    Ok(moved.expect("the parts are those of a set"))
}

fn displacements_mm(set: &Dataset, sample: usize, row: usize, sensor: &SensorModel) -> Vec<DVec3> {
    let targets = set.sample_targets(sample);
    assert_eq!(
        targets.len(),
        sensor.scale.coordinates_per_row(),
        "targets are coordinates of the row's nodes"
    );
    let position = |(node, mm): (usize, &[f64])| sensor.displacement_mm(row, node, DVec3::from_slice(mm));
    targets.chunks_exact(3).enumerate().map(position).collect()
}
