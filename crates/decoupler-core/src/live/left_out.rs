use std::ops::Range;

use glam::DVec3;

use super::{FaultyWire, WireCheck};
use crate::decoupling::DecodeError;

impl WireCheck {
    /// Decodes rows of a frame of all rows read (rows × M4, in ohm) by Eq. (2), without the wire of the fault currently
    /// reported, if there is one; writes absolute coordinates (3·M2 for each of `row_indices`).
    ///
    /// Readings of faulty column-wires have no influence. A faulty row-wire is interpolated from its neighbours in the same
    /// frame, or set to the mean deformation of the scene if nodes are independent or no neighbour is read. Each answer
    /// depends only on the readings given, not on earlier frames.
    ///
    /// # Errors
    /// If a reading is not a valid resistance.
    ///
    /// # Panics
    /// If the frame or the coordinates have the wrong length.
    pub fn decode(
        &mut self,
        frame_ohm: &[f64],
        row_indices: Range<usize>,
        coordinates_mm: &mut [f64],
    ) -> Result<(), DecodeError> {
        let (columns, outputs) = (self.columns(), self.model.scale.coordinates_per_row());
        let sizes = (self.rows.len() * columns, row_indices.len() * outputs);
        assert_eq!((frame_ohm.len(), coordinates_mm.len()), sizes, "whole rows");
        for (place, (row_index, mm)) in (row_indices.zip(coordinates_mm.chunks_exact_mut(outputs))).enumerate() {
            let row = self.rows[row_index];
            let is_dead = self.named() == Some(FaultyWire::Row(row));
            let left_out = match self.named() {
                Some(_) if is_dead => 0..columns,
                Some(wire) => wire.columns(),
                None => 0..0,
            };
            let readings_ohm = &frame_ohm[row_index * columns..][..columns];
            let solved = self.decoder.solve_without(left_out, row, readings_ohm, mm);
            solved.map_err(|error| error.after(place))?;
            if is_dead && self.has_neighbours {
                self.interpolate(frame_ohm, row, mm)?;
            }
        }
        Ok(())
    }

    /// Sets a row to the mean depth of its neighbours in the same frame, if it has any.
    fn interpolate(&mut self, frame_ohm: &[f64], row: usize, coordinates_mm: &mut [f64]) -> Result<(), DecodeError> {
        let (mut sums_mm, mut neighbours) = (vec![0.0; coordinates_mm.len()], 0.0);
        let mut neighbour_mm = sums_mm.clone();
        for row_index in 0..self.rows.len() {
            if self.rows[row_index].abs_diff(row) == 1 {
                self.decode(frame_ohm, row_index..row_index + 1, &mut neighbour_mm)?;
                sums_mm.iter_mut().zip(&neighbour_mm).for_each(|(sum, mm)| *sum += mm);
                neighbours += 1.0;
            }
        }
        let nodes = coordinates_mm.chunks_exact_mut(3).zip(sums_mm.chunks_exact(3));
        for (node, (mm, sum_mm)) in nodes.enumerate().filter(|_| neighbours > 0.0) {
            let depth_mm = self.model.geometry.height_mm - sum_mm[2] / neighbours;
            mm.copy_from_slice(&self.model.displaced_mm(row, node, DVec3::Z * depth_mm).to_array());
        }
        Ok(())
    }
}
