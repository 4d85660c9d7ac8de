use std::path::PathBuf;

use clap::Args;
use decoupler_core::{problem::Channel, text::Named};
use decoupler_files::export::{
    NetworkFile,
    bundle::{BundleDecoder, BundleError, BundleFormat, BundlePrecision, BundleReport, ExportedDecoder, export_bundle},
    format_number, is_same,
};
use serde_json::{Value, json};

use super::{
    failure::Failure,
    output::{input, print, value},
    samples::sets,
};

/// Write a decoder for other programs, and verify it
///
/// The exported decoder of a simulated array takes the resistances of one row-wire in ohm (r_1, r_2, …, one per
/// column-wire) and returns the coordinates of its nodes in mm (x_1, y_1, z_1, x_2, …), as decode does; it includes
/// scaling, conversion to conductances or logarithms, and constant coordinates. The decoder of a recording (train --data)
/// takes its inputs and returns its targets in their units. Decoders of known rows are exported as one, which also takes
/// the number of the row-wire from 1.
///
/// Decoders other than the network are fitted to the training samples of the network file, which are drawn again from its
/// settings or imported again from its recording.
///
/// The bundle states how far answers of other programs may deviate from those of the decoder, relative to the widest
/// training range of a coordinate: 1e-12 (f64), 1e-5 (f32), or in fixed16 a proven bound, and more if the decoder amplifies
/// rounding errors. The figures are measured on test readings and at the limits of the training range. A bundle in f32 also
/// takes its readings in single precision: the effect of rounding the readings is reported too, and if it exceeds 1 % the
/// bundle is not written. C is compiled and run, where there is a compiler. The bundle is a folder with golden readings and
/// answers, and a README.txt that shows how to call it. A decoder with a history of readings takes their times, and keeps a
/// state that restarts as in decode.
#[derive(Args)]
pub(super) struct Export {
    /// Network saved by train --out or by the window
    #[arg(long, value_name = "FILE", value_parser = input)]
    network: PathBuf,
    #[arg(long, value_name = "DECODER", default_value_t = BundleDecoder::Chosen, value_parser = BundleDecoder::parse, help = BundleDecoder::help())]
    decoder: BundleDecoder,
    #[arg(long, value_name = "FORMAT", value_parser = BundleFormat::parse, help = BundleFormat::help())]
    format: BundleFormat,
    /// Arithmetic of the decoder. f64: double precision; f32: single precision (onnx, c99, numpy); fixed16: integers with
    /// 16-bit weights (networks and ridge, c99), which takes integers in nano-, micro- or milliohm and returns nanometres
    #[arg(long, value_name = "f64|f32|fixed16", default_value_t, value_parser = BundlePrecision::parse)]
    precision: BundlePrecision,
    /// Folder to create, which must not exist or must be an empty folder
    #[arg(short, long, value_name = "PATH")]
    out: PathBuf,
}

impl Export {
    pub(super) fn run(self) -> Result<(), Failure> {
        if is_same(&self.network, &self.out) {
            let message = "--network and --out name the same file: give --out another name";
            return Err(Failure::Arguments(message.to_owned()));
        }
        self.format
            .check_for(self.decoder, self.precision)
            .map_err(BundleError::from)?;
        let file = NetworkFile::load(&self.network)?;
        let decoder = if self.decoder == BundleDecoder::Chosen {
            ExportedDecoder::from(&file)
        } else {
            ExportedDecoder::of_run(&file, sets(&file.setup())?, self.decoder)?
        };
        let report = export_bundle(decoder, self.format, self.precision, &self.out)?;
        print(|| object(&report), |out| out.write_all(text(&report).as_bytes()))
    }
}

/// The object printed by `export --json`. Deviations are relative to `output_range_mm`, or for a recording to the range of
/// each target.
fn object(report: &BundleReport) -> Value {
    let file = |(name, bytes): &(String, u64)| json!({"name": name, "bytes": bytes});
    let mut object = value(report);
    object["files"] = report.files.iter().map(file).collect();
    if let Some(deviation) = report.deviation() {
        object["deviation"] = deviation.into();
    }
    // Of all coordinates of an array, or of each target of a recording.
    let bound = |(output, bound): &(Channel, f64)| json!({"name": output.name, "unit": output.unit, "bound": bound});
    match &report.bounds[..] {
        [] => {}
        [(_, bound), ..] if report.output_range_mm.is_some() => object["error_bound_mm"] = (*bound).into(),
        bounds => object["error_bounds"] = bounds.iter().map(bound).collect(),
    }
    object
}

/// The files, and the deviations from the network.
fn text(report: &BundleReport) -> String {
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
    text += &format!(
        "Answers of other programs agree within {:.1e} of a {relative}; {} of {} {inputs} are in the bundle as golden \
         readings.\n",
        report.limit, report.golden, report.verified
    );
    for check in &report.checks {
        text += &format!("  {}: largest deviation {:.1e}\n", check.evaluator, check.deviation);
    }
    if let Some(rounding) = report.describe_rounding() {
        text += &format!("  {rounding}\n");
    }
    if let Some(bounds) = report.describe_bounds() {
        text += &format!("{bounds}\n");
    }
    for remark in &report.remarks {
        text += &format!("Note: {remark}.\n");
    }
    text
}
