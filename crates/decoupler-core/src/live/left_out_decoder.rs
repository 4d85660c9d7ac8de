use std::ops::Range;

use glam::{DVec2, DVec3};

use super::Diagnosis;
use crate::{
    dataset::{Seed, Stream},
    decoupling::{DecodeError, Decoder, NewtonDecoder},
    scene::{Loading, Rows, Scene},
    sensor::{SensorError, SensorModel},
};

/// Decodes known rows by Eq. (2), with the wire of a named fault left out, if there is one.
///
/// Readings of faulty column-wires have no influence: they are replaced by those of Eq. (2) at the answer, until both
/// agree. They then have no residual, and no influence on an answer of least squares: the EM algorithm (Dempster, Laird and
/// Rubin 1977, doi:10.1111/j.2517-6161.1977.tb01600.x), accelerated by Anderson's method (1965,
/// doi:10.1145/321296.321305).
///
/// A faulty row-wire is interpolated from its neighbours in the same frame, or set to the mean deformation of the scene if
/// nodes are independent or the row is decoded alone. Each answer depends only on the readings given, not on earlier
/// frames.
#[derive(Debug)]
pub struct LeftOutDecoder {
    pub(super) model: SensorModel,
    /// Row-wires read.
    pub(super) rows: Vec<usize>,
    decoder: NewtonDecoder,
    fault: Option<Diagnosis>,
    /// True if the deformations of neighbouring rows are correlated.
    has_neighbours: bool,
    /// True if the readings of a row have a common gain error.
    has_gain: bool,
    /// Mean coordinates of every row read: rows × 3·M2, in millimetres.
    means_mm: Vec<f64>,
    /// Resistances with all nodes half-way down, with which missing readings begin: rows × M4.
    pub(super) half_way_ohm: Vec<f64>,
    filled_ohm: Vec<f64>,
    /// Displacements of the nodes at the last answer: M2.
    pub(super) displacements_mm: Vec<DVec3>,
    /// Resistances at the last answer: M4.
    pub(super) predicted_ohm: Vec<f64>,
    /// Decoded coordinates of a whole frame: rows × 3·M2, in millimetres.
    frame_mm: Vec<f64>,
}

/// Number of deformations drawn to estimate their mean.
const DRAWS: usize = 200;
/// Difference of ln R at which a replaced reading agrees with its prediction.
const TOLERANCE: f64 = 1e-6;
const MAX_STEPS: usize = 20;
/// Longest step of ln R.
const LONGEST_STEP: f64 = 3.0;

impl LeftOutDecoder {
    /// Prepares to decode `rows` of `model` in `scene`, initially with all wires.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let mut decoder = Self::with_prior(model, scene, rows, scene)?;
        let sampler = scene.sampler(model);
        let mut rng = Seed(0).rng(Stream::Expectation);
        for _ in 0..DRAWS {
            let drawn = sampler.draw(&mut rng);
            let positions = rows.iter().flat_map(|&row| drawn.row_positions_mm(model, row));
            let coordinates = positions.flat_map(|position| position.to_array());
            let sums = decoder.means_mm.iter_mut().zip(coordinates);
            sums.for_each(|(sum, coordinate)| *sum += coordinate / DRAWS as f64);
        }
        Ok(decoder)
    }

    /// As [`Self::new`], but with the prior of the deformations of `presses`, and mean coordinates of 0.
    pub(super) fn with_prior(
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
        let coordinates_mm = vec![0.0; rows.len() * model.scale.coordinates_per_row()];
        Ok(Self {
            model: *model,
            rows: rows.to_vec(),
            decoder: NewtonDecoder::new(model, &known, rows)?,
            fault: None,
            has_neighbours: scene.loading != Loading::RandomNodes,
            has_gain: scene.noise.in_test().drift > 0.0,
            means_mm: coordinates_mm.clone(),
            half_way_ohm,
            filled_ohm: vec![0.0; model.scale.columns()],
            displacements_mm: half_way,
            predicted_ohm: vec![0.0; model.scale.columns()],
            frame_mm: coordinates_mm,
        })
    }

    /// Sets the fault whose wire is left out from now on; `None` uses all wires.
    pub fn leave_out(&mut self, fault: Option<Diagnosis>) {
        self.fault = fault;
    }

    /// Returns the fault whose wire is left out.
    pub fn fault(&self) -> Option<Diagnosis> {
        self.fault
    }

    /// Returns `true` if no reading of a row-wire is used.
    fn is_dead(&self, row_index: usize) -> bool {
        self.fault.is_some_and(|fault| fault.wire.is_row(self.rows[row_index]))
    }

    /// Decodes one row of a frame with all rows read (rows × M4, in ohm) into 3·M2 `targets`.
    ///
    /// # Errors
    /// If a reading is not a valid resistance.
    ///
    /// # Panics
    /// If the frame has the wrong length.
    pub fn decode_row_of(&mut self, frame: &[f64], row_index: usize, targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs) = (self.channels(), self.outputs());
        assert_eq!(frame.len(), self.rows.len() * channels);
        if !self.is_dead(row_index) {
            return self.decode_row(row_index, &frame[row_index * channels..][..channels], targets);
        }
        let mut coordinates_mm = std::mem::take(&mut self.frame_mm);
        let decoded = self.decode(frame, &mut coordinates_mm);
        targets.copy_from_slice(&coordinates_mm[row_index * outputs..][..outputs]);
        self.frame_mm = coordinates_mm;
        decoded
    }

    /// Decodes a row without the readings of up to two column-wires into absolute coordinates (3·M2).
    ///
    /// # Errors
    /// If a reading is not a resistance.
    pub(super) fn decode_without(
        &mut self,
        missing: &Range<usize>,
        row_index: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        self.filled_ohm.copy_from_slice(readings_ohm);
        let half_way_ohm = &self.half_way_ohm[row_index * readings_ohm.len()..];
        self.filled_ohm[missing.clone()].copy_from_slice(&half_way_ohm[missing.clone()]);
        let logs_of_missing = |ohm: &[f64], log_gain: f64| {
            let mut logs = ohm[missing.clone()].iter().map(|ohm| ohm.ln() + log_gain);
            DVec2::new(logs.next().unwrap_or(0.0), logs.next().unwrap_or(0.0))
        };
        let mut last: Option<(DVec2, DVec2)> = None;
        for _ in 0..MAX_STEPS {
            self.decoder.decode_row(row_index, &self.filled_ohm, coordinates_mm)?;
            self.predict(row_index, coordinates_mm);
            let at = logs_of_missing(&self.filled_ohm, 0.0);
            let misfit = logs_of_missing(&self.predicted_ohm, self.log_gain(missing)) - at;
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
            for (ohm, log_ohm) in self.filled_ohm[missing.clone()].iter_mut().zip(next.to_array()) {
                *ohm = log_ohm.exp();
            }
        }
        Ok(())
    }

    /// Mean of ln m − ln R over the readings m that are not missing, if their gain is not known to be 1.
    fn log_gain(&self, missing: &Range<usize>) -> f64 {
        if !self.has_gain {
            return 0.0;
        }
        let pairs = self.filled_ohm.iter().zip(&self.predicted_ohm).enumerate();
        let present = pairs.filter(|(column, _)| !missing.contains(column));
        let sum: f64 = present.map(|(_, (reading, ohm))| (reading / ohm).ln()).sum();
        sum / f64::max((self.filled_ohm.len() - missing.len()) as f64, 1.0)
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

    /// Sets a row of `coordinates_mm` (rows × 3·M2) to the mean depth of its neighbours in the same frame, if it has any.
    fn interpolate(&self, row_index: usize, coordinates_mm: &mut [f64]) {
        let (outputs, row) = (self.outputs(), self.rows[row_index]);
        let is_neighbour = |index: &usize| self.rows[*index].abs_diff(row) == 1;
        let neighbours = Vec::from_iter((0..self.rows.len()).filter(is_neighbour));
        for node in (0..outputs / 3).filter(|_| !neighbours.is_empty()) {
            let z_mm = neighbours
                .iter()
                .map(|index| coordinates_mm[index * outputs + 3 * node + 2]);
            let depth_mm = self.model.geometry.height_mm - z_mm.sum::<f64>() / neighbours.len() as f64;
            let displaced_mm = self.model.displaced_mm(row, node, DVec3::Z * depth_mm);
            coordinates_mm[row_index * outputs + 3 * node..][..3].copy_from_slice(&displaced_mm.to_array());
        }
    }
}

impl Decoder for LeftOutDecoder {
    fn channels(&self) -> usize {
        self.model.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.model.scale.coordinates_per_row()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        if self.is_dead(row_index) {
            DecodeError::check(readings)?;
            targets.copy_from_slice(&self.means_mm[row_index * targets.len()..][..targets.len()]);
            return Ok(());
        }
        let missing = self.fault.map_or(0..0, |fault| fault.wire.columns());
        self.decode_without(&missing, row_index, readings, targets)
    }

    /// Decodes a frame. Unlike with other decoders, this is more accurate for a faulty row than [`Self::decode_row`],
    /// which has no access to the neighbouring rows.
    fn decode(&mut self, frame: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs, count) = (self.channels(), self.outputs(), self.rows.len());
        assert_eq!((frame.len() / channels, targets.len() / outputs), (count, count));
        let rows = frame.chunks_exact(channels).zip(targets.chunks_exact_mut(outputs));
        for (row_index, (readings, targets)) in rows.enumerate() {
            self.decode_row(row_index, readings, targets)
                .map_err(|error| DecodeError { row_index, ..error })?;
        }
        let dead = (0..count).find(|&row_index| self.is_dead(row_index));
        if let Some(dead) = dead.filter(|_| self.has_neighbours) {
            self.interpolate(dead, targets);
        }
        Ok(())
    }
}
