use super::Diagnosis;
use glam::DVec3;

use crate::{
    decoupling::{DecodeError, Decoder, Estimator},
    scene::{Loading, Scene},
    sensor::{SensorError, SensorModel},
};

/// Decodes known rows by Eq. (2), with the wire of a named fault left out, if there is one.
///
/// Readings of faulty column-wires have no influence. A faulty row-wire is interpolated from its neighbours in the same
/// frame, or set to the mean deformation of the scene if nodes are independent or the row is decoded alone. Each answer
/// depends only on the readings given, not on earlier frames.
#[derive(Debug)]
pub struct LeftOutDecoder {
    model: SensorModel,
    /// Row-wires read.
    rows: Vec<usize>,
    estimator: Estimator,
    fault: Option<Diagnosis>,
    /// True if the deformations of neighbouring rows are correlated.
    has_neighbours: bool,
}

impl LeftOutDecoder {
    /// Prepares to decode `rows` of `model` in `scene`, initially with all wires.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        Ok(Self {
            model: *model,
            rows: rows.to_vec(),
            estimator: Estimator::new(model, scene, rows)?,
            fault: None,
            has_neighbours: scene.loading != Loading::RandomNodes,
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
        let mut coordinates_mm = vec![0.0; self.rows.len() * outputs];
        self.decode(frame, &mut coordinates_mm)?;
        targets.copy_from_slice(&coordinates_mm[row_index * outputs..][..outputs]);
        Ok(())
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

    fn decode_rows(&mut self, row_indices: &[usize], readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs) = (self.channels(), self.outputs());
        let sizes = (row_indices.len() * channels, row_indices.len() * outputs);
        assert_eq!((readings.len(), targets.len()), sizes, "whole rows");
        let rows = readings.chunks_exact(channels).zip(targets.chunks_exact_mut(outputs));
        for (place, (&row_index, (readings, targets))) in row_indices.iter().zip(rows).enumerate() {
            let left_out = match self.fault {
                Some(_) if self.is_dead(row_index) => 0..channels,
                Some(fault) => fault.wire.columns(),
                None => 0..0,
            };
            let solved = self
                .estimator
                .solve_without(left_out, self.rows[row_index], readings, targets);
            solved.map_err(|error| error.after(place))?;
        }
        Ok(())
    }

    /// Decodes a frame. Unlike with other decoders, this is more accurate for a faulty row than [`Self::decode_row`],
    /// which has no access to the neighbouring rows.
    fn decode(&mut self, frame: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let all = Vec::from_iter(0..self.rows.len());
        self.decode_rows(&all, frame, targets)?;
        let dead = (0..self.rows.len()).find(|&row_index| self.is_dead(row_index));
        if let Some(dead) = dead.filter(|_| self.has_neighbours) {
            self.interpolate(dead, targets);
        }
        Ok(())
    }
}
