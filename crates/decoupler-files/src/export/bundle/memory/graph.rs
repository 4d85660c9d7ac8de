use super::ExportedMemory;
use crate::export::bundle::{
    exported_decoder::Metadata,
    onnx::{StreamGraph, StreamParts},
    portable::Portable,
    weights::Weights,
};

impl ExportedMemory {
    /// ONNX graph of the memory and the network together, for one sample at a time.
    pub(super) fn graph(&self, portable: &Portable, weights: &Weights, metadata: &Metadata) -> Vec<u8> {
        let constants = &self.constants;
        let (rates, of_samples) = self.exponents().unzip();
        let averages = 1 + self.kept()..self.rows();
        let parts = StreamParts {
            channels: constants.channels,
            kept: self.kept(),
            rates,
            of_samples,
            past: constants.lags.iter().map(|lag| 1 + lag).chain(averages).collect(),
            differences: constants.differences,
        };
        parts.write(portable, weights, metadata)
    }
}

/// Evaluates the golden sequence in a graph that is read from `bytes`: returns the targets of each frame.
///
/// # Errors
/// A description of the damage, or of the first operation that fails.
pub(super) fn sequence_of_graph(bytes: &[u8], memory: &ExportedMemory) -> Result<Vec<Vec<f64>>, String> {
    let graph = StreamGraph::read(bytes)?;
    let (rows, channels) = (memory.rows(), memory.constants.channels);
    let mut state = vec![0.0; rows * channels];
    let frames = memory.frames.iter().map(|frame| {
        if frame.is_first {
            state.fill(0.0);
        }
        let (targets, next) = graph.step(&frame.features[..channels], frame.interval_s, [rows, channels], &state)?;
        state = next;
        Ok(targets)
    });
    frames.collect()
}
