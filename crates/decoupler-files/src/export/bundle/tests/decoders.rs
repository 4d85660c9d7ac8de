//! Bundles of decoders other than networks, compared with the decoders themselves.

use std::{fs, path::Path};

use ndarray::array;

use super::{run_of, trained_settings};
use crate::export::{
    NetworkFile,
    bundle::{
        BundleDecoder, BundleError, BundleFormat, BundlePrecision, ExportedDecoder,
        choice::Taking,
        exact::decode_exactly,
        export_bundle,
        layers::{AffineLayer, Layer, LayeredMap},
        portable::{FoldedMap, Portable},
        vectors::Vectors,
    },
};
use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::RunSettings,
    job::Job,
    network::{Quantity, ScalingChoice},
    scene::Rows,
};

/// Decoders that consist of layers.
const LAYERED: [BundleDecoder; 4] = [
    BundleDecoder::Kind(DecoderKind::Mean),
    BundleDecoder::Kind(DecoderKind::Ridge),
    BundleDecoder::Linear,
    BundleDecoder::Kind(DecoderKind::RadialBasis),
];

fn settings(rows: Rows, noise: f64) -> RunSettings {
    trained_settings(rows, Quantity::Conductance, ScalingChoice::Whitening, noise)
}

/// The decoder fitted to the training samples of `file`.
fn decoder(file: &NetworkFile, kind: BundleDecoder) -> Result<ExportedDecoder<'_>, BundleError> {
    let sets = file.setup().sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ())?;
    ExportedDecoder::of_run(file, sets, kind)
}

/// The reference is the program's own decoders, which share no code with the layers.
#[test]
fn folded_descriptions_agree_with_the_decoders() {
    for rows in [Rows::All, Rows::Known, Rows::One(1)] {
        let file = run_of(settings(rows, 1e-3));
        for kind in LAYERED {
            let mut exported = decoder(&file, kind).unwrap();
            let portable = Portable::of(&exported).unwrap();
            assert_eq!(portable.takes_row(), rows == Rows::Known, "{kind}");
            let vectors = Vectors::of(&mut exported, &portable, Taking::Double).unwrap();
            assert!(
                vectors.program_deviation < 1e-10,
                "{kind}, rows {rows}: {}",
                vectors.program_deviation
            );
            // The answers vary, except those of the mean.
            let first = &vectors.all()[0].answers;
            let is_constant = vectors.all().iter().all(|vector| vector.answers[2] == first[2]);
            assert_eq!(
                is_constant,
                kind == LAYERED[0] && rows != Rows::Known,
                "{kind}, rows {rows}"
            );
        }
    }
}

#[test]
fn every_decoder_of_layers_is_exported_in_every_format() {
    let home = tempfile::tempdir().unwrap();
    let file = run_of(settings(Rows::Known, 1e-2));
    for kind in LAYERED {
        for format in BundleFormat::ALL {
            for &precision in format.precisions() {
                if precision == BundlePrecision::Fixed16 {
                    continue;
                }
                let path = home.path().join(format!("{kind} {format} {precision}"));
                let report = export_bundle(decoder(&file, kind).unwrap(), format, precision, &path).unwrap();
                assert!(report.deviation() <= report.limit, "{kind}, {format}: {report:?}");
                assert!(report.vectors.golden > 0, "{kind}, {format}: {report:?}");
                if format == BundleFormat::Json {
                    let document: serde_json::Value =
                        serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
                    assert_eq!(document["metadata"]["decoder"], kind.to_string());
                    continue;
                }
                let read = |name: &str| fs::read_to_string(path.join(name)).unwrap();
                assert!(read("README.txt").starts_with(kind.name()), "{}", read("README.txt"));
                let metadata: serde_json::Value = serde_json::from_str(&read("metadata.json")).unwrap();
                assert_eq!(metadata["decoder"], kind.to_string());
                assert_eq!(metadata["row_numbers"], serde_json::json!([1, 3]));
                // The errors of the decoder, not of the network.
                let error = metadata["errors"]["z_mm"].as_f64().unwrap();
                assert!(
                    error > 0.0 && Some(error) != file.scores.network.nodes().map(|errors| errors.z_mm),
                    "{kind}: {error}"
                );
            }
        }
    }
}

/// Padding to the number of Gaussians of the other rows changes no answer.
#[test]
fn padding_maps_of_different_sizes_has_no_effect() {
    let affine = |weights, biases: &[f64]| AffineLayer {
        weights,
        biases: biases.to_vec(),
    };
    let gaussians = |inputs, centres, outputs| LayeredMap {
        quantity: Quantity::Raw,
        centre: vec![0.5, 0.2],
        layers: vec![
            Layer::Affine(inputs),
            Layer::Gaussians { centres },
            Layer::Affine(outputs),
        ],
    };
    let pairs = [[
        gaussians(
            affine(array![[1.0], [0.5]], &[0.2]),
            array![[0.4]],
            affine(array![[3.0]], &[0.1]),
        ),
        gaussians(
            affine(array![[1.0, -1.0], [0.5, 0.3]], &[0.2, 0.0]),
            array![[0.4, 0.1, -0.2], [-0.3, 0.9, 0.0]],
            affine(array![[3.0], [-1.0], [0.5]], &[0.1]),
        ),
    ]];
    let file = run_of(settings(Rows::All, 1e-3));
    let any = Portable::of(&(&file).into()).unwrap();
    let any = Portable {
        quantity: Quantity::Raw,
        scales: vec![1.0],
        ..any
    };
    for pair in pairs {
        let before = pair.each_ref().map(FoldedMap::of);
        let mut after = before.to_vec();
        FoldedMap::widen(&mut after);
        for readings in [[0.0, 0.0], [1.0, -2.0], [30.0, 40.0]] {
            for (before, after) in before.iter().zip(&after) {
                let [expected, found] = [before, after].map(|map| decode_exactly(&any, map, &readings).answers);
                assert_eq!(expected, found, "{readings:?}");
            }
        }
        let shapes = |map: &FoldedMap| {
            map.layers
                .iter()
                .map(|layer| layer.values().count())
                .collect::<Vec<_>>()
        };
        assert_ne!(shapes(&before[0]), shapes(&before[1]));
        assert_eq!(shapes(&after[0]), shapes(&after[1]));
    }
}

#[test]
fn decoders_that_cannot_be_exported_are_refused_with_the_reason() {
    for (kind, reason) in [
        (DecoderKind::Newton, "solves the equations of the sensor"),
        (DecoderKind::Polish, "solves the equations of the sensor"),
        (DecoderKind::Fuzzy, "only for comparison"),
    ] {
        let refused = BundleFormat::C99.check_for(BundleDecoder::Kind(kind), BundlePrecision::Double);
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(reason) && message.contains("export "), "{message}");
        assert!(BundleDecoder::all().all(|other| other != BundleDecoder::Kind(kind)));
    }
    for kind in LAYERED {
        let refused = BundleFormat::C99.check_for(kind, BundlePrecision::Fixed16).unwrap_err();
        assert!(refused.to_string().contains("networks only"), "{refused}");
    }
    for kind in BundleDecoder::all() {
        assert_eq!(kind.to_string().parse(), Ok(kind));
    }
}
