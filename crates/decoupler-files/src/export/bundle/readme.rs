use std::fmt::Write;

use super::{draft::Call, fixed_point::FixedNetworks, meaning::Meaning, portable::Portable, report::BundleReport};
use crate::export::format_number;

/// Writes the README of a bundle: how to call it, and what it is worth.
pub(super) fn readme(name: &str, portable: &Portable, fixed: Option<&FixedNetworks>, report: &BundleReport) -> String {
    let meaning = &portable.meaning;
    let subject = match meaning {
        Meaning::Array(scale) => format!("a tactile array {scale}"),
        Meaning::Own { .. } => "own data".to_owned(),
    };
    let mut text = format!(
        "{decoder} of {subject}, exported by {program} as {format}, {precision}.\n\n",
        decoder = portable.name,
        program = crate::export::document::PROGRAM,
        format = report.format,
        precision = report.precision,
    );
    text += &match meaning {
        Meaning::Array(_) => format!(
            "It turns the {channels} readings of one row-wire (r_1 to r_{channels}, in ohm) into the {outputs} coordinates of\n\
             its nodes (x_1, y_1, z_1, x_2, ... {last}, in mm).",
            channels = portable.channels,
            outputs = portable.outputs,
            last = meaning.targets().last().map_or("", |target| &target.name),
        ),
        Meaning::Own { .. } => format!(
            "It turns {channels} readings into {outputs} targets.\n\n{legend}",
            channels = portable.channels,
            outputs = portable.outputs,
            legend = meaning.legend().join("\n"),
        ),
    };
    if portable.takes_row() {
        let _ = write!(
            text,
            " There is one {} for each row, from 1 to {}.",
            portable.decoder,
            portable.rows()
        );
    }
    text += "\n\nHow to call it\n\n";
    let call = Call {
        name,
        portable,
        fixed,
        precision: report.precision,
    };
    text += &(report.format.writer().call)(&call);
    text += "\n\nWhat it is worth\n\n";
    for check in &report.checks {
        let _ = writeln!(
            text,
            "{}: largest deviation {:.1e} of {}{}.",
            check.evaluator,
            check.deviation,
            meaning.scale(),
            report
                .output_range_mm
                .map_or_else(String::new, |range| format!(" ({} mm)", format_number(range)))
        );
    }
    if let Some(rounding) = report.describe_rounding() {
        let _ = writeln!(text, "{rounding}.");
    }
    if let Some(bounds) = report.describe_bounds() {
        let _ = writeln!(text, "{bounds}.");
    }
    for remark in &report.remarks {
        let _ = writeln!(text, "Note: {remark}.");
    }
    let subject = match meaning {
        Meaning::Array(_) => "the array, its geometry",
        Meaning::Own { .. } => "names and units",
    };
    text + &format!(
        "\ngolden.csv has readings in double precision with the {output}s that the {decoder} gives to them, for a test of your\n\
         own: convert the readings as you would your own.\n\
         metadata.json has {subject}, the errors of the {decoder}, the range of the readings in training,\n\
         the seed and the version of the program.\n",
        output = meaning.output(),
        decoder = portable.decoder,
    )
}
