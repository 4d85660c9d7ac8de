use ndarray::{Array2, Axis};
use thiserror::Error;

use crate::dataset::Dataset;

/// A way from the readings of a frame, all rows of one moment, to the coordinates of their nodes.
pub trait FrameDecoder: Send {
    /// Takes resistances in ohm (rows × M4, row by row) and writes absolute coordinates in millimetres (rows × 3·M2).
    ///
    /// # Errors
    /// A reading that is no resistance; then nothing is written.
    ///
    /// # Panics
    /// If the slices are not of whole rows.
    fn decode(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Result<(), DecodeError>;
}

/// A reading that is no resistance.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("reading {index} of the frame is {value} ohm: give finite numbers above 0")]
pub struct DecodeError {
    /// Which, row by row from 0.
    pub index: usize,
    /// Its value.
    pub value: f64,
}

impl DecodeError {
    /// Refuses readings that are not above 0 and finite.
    pub(crate) fn check(readings_ohm: &[f64]) -> Result<(), Self> {
        let is_resistance = |value: f64| (value > 0.0) & (value < f64::INFINITY);
        if readings_ohm.iter().fold(true, |all, &value| all & is_resistance(value)) {
            return Ok(());
        }
        let index = readings_ohm
            .iter()
            .position(|&value| !is_resistance(value))
            .unwrap_or(0);
        Err(Self {
            index,
            value: readings_ohm[index],
        })
    }
}

/// Decodes every snapshot of a set: coordinates in the shape of [`Dataset::coordinates_mm`].
///
/// # Errors
/// A reading that is no resistance.
pub fn decode_set(decoder: &mut dyn FrameDecoder, set: &Dataset) -> Result<Array2<f64>, DecodeError> {
    let mut decoded_mm = Array2::zeros(set.coordinates_mm.dim());
    let readings = set.resistances_ohm.axis_chunks_iter(Axis(0), set.rows());
    for (readings, mut coordinates) in readings.zip(decoded_mm.axis_chunks_iter_mut(Axis(0), set.rows())) {
        let readings = readings.as_slice().expect("rows of a standard array are contiguous");
        let coordinates = coordinates
            .as_slice_mut()
            .expect("rows of a standard array are contiguous");
        decoder.decode(readings, coordinates)?;
    }
    Ok(decoded_mm)
}

/// A way from the readings of one row-wire (M4) to its coordinates (3·M2).
pub trait RowMap: Send {
    /// Resistances in ohm of a row, all above 0 and finite.
    fn map(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]);
}

/// Row maps as a decoder of frames: one map for every row alike, or one for each.
#[derive(Clone, Debug)]
pub struct RowMaps<M> {
    maps: Vec<M>,
    rows: usize,
}

impl<M: RowMap> RowMaps<M> {
    /// One map for all of `rows` row-wires.
    pub fn shared(map: M, rows: usize) -> Self {
        Self { maps: vec![map], rows }
    }

    /// One map for each row-wire.
    ///
    /// # Panics
    /// If there is none.
    pub fn each(maps: Vec<M>) -> Self {
        assert!(!maps.is_empty());
        Self { rows: maps.len(), maps }
    }

    /// The maps.
    pub fn maps(&self) -> &[M] {
        &self.maps
    }
}

impl<M: RowMap> FrameDecoder for RowMaps<M> {
    fn decode(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        let last = self.maps.len() - 1;
        let readings = readings_ohm.chunks_exact(readings_ohm.len() / self.rows);
        let coordinates = coordinates_mm.chunks_exact_mut(coordinates_mm.len() / self.rows);
        for (row, (readings, coordinates)) in readings.zip(coordinates).enumerate() {
            self.maps[row.min(last)].map(readings, coordinates);
        }
        Ok(())
    }
}

/// Fits one map to all rows of a set, or one to each row-wire where the row is known.
///
/// # Errors
/// What `fit` says.
pub fn fit_rows<M: RowMap, E>(
    training: &Dataset,
    known: bool,
    mut fit: impl FnMut(&Dataset) -> Result<M, E>,
) -> Result<RowMaps<M>, E> {
    if known {
        let maps = (0..training.rows()).map(|row| fit(&training.of_row(row)));
        Ok(RowMaps::each(maps.collect::<Result<_, _>>()?))
    } else {
        Ok(RowMaps::shared(fit(training)?, training.rows()))
    }
}
