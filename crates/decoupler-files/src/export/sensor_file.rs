use std::path::Path;

use serde::Deserialize;
use serde_json::value::to_raw_value;

use super::{AtomicFile, DocumentError, DocumentKind, WriteError, document::PROGRAM, network_file::Sealed};
use decoupler_core::sensor::SensorModel;

const KIND: DocumentKind = DocumentKind::Sensor;

/// A sensor model, such as one that was calibrated. The file is JSON with a checksum; one that is written by hand has the
/// model in the field `sensor` instead, without a checksum.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFile;

/// Layout without a checksum.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(rename = "format")]
    _format: String,
    #[serde(rename = "version")]
    _version: u64,
    #[serde(rename = "program")]
    _program: String,
    sensor: SensorModel,
}

impl SensorFile {
    /// Writes `sensor` whole or not at all.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn save(sensor: &SensorModel, path: &Path) -> Result<(), WriteError> {
        let sensor = to_raw_value(sensor).map_err(|error| WriteError::io(path, error.into()))?;
        Sealed::new(KIND, PROGRAM, &sensor).save(path, AtomicFile::commit)
    }

    /// Reads the sensor in the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or its sensor is impossible.
    pub fn load(path: &Path) -> Result<SensorModel, DocumentError> {
        let bytes = KIND.read(path)?;
        Self::parse(&bytes).map_err(|defect| KIND.damaged(path, defect))
    }

    fn parse(bytes: &[u8]) -> Result<SensorModel, String> {
        let text = |error: serde_json::Error| error.to_string();
        let has_checksum = String::from_utf8_lossy(bytes).contains("\"crc32\"");
        let sensor = if has_checksum {
            serde_json::from_str(Sealed::read(bytes)?.run.get()).map_err(text)?
        } else {
            serde_json::from_slice::<Document>(bytes).map_err(text)?.sensor
        };
        sensor.check().map_err(|error| error.to_string())?;
        Ok(sensor)
    }
}
