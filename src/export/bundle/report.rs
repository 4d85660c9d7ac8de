use std::path::PathBuf;

use super::choice::{BundleFormat, BundlePrecision};

/// Files that an export wrote, and how far they are from the network.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BundleReport {
    /// Form of the bundle.
    pub format: BundleFormat,
    /// Numbers in which it decodes.
    pub precision: BundlePrecision,
    /// The folder, or the file.
    pub path: PathBuf,
    /// Names of its files, with their sizes in bytes.
    pub files: Vec<(String, u64)>,
    /// Readings with which the bundle was verified, and how many of them it contains.
    pub vectors: VectorCounts,
    /// Evaluations of the bundle as it was read back.
    pub checks: Vec<BundleCheck>,
    /// Largest deviation allowed, relative to [`Self::output_range_mm`], or to the range of each target of own data.
    pub limit: f64,
    /// Widest range of a coordinate in training, in mm; `None` for own data.
    pub output_range_mm: Option<f64>,
    /// Deviation of `decode` of this program from the same exact answers, relative as [`Self::limit`].
    pub program_deviation: f64,
    /// Proven bound on the error in fixed point, in mm.
    pub bound_mm: Option<f64>,
    /// Remarks for the user, with cause and cure.
    pub remarks: Vec<String>,
}

/// Numbers of readings of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorCounts {
    /// With which the bundle was verified.
    pub verified: usize,
    /// Which it contains as golden vectors.
    pub golden: usize,
}

/// An evaluation of a bundle as it was read back.
#[derive(Clone, Debug, PartialEq)]
pub struct BundleCheck {
    /// Name of the program that evaluated it.
    pub evaluator: &'static str,
    /// Largest deviation from the network, relative as [`BundleReport::limit`].
    pub deviation: f64,
}

impl BundleReport {
    /// Largest deviation of all checks.
    pub fn deviation(&self) -> f64 {
        self.checks.iter().map(|check| check.deviation).fold(0.0, f64::max)
    }
}
