//! Files whose contents are compressed: the contents are mutated and compressed again, since damage to the compressed
//! bytes rarely gets past their checksum.

use std::io::{Cursor, Read, Write};

use flate2::{Compression, read::ZlibDecoder, write::ZlibEncoder};
use rand::{Rng, RngExt};
use zip::{CompressionMethod, ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::{
    corpus::replay,
    import::check,
    mutation::{accepted, mutated},
};

/// Contents of a compressed file.
enum Contents {
    /// Names and bytes of the entries of a zip archive: `.npz`, `.xlsx` or `.ods`.
    Zip(Vec<(String, Vec<u8>)>),
    /// Header of a MAT-file, and the bytes of each of its compressed variables.
    Matlab(Vec<u8>, Vec<Vec<u8>>),
}

/// Kind of a compressed variable of a MAT-file.
const COMPRESSED: [u8; 4] = 15_u32.to_le_bytes();

impl Contents {
    fn of(file: &[u8]) -> Option<Self> {
        if file.starts_with(b"PK") {
            let mut archive = ZipArchive::new(Cursor::new(file)).ok()?;
            let mut entries = Vec::new();
            for index in 0..archive.len() {
                let mut entry = archive.by_index(index).ok()?;
                let mut bytes = Vec::new();
                entry.read_to_end(&mut bytes).ok()?;
                entries.push((entry.name().ok()?.into_owned(), bytes));
            }
            return Some(Self::Zip(entries));
        }
        let (header, mut rest) = file.split_at_checked(128)?;
        let mut variables = Vec::new();
        while let Some(after) = rest.strip_prefix(&COMPRESSED) {
            let (size, after) = after.split_first_chunk()?;
            let (variable, after) = after.split_at_checked(u32::from_le_bytes(*size) as usize)?;
            let mut bytes = Vec::new();
            ZlibDecoder::new(variable).read_to_end(&mut bytes).ok()?;
            variables.push(bytes);
            rest = after;
        }
        Some(Self::Matlab(header.to_vec(), variables))
    }

    /// Returns the file with these contents.
    fn packed(&self) -> Vec<u8> {
        match self {
            Self::Zip(entries) => {
                let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
                for (name, bytes) in entries {
                    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
                    archive.start_file(name.as_str(), stored).unwrap();
                    archive.write_all(bytes).unwrap();
                }
                archive.finish().unwrap().into_inner()
            }
            Self::Matlab(header, variables) => {
                let mut file = header.clone();
                for variable in variables {
                    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
                    encoder.write_all(variable).unwrap();
                    let bytes = encoder.finish().unwrap();
                    file.extend(COMPRESSED);
                    file.extend((bytes.len() as u32).to_le_bytes());
                    file.extend(bytes);
                }
                file
            }
        }
    }

    /// Mutates one entry or variable.
    fn mutate(&mut self, rng: &mut impl Rng) {
        let mut parts: Vec<&mut Vec<u8>> = match self {
            Self::Zip(entries) => entries.iter_mut().map(|(_, bytes)| bytes).collect(),
            Self::Matlab(_, variables) => variables.iter_mut().collect(),
        };
        if !parts.is_empty() {
            let place = rng.random_range(0..parts.len());
            *parts[place] = mutated(parts[place], rng);
        }
    }
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data.mat");
    replay!(20, |bytes: &[u8]| {
        check(bytes, &path);
        accepted(20, |rng| {
            let contents = Contents::of(bytes).map(|mut contents| {
                contents.mutate(rng);
                check(&contents.packed(), &path);
            });
            contents.is_some()
        })
    });
}
