use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DocumentError, DocumentKind, WriteError, atomic_write, document::PROGRAM};
use decoupler_core::sensor::SensorModel;

const KIND: DocumentKind = DocumentKind::Sensor;

/// A sensor model, such as one that was calibrated. The file is JSON to be read and changed by hand.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFile;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u64,
    program: String,
    sensor: SensorModel,
}

impl SensorFile {
    /// Writes `sensor` whole or not at all.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn save(sensor: &SensorModel, path: &Path) -> Result<(), WriteError> {
        let document = Document {
            format: KIND.format().to_owned(),
            version: KIND.version(),
            program: PROGRAM.to_owned(),
            sensor: *sensor,
        };
        atomic_write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, &document)?;
            writeln!(writer)
        })
    }

    /// Reads the sensor in the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or its sensor is impossible.
    pub fn load(path: &Path) -> Result<SensorModel, DocumentError> {
        let bytes = KIND.read(path)?;
        let document: Document =
            serde_json::from_slice(&bytes).map_err(|error| KIND.damaged(path, error.to_string()))?;
        let sensor = document.sensor;
        sensor.check().map_err(|error| KIND.damaged(path, error.to_string()))?;
        Ok(sensor)
    }
}
