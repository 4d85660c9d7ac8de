//! Bundles: trained networks as other programs read them (feature `bundle`).
//!
//! A network file, of a simulated sensor or of own data, is folded once into a description without any scaling (`portable`:
//! readings to outputs, in the units of the user), which each format then writes: an ONNX graph, C99 in floating point or in whole numbers, a MATLAB function,
//! NumPy arrays. What was written is read back and evaluated, and compared with the network computed with twice the
//! digits (`exact`). Only a bundle that agrees is put in its place.

mod c99;
mod choice;
mod error;
mod exact;
mod exported_network;
mod exporting;
mod fixed_point;
mod folder;
mod golden;
mod identifier;
mod matlab;
mod meaning;
mod numpy;
mod onnx;
mod portable;
mod readme;
mod report;
mod taking;
mod tolerance;
mod twofold;
mod vectors;
mod weights;

#[cfg(test)]
mod tests;

pub use self::{
    choice::{BundleFormat, BundlePrecision, ChoiceError},
    error::BundleError,
    exported_network::ExportedNetwork,
    exporting::export_bundle,
    fixed_point::FixedPointError,
    portable::FoldError,
    report::{BundleCheck, BundleReport, VectorCounts},
    taking::ReadingRounding,
};
