use glam::{DVec2, DVec3};

use crate::{
    decoupling::{DecodeError, Decoder, NewtonDecoder},
    scene::{Rows, Scene},
    sensor::{SensorError, SensorModel},
};

/// Decodes known rows of which some readings are missing, by a decoder of Eq. (2) that needs all of them.
///
/// Missing readings are replaced by those of Eq. (2) at the answer, until both agree. They then have no residual, and no
/// influence on an answer of least squares: the EM algorithm (Dempster, Laird and Rubin 1977,
/// doi:10.1111/j.2517-6161.1977.tb01600.x), accelerated by Anderson's method (1965, doi:10.1145/321296.321305).

#[derive(Debug)]
pub(super) struct PartialDecoder {
    pub(super) model: SensorModel,
    decoder: NewtonDecoder,
    /// Row-wires read.
    pub(super) rows: Vec<usize>,
    /// Resistances with all nodes half-way down, with which missing readings begin: rows × M4.
    pub(super) half_way_ohm: Vec<f64>,
    /// True if the readings of a row have a common gain error.
    has_gain: bool,
    filled_ohm: Vec<f64>,
    /// Displacements of the nodes at the last answer: M2.
    pub(super) displacements_mm: Vec<DVec3>,
    /// Resistances at the last answer: M4.
    pub(super) predicted_ohm: Vec<f64>,
}

/// Up to two column-wires without readings.
pub(super) type Missing = [Option<usize>; 2];

/// Difference of ln R at which a replaced reading agrees with its prediction.
const TOLERANCE: f64 = 1e-6;
const MAX_STEPS: usize = 20;
/// Longest step of ln R.
const LONGEST_STEP: f64 = 3.0;

impl PartialDecoder {
    /// Prepares to decode `rows` of `model` in `scene`, with the prior of the deformations of `presses`.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub(super) fn new(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        presses: &Scene,
    ) -> Result<Self, SensorError> {
        let known = Scene {
            rows: Rows::Known,
            ..*presses
        };
        let half_way = vec![DVec3::Z * (0.5 * scene.stroke_mm(&model.geometry)); model.scale.nodes_per_row()];
        let mut half_way_ohm = Vec::with_capacity(rows.len() * model.scale.columns());
        for &row in rows {
            half_way_ohm.extend(model.row_resistances(row, &half_way)?);
        }
        Ok(Self {
            model: *model,
            decoder: NewtonDecoder::new(model, &known, rows)?,
            rows: rows.to_vec(),
            half_way_ohm,
            has_gain: scene.noise.in_test().drift > 0.0,
            filled_ohm: vec![0.0; model.scale.columns()],
            displacements_mm: half_way,
            predicted_ohm: vec![0.0; model.scale.columns()],
        })
    }

    /// Decodes a row without the `missing` readings into absolute coordinates (3·M2).
    ///
    /// # Errors
    /// If a reading is not a resistance.
    pub(super) fn decode_row(
        &mut self,
        row_index: usize,
        readings_ohm: &[f64],
        missing: Missing,
        coordinates_mm: &mut [f64],
    ) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        self.filled_ohm.copy_from_slice(readings_ohm);
        for column in missing.into_iter().flatten() {
            self.filled_ohm[column] = self.half_way_ohm[row_index * readings_ohm.len() + column];
        }
        let logs = |ohm: &[f64]| DVec2::from_array(missing.map(|column| column.map_or(0.0, |column| ohm[column].ln())));
        let is_missing = DVec2::from_array(missing.map(|column| if column.is_some() { 1.0 } else { 0.0 }));
        let mut last: Option<(DVec2, DVec2)> = None;
        for _ in 0..MAX_STEPS {
            self.decoder.decode_row(row_index, &self.filled_ohm, coordinates_mm)?;
            self.predict(row_index, coordinates_mm);
            let at = logs(&self.filled_ohm);
            let misfit = logs(&self.predicted_ohm) + self.log_gain(missing) * is_missing - at;
            if !misfit.is_finite() || misfit.abs().max_element() <= TOLERANCE {
                break;
            }
            let mut step = misfit;
            if let Some((last_at, last_misfit)) = last.replace((at, misfit)) {
                // The step after which the misfit vanishes if it is linear in one value.
                let change = misfit - last_misfit;
                let share = misfit.dot(change) / change.length_squared();
                if share.is_finite() {
                    step -= share * (at - last_at + change);
                }
            }
            let next = at + step.clamp(DVec2::splat(-LONGEST_STEP), DVec2::splat(LONGEST_STEP));
            for (column, log_ohm) in missing.into_iter().zip(next.to_array()) {
                if let Some(column) = column {
                    self.filled_ohm[column] = log_ohm.exp();
                }
            }
        }
        Ok(())
    }

    /// Mean of ln m − ln R over the readings m that are not missing, if their gain is not known to be 1.
    fn log_gain(&self, missing: Missing) -> f64 {
        if !self.has_gain {
            return 0.0;
        }
        let pairs = self.filled_ohm.iter().zip(&self.predicted_ohm).enumerate();
        let misfits = pairs.filter(|(column, _)| !missing.contains(&Some(*column)));
        let (sum, count) = misfits.fold((0.0, 0.0), |(sum, count), (_, (reading, ohm))| {
            (sum + (reading / ohm).ln(), count + 1.0)
        });
        sum / f64::max(count, 1.0)
    }

    /// Sets the resistances to those at these coordinates; to NaN if there are none.
    fn predict(&mut self, row_index: usize, coordinates_mm: &[f64]) {
        let row = self.rows[row_index];
        let nodes = self.displacements_mm.iter_mut().zip(coordinates_mm.chunks_exact(3));
        for (node, (displacement, at)) in nodes.enumerate() {
            *displacement = self.model.displacement_mm(row, node, DVec3::from_slice(at));
        }
        let predicted = (self.model).row_resistances_into(row, &self.displacements_mm, &mut self.predicted_ohm);
        if predicted.is_err() {
            self.predicted_ohm.fill(f64::NAN);
        }
    }
}
