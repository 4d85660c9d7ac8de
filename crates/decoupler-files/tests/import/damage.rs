//! Damaged files are refused: no changed bit and no missing end changes a number or loses a column silently.

use std::{
    fs,
    io::{self, Cursor},
    path::Path,
};

use decoupler_files::import::Table;
use zip::{CompressionMethod, ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::support;

/// Formats with a checksum.
const CHECKED: [&str; 7] = [
    "plain.npz",
    "deflated.npz",
    "deflated.mat",
    "press.xlsx",
    "stamps.xlsx",
    "press.ods",
    STORED,
];
/// press.xlsx without compression, where any digit may become another.
const STORED: &str = "stored.xlsx";

fn fixture(name: &str) -> Vec<u8> {
    if name == STORED {
        return stored(&fixture("press.xlsx"));
    }
    fs::read(support::fixture(name)).unwrap()
}

/// Returns a zip archive without compression.
fn stored(archive: &[u8]) -> Vec<u8> {
    let mut source = ZipArchive::new(Cursor::new(archive)).unwrap();
    let mut target = ZipWriter::new(Cursor::new(Vec::new()));
    for index in 0..source.len() {
        let mut entry = source.by_index(index).unwrap();
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        target.start_file(entry.name().unwrap().into_owned(), options).unwrap();
        io::copy(&mut entry, &mut target).unwrap();
    }
    target.finish().unwrap().into_inner()
}

/// Names of columns, bits of their numbers, and notes.
type Content = (Vec<String>, Vec<Vec<u64>>, Vec<String>);

/// Reads `bytes` as a file of this name; returns everything of the table that is used or shown.
fn read(bytes: &[u8], path: &Path) -> Result<Content, String> {
    fs::write(path, bytes).unwrap();
    let Table { columns, notes, .. } = support::read(path)?;
    let bits = |numbers: &[f64]| numbers.iter().map(|number| number.to_bits()).collect();
    let numbers = columns.iter().map(|column| bits(&column.numbers)).collect();
    let names = columns.into_iter().map(|column| column.name).collect();
    Ok((names, numbers, notes))
}

/// Every byte of a small file, and an odd number of bytes apart in a larger one, so that all bits have their turn.
fn step(file: &[u8]) -> usize {
    1 + 2 * (file.len() / 3000)
}

#[test]
fn no_changed_bit_changes_a_number_or_a_name() {
    let folder = tempfile::tempdir().unwrap();
    for name in CHECKED {
        let (path, good) = (folder.path().join(name), fixture(name));
        let expected = read(&good, &path).unwrap();
        let (mut accepted, mut refused) = (0, 0);
        for place in (0..good.len()).step_by(step(&good)) {
            // Neighbours differ in their bit.
            let bit = place * 3 % 8;
            let mut bytes = good.clone();
            bytes[place] ^= 1 << bit;
            match read(&bytes, &path) {
                Err(_) => refused += 1,
                Ok(found) => {
                    assert_eq!(found, expected, "{name}: bit {bit} of byte {place}");
                    accepted += 1;
                }
            }
        }
        // Dates and versions are not checked, as by other programs.
        assert!(refused > accepted, "{name}: {refused} refused, {accepted} accepted");
    }
}

#[test]
fn a_missing_end_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    for name in [&CHECKED[..], &["plain.mat", "f8.npy", "i2.npy"]].concat() {
        let (path, good) = (folder.path().join(name), fixture(name));
        let (names, numbers, _) = read(&good, &path).unwrap();
        for length in (0..good.len()).step_by(step(&good)) {
            let Ok((found, values, _)) = read(&good[..length], &path) else {
                continue;
            };
            // A MAT-file may end after any of its variables.
            assert!(name.ends_with(".mat"), "{name}: {length} bytes are read");
            let whole = found
                .iter()
                .zip(&values)
                .all(|column| names.iter().zip(&numbers).any(|other| other == column));
            assert!(whole, "{name}: {length} bytes are read as {found:?}");
        }
    }
}
