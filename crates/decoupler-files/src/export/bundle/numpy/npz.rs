//! Arrays in NumPy's format 1.0 (`.npy`) in an uncompressed ZIP archive (`.npz`).

use std::io::{Cursor, Write};

use decoupler_core::decoupling::Precision;
use zip::{CompressionMethod, DateTime, ZipWriter, result::ZipResult, write::SimpleFileOptions};

use crate::export::bundle::contents::{Constant, word};

const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";

/// Writes the archive. The same arrays always give the same bytes.
pub(super) fn write<'a>(arrays: impl Iterator<Item = Constant<'a>>) -> Vec<u8> {
    let archive = || -> ZipResult<Vec<u8>> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::default());
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for array in arrays {
            archive.start_file(format!("{}.npy", array.name), options)?;
            archive.write_all(&write_array(&array))?;
        }
        Ok(archive.finish()?.into_inner())
    };
    archive().expect("writing to memory does not fail, and every array has a short, unique name and less than 4 GB")
}

fn write_array(array: &Constant<'_>) -> Vec<u8> {
    let descr = word(array.precision, ["<f4", "<f8"]);
    let sizes: Vec<_> = array.shape.iter().map(usize::to_string).collect();
    // A tuple of one element ends with a comma.
    let comma = if sizes.len() == 1 { "," } else { "" };
    let mut header = format!(
        "{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}{comma}), }}",
        sizes.join(", ")
    );
    // The values begin at a multiple of 64 bytes; the line ends the header.
    let padded = (MAGIC.len() + 2 + header.len() + 1).next_multiple_of(64);
    header += &" ".repeat(padded - MAGIC.len() - 2 - header.len() - 1);
    header.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for value in array.values() {
        match array.precision {
            Precision::Single => bytes.extend((value as f32).to_le_bytes()),
            Precision::Double => bytes.extend(value.to_le_bytes()),
        }
    }
    bytes
}
