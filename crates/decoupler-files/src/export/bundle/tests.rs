//! Bundles of every decoder, format and precision: what they contain is what the program of the decoder says.

use std::{fs, path::Path};

use super::{BundleDecoder, BundleFormat, BundlePrecision, ExportedDecoder, contents::Contents, export_bundle};
use crate::export::NetworkFile;
use decoupler_core::{
    decoupling::{DecoderKind, Operation, Precision},
    evaluation::{Run, RunSettings},
    job::Job,
    network::{InputChoice, Quantity, ScalingChoice},
    problem::{Channel, Problem},
    scene::{Noise, RowModel, Rows},
    text::Named,
};

/// A network of a small array after little training.
fn trained(rows: Rows, quantity: Quantity, scaling: ScalingChoice, noise: f64) -> NetworkFile {
    let mut settings = RunSettings::default();
    let simulation = settings.simulation_mut().unwrap();
    simulation.sensor = decoupler_core::sensor::SensorModel::new("3x2_2x6".parse().unwrap());
    simulation.samples = 90;
    simulation.validation_samples = 0;
    simulation.test_samples = 9;
    simulation.scene.rows = rows;
    simulation.scene.noise = Noise::relative(noise);
    settings.inputs = InputChoice { quantity, scaling };
    settings.hidden = 4;
    settings.training.stopping.epochs = 4;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    NetworkFile::from_run(&run, None).unwrap()
}

/// Networks of every quantity, shared and of known rows, with names.
fn networks() -> Vec<(String, NetworkFile)> {
    let mut all = Vec::new();
    for quantity in Quantity::ALL {
        for (rows, scaling) in [
            (Rows::All, ScalingChoice::MinMax),
            (Rows::Known, ScalingChoice::Whitening),
        ] {
            let name = format!("{quantity}, rows {rows}");
            all.push((name, trained(rows, quantity, scaling, 1e-3)));
        }
    }
    all
}

/// The decoder fitted to the training samples of `file`.
fn decoder(file: &NetworkFile, kind: BundleDecoder) -> ExportedDecoder {
    let sets = file
        .setup()
        .sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ())
        .unwrap();
    ExportedDecoder::of_run(file, sets, kind).unwrap()
}

/// The values of all numbers in a text, in their order.
fn numbers(text: &str) -> Vec<f64> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || "+-.".contains(c)));
    words
        .filter_map(|word| word.trim_end_matches('f').parse().ok())
        .collect()
}

/// Each table of the program, as it should be in a file.
fn tables(contents: &Contents) -> Vec<(String, Vec<f64>)> {
    let rounded = |precision: Precision, value: f64| match precision {
        Precision::Double => value,
        Precision::Single => f64::from(value as f32),
    };
    let all = contents.constants().map(|constant| {
        let values = constant.values().map(|value| rounded(constant.precision, value));
        (constant.name.to_owned(), values.collect())
    });
    all.collect()
}

/// Constants in the files of every format are those of the program, bit for bit. What the printed program computes with them
/// is checked by the compiled self-test here, and by the other programs in `.ci/readers`.
#[test]
fn printed_constants_are_those_of_the_program() {
    let home = tempfile::tempdir().unwrap();
    for (name, file) in [networks().remove(0), networks().remove(3)] {
        let exported = ExportedDecoder::from(&file);
        for &format in BundleFormat::ALL {
            for &precision in format.precisions() {
                let path = home.path().join(format!("{name} {format} {precision}"));
                let report = export_bundle(&file, format, precision, &path).unwrap();
                if precision == BundlePrecision::Fixed16 {
                    continue;
                }
                let mut contents = exported.contents("any", precision).unwrap();
                if precision == BundlePrecision::Single {
                    let wide = usize::from(
                        report
                            .remarks
                            .iter()
                            .any(|remark| remark.contains("in double precision")),
                    );
                    contents.exported = contents.exported.in_single(wide);
                }
                let read = |suffix: &str| {
                    let (file, _) = report.files.iter().find(|(file, _)| file.ends_with(suffix)).unwrap();
                    fs::read(path.join(file)).unwrap()
                };
                for (table, expected) in tables(&contents) {
                    let found = match format {
                        BundleFormat::C99 => {
                            let text = String::from_utf8(read("_decode.c")).unwrap();
                            let rest = text
                                .split(&format!(" {table}["))
                                .nth(1)
                                .unwrap()
                                .split(';')
                                .next()
                                .unwrap();
                            let found = numbers(rest.split_once('=').unwrap().1);
                            // Literals of single precision end in f.
                            let is_single = rest.contains("f, ") || rest.contains("f,\n");
                            let rounded = |value: f64| if is_single { f64::from(value as f32) } else { value };
                            found.into_iter().map(rounded).collect()
                        }
                        BundleFormat::Matlab => {
                            let text = String::from_utf8(read(".m")).unwrap();
                            let begin = format!("\n{table}_{{");
                            let of_rows = text.split(&begin).skip(1);
                            let of_row = |rest: &str| {
                                numbers(
                                    &rest
                                        .split_once('[')
                                        .unwrap()
                                        .1
                                        .split(']')
                                        .next()
                                        .unwrap()
                                        .replace("...", " "),
                                )
                            };
                            of_rows.flat_map(of_row).collect()
                        }
                        BundleFormat::NumPy => numpy_array(&read(".npz"), &table),
                        BundleFormat::Onnx => super::onnx::initializer(&read(".onnx"), &table),
                    };
                    assert_eq!(found, expected, "{name}, {format} {precision}: {table}");
                }
            }
        }
    }
}

fn numpy_array(bytes: &[u8], name: &str) -> Vec<f64> {
    use std::io::Read;
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut contents = Vec::new();
    archive
        .by_name(&format!("{name}.npy"))
        .unwrap()
        .read_to_end(&mut contents)
        .unwrap();
    let header = usize::from(u16::from_le_bytes([contents[8], contents[9]]));
    let (text, values) = contents[10..].split_at(header);
    match String::from_utf8_lossy(text).contains("<f8") {
        true => values
            .as_chunks()
            .0
            .iter()
            .map(|bytes| f64::from_le_bytes(*bytes))
            .collect(),
        false => values
            .as_chunks()
            .0
            .iter()
            .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
            .collect(),
    }
}

/// The reference is the decoder of the run, which knows nothing of bundles.
#[test]
fn every_decoder_and_format_is_written_and_the_compiled_source_agrees_with_the_decoder() {
    let home = tempfile::tempdir().unwrap();
    for rows in [Rows::All, Rows::Known, Rows::One(1)] {
        let file = trained(rows, Quantity::Conductance, ScalingChoice::Whitening, 1e-3);
        for kind in BundleDecoder::all() {
            for &format in BundleFormat::ALL {
                for &precision in format.precisions() {
                    if format.check_for(kind, precision).is_err() {
                        assert_eq!(kind, BundleDecoder::Kind(DecoderKind::RadialBasis));
                        continue;
                    }
                    let path = home.path().join(format!("{rows} {kind} {format} {precision}"));
                    let report = export_bundle(decoder(&file, kind), format, precision, &path).unwrap();
                    assert!(
                        report.deviation().is_none_or(|found| found <= report.limit),
                        "{kind}: {report:?}"
                    );
                    if precision == BundlePrecision::Double {
                        assert!(report.limit < 1e-6, "{kind} {format}: {report:?}");
                    }
                    let golden = fs::read_to_string(path.join("golden.csv")).unwrap();
                    assert_eq!(golden.starts_with("row,r_1,"), rows == Rows::Known, "{kind} {rows}");
                    assert_eq!(golden.lines().count(), report.golden + 1);
                    let metadata = fs::read_to_string(path.join("metadata.json")).unwrap();
                    let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
                    assert_eq!(
                        (&metadata["array"], &metadata["outputs"]["names"][4]),
                        (&"3×2_2×6".into(), &"y_2".into())
                    );
                    // A run whose settings were not chosen answers with its network.
                    let exported = if kind.is_network() {
                        BundleDecoder::default()
                    } else {
                        kind
                    };
                    assert_eq!(metadata["decoder"], exported.to_string());
                }
            }
        }
    }
}

/// Golden answers are those of `decode` to readings in double precision; constant coordinates are exact.
#[test]
fn golden_answers_are_those_of_the_network() {
    for (name, file) in networks() {
        let contents = ExportedDecoder::from(&file)
            .contents("any", BundlePrecision::Double)
            .unwrap();
        assert!(
            contents
                .golden
                .all()
                .iter()
                .any(|row| row.readings.iter().any(|&ohm| f64::from(ohm as f32) != ohm))
        );
        for row in contents.golden.all() {
            let readings = ndarray::ArrayView2::from_shape((1, row.readings.len()), &row.readings).unwrap();
            let network = file.network.at(row.row);
            for (target, (ours, truth)) in row.targets.iter().zip(&network.decouple(readings)).enumerate() {
                let (low, high) = network.outputs().extremes(target);
                assert!((ours - truth).abs() < 1e-12 * truth.abs(), "{name}");
                assert!(low < high || *ours == low, "{name}: {target}");
            }
        }
    }
}

#[test]
fn steps_of_affine_maps_are_joined() {
    let file = trained(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 1e-3);
    let contents = ExportedDecoder::from(&file)
        .contents("any", BundlePrecision::Double)
        .unwrap();
    let affine = contents
        .computed()
        .filter(|(_, operation)| matches!(operation, Operation::Affine { .. }));
    assert_eq!(affine.count(), 2, "hidden layer and targets");
}

#[test]
fn networks_of_samples_in_memory_are_exported_without_errors() {
    let home = tempfile::tempdir().unwrap();
    let network = trained(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 1e-3).network;
    let settings = RunSettings::measured(RowModel::Shared);
    let mut problem = Problem::unnamed(6, network.at(0).outputs().channels());
    problem.inputs[5] = Channel::new("odd \u{200b}*/ \"name\"", Some("µT"));
    let path = home.path().join("bundle");
    let exported = ExportedDecoder::of_networks(&network, None, settings, problem, None);
    export_bundle(exported, BundleFormat::C99, BundlePrecision::Double, &path).unwrap();
    let metadata = fs::read_to_string(path.join("metadata.json")).unwrap();
    let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
    assert_eq!(metadata["errors"], serde_json::json!([]));
    assert_eq!(metadata["inputs"]["names"][4], "c5");
    let golden = csv::Reader::from_path(path.join("golden.csv"))
        .unwrap()
        .headers()
        .unwrap()
        .clone();
    assert_eq!(golden.len(), 6 + network.at(0).outputs().channels());
}

#[test]
fn refused_exports_leave_no_files() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("bundle");
    let mut file = trained(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 1e-3);
    let taken = home.path().join("taken");
    fs::write(&taken, "").unwrap();
    let with = |change: &dyn Fn(&mut serde_json::Value)| {
        let text = serde_json::to_string(&file.network).unwrap();
        let mut network: serde_json::Value = serde_json::from_str(&text).unwrap();
        change(&mut network);
        NetworkFile {
            network: serde_json::from_value(network).unwrap(),
            ..file.clone()
        }
    };
    let without_range = with(&|network| drop(network.as_object_mut().unwrap().remove("reading_range")));
    let large = with(&|network| network["output_layer"][0] = serde_json::json!(1e300));
    let double = BundlePrecision::Double;
    let cases = [
        (
            export_bundle(&file, BundleFormat::Onnx, BundlePrecision::Fixed16, &path),
            "give f64 or f32",
        ),
        (
            export_bundle(&file, BundleFormat::Onnx, double, &taken),
            "is there already",
        ),
        (
            export_bundle(&without_range, BundleFormat::C99, BundlePrecision::Fixed16, &path),
            "train again",
        ),
        (
            export_bundle(&large, BundleFormat::NumPy, BundlePrecision::Single, &path),
            "choose precision f64",
        ),
    ];
    for (refused, expected) in cases {
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    // Without the range, the other bundles have no count of readings outside.
    for &format in BundleFormat::ALL {
        export_bundle(
            &without_range,
            format,
            double,
            &home.path().join(format!("without {format}")),
        )
        .unwrap();
    }
    file.network = large.network;
    export_bundle(&file, BundleFormat::NumPy, double, &path).unwrap();
    let left = fs::read_dir(home.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    assert!(left.into_iter().all(|name| !name.to_string_lossy().starts_with('.')));
}

/// The reference is `decode` of this program on readings in double precision, which callers of a bundle in single
/// precision cannot pass to it.
#[test]
fn single_precision_is_judged_by_the_readings_of_the_caller() {
    let home = tempfile::tempdir().unwrap();
    let mut refused = 0;
    for (index, noise) in [0.0, 1e-6, 1e-4, 1e-2].into_iter().enumerate() {
        let file = trained(Rows::Known, Quantity::Conductance, ScalingChoice::Whitening, noise);
        let contents = ExportedDecoder::from(&file)
            .contents("any", BundlePrecision::Double)
            .unwrap();
        let mut largest = 0.0_f64;
        for row in contents.golden.all() {
            let network = file.network.at(row.row);
            let answer = |taken: &dyn Fn(f64) -> f64| {
                let readings: Vec<f64> = row.readings.iter().map(|&ohm| taken(ohm)).collect();
                network.decouple(ndarray::ArrayView2::from_shape((1, readings.len()), &readings).unwrap())
            };
            let pairs = answer(&|ohm| ohm) - answer(&|ohm| f64::from(ohm as f32));
            largest = pairs
                .iter()
                .zip(&contents.scales)
                .fold(largest, |most, (off, scale)| most.max(off.abs() / scale));
        }
        let path = home.path().join(format!("bundle {index}"));
        match export_bundle(&file, BundleFormat::Onnx, BundlePrecision::Single, &path) {
            Ok(report) => {
                let rounding = report.rounding.unwrap();
                assert!(
                    rounding >= largest && rounding < 40.0 * largest,
                    "{noise}: {report:?} {largest}"
                );
                assert!(
                    report.deviation().unwrap() <= report.limit && rounding <= 0.01,
                    "{noise}: {report:?}"
                );
                let is_noted = report
                    .remarks
                    .iter()
                    .any(|remark| remark.contains("rounding the readings"));
                let readme = fs::read_to_string(path.join("README.txt")).unwrap();
                assert_eq!(is_noted, rounding > 1e-5, "{noise}: {report:?}");
                assert_eq!(readme.contains("Note: rounding the readings"), is_noted);
            }
            Err(error) => {
                refused += 1;
                let message = error.to_string();
                assert!(
                    message.starts_with("single precision cannot resolve the readings") && largest > 2e-4,
                    "{message} {largest}"
                );
                assert!(
                    message.contains(" mm") && message.contains("precision f64"),
                    "{message}"
                );
                assert!(!path.exists());
            }
        }
    }
    assert!((1..4).contains(&refused), "{refused}");
}

/// A converter of 2 bits leaves channels that never vary: no integer in fine units is within their limits.
#[test]
fn constant_channels_are_exported_in_fixed_point() {
    let home = tempfile::tempdir().unwrap();
    let mut file = trained(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 0.0);
    file.settings.simulation_mut().unwrap().scene.noise.converter_bits = Some(2);
    let mut run = Run::prepare(file.settings).unwrap();
    while run.step().is_none() {}
    let file = NetworkFile::from_run(&run, None).unwrap();
    let path = home.path().join("bundle");
    let report = export_bundle(&file, BundleFormat::C99, BundlePrecision::Fixed16, &path).unwrap();
    assert!(
        report.golden >= 3 && report.deviation().is_none_or(|found| found <= report.limit),
        "{report:?}"
    );
}
