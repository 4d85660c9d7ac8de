//! The network file: what is kept, and contents that are invalid. That networks are read back bit for bit is tested in
//! `properties`.

use std::fs;

use decoupler_core::evaluation::{Run, RunSettings, TestErrors};
use decoupler_files::export::NetworkFile;

use crate::trained::{network, place};

fn trained() -> NetworkFile {
    network("10x6_3x18", 5, 8)
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
    let range = "\"reading_range\":{\"minimum\":[";
    let first_weight = format!("\"hidden_layer\":[{}", number("\"hidden_layer\":["));
    let worst = format!("\"worst_mm\":{}", number("\"worst_mm\":"));
    let cases = [
        ("\"hidden_nodes\":5,", "", "missing field `hidden_nodes`"),
        ("\"hidden_nodes\"", "\"nodes\"", "unknown field `nodes`"),
        // A method that no longer exists.
        (
            "\"levenberg_marquardt\"",
            "\"variable_projection\"",
            "unknown variant `variable_projection`, expected one of `levenberg_marquardt`",
        ),
        (
            &format!("{first_weight},"),
            "\"hidden_layer\":[",
            "hidden layer has 94 weights, but 95",
        ),
        (&first_weight, "\"hidden_layer\":[null", "line 1 column"),
        (&first_weight, "\"hidden_layer\":[1e999", "out of range at line 1"),
        (
            "\"hidden_nodes\":5",
            "\"hidden_nodes\":18446744073709551615",
            "hidden layer has 95 weights",
        ),
        (
            "\"hidden\":5",
            "\"hidden\":6",
            "it has 5 hidden nodes, but the settings need 6",
        ),
        ("10×6_3×18", "10×8_4×24", "problem: it does not match the array"),
        ("10×6_3×18", "10×6", "'10×6' is not an array scale"),
        (
            "\"height_mm\":5.0",
            "\"height_mm\":-5.0",
            "settings.source.sensor: the height is -5 mm",
        ),
        (
            "\"largest_compression\":0.2",
            "\"largest_compression\":2.0",
            "settings.source.scene",
        ),
        ("\"mu\":0.001", "\"mu\":-1", "settings.training: mu"),
        (&worst, "\"worst_mm\":null", "line 1 column"),
        ("\"epoch\":[0,1,", "\"epoch\":[0,", "entries, but epoch has"),
        ("\"epoch\":[0,1,", "\"epoch\":[0,0,", "epoch 1 is missing"),
        (
            "\"epochs\":8,\"seconds\"",
            "\"epochs\":9,\"seconds\"",
            "training.epochs: it is 9",
        ),
        ("\"seconds\":", "\"seconds\":-", "training.seconds"),
        ("\"best_epoch\":", "\"best_epoch\":10", "training.best_epoch"),
        // A range of other channels, and one of impossible readings.
        (range, &format!("{range}1.0,"), "input scaling is damaged"),
        (range, &format!("{range}-"), "input scaling is damaged"),
    ];
    for (old, new, expected) in cases {
        assert!(text.contains(old), "{old}");
        let text = text.replacen(old, new, 1);
        fs::write(&path, &text).unwrap();
        let message = NetworkFile::load(&path).unwrap_err().to_string();
        assert!(message.contains("its checksum shows"), "{new}: {message}");
        fs::write(&path, resealed(&text)).unwrap();
        let message = NetworkFile::load(&path).unwrap_err().to_string();
        assert!(message.contains(expected), "{new}: {message}");
        assert!(
            message.contains("file.json") && !message.contains('\n'),
            "{new}: {message}"
        );
    }
}
