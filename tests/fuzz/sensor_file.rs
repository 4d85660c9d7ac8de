use std::{fs, path::Path};

use decoupler_files::export::SensorFile;

use crate::{
    corpus::replay,
    mutation::{accepted, mutated_document},
};

/// Returns true if the sensor is accepted: it is then possible, and unchanged after saving and loading.
fn check(path: &Path, bytes: &[u8]) -> bool {
    fs::write(path, bytes).unwrap();
    match SensorFile::load(path) {
        Ok(sensor) => {
            let text = String::from_utf8_lossy(bytes);
            let geometry = sensor.geometry;
            assert!(geometry.height_mm > 0.0 && geometry.height_mm.is_finite(), "{text}");
            SensorFile::save(&sensor, path).unwrap();
            assert_eq!(SensorFile::load(path).unwrap(), sensor, "{text}");
            true
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 2000 && !message.contains('\n'), "{message}");
            false
        }
    }
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.json");
    replay!(20, |bytes: &[u8]| {
        usize::from(check(&path, bytes)) + accepted(100, |rng| check(&path, &mutated_document(bytes, rng)))
    });
}
