use std::fmt::Write;

use super::{
    c99,
    choice::{BundleFormat, BundlePrecision},
    fixed_point::FixedNetworks,
    metadata::coordinate_names,
    portable::Portable,
    report::BundleReport,
};
use crate::export::format_number;

/// Writes the README of a bundle: how to call it, and what it is worth.
pub(super) fn readme(
    name: &str,
    array: &str,
    portable: &Portable,
    fixed: Option<&FixedNetworks>,
    report: &BundleReport,
) -> String {
    let names = coordinate_names(portable);
    let last = names.last().map_or("", String::as_str);
    let mut text = format!(
        "Network of a tactile array {array}, exported by {program} as {format}, {precision}.\n\n\
         It turns the {channels} readings of one row-wire (r_1 to r_{channels}, in ohm) into the {outputs} coordinates of\n\
         its nodes (x_1, y_1, z_1, x_2, ... {last}, in mm).",
        program = crate::export::document::PROGRAM,
        format = report.format,
        precision = report.precision,
        channels = portable.channels,
        outputs = portable.outputs,
    );
    if portable.takes_row() {
        let _ = write!(
            text,
            " There is one network for each row-wire, from 1 to {}.",
            portable.networks.len()
        );
    }
    text += "\n\nHow to call it\n\n";
    text += &call(name, portable, fixed, report);
    text += "\n\nWhat it is worth\n\n";
    for check in &report.checks {
        let _ = writeln!(
            text,
            "{}: largest deviation {:.1e} of the widest range of an output ({} mm).",
            check.evaluator,
            check.deviation,
            format_number(report.output_range_mm)
        );
    }
    if let Some(bound_mm) = report.bound_mm {
        let _ = writeln!(
            text,
            "Proven bound on the error of the whole numbers, for readings that are not out of range: {} mm.",
            format_number(bound_mm)
        );
    }
    for remark in &report.remarks {
        let _ = writeln!(text, "Note: {remark}.");
    }
    text + "\ngolden.csv has readings with the coordinates that the network gives to them, for a test of your own.\n\
           metadata.json has the array, its geometry, the errors of the network, the range of the readings in training,\n\
           the seed and the version of the program.\n"
}

fn call(name: &str, portable: &Portable, fixed: Option<&FixedNetworks>, report: &BundleReport) -> String {
    let takes_row = portable.takes_row();
    let (channels, outputs, upper) = (portable.channels, portable.outputs, name.to_uppercase());
    match report.format {
        BundleFormat::Onnx => {
            let kind = if report.precision == BundlePrecision::Single {
                "float32"
            } else {
                "float64"
            };
            let row = if takes_row {
                ", \"row\": np.array([1], np.int64)"
            } else {
                ""
            };
            format!(
                "    import numpy as np\n    import onnxruntime\n    \
                 session = onnxruntime.InferenceSession(\"network.onnx\")\n    \
                 readings = np.loadtxt(\"golden.csv\", delimiter=\",\", skiprows=1, ndmin=2)[:1, {first}:{end}]\n    \
                 inputs = {{\"resistances_ohm\": readings.astype(np.{kind}){row}}}\n    \
                 coordinates_mm = session.run([\"coordinates_mm\"], inputs)[0]\n\n\
                 resistances_ohm is batch x {channels}, coordinates_mm batch x {outputs}; where a reading is not a finite \
                 number above 0{row_text},\nthe coordinates are NaN. A second output, readings_outside, counts the readings \
                 of each line beyond the range\nseen in training.",
                first = usize::from(takes_row),
                end = channels + usize::from(takes_row),
                row_text = if takes_row { ", or the row does not exist" } else { "" },
            )
        }
        BundleFormat::C99 => {
            let row = if takes_row { "1, " } else { "" };
            let (reading, readings, coordinate, coordinates) = match (fixed, report.precision) {
                (Some(fixed), _) => ("int32_t", c99::readings(fixed), "int32_t", "coordinates_nm"),
                (None, BundlePrecision::Single) => ("float", "resistances_ohm", "float", "coordinates_mm"),
                (None, _) => ("double", "resistances_ohm", "double", "coordinates_mm"),
            };
            let range = if portable.ranges().is_some() {
                format!(
                    "\nint outside = {name}_is_out_of_range({row}{readings}); counts the readings beyond the range seen in \
                     training."
                )
            } else {
                String::new()
            };
            let library = if fixed.is_some() { "" } else { " -lm" };
            format!(
                "    #include \"{name}_decode.h\"\n    \
                 {reading} {readings}[{upper}_CHANNELS];\n    \
                 {coordinate} {coordinates}[{upper}_OUTPUTS];\n    \
                 int status = {name}_decode({row}{readings}, {coordinates});\n\n\
                 The status is {upper}_OK, or tells what is wrong. Compile {name}_decode.c with your program{libm}. The\n\
                 self-test compares the golden vectors:\n\n    \
                 cc -std=c99 -O2 {name}_decode.c {name}_selftest.c -lm -o selftest && ./selftest\n{range}",
                libm = if library.is_empty() { "" } else { ", and link with -lm" },
            )
        }
        BundleFormat::Matlab => {
            let row = if takes_row { ", row" } else { "" };
            format!(
                "    [coordinates_mm, readings_outside] = {name}_decode(resistances_ohm{row})\n\n\
                 in MATLAB (from R2016b) or GNU Octave. resistances_ohm is samples x {channels}, coordinates_mm samples x \
                 {outputs}{row_text}.",
                row_text = if takes_row {
                    ";\nrow has the row-wire of each sample, from 1"
                } else {
                    ""
                },
            )
        }
        BundleFormat::NumPy => {
            let row = if takes_row { ", row" } else { "" };
            format!(
                "    from decode import decode\n    \
                 coordinates_mm, readings_outside = decode(resistances_ohm{row})\n\n\
                 resistances_ohm is samples x {channels}, coordinates_mm samples x {outputs}{row_text}.",
                row_text = if takes_row {
                    ";\nrow has the row-wire of each sample, from 1"
                } else {
                    ""
                },
            )
        }
        BundleFormat::Json => String::new(),
    }
}
