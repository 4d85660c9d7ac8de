//! Sensor files: sealed with a checksum, unless they are written by hand.

use std::{fs, path::Path};

use decoupler_core::sensor::{ArrayScale, SensorModel};
use decoupler_files::export::SensorFile;

fn calibrated() -> SensorModel {
    let mut sensor = SensorModel::new(ArrayScale::default());
    sensor.geometry.height_mm = 4.987_654_321;
    sensor.resistivity_ohm_per_mm = 97.3;
    sensor
}

fn load(path: &Path, text: &[u8]) -> Result<SensorModel, String> {
    fs::write(path, text).unwrap();
    SensorFile::load(path).map_err(|error| error.to_string())
}

#[test]
fn no_changed_bit_changes_a_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.json");
    SensorFile::save(&calibrated(), &path).unwrap();
    let good = fs::read(&path).unwrap();
    assert_eq!(SensorFile::load(&path).unwrap(), calibrated());
    for place in 0..good.len() {
        for bit in 0..7 {
            let mut bytes = good.clone();
            bytes[place] ^= 1 << bit;
            if let Ok(found) = load(&path, &bytes) {
                assert_eq!(found, calibrated(), "bit {bit} of byte {place}");
            }
        }
    }
    let text = String::from_utf8(good).unwrap();
    let error = load(&path, text.replace("97.3", "97.4").as_bytes()).unwrap_err();
    assert!(
        error.contains("its checksum shows that something in it has changed; "),
        "{error}"
    );
}

#[test]
fn files_without_a_checksum_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.json");
    let text = r#"{"format": "decoupler sensor", "version": 1, "program": "by hand", "sensor": {"resistivity_ohm_per_mm": 97.3}}"#;
    assert_eq!(load(&path, text.as_bytes()).unwrap().resistivity_ohm_per_mm, 97.3);
    let error = load(&path, text.replace("sensor\": {", "senor\": {").as_bytes()).unwrap_err();
    assert!(error.contains("unknown field `senor`"), "{error}");
}
