use ndarray::Array2;
use thiserror::Error;

use crate::dataset::{Dataset, PerRow};

/// A way from readings to targets: of a simulated array, from resistances in ohm to coordinates of nodes in millimetres.
///
/// Every decoder answers for single rows and for whole frames; both give the same bits.
pub trait Decoder: Send {
    /// Readings of a row.
    fn channels(&self) -> usize;

    /// Targets of a row.
    fn outputs(&self) -> usize;

    /// Decodes one row: `readings` (channels) of the row-wire with this index among those read; writes `targets`
    /// (outputs).
    ///
    /// # Errors
    /// A reading that cannot be decoded; then nothing is written.
    ///
    /// # Panics
    /// If the slices are of other lengths, or there is no such row-wire.
    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError>;

    /// Decodes a frame, all row-wires read at one moment: `readings` are rows × channels, row by row, `targets` rows ×
    /// outputs.
    ///
    /// # Errors
    /// A reading that cannot be decoded; what `targets` then hold means nothing.
    ///
    /// # Panics
    /// If the slices are not of whole rows.
    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs) = (self.channels(), self.outputs());
        assert_eq!(readings.len() / channels, targets.len() / outputs);
        let rows = readings.chunks_exact(channels).zip(targets.chunks_exact_mut(outputs));
        for (row_index, (readings, targets)) in rows.enumerate() {
            self.decode_row(row_index, readings, targets)
                .map_err(|error| DecodeError { row_index, ..error })?;
        }
        Ok(())
    }
}

/// A reading that cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("row {}, reading {}: {value} is not a resistance; give a finite number of ohm above 0", .row_index + 1, .channel + 1)]
pub struct DecodeError {
    /// The row's index in its frame or set, from 0.
    pub row_index: usize,
    /// The reading's index in its row, from 0.
    pub channel: usize,
    /// Its value.
    pub value: f64,
}

impl DecodeError {
    /// Refuses readings of a row that are not above 0 and finite.
    pub(crate) fn check(readings: &[f64]) -> Result<(), Self> {
        Self::check_that(readings, |value| (value > 0.0) & (value < f64::INFINITY))
    }

    /// Refuses readings of a row that `is_sound` does not hold for. All are looked at in one sweep of the vector
    /// registers, since bad ones are rare.
    #[inline(always)]
    pub(crate) fn check_that(readings: &[f64], is_sound: impl Fn(f64) -> bool) -> Result<(), Self> {
        if readings.iter().fold(true, |all, &value| all & is_sound(value)) {
            return Ok(());
        }
        let channel = readings.iter().position(|&value| !is_sound(value)).unwrap_or(0);
        Err(Self {
            row_index: 0,
            channel,
            value: readings[channel],
        })
    }
}

/// Decodes every sample of a set, each as of its own row-wire: samples × outputs.
///
/// # Errors
/// A reading that cannot be decoded; its `row_index` is the sample.
///
/// # Panics
/// If the set has other channels, or row-wires that the decoder does not know.
pub fn decode_set(decoder: &mut dyn Decoder, set: &Dataset) -> Result<Array2<f64>, DecodeError> {
    let mut answers = Array2::zeros((set.samples(), decoder.outputs()));
    for (sample, mut answer) in answers.rows_mut().into_iter().enumerate() {
        let answer = answer.as_slice_mut().expect("a row of a standard array is contiguous");
        decoder
            .decode_row(set.row_index(sample), set.sample_readings(sample), answer)
            .map_err(|error| DecodeError {
                row_index: sample,
                ..error
            })?;
    }
    Ok(answers)
}

impl<D: Decoder> Decoder for PerRow<D> {
    fn channels(&self) -> usize {
        self.at(0).channels()
    }

    fn outputs(&self) -> usize {
        self.at(0).outputs()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.at_mut(row_index).decode_row(row_index, readings, targets)
    }
}
