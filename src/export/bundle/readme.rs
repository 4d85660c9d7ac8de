use std::fmt::Write;

use super::{
    c99,
    choice::{BundleFormat, BundlePrecision},
    fixed_point::FixedNetworks,
    meaning::Meaning,
    portable::Portable,
    report::BundleReport,
};
use crate::{export::format_number, network::Quantity};

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
    text += &call(name, portable, fixed, report);
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

fn call(name: &str, portable: &Portable, fixed: Option<&FixedNetworks>, report: &BundleReport) -> String {
    let takes_row = portable.takes_row();
    let (channels, outputs, upper) = (portable.channels, portable.outputs, name.to_uppercase());
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
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
                 session = onnxruntime.InferenceSession(\"{noun}.onnx\")\n    \
                 readings = np.loadtxt(\"golden.csv\", delimiter=\",\", skiprows=1, ndmin=2)[:1, {first}:{end}]\n    \
                 inputs = {{\"{input}\": readings.astype(np.{kind}){row}}}\n    \
                 {output} = session.run([\"{output}\"], inputs)[0]\n\n\
                 {input} is batch x {channels}, {output} batch x {outputs}; where a reading is not a finite \
                 number{above}{row_text},\nthe {one}s are NaN. A second output, readings_outside, counts the readings \
                 of each line beyond the range\nseen in training.",
                above = if portable.quantity == Quantity::Raw {
                    ""
                } else {
                    " above 0"
                },
                one = meaning.output(),
                noun = portable.decoder,
                first = usize::from(takes_row),
                end = channels + usize::from(takes_row),
                row_text = if takes_row { ", or the row does not exist" } else { "" },
            )
        }
        BundleFormat::C99 => {
            let row = if takes_row { "1, " } else { "" };
            let (reading, readings, coordinate, coordinates) = match (fixed, report.precision) {
                (Some(fixed), _) => (
                    "int32_t",
                    c99::readings(portable, fixed),
                    "int32_t",
                    c99::outputs(portable),
                ),
                (None, BundlePrecision::Single) => ("float", input, "float", output),
                (None, _) => ("double", input, "double", output),
            };
            let range = if portable.known_ranges().is_some() {
                format!(
                    "\nint outside = {name}_is_out_of_range({row}{readings}); counts the readings beyond the range seen in \
                     training."
                )
            } else {
                String::new()
            };
            let explained = match &portable.equations {
                Some(equations) if equations.seeks_solution => format!(
                    "\nWhere no deformation explains the readings to 1e-10, as with noise, it is {upper}_NOT_EXPLAINED and the\n\
                     coordinates are the best found."
                ),
                _ => String::new(),
            };
            let library = if fixed.is_some() { "" } else { " -lm" };
            let units = match (fixed, meaning) {
                (Some(_), Meaning::Own { .. }) => format!(
                    "\nReadings and targets are whole numbers of the units {upper}_READING_UNITS and {upper}_TARGET_UNITS \
                     in the header:\nround(reading / unit) goes in, and unit * number comes out."
                ),
                _ => String::new(),
            };
            format!(
                "    #include \"{name}_decode.h\"\n    \
                 {reading} {readings}[{upper}_CHANNELS];\n    \
                 {coordinate} {coordinates}[{upper}_OUTPUTS];\n    \
                 int status = {name}_decode({row}{readings}, {coordinates});\n\n\
                 The status is {upper}_OK, or tells what is wrong. Compile {name}_decode.c with your program{libm}. The\n\
                 self-test compares the golden vectors:\n\n    \
                 cc -std=c99 -O2 {name}_decode.c {name}_selftest.c -lm -o selftest && ./selftest\n{units}{range}{explained}",
                libm = if library.is_empty() { "" } else { ", and link with -lm" },
            )
        }
        BundleFormat::Matlab => {
            let row = if takes_row { ", row" } else { "" };
            format!(
                "    [{output}, readings_outside] = {name}_decode({input}{row})\n\n\
                 in MATLAB (from R2016b) or GNU Octave. {input} is samples x {channels}, {output} samples x \
                 {outputs}{row_text}.",
                row_text = if takes_row {
                    ";\nrow has the row of each sample, from 1"
                } else {
                    ""
                },
            )
        }
        BundleFormat::NumPy => {
            let row = if takes_row { ", row" } else { "" };
            format!(
                "    from decode import decode\n    \
                 {output}, readings_outside = decode({input}{row})\n\n\
                 {input} is samples x {channels}, {output} samples x {outputs}{row_text}.{explained}",
                row_text = if takes_row {
                    ";\nrow has the row of each sample, from 1"
                } else {
                    ""
                },
                explained = match &portable.equations {
                    Some(equations) if equations.seeks_solution => {
                        "\nIt warns of samples that no deformation explains to 1e-10, as with noise."
                    }
                    _ => "",
                },
            )
        }
        BundleFormat::Json => String::new(),
    }
}
