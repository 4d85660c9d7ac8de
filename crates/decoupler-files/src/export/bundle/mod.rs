//! Bundles: decoders exported for other programs (feature `bundle`).
//!
//! A decoder describes its computation as a chain of a few kinds of layers, which is folded once into layers without
//! any scaling (`portable`: readings to outputs, in the units of the user). Each format writes these layers and is
//! independent of the decoder: an ONNX graph, C99 in floating point or (networks only) in fixed point, a MATLAB
//! function, NumPy arrays. The files are read back, evaluated, and compared with the decoder computed with twice the
//! digits (`exact`). Only a bundle that agrees is moved into place.

mod c99;
mod choice;
mod exact;
mod exported_decoder;
mod exporting;
mod fixed_point;
mod folder;
mod layers;
mod matlab;
mod meaning;
mod memory;
mod numpy;
mod onnx;
mod portable;
mod report;
mod vectors;
mod weights;

#[cfg(test)]
mod tests;

pub use self::{
    choice::{BundleFormat, BundlePrecision, ChoiceError},
    exported_decoder::ExportedDecoder,
    exporting::export_bundle,
    fixed_point::FixedPointError,
    portable::FoldError,
    report::{BundleCheck, BundleReport, VectorCounts},
};
pub use choice::{BundleDecoder, ReadingRounding};
pub use report::BundleError;
