use crate::decoupling::{DecodeError, Decoder, Solution, SolvedRows, side_by_side::LANES};

/// Decoders that answer the rows of a frame side by side by plain steps, and with more care the rows for which those do not
/// suffice.
pub(super) trait PlainFirst: Decoder {
    /// Answers the rows from index `first` on, at most [`LANES`], as far as plain steps do; returns their standing. Leaves the
    /// targets of all others as they are.
    fn answer_plainly(&mut self, first: usize, readings: &[f64], targets: &mut [f64]) -> [Option<Solution>; LANES];

    /// Answers one row with care; returns its standing.
    ///
    /// # Errors
    /// Readings that are no resistances.
    fn answer(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<Solution, DecodeError>;

    /// The rows counted so far.
    fn solved(&mut self) -> &mut SolvedRows;

    /// Answers all rows of a frame.
    ///
    /// # Errors
    /// Readings that are no resistances; the error names their row.
    ///
    /// # Panics
    /// If there are not as many rows of targets as of readings.
    fn answer_all(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs) = (self.channels(), self.outputs());
        assert_eq!(readings.len() / channels, targets.len() / outputs);
        for (row_index, readings) in readings.chunks_exact(channels).enumerate() {
            DecodeError::check(readings).map_err(|error| DecodeError { row_index, ..error })?;
        }
        let chunks = readings
            .chunks(LANES * channels)
            .zip(targets.chunks_mut(LANES * outputs));
        for (chunk, (readings, targets)) in chunks.enumerate() {
            let first = chunk * LANES;
            let plain = self.answer_plainly(first, readings, targets);
            let rows = readings.chunks_exact(channels).zip(targets.chunks_exact_mut(outputs));
            for (place, ((readings, targets), plain)) in rows.zip(plain).enumerate() {
                let row_index = first + place;
                let solution = match plain {
                    Some(solution) => solution,
                    None => self
                        .answer(row_index, readings, targets)
                        .map_err(|error| DecodeError { row_index, ..error })?,
                };
                self.solved().count(solution);
            }
        }
        Ok(())
    }
}
