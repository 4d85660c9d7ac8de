use glam::DVec3;

use super::{Diagnosis, partial_decoder::PartialDecoder};
use crate::{
    dataset::{Seed, Stream},
    decoupling::{DecodeError, Decoder},
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
    partial: PartialDecoder,
    fault: Option<Diagnosis>,
    /// Mean coordinates of every row read: rows × 3·M2, in millimetres.
    means_mm: Vec<f64>,
    /// True if the deformations of neighbouring rows are correlated.
    has_neighbours: bool,
    /// Decoded coordinates of a whole frame: rows × 3·M2, in millimetres.
    frame_mm: Vec<f64>,
}

/// Number of deformations drawn to estimate their mean.
const DRAWS: usize = 200;

impl LeftOutDecoder {
    /// Prepares to decode `rows` of `model` in `scene`, initially with all wires.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let sampler = scene.sampler(model);
        let mut rng = Seed(0).rng(Stream::Expectation);
        let mut means_mm = vec![0.0; rows.len() * model.scale.coordinates_per_row()];
        for _ in 0..DRAWS {
            let drawn = sampler.draw(&mut rng);
            let positions = rows.iter().flat_map(|&row| drawn.row_positions_mm(model, row));
            let coordinates = positions.flat_map(|position| position.to_array());
            let sums = means_mm.iter_mut().zip(coordinates);
            sums.for_each(|(sum, coordinate)| *sum += coordinate / DRAWS as f64);
        }
        Ok(Self {
            partial: PartialDecoder::new(model, scene, rows, scene)?,
            fault: None,
            frame_mm: means_mm.clone(),
            means_mm,
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
    fn is_dead(&self, row: usize) -> bool {
        self.fault.is_some_and(|fault| fault.wire.is_row(row))
    }

    /// Sets a row of `coordinates_mm` (rows × 3·M2) to the mean depth of its neighbours in the same frame, if it has any.
    fn interpolate(&self, row_index: usize, coordinates_mm: &mut [f64]) {
        let (model, rows) = (&self.partial.model, &self.partial.rows);
        let (nodes, row) = (model.scale.nodes_per_row(), rows[row_index]);
        let neighbours = || (0..rows.len()).filter(|&index| rows[index].abs_diff(row) == 1);
        let count = neighbours().count();
        for node in (0..nodes).filter(|_| count > 0) {
            let z_mm = |index: usize| coordinates_mm[3 * (index * nodes + node) + 2];
            let depth_mm = model.geometry.height_mm - neighbours().map(z_mm).sum::<f64>() / count as f64;
            let displaced_mm = model.displaced_mm(row, node, DVec3::Z * depth_mm);
            coordinates_mm[3 * (row_index * nodes + node)..][..3].copy_from_slice(&displaced_mm.to_array());
        }
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
        assert_eq!(frame.len(), self.partial.rows.len() * channels);
        if !self.is_dead(self.partial.rows[row_index]) {
            return self.decode_row(row_index, &frame[row_index * channels..][..channels], targets);
        }
        let mut coordinates_mm = std::mem::take(&mut self.frame_mm);
        let decoded = self.decode(frame, &mut coordinates_mm);
        targets.copy_from_slice(&coordinates_mm[row_index * outputs..][..outputs]);
        self.frame_mm = coordinates_mm;
        decoded
    }
}

impl Decoder for LeftOutDecoder {
    fn channels(&self) -> usize {
        self.partial.model.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.partial.model.scale.coordinates_per_row()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        if self.is_dead(self.partial.rows[row_index]) {
            DecodeError::check(readings)?;
            targets.copy_from_slice(&self.means_mm[row_index * targets.len()..][..targets.len()]);
            return Ok(());
        }
        let missing = self.fault.map_or([None; 2], |fault| fault.wire.columns());
        self.partial.decode_row(row_index, readings, missing, targets)
    }

    /// Decodes a frame. Unlike with other decoders, this is more accurate for a faulty row than [`Self::decode_row`],
    /// which has no access to the neighbouring rows.
    fn decode(&mut self, frame: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs, count) = (self.channels(), self.outputs(), self.partial.rows.len());
        assert_eq!((frame.len() / channels, targets.len() / outputs), (count, count));
        let rows = frame.chunks_exact(channels).zip(targets.chunks_exact_mut(outputs));
        for (row_index, (readings, targets)) in rows.enumerate() {
            self.decode_row(row_index, readings, targets)
                .map_err(|error| DecodeError { row_index, ..error })?;
        }
        let dead = self.partial.rows.iter().position(|&row| self.is_dead(row));
        if let Some(dead) = dead.filter(|_| self.has_neighbours) {
            self.interpolate(dead, targets);
        }
        Ok(())
    }
}
