use glam::DVec3;

use super::faults::{Diagnosis, FaultCause, FaultyWire, FitPrior, RowFit, RowReadings};
use crate::{
    dataset::{Seed, Stream},
    decoupling::{DecodeError, Decoder},
    numerics::median,
    scene::{Loading, Scene},
    sensor::{SensorError, SensorModel},
};

/// Decodes with the wires of a named fault left out, if there is one: the most probable deformation given the other
/// readings, the noise and the prior of the scene, by the Gauss-Newton method.
///
/// A broken row-wire is decoded from the nodes before its break, and two touching row-wires from the mean of their
/// readings. A row-wire without usable readings is interpolated from its neighbours in the same frame, or set to the mean
/// of the prior if nodes are independent or the row is decoded alone. Each answer depends only on the readings given, not
/// on earlier frames. Decoding does not allocate.
#[derive(Clone, Debug)]
pub struct LeftOutDecoder {
    model: SensorModel,
    fault: Option<Diagnosis>,
    rows: Vec<usize>,
    priors: Vec<FitPrior>,
    one: RowFit,
    two: RowFit,
    /// True if the deformations of neighbouring rows are correlated.
    has_neighbours: bool,
    /// Geometric means of the readings of two touching rows: M4.
    shared_ohm: Vec<f64>,
    /// Decoded coordinates of a whole frame: rows × 3·M2, in millimetres.
    frame_mm: Vec<f64>,
}

impl LeftOutDecoder {
    /// Prepares to decode `rows` of `model` in `scene`, initially with all wires.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        Ok(Self {
            model: *model,
            fault: None,
            rows: rows.to_vec(),
            priors: FitPrior::of_rows(model, scene, rows, &mut Seed(0).rng(Stream::Expectation)),
            one: RowFit::new(model, scene, 1)?,
            two: RowFit::new(model, scene, 2)?,
            has_neighbours: scene.loading != Loading::RandomNodes,
            shared_ohm: vec![0.0; model.scale.columns()],
            frame_mm: vec![0.0; rows.len() * model.scale.coordinates_per_row()],
        })
    }

    /// Sets the fault whose wires are left out from now on; `None` uses all wires.
    pub fn leave_out(&mut self, fault: Option<Diagnosis>) {
        self.fault = fault;
    }

    /// Returns the fault whose wires are left out.
    pub fn fault(&self) -> Option<Diagnosis> {
        self.fault
    }

    /// Returns `true` if a row-wire can only be interpolated from its neighbours.
    fn is_dead(&self, row: usize) -> bool {
        self.fault.is_some_and(|fault| {
            fault.wire == FaultyWire::Row(row) && !matches!(fault.cause, FaultCause::Broken { .. })
        })
    }

    /// Sets a row of `coordinates_mm` (rows × 3·M2) to the mean depth of its neighbours in the same frame. Returns
    /// `false` if it has no neighbours.
    fn interpolate(&self, row_index: usize, coordinates_mm: &mut [f64]) -> bool {
        let (nodes, row) = (self.model.scale.nodes_per_row(), self.rows[row_index]);
        let is_neighbour = |&index: &usize| self.rows[index].abs_diff(row) == 1;
        let height_mm = self.model.geometry.height_mm;
        for node in 0..nodes {
            let (mut sum_mm, mut count) = (0.0, 0);
            for index in (0..self.rows.len()).filter(is_neighbour) {
                sum_mm += height_mm - coordinates_mm[3 * (index * nodes + node) + 2];
                count += 1;
            }
            if count == 0 {
                return false;
            }
            let depth_mm = sum_mm / f64::from(count);
            let displaced_mm = self.model.displaced_mm(row, node, DVec3::Z * depth_mm);
            coordinates_mm[3 * (row_index * nodes + node)..][..3].copy_from_slice(&displaced_mm.to_array());
        }
        true
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
        let row = self.rows[row_index];
        if !self.fault.is_some_and(|fault| fault.wire.is_row(row)) {
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
        self.model.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.model.scale.coordinates_per_row()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        DecodeError::check(readings)?;
        let row = self.rows[row_index];
        let nodes = self.model.scale.nodes_per_row();
        let prior = &self.priors[row_index];
        let wire = self.fault.map(|fault| fault.wire);
        let whole = RowReadings {
            rows: &[(row, prior)],
            readings_ohm: readings,
            left_out: wire.map_or([None; 2], FaultyWire::columns),
            nodes,
        };
        match (wire, self.fault.map(|fault| fault.cause)) {
            (Some(FaultyWire::Row(faulty)), Some(FaultCause::Broken { before_node: nodes })) if faulty == row => {
                self.one.solve(RowReadings { nodes, ..whole });
                self.one.coordinates(row, 0, targets);
            }
            (Some(FaultyWire::Row(faulty)), _) if faulty == row => {
                self.one.set_to(prior);
                self.one.coordinates(row, 0, targets);
            }
            (Some(FaultyWire::Rows(first)), _) if (first..=first + 1).contains(&row) => {
                let place = row - first;
                let first_index = row_index - place;
                let rows = [
                    (first, &self.priors[first_index]),
                    (first + 1, &self.priors[first_index + 1]),
                ];
                self.two.solve(RowReadings { rows: &rows, ..whole });
                self.two.coordinates(row, place, targets);
            }
            _ => {
                self.one.solve(whole);
                self.one.coordinates(row, 0, targets);
            }
        }
        Ok(())
    }

    /// Decodes a frame. Unlike with other decoders, this is more accurate for faulty rows than [`Self::decode_row`],
    /// which has no access to the neighbouring rows.
    fn decode(&mut self, frame: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs) = (self.channels(), self.outputs());
        assert_eq!(
            (frame.len() / channels, targets.len() / outputs),
            (self.rows.len(), self.rows.len())
        );
        let shorted = match self.fault.map(|fault| fault.wire) {
            Some(FaultyWire::Rows(first)) => self.rows.iter().position(|&row| row == first),
            _ => None,
        };
        let mut shared_ohm = std::mem::take(&mut self.shared_ohm);
        let mut decoded = Ok(());
        let rows = frame.chunks_exact(channels).zip(targets.chunks_exact_mut(outputs));
        for (row_index, (readings, targets)) in rows.enumerate() {
            // Two touching rows have the same resistances; their mean has less noise.
            let readings = match shorted {
                Some(first) if (first..=first + 1).contains(&row_index) => {
                    let (one, other) = (&frame[first * channels..][..channels], &frame[(first + 1) * channels..]);
                    for (shared, (one, other)) in shared_ohm.iter_mut().zip(one.iter().zip(other)) {
                        *shared = one.sqrt() * other.sqrt();
                    }
                    &shared_ohm[..]
                }
                _ => readings,
            };
            let of_row = self.decode_row(row_index, readings, targets);
            decoded = decoded.and(of_row.map_err(|error| DecodeError { row_index, ..error }));
        }
        self.shared_ohm = shared_ohm;
        decoded?;
        if let Some(dead) = (0..self.rows.len()).find(|&index| self.is_dead(self.rows[index]))
            && self.has_neighbours
        {
            // Without neighbours, the mean of the prior is kept.
            let _ = self.interpolate(dead, targets);
        }
        Ok(())
    }
}

/// Iterations of median polish: two or three are enough.
const ROUNDS: usize = 6;

/// Values decomposed into a common part, row parts and column parts.
pub(super) struct Polished {
    pub(super) common: f64,
    pub(super) of_rows: Vec<f64>,
    pub(super) of_columns: Vec<f64>,
    /// Residuals: rows × columns.
    pub(super) rest: Vec<f64>,
}

impl Polished {
    /// Decomposes values (rows × columns) by median polish.
    pub(super) fn new(values: &[f64], columns: usize) -> Self {
        let rows = values.len() / columns;
        let mut found = Self {
            common: 0.0,
            of_rows: vec![0.0; rows],
            of_columns: vec![0.0; columns],
            rest: values.to_vec(),
        };
        for _ in 0..ROUNDS {
            for column in 0..columns {
                let shift = median((0..rows).map(|row| found.rest[row * columns + column]).collect());
                (0..rows).for_each(|row| found.rest[row * columns + column] -= shift);
                found.of_columns[column] += shift;
            }
            for row in 0..rows {
                let of_row = &mut found.rest[row * columns..(row + 1) * columns];
                let shift = median(of_row.to_vec());
                of_row.iter_mut().for_each(|e| *e -= shift);
                found.of_rows[row] += shift;
            }
            for parts in [&mut found.of_columns, &mut found.of_rows] {
                let shift = median(parts.clone());
                parts.iter_mut().for_each(|part| *part -= shift);
                found.common += shift;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Row and column parts with median 0 are recovered even if fewer than half of the rows are corrupted.
    #[test]
    fn additive_parts_are_found_despite_outliers() {
        let (rows, columns) = ([-2.0, 0.0, 1.0, 0.0, 3.0], [0.5, 0.0, -0.25]);
        let value = |index: usize| 10.0 + rows[index / 3] + columns[index % 3] - if index == 4 { 7.0 } else { 0.0 };
        let values: Vec<f64> = (0..15).map(value).collect();
        let found = Polished::new(&values, 3);
        assert_eq!(
            (found.common, &found.of_rows[..], &found.of_columns[..]),
            (10.0, &rows[..], &columns[..])
        );
        assert_eq!(found.rest[4], -7.0);
        assert!(
            found
                .rest
                .iter()
                .enumerate()
                .all(|(index, rest)| index == 4 || *rest == 0.0)
        );
    }
}
