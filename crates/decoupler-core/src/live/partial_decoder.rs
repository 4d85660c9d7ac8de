use std::fmt;

use glam::DVec3;

use crate::{
    decoupling::{DecodeError, Decoder, Estimator},
    scene::{Rows, Scene},
    sensor::{SensorError, SensorModel},
};

/// Decodes rows of which some readings are missing, by a decoder that needs all of them.
///
/// Missing readings are replaced by those of Eq. (2) at the answer, until both agree. They then have no residual, and no
/// influence on an answer of least squares: the EM algorithm (Dempster, Laird and Rubin 1977,
/// doi:10.1111/j.2517-6161.1977.tb01600.x), accelerated by Anderson's method (1965, doi:10.1145/321296.321305).
pub(super) struct PartialDecoder {
    pub(super) model: SensorModel,
    decoder: Box<dyn Decoder>,
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
    /// Prepares to decode `rows` of `model` by `decoder`, whose answers are absolute coordinates.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub(super) fn new(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        decoder: Box<dyn Decoder>,
    ) -> Result<Self, SensorError> {
        let half_way = vec![DVec3::Z * (0.5 * scene.stroke_mm(&model.geometry)); model.scale.nodes_per_row()];
        let mut half_way_ohm = Vec::with_capacity(rows.len() * model.scale.columns());
        for &row in rows {
            half_way_ohm.extend(model.row_resistances(row, &half_way)?);
        }
        Ok(Self {
            model: *model,
            decoder,
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
        let mut last: Option<[[f64; 2]; 2]> = None;
        for _ in 0..MAX_STEPS {
            self.decoder.decode_row(row_index, &self.filled_ohm, coordinates_mm)?;
            self.predict(row_index, coordinates_mm);
            let log_of = |ohm: &[f64], place: usize| missing[place].map_or(0.0, |column| ohm[column].ln());
            let at = [0, 1].map(|place| log_of(&self.filled_ohm, place));
            let log_gain = self.log_gain(missing);
            let misfit = [0, 1].map(|place| match missing[place] {
                Some(column) => self.predicted_ohm[column].ln() + log_gain - at[place],
                None => 0.0,
            });
            let apart = misfit[0].abs().max(misfit[1].abs());
            if apart <= TOLERANCE || apart.is_nan() {
                break;
            }
            let next = match last.replace([at, misfit]) {
                Some([last_at, last_misfit]) => extrapolated((at, misfit), (last_at, last_misfit)),
                None => [0, 1].map(|place| at[place] + misfit[place]),
            };
            for (place, column) in missing.into_iter().enumerate() {
                if let Some(column) = column {
                    let step = (next[place] - at[place]).clamp(-LONGEST_STEP, LONGEST_STEP);
                    self.filled_ohm[column] = (at[place] + step).exp();
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

impl fmt::Debug for PartialDecoder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PartialDecoder")
            .field("rows", &self.rows)
            .finish_non_exhaustive()
    }
}

/// The next value from two values with their misfits, which vanishes if misfits are linear in one value.
fn extrapolated((at, misfit): ([f64; 2], [f64; 2]), (last_at, last_misfit): ([f64; 2], [f64; 2])) -> [f64; 2] {
    let change = [0, 1].map(|place| misfit[place] - last_misfit[place]);
    let product = |other: [f64; 2]| change[0] * other[0] + change[1] * other[1];
    let share = product(misfit) / product(change);
    let share = if share.is_finite() { share } else { 0.0 };
    [0, 1].map(|place| at[place] + misfit[place] - share * (at[place] - last_at[place] + change[place]))
}

/// Decoder of known rows by Eq. (2), with the noise and the deformations of `scene`.
///
/// # Errors
/// If the model has no resistance.
pub fn equation_decoder(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Box<dyn Decoder>, SensorError> {
    let scene = Scene {
        rows: Rows::Known,
        ..*scene
    };
    Ok(Box::new(OfKnownRows {
        estimator: Estimator::new(model, &scene, rows)?,
        rows: rows.to_vec(),
        channels: model.scale.columns(),
        outputs: model.scale.coordinates_per_row(),
    }))
}

struct OfKnownRows {
    estimator: Estimator,
    rows: Vec<usize>,
    channels: usize,
    outputs: usize,
}

impl Decoder for OfKnownRows {
    fn channels(&self) -> usize {
        self.channels
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.estimator.solve(self.rows[row_index], readings, targets)?;
        Ok(())
    }
}
