use std::{
    io::{Write, stdout},
    path::Path,
};

use serde::Serialize;

use super::failure::Failure;
use decoupler_files::export::{bundle::BundleReport, format_number};

/// The object printed by `export --json`.
#[derive(Serialize)]
struct Report<'a> {
    path: &'a Path,
    format: String,
    precision: String,
    files: Vec<File<'a>>,
    verified_vectors: usize,
    golden_vectors: usize,
    checks: Vec<Check>,
    /// Largest of all checks; like these relative to `output_range_mm`, or for a recording to the range of each target.
    deviation: f64,
    limit: f64,
    /// Of `f32`: by rounding the readings alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    change_by_rounding_readings: Option<Rounding>,
    #[serde(skip_serializing_if = "Option::is_none")]
    output_range_mm: Option<f64>,
    deviation_of_decode: f64,
    /// In mm, of any coordinate of an array.
    #[serde(skip_serializing_if = "Option::is_none")]
    error_bound_mm: Option<f64>,
    /// Of each target of a recording, in its unit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    error_bounds: Vec<Bound<'a>>,
    remarks: &'a [String],
}

#[derive(Serialize)]
struct File<'a> {
    name: &'a str,
    bytes: u64,
}

#[derive(Serialize)]
struct Bound<'a> {
    name: &'a str,
    unit: Option<&'a str>,
    bound: f64,
}

#[derive(Serialize)]
struct Check {
    evaluator: &'static str,
    deviation: f64,
    /// Without the rounding of the readings.
    deviation_of_arithmetic: f64,
}

#[derive(Serialize)]
struct Rounding {
    largest: f64,
    bound: f64,
}

/// Prints one JSON object.
pub(super) fn print_json(report: &BundleReport) -> Result<(), Failure> {
    let files = report.files.iter().map(|(name, bytes)| File { name, bytes: *bytes });
    let checks = report.checks.iter().map(|check| Check {
        evaluator: check.evaluator,
        deviation: check.deviation,
        deviation_of_arithmetic: check.of_arithmetic,
    });
    let bounds = report.bounds.iter().map(|(output, bound)| Bound {
        name: &output.name,
        unit: output.unit.as_deref(),
        bound: *bound,
    });
    let is_array = report.output_range_mm.is_some();
    let printed = Report {
        path: &report.path,
        format: report.format.to_string(),
        precision: report.precision.to_string(),
        files: files.collect(),
        verified_vectors: report.vectors.verified,
        golden_vectors: report.vectors.golden,
        checks: checks.collect(),
        deviation: report.deviation(),
        limit: report.limit,
        change_by_rounding_readings: report.rounding.map(|rounding| Rounding {
            largest: rounding.largest,
            bound: rounding.bound,
        }),
        output_range_mm: report.output_range_mm,
        deviation_of_decode: report.program_deviation,
        error_bound_mm: report.bounds.first().filter(|_| is_array).map(|(_, bound)| *bound),
        error_bounds: bounds.filter(|_| !is_array).collect(),
        remarks: &report.remarks,
    };
    let mut stdout = stdout().lock();
    serde_json::to_writer(&mut stdout, &printed).map_err(|error| Failure::Output(error.into()))?;
    writeln!(stdout).map_err(Failure::Output)
}

/// Prints what was written, and how far it is from the network.
pub(super) fn print_text(report: &BundleReport) -> Result<(), Failure> {
    let (inputs, relative) = match report.output_range_mm {
        Some(range) => (
            "readings of a row-wire",
            format!(
                "coordinate, relative to the widest range of one in training ({} mm)",
                format_number(range)
            ),
        ),
        None => ("readings", "target, relative to its range in training".to_owned()),
    };
    let mut text = format!("{} ({}, {})\n", report.path.display(), report.format, report.precision);
    for (name, bytes) in &report.files {
        text += &format!("  {name:<30} {bytes:>9} bytes\n");
    }
    if report.vectors.verified > 0 {
        text += &format!(
            "Verified on {} {inputs}, {} of them in the bundle as golden vectors. Largest deviation of a {relative}:\n",
            report.vectors.verified, report.vectors.golden
        );
    }
    for check in &report.checks {
        text += &format!("  {}: {:.1e}\n", check.evaluator, check.deviation);
    }
    if report.vectors.verified > 0 {
        text += &format!("  decode of this program: {:.1e}\n", report.program_deviation);
        if let Some(rounding) = report.describe_rounding() {
            text += &format!("  {rounding}\n");
        }
        text += &format!("  limit: {:.1e}\n", report.limit);
    }
    if let Some(bounds) = report.describe_bounds() {
        text += &format!("{bounds}\n");
    }
    for remark in &report.remarks {
        text += &format!("Note: {remark}.\n");
    }
    stdout().lock().write_all(text.as_bytes()).map_err(Failure::Output)
}
