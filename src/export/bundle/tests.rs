//! Bundles of small networks of every kind against the networks themselves.

use std::fs;

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::{
    BundleError, BundleFormat, BundlePrecision, FoldError,
    exact::decode_exactly,
    export_bundle,
    exported_network::ExportedNetwork,
    fixed_point::{FixedNetworks, HiddenWidth},
    matlab,
    meaning::Meaning,
    numpy, onnx,
    portable::Portable,
    vectors::Vectors,
    weights::{Arithmetic, Weights},
};
use crate::{
    evaluation::{Run, SimulatedSettings},
    export::NetworkFile,
    import::Channel,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Noise, Rows},
};

/// A network of a small array, hardly trained.
fn trained(rows: Rows, quantity: Quantity, scaling: ScalingChoice, noise: f64) -> NetworkFile {
    let mut settings = SimulatedSettings::default();
    settings.source.sensor = crate::sensor::SensorModel::new("3x2_2x6".parse().unwrap());
    settings.source.samples = 90;
    settings.source.validation_samples = 0;
    settings.source.test_samples = 9;
    settings.source.scene.rows = rows;
    settings.source.scene.noise = Noise::relative(noise);
    settings.inputs = InputChoice { quantity, scaling };
    settings.hidden = 4;
    settings.training.stopping.epochs = 4;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    NetworkFile::from_run(&run).unwrap()
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

/// The program's own `decode` is the truth: it neither folds scaling nor takes differences from a centre.
#[test]
fn the_exact_answers_and_the_folded_weights_are_those_of_decode() {
    for (name, file) in networks() {
        let portable = Portable::of((&file).into()).unwrap();
        let vectors = Vectors::of((&file).into(), &portable, |_, ohm| Arithmetic::SINGLE.rest.round(ohm)).unwrap();
        assert!(
            vectors.program_deviation < 1e-11,
            "{name}: {}",
            vectors.program_deviation
        );
        for (arithmetic, limit) in [
            (Arithmetic::DOUBLE, 1e-12),
            (Arithmetic::MIXED, 2e-5),
            (Arithmetic::SINGLE, 2e-3),
        ] {
            let weights = Weights::of(&portable, arithmetic);
            let deviation = vectors.deviation(|vector| weights.decode(vector.network, &vector.readings));
            assert!(deviation < limit, "{name}, {arithmetic:?}: {deviation}");
        }
        assert_eq!(portable.takes_row(), name.ends_with("known"), "{name}");
    }
}

#[test]
fn coordinates_that_did_not_vary_come_out_exactly() {
    for (name, file) in networks() {
        let portable = Portable::of((&file).into()).unwrap();
        let vectors = Vectors::of((&file).into(), &portable, |_, ohm| ohm).unwrap();
        for vector in vectors.all() {
            let outputs = file.network.at(vector.network).outputs();
            for coordinate in 0..portable.outputs {
                let (low, high) = outputs.extremes(coordinate);
                assert!(low < high || vector.answers[coordinate] == low, "{name}: {coordinate}");
            }
        }
    }
}

#[test]
fn graphs_answer_as_the_network_count_readings_outside_and_refuse_what_is_invalid() {
    for (name, file) in networks() {
        let portable = Portable::of((&file).into()).unwrap();
        for (precision, arithmetic, limit) in [
            (BundlePrecision::Double, Arithmetic::DOUBLE, 1e-12),
            (BundlePrecision::Single, Arithmetic::MIXED, 2e-5),
        ] {
            let vectors = Vectors::of((&file).into(), &portable, |_, ohm| arithmetic.rest.round(ohm)).unwrap();
            let metadata = ExportedNetwork::from(&file).metadata(&portable, precision);
            let bytes = onnx::write(&portable, &Weights::of(&portable, arithmetic), &metadata);
            let graph = onnx::OnnxGraph::read(&bytes).unwrap();
            let mut answers = graph.decode(vectors.all()).unwrap().answers.into_iter();
            let deviation = vectors.deviation(|_| answers.next().unwrap());
            assert!(deviation < limit, "{name}, {precision}: {deviation}");

            let mut odd = vectors.golden()[..4].to_vec();
            odd[0].readings[2] = -1.0;
            odd[1].readings[2] = f64::INFINITY;
            odd[2].readings[2] *= 100.0;
            odd[3].network = 7;
            let answers = graph.decode(&odd).unwrap();
            let are_valid: Vec<_> = (answers.answers.iter())
                .map(|row| row.iter().all(|mm| !mm.is_nan()))
                .collect();
            assert_eq!(are_valid, [false, false, true, !portable.takes_row()], "{name}");
            let inputs = file.network.at(odd[2].network).inputs();
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
fn weights_for_numpy_and_matlab_come_back_bit_for_bit() {
    for (name, file) in networks() {
        let portable = Portable::of((&file).into()).unwrap();
        for arithmetic in [Arithmetic::DOUBLE, Arithmetic::MIXED, Arithmetic::SINGLE] {
            let weights = Weights::of(&portable, arithmetic);
            let bytes = numpy::write_weights(&portable, &weights);
            assert_eq!(numpy::read_weights(&bytes, &portable).unwrap(), weights, "{name}");
        }
        let weights = Weights::of(&portable, Arithmetic::DOUBLE);
        let text = matlab::write("decode", &portable, &weights);
        assert_eq!(matlab::read_weights(&text, &portable).unwrap(), weights, "{name}");
        assert!(matlab::read_weights(&text.replace("output_biases = [", "x = ["), &portable).is_err());
    }
}

/// The same network of own data: readings that may have any sign, in volts or newtons for all that is known.
fn own_data(array: &Portable) -> Portable {
    let channels = |count| {
        let named = |index| Channel {
            name: format!("c{index}"),
            unit: None,
        };
        (0..count).map(named).collect()
    };
    Portable {
        quantity: Quantity::Raw,
        meaning: Meaning::Own {
            inputs: channels(array.channels),
            targets: channels(array.outputs),
            row_wires: Vec::new(),
        },
        ..array.clone()
    }
}

/// Overflow panics in tests, so that nothing wraps unnoticed.
#[test]
fn whole_numbers_stay_within_their_bound_inside_the_range_and_saturate_beyond_it() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let arrays = networks()
        .into_iter()
        .map(|(name, file)| (name, Portable::of((&file).into()).unwrap()));
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
        for index in 0..portable.networks.len() {
            let network = &portable.networks[index];
            let limits = &network.range.as_ref().unwrap().limits;
            let mut largest_mm = 0.0_f64;
            for _ in 0..300 {
                let drawn = limits
                    .iter()
                    .map(|&(low, high)| rng.random_range(low..high))
                    .enumerate();
                let readings: Vec<f64> = drawn.map(|(channel, ohm)| fixed.representable(channel, ohm)).collect();
                let exact = decode_exactly(&portable, network, &readings).answers;
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
fn networks_whose_products_cancel_have_wider_hidden_weights() {
    let file = trained(Rows::All, Quantity::LogResistance, ScalingChoice::Whitening, 1e-5);
    let fixed = FixedNetworks::of(&Portable::of((&file).into()).unwrap()).unwrap();
    assert_eq!(fixed.hidden_width, HiddenWidth::TwentyFour);
}

#[test]
fn every_format_and_precision_is_written_verified_and_whole() {
    let home = tempfile::tempdir().unwrap();
    // Compiling takes its time: one network for all rows and one of known rows.
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
fn what_cannot_be_exported_is_refused_and_leaves_nothing() {
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
