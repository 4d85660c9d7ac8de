use std::path::Path;

use super::{AtomicFile, DocumentError, DocumentKind, WriteError, document::PROGRAM};
use decoupler_core::sensor::SensorModel;

const KIND: DocumentKind = DocumentKind::Sensor;

/// A sensor model, such as one that was calibrated. The file is JSON with a checksum; one that is written by hand has the
/// model in the field `sensor` instead, without a checksum.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFile;

impl SensorFile {
    /// Writes `sensor` whole or not at all.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn save(sensor: &SensorModel, path: &Path) -> Result<(), WriteError> {
        KIND.save(PROGRAM, sensor, path, AtomicFile::commit)
    }

    /// Reads the sensor in the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or its sensor is impossible.
    pub fn load(path: &Path) -> Result<SensorModel, DocumentError> {
        let (_, sensor): (_, SensorModel) = KIND.load(path)?;
        let checked = sensor.check().map_err(|error| KIND.damaged(path, error));
        checked.map(|()| sensor)
    }
}
