use std::path::PathBuf;

use super::{
    choice::{BundleFormat, BundlePrecision},
    error::BundleError,
    taking::ReadingRounding,
    vectors::Deviation,
};
use crate::export::format_number;
use decoupler_core::evaluation::Channel;

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
    /// Changes of the outputs by rounding the readings to single precision; `None` for other precisions.
    pub rounding: Option<ReadingRounding>,
    /// Widest range of a coordinate in training, in mm; `None` for own data.
    pub output_range_mm: Option<f64>,
    /// Deviation of `decode` of this program from the same exact answers, relative as [`Self::limit`].
    pub program_deviation: f64,
    /// Proven bounds on the errors in fixed point: of any coordinate of an array, or of each target; empty otherwise.
    pub bounds: Vec<(Channel, f64)>,
    /// Remarks for the user, with cause and cure.
    pub remarks: Vec<String>,
}

/// Numbers of readings of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorCounts {
    /// Number with which the bundle was verified.
    pub verified: usize,
    /// Number in the bundle, as golden vectors.
    pub golden: usize,
}

/// An evaluation of a bundle as it was read back.
#[derive(Clone, Debug, PartialEq)]
pub struct BundleCheck {
    /// Name of the program that evaluated it.
    pub evaluator: &'static str,
    /// Largest deviation from the network, which takes the readings in double precision, where the bundle takes them as its
    /// callers must round them; relative as [`BundleReport::limit`].
    pub deviation: f64,
    /// The part of it that is not the rounding of the readings.
    pub of_arithmetic: f64,
}

impl BundleCheck {
    pub(super) fn of(evaluator: &'static str, deviation: Deviation) -> Self {
        Self {
            evaluator,
            deviation: deviation.total,
            of_arithmetic: deviation.of_arithmetic,
        }
    }

    /// Checks the deviations.
    ///
    /// # Errors
    /// One is above its limit, or not a number.
    pub(super) fn admit(&self, limits: Deviation) -> Result<(), BundleError> {
        for (deviation, limit) in [
            (self.of_arithmetic, limits.of_arithmetic),
            (self.deviation, limits.total),
        ] {
            if deviation.is_nan() || deviation > limit {
                return Err(BundleError::Deviation {
                    evaluator: self.evaluator.to_owned(),
                    deviation,
                    limit,
                });
            }
        }
        Ok(())
    }
}

impl BundleReport {
    /// The sentence on [`Self::bounds`], if there are any.
    pub fn describe_bounds(&self) -> Option<String> {
        let bound = |(output, bound): &(Channel, f64)| {
            let unit = output.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
            format!("{}{unit} ({})", format_number(*bound), output.name)
        };
        let bounds: Vec<String> = self.bounds.iter().map(bound).collect();
        (!bounds.is_empty()).then(|| {
            format!(
                "Proven bound on the error of the whole numbers, for readings that are not out of range: {}",
                bounds.join(", ")
            )
        })
    }

    /// The sentence on [`Self::rounding`], if there is one.
    pub fn describe_rounding(&self) -> Option<String> {
        self.rounding.map(|rounding| {
            format!(
                "Rounding the readings to single precision alone: {:.1e}, at most {:.1e}",
                rounding.largest,
                rounding.worst()
            )
        })
    }

    /// Largest deviation of all checks.
    pub fn deviation(&self) -> f64 {
        self.checks.iter().map(|check| check.deviation).fold(0.0, f64::max)
    }
}
