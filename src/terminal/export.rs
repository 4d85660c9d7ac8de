use std::path::PathBuf;

use clap::Args;

use super::{
    export_report::{print_json, print_text},
    failure::Failure,
    samples::sets,
};
use decoupler_files::export::{
    NetworkFile,
    bundle::{BundleDecoder, BundleError, BundleFormat, BundlePrecision, ExportedDecoder, export_bundle},
    is_same,
};

/// Write a decoder for other programs, and verify what was written
///
/// The exported decoder of a simulated array takes the resistances of one row-wire in ohm (r_1, r_2, …, one for each column-wire) and gives
/// the coordinates of its nodes in mm (x_1, y_1, z_1, x_2, …), as decode does; scaling, conductances or logarithms, and
/// constant coordinates are part of it. The decoder of a recording (train --data) takes its inputs and gives its targets, in their
/// units. Decoders of known rows leave as one, which also takes the number of the row-wire,
/// from 1.
///
/// Decoders other than the network are fitted again: to the training samples of the network file, which are drawn again from
/// its settings or imported again from its recording.
///
/// What was written is read back, evaluated, and compared with the decoder on readings of its scene and on the extremes of
/// its training range: the largest deviation is shown, relative to the widest range of a coordinate in training. A bundle
/// that deviates by more than 1e-12 (f64) or 1e-5 (f32), or in fixed16 by more than its proven bound, is not written,
/// unless the decoder itself magnifies rounding errors further, which is then reported. A bundle in f32 also takes its
/// readings in single precision: the change by rounding them to it is reported too, and a bundle that it changes by more
/// than 1 % is not written. The bundle is a folder (for json a file) with golden vectors and a README.txt that shows how to
/// call it.
#[derive(Args)]
pub(super) struct Export {
    /// Network saved by train --out or by the window
    #[arg(long, value_name = "FILE")]
    network: PathBuf,
    #[arg(long, value_name = "DECODER", default_value_t, help = BundleDecoder::help())]
    decoder: BundleDecoder,
    #[arg(long, value_name = "FORMAT", help = BundleFormat::help())]
    format: BundleFormat,
    /// Numbers in which it decodes. f64: double precision; f32: single precision (onnx, c99, numpy); fixed16: whole numbers
    /// with 16-bit weights (networks, c99), which reads whole numbers of nano-, micro- or milliohm and gives nanometres
    #[arg(long, value_name = "f64|f32|fixed16", default_value_t)]
    precision: BundlePrecision,
    /// Folder to be made (for json the file), which must not exist or be an empty folder
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
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
        let decoder = if self.decoder.is_network() {
            ExportedDecoder::from(&file)
        } else {
            ExportedDecoder::of_run(&file, sets(&file.setup(), self.json)?, self.decoder)?
        };
        let report = export_bundle(decoder, self.format, self.precision, &self.out)?;
        if self.json {
            print_json(&report)
        } else {
            print_text(&report)
        }
    }
}
