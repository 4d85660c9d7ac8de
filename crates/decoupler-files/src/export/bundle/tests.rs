//! Bundles of small networks of every kind against the networks themselves.

mod decoders;

use std::fs;

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::{
    BundleError, BundleFormat, BundlePrecision, FoldError, c99,
    choice::Taking,
    exact::{Twofold, decode_exactly},
    export_bundle,
    exported_decoder::ExportedDecoder,
    fixed_point::{FixedNetworks, HiddenWidth},
    layers::Layer,
    matlab,
    meaning::Meaning,
    numpy, onnx,
    portable::Portable,
    vectors::{Deviation, Vectors},
    weights::{Arithmetic, Weights},
};
use crate::export::NetworkFile;
use decoupler_core::{
    evaluation::{Measured, Run, RunSettings},
    network::{InputChoice, Quantity, ScalingChoice},
    problem::{Channel, Problem},
    scene::{Noise, RowModel, Rows},
};

/// A network of a small array after little training.
fn trained(rows: Rows, quantity: Quantity, scaling: ScalingChoice, noise: f64) -> NetworkFile {
    run_of(trained_settings(rows, quantity, scaling, noise))
}

fn trained_settings(rows: Rows, quantity: Quantity, scaling: ScalingChoice, noise: f64) -> RunSettings {
    let mut settings = RunSettings::default();
    settings.simulation_mut().unwrap().sensor = decoupler_core::sensor::SensorModel::new("3x2_2x6".parse().unwrap());
    settings.simulation_mut().unwrap().samples = 90;
    settings.simulation_mut().unwrap().validation_samples = 0;
    settings.simulation_mut().unwrap().test_samples = 9;
    settings.simulation_mut().unwrap().scene.rows = rows;
    settings.simulation_mut().unwrap().scene.noise = Noise::relative(noise);
    settings.inputs = InputChoice { quantity, scaling };
    settings.hidden = 4;
    settings.training.stopping.epochs = 4;
    settings
}

fn run_of(settings: RunSettings) -> NetworkFile {
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
            all.push((
                format!("{quantity}, rows {rows}"),
                trained(rows, quantity, scaling, 1e-3),
            ));
        }
    }
    all
}

/// The reference is the program's own `decode`, which neither folds scaling nor subtracts a centre.
#[test]
fn exact_answers_and_folded_weights_agree_with_decode() {
    for (name, file) in networks() {
        let portable = Portable::of(&(&file).into()).unwrap();
        let vectors = Vectors::of(&mut (&file).into(), &portable, Taking::Single).unwrap();
        assert!(
            vectors.program_deviation < 1e-11,
            "{name}: {}",
            vectors.program_deviation
        );
        for (arithmetic, limit) in [
            (Arithmetic::DOUBLE, 1e-12),
            (Arithmetic::single(1), 2e-5),
            (Arithmetic::single(0), 2e-3),
        ] {
            let weights = Weights::of(&portable, arithmetic);
            let deviation = vectors
                .deviation(|vector| weights.decode(vector.row, &vector.taken))
                .of_arithmetic;
            assert!(deviation < limit, "{name}, {arithmetic:?}: {deviation}");
        }
        assert_eq!(portable.takes_row(), name.ends_with("known"), "{name}");
    }
}

#[test]
fn constant_coordinates_are_exact() {
    for (name, file) in networks() {
        let portable = Portable::of(&(&file).into()).unwrap();
        let vectors = Vectors::of(&mut (&file).into(), &portable, Taking::Double).unwrap();
        for vector in vectors.all() {
            let outputs = file.network.at(vector.row).outputs();
            for coordinate in 0..portable.outputs {
                let (low, high) = outputs.extremes(coordinate);
                assert!(low < high || vector.answers[coordinate] == low, "{name}: {coordinate}");
            }
        }
    }
}

#[test]
fn graphs_agree_with_the_network_count_readings_outside_and_refuse_invalid_ones() {
    for (name, file) in networks() {
        let portable = Portable::of(&(&file).into()).unwrap();
        for (precision, arithmetic, taking, limit) in [
            (BundlePrecision::Double, Arithmetic::DOUBLE, Taking::Double, 1e-12),
            (BundlePrecision::Single, Arithmetic::single(1), Taking::Single, 2e-5),
        ] {
            let vectors = Vectors::of(&mut (&file).into(), &portable, taking).unwrap();
            let metadata = ExportedDecoder::from(&file).metadata(&portable, precision);
            let bytes = onnx::write(&portable, &Weights::of(&portable, arithmetic), &metadata, &[]);
            let graph = onnx::OnnxGraph::read(&bytes).unwrap();
            let mut answers = graph.decode(vectors.all()).unwrap().answers.into_iter();
            let deviation = vectors.deviation(|_| answers.next().unwrap()).of_arithmetic;
            assert!(deviation < limit, "{name}, {precision}: {deviation}");

            let mut odd = vectors.golden()[..4].to_vec();
            odd[0].readings[2] = -1.0;
            odd[1].readings[2] = f64::INFINITY;
            odd[2].readings[2] *= 100.0;
            odd[3].row = 7;
            let answers = graph.decode(&odd).unwrap();
            let are_valid: Vec<_> = (answers.answers.iter())
                .map(|row| row.iter().all(|mm| !mm.is_nan()))
                .collect();
            assert_eq!(are_valid, [false, false, true, !portable.takes_row()], "{name}");
            let inputs = file.network.at(odd[2].row).inputs();
            let outside = inputs
                .range()
                .unwrap()
                .outside(portable.quantity, &odd[2].readings)
                .count();
            assert_eq!(answers.readings_outside.unwrap()[2], outside as i64, "{name}");
        }
    }
}

#[test]
fn weights_for_numpy_and_matlab_round_trip_bit_for_bit() {
    for (name, file) in networks() {
        let portable = Portable::of(&(&file).into()).unwrap();
        for arithmetic in [Arithmetic::DOUBLE, Arithmetic::single(1), Arithmetic::single(0)] {
            let weights = Weights::of(&portable, arithmetic);
            let bytes = numpy::write_weights(&portable, &weights);
            assert_eq!(
                numpy::read_weights(&bytes, &portable, arithmetic).unwrap(),
                weights,
                "{name}"
            );
        }
        let weights = Weights::of(&portable, Arithmetic::DOUBLE);
        let text = matlab::write("decode", &portable, &weights);
        assert_eq!(matlab::read_weights(&text, &portable).unwrap(), weights, "{name}");
        assert!(matlab::read_weights(&text.replace("output_biases = [", "x = ["), &portable).is_err());
    }
}

/// The same network of own data: readings of any sign and in any unit.
fn own_data(array: &Portable) -> Portable {
    let channels = |count| {
        let named = |index| Channel::new(format!("c{index}"), None);
        (0..count).map(named).collect()
    };
    Portable {
        quantity: Quantity::Raw,
        meaning: Meaning::Own {
            inputs: channels(array.channels),
            targets: channels(array.outputs),
            has_memory: false,
            row_wires: Vec::new(),
            half_widths: Vec::new(),
        },
        ..array.clone()
    }
}

/// Overflow panics in tests, so it cannot go unnoticed.
#[test]
fn fixed_point_stays_within_its_bound_inside_the_range_and_saturates_beyond_it() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let arrays = networks()
        .into_iter()
        .map(|(name, file)| (name, Portable::of(&(&file).into()).unwrap()));
    let mut all: Vec<(String, Portable)> = arrays.collect();
    let own = all.iter().filter(|(_, array)| array.quantity == Quantity::Resistance);
    let own: Vec<_> = own
        .map(|(name, array)| (format!("{name}, own"), own_data(array)))
        .collect();
    all.extend(own);
    for (name, portable) in all {
        let fixed = FixedNetworks::of(&portable).unwrap();
        let bound_mm = fixed.bounds.iter().fold(0.0_f64, |largest, &bound| largest.max(bound));
        assert!(bound_mm < 0.02, "{name}: {bound_mm}");
        for (index, map) in portable.maps.iter().enumerate() {
            let limits = &portable.ranges[index].as_ref().unwrap().limits;
            let mut largest_mm = 0.0_f64;
            for _ in 0..300 {
                let drawn = limits
                    .iter()
                    .map(|&(low, high)| rng.random_range(low..high))
                    .enumerate();
                let readings: Vec<f64> = drawn.map(|(channel, ohm)| fixed.representable(channel, ohm)).collect();
                let exact = decode_exactly(&portable, map, &readings).answers;
                let ours = fixed.decode(index, &readings).unwrap();
                for (nm, mm) in ours.iter().zip(exact) {
                    largest_mm = largest_mm.max((f64::from(*nm) * 1e-6 - mm).abs());
                }
            }
            assert!(largest_mm <= bound_mm, "{name}: {largest_mm} {bound_mm}");
            assert!(largest_mm > 0.005 * bound_mm, "{name}: {largest_mm} {bound_mm}");
            let is_signed = portable.quantity == Quantity::Raw;
            let least = if is_signed { i32::MIN } else { 1 };
            for _ in 0..300 {
                let readings: Vec<i32> = limits.iter().map(|_| rng.random_range(least..=i32::MAX)).collect();
                assert!(fixed.decode_whole(index, &readings).is_some(), "{name}");
            }
            for reading in [least, i32::MAX] {
                let all = vec![reading; limits.len()];
                assert!(fixed.decode_whole(index, &all).is_some(), "{name}");
            }
            let zeros = fixed.decode_whole(index, &vec![0; limits.len()]);
            assert_eq!(zeros.is_some(), is_signed, "{name}");
        }
    }
}

#[test]
fn networks_with_cancelling_products_have_wider_hidden_weights() {
    let file = trained(Rows::All, Quantity::LogResistance, ScalingChoice::Whitening, 1e-5);
    let fixed = FixedNetworks::of(&Portable::of(&(&file).into()).unwrap()).unwrap();
    assert_eq!(fixed.hidden_width, HiddenWidth::TwentyFour);
}

#[test]
fn every_format_and_precision_is_written_verified_and_complete() {
    let home = tempfile::tempdir().unwrap();
    // Compiling is slow: only one network for all rows and one of known rows.
    for (index, (name, file)) in networks().into_iter().enumerate().skip(3).take(2) {
        for format in BundleFormat::ALL {
            for &precision in format.precisions() {
                let path = home.path().join(format!("{index} {format} {precision}"));
                let report = export_bundle(&file, format, precision, &path).unwrap();
                assert!(
                    report.deviation() <= report.limit,
                    "{name}, {format} {precision}: {report:?}"
                );
                if format == BundleFormat::Json {
                    assert_eq!(NetworkFile::load(&path).unwrap().network, file.network);
                    continue;
                }
                let names: Vec<_> = report.files.iter().map(|(name, _)| name.as_str()).collect();
                for expected in ["README.txt", "golden.csv", "metadata.json"] {
                    assert!(names.contains(&expected), "{names:?}");
                }
                let golden = fs::read_to_string(path.join("golden.csv")).unwrap();
                let has_row = golden.starts_with("row,r_1,");
                assert_eq!(has_row, name.ends_with("known"), "{name}");
                assert_eq!(golden.lines().count(), report.vectors.golden + 1);
                let metadata = fs::read_to_string(path.join("metadata.json")).unwrap();
                let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
                assert_eq!(metadata["array"], "3×2_2×6");
                assert_eq!(metadata["outputs"]["names"][4], "y_2");
            }
        }
    }
}

#[test]
fn networks_of_samples_in_memory_are_exported_without_errors() {
    let home = tempfile::tempdir().unwrap();
    let network = trained(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 1e-3).network;
    let settings = RunSettings::from(Measured { rows: RowModel::Shared });
    let problem = Problem::unnamed(6, network.at(0).outputs().channels());
    let decoder = || ExportedDecoder::of_networks(&network, settings, problem.clone(), None);
    let path = home.path().join("bundle");
    let report = export_bundle(decoder(), BundleFormat::Onnx, BundlePrecision::Double, &path).unwrap();
    assert!(report.deviation() <= report.limit);
    let metadata = fs::read_to_string(path.join("metadata.json")).unwrap();
    let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
    assert_eq!(metadata["errors"], serde_json::json!([]));
    assert_eq!(metadata["inputs"]["names"][5], "c6");
    let other = home.path().join("network.json");
    let refused = export_bundle(decoder(), BundleFormat::Json, BundlePrecision::Double, &other);
    assert!(matches!(refused, Err(BundleError::NoFile)), "{refused:?}");
}

#[test]
fn refused_exports_leave_no_files() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("bundle");
    let mut file = trained(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 1e-3);
    let taken = home.path().join("taken");
    fs::write(&taken, "").unwrap();
    let without_range = {
        let text = serde_json::to_string(&file.network).unwrap();
        let mut network: serde_json::Value = serde_json::from_str(&text).unwrap();
        network.as_object_mut().unwrap().remove("reading_range");
        NetworkFile {
            network: serde_json::from_value(network).unwrap(),
            ..file.clone()
        }
    };
    let cases = [
        (
            export_bundle(&file, BundleFormat::Onnx, BundlePrecision::Fixed16, &path),
            "give f64 or f32",
        ),
        (
            export_bundle(&file, BundleFormat::Onnx, BundlePrecision::Double, &taken),
            "is there already",
        ),
        (
            export_bundle(&file, BundleFormat::Json, BundlePrecision::Double, &taken),
            "is there already",
        ),
        (
            export_bundle(&without_range, BundleFormat::C99, BundlePrecision::Fixed16, &path),
            "train again",
        ),
    ];
    for (refused, expected) in cases {
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    // Without the range, the other bundles have no count of readings outside.
    for format in [
        BundleFormat::Onnx,
        BundleFormat::C99,
        BundleFormat::NumPy,
        BundleFormat::Matlab,
    ] {
        let path = home.path().join(format!("without {format}"));
        export_bundle(&without_range, format, BundlePrecision::Double, &path).unwrap();
    }
    // A network that is damaged in memory only.
    let text = serde_json::to_string(&file.network).unwrap();
    let mut network: serde_json::Value = serde_json::from_str(&text).unwrap();
    network["output_layer"][0] = serde_json::json!(1e300);
    file.network = serde_json::from_value(network).unwrap();
    let refused = export_bundle(&file, BundleFormat::NumPy, BundlePrecision::Double, &path);
    assert!(
        matches!(refused, Err(BundleError::Fold(FoldError::NotFinite { network: 1 }))),
        "{refused:?}"
    );
    assert!(!path.exists());
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
        let portable = Portable::of(&(&file).into()).unwrap();
        let vectors = Vectors::of(&mut (&file).into(), &portable, Taking::Single).unwrap();
        let weights = Weights::of(&portable, Arithmetic::single(1));
        let mut largest = 0.0_f64;
        for vector in vectors.all() {
            let readings = ndarray::ArrayView2::from_shape((1, vector.readings.len()), &vector.readings).unwrap();
            assert!(vector.readings.iter().any(|&ohm| f64::from(ohm as f32) != ohm));
            let truth = file.network.at(vector.row).decouple(readings);
            let rounded: Vec<f64> = vector.readings.iter().map(|&ohm| f64::from(ohm as f32)).collect();
            let answers = weights.decode(vector.row, &rounded);
            for ((answer, truth), scale) in answers.iter().zip(&truth).zip(&portable.scales) {
                largest = largest.max((answer - truth).abs() / scale);
            }
        }
        let path = home.path().join(format!("bundle {index}"));
        match export_bundle(&file, BundleFormat::Onnx, BundlePrecision::Single, &path) {
            Ok(report) => {
                assert!(
                    (report.deviation() / largest - 1.0).abs() < 0.5,
                    "{noise}: {report:?} {largest}"
                );
                assert!(
                    report.limit >= largest && largest < 0.011,
                    "{noise}: {report:?} {largest}"
                );
                let is_noted = report
                    .remarks
                    .iter()
                    .any(|remark| remark.contains("rounding the readings"));
                let readme = fs::read_to_string(path.join("README.txt")).unwrap();
                let readme = readme.split_whitespace().collect::<Vec<_>>().join(" ");
                assert!(is_noted || largest < 1e-5, "{noise}: {report:?}");
                assert_eq!(readme.contains("Note: rounding the readings"), is_noted);
                let metadata = fs::read_to_string(path.join("metadata.json")).unwrap();
                let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
                let found = metadata["change_by_rounding_readings"]["largest"].as_f64().unwrap();
                assert!(found > 0.0 && found <= report.limit, "{metadata}");
                // Golden vectors are the readings of a caller.
                let golden = fs::read_to_string(path.join("golden.csv")).unwrap();
                let last = golden.lines().last().unwrap();
                let ohm: f64 = last.split(',').nth(1).unwrap().parse().unwrap();
                assert!(f64::from(ohm as f32) != ohm, "{last}");
            }
            Err(error) => {
                refused += 1;
                let message = error.to_string();
                assert!(
                    matches!(error, BundleError::Unresolved { .. }) && largest > 0.009,
                    "{message} {largest}"
                );
                assert!(
                    message.contains(" mm") && message.contains("--precision f64"),
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
    let mut settings = trained_settings(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 0.0);
    settings.simulation_mut().unwrap().scene.noise.converter_bits = Some(2);
    let file = run_of(settings);
    let report = export_bundle(
        &file,
        BundleFormat::C99,
        BundlePrecision::Fixed16,
        &home.path().join("bundle"),
    )
    .unwrap();
    assert!(report.vectors.golden >= 3, "{report:?}");
    assert!(report.deviation() <= report.limit, "{report:?}");
}

/// Answers of a bundle in C to readings, or `None` for a status that is not 0. `None` without a compiler.
fn answers_in_c(folder: &std::path::Path, name: &str, readings: &[Vec<f64>]) -> Option<Vec<Option<Vec<f64>>>> {
    let upper = name.to_uppercase();
    let lines: Vec<String> = readings
        .iter()
        .map(|row| row.iter().map(|reading| format!("{reading:e},")).collect())
        .map(|row: String| format!("{{{row}}},"))
        .collect();
    let main = format!(
        "#include \"{name}_decode.h\"\n#include <stdio.h>\nstatic const double readings[{count}][{upper}_CHANNELS] = {{{rows}}};\n\
         int main(void)\n{{\n    for (int v = 0; v < {count}; ++v) {{\n        float taken[{upper}_CHANNELS], out[{upper}_OUTPUTS];\n\
         for (int i = 0; i < {upper}_CHANNELS; ++i) taken[i] = (float)readings[v][i];\n\
         int status = {name}_decode(taken, out);\n printf(\"%d\", status);\n\
         for (int k = 0; k < {upper}_OUTPUTS && status == 0; ++k) printf(\" %.9g\", (double)out[k]);\n puts(\"\");\n    }}\n\
         return 0;\n}}\n",
        count = readings.len(),
        rows = lines.concat(),
    );
    fs::write(folder.join("main.c"), main).unwrap();
    let compiled = std::process::Command::new("cc")
        .args(["-std=c99", "-O2", "-o", "main", "main.c"])
        .args([&format!("{name}_decode.c"), "-lm"])
        .current_dir(folder)
        .output()
        .ok()?;
    assert!(
        compiled.status.success(),
        "{}",
        String::from_utf8_lossy(&compiled.stderr)
    );
    let output = std::process::Command::new(folder.join("main")).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let answer = |line: &str| {
        let mut words = line.split(' ');
        (words.next() == Some("0")).then(|| words.map(|word| word.parse().unwrap()).collect())
    };
    Some(text.lines().map(answer).collect())
}

#[test]
fn c_answers_extreme_readings_with_finite_numbers_or_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = trained(Rows::All, Quantity::Resistance, ScalingChoice::MinMax, 1e-3);
    let mut own = own_data(&Portable::of(&(&file).into()).unwrap());
    // Limits beyond the largest number of single precision.
    for limits in &mut own.ranges[0].as_mut().unwrap().limits {
        *limits = (-3.9e38, 3.9e38);
    }
    let vectors = Vectors::of(&mut (&file).into(), &own, Taking::Single).unwrap();
    // Weights that take such readings beyond it.
    if let Layer::Affine(hidden) = &mut own.maps[0].layers[0] {
        hidden.weights.mapv_inplace(|weight| weight * Twofold::from(1e3));
    }
    let limits = Deviation {
        total: 1.0,
        of_arithmetic: 1.0,
    };
    let weights = Weights::of(&own, Arithmetic::single(0));
    for (name, text) in c99::write_floating("odd", &own, &weights, vectors.golden(), limits, &[]) {
        assert!(!text.contains("inf"), "{name}");
        fs::write(folder.path().join(name), text).unwrap();
    }
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let sizes = [1e38, -1e38, 3.4e38, -3.4e38, 0.0, 1.0, f64::from(f32::MIN_POSITIVE)];
    // Two extreme readings among usual ones: of infinite terms, some have the same sign and some have not.
    let readings: Vec<Vec<f64>> = (0..400)
        .map(|_| {
            let mut row = vec![1.0; own.channels];
            for _ in 0..2 {
                row[rng.random_range(0..own.channels)] = sizes[rng.random_range(0..sizes.len())];
            }
            row
        })
        .collect();
    let Some(answers) = answers_in_c(folder.path(), "odd", &readings) else {
        return;
    };
    let decoded: Vec<_> = answers.iter().flatten().collect();
    assert!(
        decoded.iter().all(|row| row.iter().all(|answer| answer.is_finite())),
        "{decoded:?}"
    );
    assert!(
        !decoded.is_empty() && decoded.len() < answers.len(),
        "{}",
        decoded.len()
    );
}
