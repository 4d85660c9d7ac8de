//! Bundles: decoders exported for other programs.
//!
//! What a decoder computes is a program of the core, extended by prediction intervals and the count of readings outside of the
//! range in training (`exported_program`). A format is a printer of its nodes: an ONNX graph, C99 in floating point or in
//! fixed point (`fixed16`), a MATLAB function, NumPy. Folder, README, metadata and golden pairs are the same for all.

mod c99;
mod choice;
mod contents;
mod exported_decoder;
mod exported_program;
mod exporting;
mod fixed16;
mod folder;
mod golden;
mod matlab;
mod meaning;
mod names;
mod numpy;
mod onnx;
mod report;

#[cfg(test)]
mod tests;

pub use self::{
    choice::{BundleDecoder, BundleFormat, BundlePrecision, ChoiceError},
    exported_decoder::ExportedDecoder,
    exporting::export_bundle,
    report::{BundleCheck, BundleError, BundleReport},
};
