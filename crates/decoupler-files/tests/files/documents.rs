//! Every kind of file: anything else, other versions and any damage are refused in one line that names the file.

use std::{fs, path::Path};

use decoupler_core::sensor::{ArrayScale, SensorModel};
use decoupler_files::{
    export::{CheckpointFile, DocumentError, NetworkFile, RecipeFile, SensorFile},
    import::Plan,
};

use crate::trained::{network, place, settings, stepped};

/// Reads a file and returns its contents without the name of the program, which may be any text.
type Load = fn(&Path) -> Result<String, DocumentError>;

/// Names of all kinds, with their format, a valid file and how it is read.
fn kinds() -> [(&'static str, &'static str, String, Load); 4] {
    let (_folder, path) = place();
    let written = || fs::read_to_string(&path).unwrap();
    network("2x2_2x6", 2, 3).save(&path).unwrap();
    let network = written();
    let run = stepped(settings("2x2_2x6", 2, 9), 3);
    CheckpointFile::from_run(&run, None).unwrap().save(&path).unwrap();
    let checkpoint = written();
    RecipeFile::Recording(Plan::default()).save(&path).unwrap();
    let recipe = written();
    SensorFile::save(&calibrated(), &path).unwrap();
    let sensor = written();
    [
        ("network file", "network", network, |path| {
            let mut file = NetworkFile::load(path)?;
            file.program.clear();
            Ok(format!("{file:?}"))
        }),
        ("checkpoint", "checkpoint", checkpoint, |path| {
            let mut file = CheckpointFile::load(path)?;
            file.program.clear();
            Ok(format!("{file:?}"))
        }),
        ("recipe", "recipe", recipe, |path| {
            Ok(format!("{:?}", RecipeFile::load(path)?))
        }),
        ("sensor file", "sensor", sensor, |path| {
            Ok(format!("{:?}", SensorFile::load(path)?))
        }),
    ]
}

fn calibrated() -> SensorModel {
    let mut sensor = SensorModel::new(ArrayScale::default());
    sensor.geometry.height_mm = 4.987_654_321;
    sensor.resistivity_ohm_per_mm = 97.3;
    sensor
}

#[test]
fn anything_else_is_refused_with_the_reason() {
    let (_folder, path) = place();
    for (kind, format, valid, load) in kinds() {
        let version = valid.find("\"version\":").unwrap();
        let digit = version + valid[version..].find(|c: char| c.is_ascii_digit()).unwrap();
        let with_version = |text: &str| [&valid[..digit], text, &valid[digit + 1..]].concat();
        let other = if format == "network" { "sensor" } else { "network" };
        for (text, expected) in [
            (String::new(), "it is empty".to_owned()),
            ("epoch,mse\n1,2\n".to_owned(), "line 1 column 1".to_owned()),
            ("{\"a\": [1, 2]}".to_owned(), "no field \"format\"".to_owned()),
            ("5".to_owned(), "no field \"format\"".to_owned()),
            ("[".repeat(100_000), format!("not a {kind}")),
            (valid[..valid.len() / 2].to_owned(), "cut off at line".to_owned()),
            (format!("{valid}x"), "column 1".to_owned()),
            (
                valid.replacen(&format!("decoupler {format}"), &format!("decoupler {other}"), 1),
                format!("its format is \"decoupler {other}\""),
            ),
            (with_version("0"), "has version 0".to_owned()),
            (with_version("null"), "has version null".to_owned()),
            (
                with_version("99"),
                "has version 99 of the format, written by decoupler".to_owned(),
            ),
            (
                format!(r#"{{"format":"decoupler {format}","version":99,"program":"decoupler 7.8","x":1}}"#),
                "written by decoupler 7.8".to_owned(),
            ),
            (with_version("0"), "open it with the program that wrote it".to_owned()),
        ] {
            fs::write(&path, &text).unwrap();
            let message = load(&path).unwrap_err().to_string();
            assert!(message.contains(&expected), "{kind}, {expected}: {message}");
            assert!(
                message.contains("file.json") && !message.contains('\n'),
                "{kind}: {message}"
            );
        }
        fs::write(&path, b"{\"format\": \"\xff\"}").unwrap();
        assert!(matches!(load(&path), Err(DocumentError::Unusable { .. })), "{kind}");
        fs::remove_file(&path).unwrap();
        assert!(matches!(load(&path), Err(DocumentError::Read { .. })), "{kind}");
    }
}

#[test]
fn a_missing_end_or_a_flipped_bit_anywhere_is_noticed() {
    let (_folder, path) = place();
    for (kind, _, valid, load) in kinds() {
        let valid = valid.trim_end().as_bytes();
        let step = 1 + valid.len() / 400;
        fs::write(&path, valid).unwrap();
        let whole = load(&path).unwrap();
        for length in (1..valid.len()).step_by(step) {
            fs::write(&path, &valid[..length]).unwrap();
            let message = load(&path).unwrap_err().to_string();
            assert!(message.contains("cut off at line"), "{kind}, {length} bytes: {message}");
        }
        // A recipe may be written by hand, and has no checksum.
        for bit in 0..if kind == "recipe" { 0 } else { 7 } {
            for place in (0..valid.len()).skip(bit).step_by(step) {
                let mut bytes = valid.to_vec();
                bytes[place] ^= 1 << bit;
                fs::write(&path, &bytes).unwrap();
                match load(&path) {
                    Ok(found) => assert_eq!(found, whole, "{kind}: bit {bit} of byte {place}"),
                    Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
                }
            }
        }
    }
}

#[test]
fn a_changed_digit_is_named_and_a_sensor_may_be_written_by_hand() {
    let (_folder, path) = place();
    let load = |text: &str| {
        fs::write(&path, text).unwrap();
        SensorFile::load(&path).map_err(|error| error.to_string())
    };
    SensorFile::save(&calibrated(), &path).unwrap();
    let changed = fs::read_to_string(&path).unwrap().replace("97.3", "97.4");
    let error = load(&changed).unwrap_err();
    assert!(
        error.contains("its checksum shows that something in it has changed; "),
        "{error}"
    );
    let text = r#"{"format": "decoupler sensor", "version": 1, "program": "by hand", "sensor": {"resistivity_ohm_per_mm": 97.3}}"#;
    assert_eq!(load(text).unwrap().resistivity_ohm_per_mm, 97.3);
    let error = load(&text.replace("sensor\": {", "senor\": {")).unwrap_err();
    assert!(error.contains("unknown field `senor`"), "{error}");
}
