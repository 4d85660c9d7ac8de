//! The network file: a network read back answers bit for bit as before, and damage is reported.

use std::{fs, path::PathBuf};

use decoupler_core::{
    dataset::{Seed, Simulation},
    evaluation::{Run, RunSettings, TestErrors},
    sensor::SensorModel,
};
use decoupler_files::export::{DocumentError, NetworkFile};
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use tempfile::TempDir;

fn trained() -> NetworkFile {
    let mut settings = RunSettings {
        source: Simulation {
            sensor: SensorModel::new("10x6_3x18".parse().unwrap()),
            samples: 100,
            validation_samples: 20,
            test_samples: 20,
            ..Simulation::default()
        }
        .into(),
        hidden: 5,
        seed: Seed(u64::MAX),
        ..RunSettings::default()
    };
    settings.training.stopping.epochs = 8;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    NetworkFile::from_run(&run, None).unwrap()
}

fn place() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.json");
    (folder, path)
}

#[test]
fn networks_round_trip_bit_for_bit() {
    let (_folder, path) = place();
    let file = trained();
    file.save(&path).unwrap();
    let read = NetworkFile::load(&path).unwrap();
    assert_eq!(read, file);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    // Far beyond the training range on both sides.
    let readings = Array2::from_shape_simple_fn((2000, 18), || 10_f64.powf(rng.random_range(-2.0..6.0)));
    let bits = |network: &NetworkFile| network.network.at(0).decouple(readings.view()).mapv(f64::to_bits);
    assert_eq!(bits(&read), bits(&file));
}

#[test]
fn the_text_of_a_file_is_read_back_and_damage_is_reported() {
    let file = trained();
    let text = file.to_text().unwrap();
    assert_eq!(NetworkFile::from_text(&text).unwrap(), file);
    let damaged = text.replacen("\"seed\":18446744073709551615", "\"seed\":1", 1);
    assert_ne!(damaged, text);
    let message = NetworkFile::from_text(&damaged).unwrap_err().to_string();
    assert!(
        message.contains("'network in memory' is damaged: its checksum"),
        "{message}"
    );
}

#[test]
fn a_training_in_progress_can_be_saved() {
    let (_folder, path) = place();
    let mut run = Run::prepare(RunSettings::default()).unwrap();
    for epochs in 0..2 {
        let file = NetworkFile::from_run(&run, None).unwrap();
        assert_eq!(
            (file.training.stop_reason, file.training.history.len()),
            (None, epochs + 1)
        );
        file.save(&path).unwrap();
        assert_eq!(NetworkFile::load(&path).unwrap(), file);
        run.step();
    }
}

#[test]
fn infinite_errors_of_an_epoch_are_kept_and_infinite_results_are_refused() {
    let (_folder, path) = place();
    let mut file = trained();
    file.training.history[3].training_mse = f64::INFINITY;
    file.training.history[4].test_mse = Some(f64::NEG_INFINITY);
    file.save(&path).unwrap();
    assert_eq!(NetworkFile::load(&path).unwrap(), file);
    let before = fs::read(&path).unwrap();
    let TestErrors::Nodes(errors) = &mut file.scores.network else {
        panic!("the targets are nodes")
    };
    errors.worst_mm = f64::NAN;
    let error = file.save(&path).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("is not saved: scores.network.worst_mm"), "{message}");
    assert_eq!(fs::read(&path).unwrap(), before, "the old file stays");
}

/// Returns the file with the correct checksum of its contents.
fn resealed(text: &str) -> String {
    let (heading, run) = text.split_once("\"run\":").unwrap();
    let run = run.trim_end().strip_suffix('}').unwrap();
    let (before, after) = heading.split_once("\"crc32\":\"").unwrap();
    let crc32 = crc32fast::hash(run.as_bytes());
    format!("{before}\"crc32\":\"{crc32:08x}{}\"run\":{run}}}\n", &after[8..])
}

/// Contents with a correct checksum that are invalid.
#[test]
fn invalid_contents_are_named() {
    let (_folder, path) = place();
    trained().save(&path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let number = |field: &str| {
        let start = text.find(field).unwrap() + field.len();
        let length = text[start..].find([',', ']', '}']).unwrap();
        text[start..start + length].to_owned()
    };
    let replaced = |old: &str, new: &str| {
        assert!(text.contains(old), "{old}");
        text.replacen(old, new, 1)
    };
    let first_weight = format!("\"hidden_layer\":[{}", number("\"hidden_layer\":["));
    let worst = format!("\"worst_mm\":{}", number("\"worst_mm\":"));
    let cases = [
        (
            "a missing part",
            replaced("\"hidden_nodes\":5,", ""),
            "missing field `hidden_nodes`",
        ),
        (
            "an unknown part",
            replaced("\"hidden_nodes\"", "\"nodes\""),
            "unknown field `nodes`",
        ),
        (
            "a training method that no longer exists",
            replaced("\"levenberg_marquardt\"", "\"variable_projection\""),
            "unknown variant `variable_projection`, expected one of `levenberg_marquardt`",
        ),
        (
            "one weight missing",
            replaced(&format!("{first_weight},"), "\"hidden_layer\":["),
            "hidden layer has 94 weights, but 95",
        ),
        (
            "a weight that is null",
            replaced(&first_weight, "\"hidden_layer\":[null"),
            "line 1 column",
        ),
        (
            "a weight out of range",
            replaced(&first_weight, "\"hidden_layer\":[1e999"),
            "out of range at line 1",
        ),
        (
            "too many hidden nodes",
            replaced("\"hidden_nodes\":5", "\"hidden_nodes\":18446744073709551615"),
            "hidden layer has 95 weights",
        ),
        (
            "another number of hidden nodes",
            replaced("\"hidden\":5", "\"hidden\":6"),
            "it has 5 hidden nodes, but the settings need 6",
        ),
        (
            "another array",
            replaced("10×6_3×18", "10×8_4×24"),
            "problem: it does not match the array",
        ),
        (
            "no array",
            replaced("10×6_3×18", "10×6"),
            "'10×6' is not an array scale",
        ),
        (
            "an impossible geometry",
            replaced("\"height_mm\":5.0", "\"height_mm\":-5.0"),
            "settings.source.sensor: the height is -5 mm",
        ),
        (
            "an impossible scene",
            replaced("\"largest_compression\":0.2", "\"largest_compression\":2.0"),
            "settings.source.scene",
        ),
        (
            "an impossible setting",
            replaced("\"mu\":0.001", "\"mu\":-1"),
            "settings.training: mu",
        ),
        ("no figure", replaced(&worst, "\"worst_mm\":null"), "line 1 column"),
        (
            "one epoch missing",
            replaced("\"epoch\":[0,1,", "\"epoch\":[0,"),
            "entries, but epoch has",
        ),
        (
            "an epoch twice",
            replaced("\"epoch\":[0,1,", "\"epoch\":[0,0,"),
            "epoch 1 is missing",
        ),
        (
            "another number of epochs",
            replaced("\"epochs\":8,\"seconds\"", "\"epochs\":9,\"seconds\""),
            "training.epochs: it is 9",
        ),
        (
            "a time before the start",
            replaced("\"seconds\":", "\"seconds\":-"),
            "training.seconds",
        ),
        (
            "a best epoch after the last",
            replaced("\"best_epoch\":", "\"best_epoch\":10"),
            "training.best_epoch",
        ),
        (
            "a range of other channels",
            replaced(
                "\"reading_range\":{\"minimum\":[",
                "\"reading_range\":{\"minimum\":[1.0,",
            ),
            "input scaling is damaged",
        ),
        (
            "a range of impossible readings",
            replaced("\"reading_range\":{\"minimum\":[", "\"reading_range\":{\"minimum\":[-"),
            "input scaling is damaged",
        ),
    ];
    for (sentence, text, expected) in cases {
        fs::write(&path, &text).unwrap();
        let message = NetworkFile::load(&path).unwrap_err().to_string();
        assert!(message.contains("its checksum shows"), "{sentence}: {message}");
        fs::write(&path, resealed(&text)).unwrap();
        let message = NetworkFile::load(&path).unwrap_err().to_string();
        assert!(message.contains(expected), "{sentence}: {message}");
        assert!(
            message.contains("network.json") && !message.contains('\n'),
            "{sentence}: {message}"
        );
    }
}

#[test]
fn other_files_and_versions_are_named() {
    let (_folder, path) = place();
    trained().save(&path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let replaced = |old: &str, new: &str| {
        assert!(text.contains(old), "{old}");
        text.replacen(old, new, 1)
    };
    let cases = [
        ("an empty file", String::new(), "it is empty"),
        ("another text", "epoch,mse\n1,2\n".to_owned(), "line 1 column 1"),
        (
            "JSON of another program",
            "{\"a\": [1, 2]}".to_owned(),
            "no field \"format\"",
        ),
        ("a number", "5".to_owned(), "no field \"format\""),
        ("deep nesting", "[".repeat(100_000), "not a network file"),
        (
            "a file cut off",
            text[..text.len() / 2].to_owned(),
            "cut off at line 1, column",
        ),
        (
            "a newer version",
            replaced("\"version\":4", "\"version\":5"),
            "has version 5 of the format, written by decoupler 0.1.0",
        ),
        (
            "a newer version with other fields",
            "{\"format\":\"decoupler network\",\"version\":9,\"w\":0}".to_owned(),
            "version 9",
        ),
        ("no version", replaced("\"version\":4,", ""), "has version null"),
        (
            "an impossible version",
            replaced("\"version\":4", "\"version\":0"),
            "has version 0",
        ),
        (
            "an old version",
            replaced("\"version\":4", "\"version\":3"),
            "which reads version 4: open it with the program that wrote it",
        ),
        ("something after the end", format!("{text}x"), "line 2 column 1"),
    ];
    for (sentence, text, expected) in cases {
        fs::write(&path, text).unwrap();
        let message = NetworkFile::load(&path).unwrap_err().to_string();
        assert!(message.contains(expected), "{sentence}: {message}");
        assert!(
            message.contains("network.json") && !message.contains('\n'),
            "{sentence}: {message}"
        );
    }
    fs::write(&path, b"{\"format\": \"\xff\"}").unwrap();
    assert!(matches!(NetworkFile::load(&path), Err(DocumentError::Unusable { .. })));
    fs::remove_file(&path).unwrap();
    assert!(matches!(NetworkFile::load(&path), Err(DocumentError::Read { .. })));
}
