//! Decoders beside the network as exports: fitted to the training samples of a run when they are written.

use std::path::Path;

use super::{
    Contents, FileTask, FileWords, NetworkSource,
    network_exports::{bundle_name, bundles, said_of},
};
use crate::{
    decoupling::DecoderKind,
    export::{
        NetworkFile,
        bundle::{BundleDecoder, BundleFormat, BundlePrecision, BundleReport, ExportedDecoder, export_bundle, fitted},
    },
};

/// The forms in which a decoder of the run `source` can be exported, each with its name: "C99, f32".
pub fn decoder_tasks(source: &NetworkSource, kind: DecoderKind) -> Vec<(String, FileTask)> {
    let decoder = BundleDecoder::Kind(kind);
    let forms = bundles().filter(|(format, precision)| format.check_for(decoder, *precision).is_ok());
    let task = |(format, precision): (BundleFormat, BundlePrecision)| {
        let (name, stem) = match format {
            BundleFormat::Json => ("JSON".to_owned(), kind.to_string()),
            _ => (
                format!("{}, {precision}", bundle_name(format)),
                format!("{kind}-{format}-{precision}"),
            ),
        };
        let task = source.task(words(format), &stem, move |file, _| {
            Contents::telling(move |path| {
                let report = export(&file, decoder, (format, precision), path)?;
                Ok(said_of(&report))
            })
        });
        (name, task)
    };
    forms.map(task).collect()
}

/// Fits the decoder to the samples of the run of `file`, which are drawn or read again, and writes it.
fn export(
    file: &NetworkFile,
    decoder: BundleDecoder,
    (format, precision): (BundleFormat, BundlePrecision),
    path: &Path,
) -> Result<BundleReport, String> {
    if decoder.is_network() {
        return export_bundle(file, format, precision, path).map_err(|error| error.to_string());
    }
    let sets = file.setup().sets(Path::new(""), &|| false, &mut |_| ());
    let sets = sets.map_err(|error| error.to_string())?;
    let sets = sets.ok_or("the samples were not drawn")?.sets;
    let networks = Some(file.network.clone());
    let fitted = fitted(file.settings, sets.split.training, networks, decoder, &sets.test);
    let exported = fitted.map(|fitted| ExportedDecoder::new(file, fitted));
    exported
        .and_then(|exported| export_bundle(exported, format, precision, path))
        .map_err(|error| error.to_string())
}

fn words(format: BundleFormat) -> FileWords {
    let (kind, description) = match format {
        BundleFormat::Onnx => (
            "decoder as ONNX",
            "A folder with the decoder as an ONNX graph (opset 13) and golden vectors: readings in, targets out.",
        ),
        BundleFormat::C99 => (
            "decoder as C99",
            "A folder with one header and one source in C99 and a self-test: readings in, targets out.",
        ),
        BundleFormat::Matlab => (
            "decoder for MATLAB and Octave",
            "A folder with one function file for MATLAB and GNU Octave and golden vectors: readings in, targets out.",
        ),
        BundleFormat::NumPy => (
            "decoder for NumPy",
            "A folder with the numbers as .npz, a short decode.py and golden vectors: readings in, targets out.",
        ),
        BundleFormat::Json => {
            return FileWords {
                kind: "decoder",
                description: "The numbers of the decoder as JSON, with what they mean.",
                extensions: &["json"],
            };
        }
    };
    FileWords {
        kind,
        description,
        extensions: &[],
    }
}
