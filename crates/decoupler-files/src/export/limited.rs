//! Reading of files, of which none has to be a file of ours or even to end.

use std::{
    fs::File,
    io::{self, ErrorKind, Read},
    path::Path,
};

use super::heading::{Heading, NoHeading};

/// Largest file of JSON that is read or written, in bytes: 1 GiB.
pub(super) const LARGEST_BYTES: u64 = 1 << 30;
/// Length of the beginning that shows whether the rest is worth reading.
const BEGINNING: u64 = 1 << 16;

/// Reads the file of JSON at `path`. Where the beginning shows that it is none of ours, only the beginning is returned.
///
/// # Errors
/// The operating system refuses, or the file does not end within [`LARGEST_BYTES`].
pub(super) fn read_limited(path: &Path) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    if length > LARGEST_BYTES {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    (&file).take(BEGINNING).read_to_end(&mut bytes)?;
    if matches!(Heading::read(&bytes), Err(NoHeading::NotJson(_) | NoHeading::Other)) {
        return Ok(bytes);
    }
    // A pipe or device tells no length.
    (&file).take(LARGEST_BYTES + 1 - BEGINNING).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST_BYTES {
        return Err(too_large());
    }
    Ok(bytes)
}

pub(super) fn too_large() -> io::Error {
    io::Error::new(
        ErrorKind::FileTooLarge,
        "it is larger than 1 GiB, which no file of its kind is",
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use rand::{Rng, SeedableRng, rngs::ChaCha8Rng};

    use super::*;

    #[test]
    fn only_the_beginning_is_read_of_what_is_no_json() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            read_limited(&path).unwrap()
        };
        let json = format!("{{\"format\":\"a\",\"text\":\"{}\"}}", "ä".repeat(100_000));
        assert_eq!(read(json.as_bytes()), json.as_bytes());
        let cut = &json.as_bytes()[..150_000];
        assert_eq!(read(cut), cut);
        assert_eq!(read(&[b'x'; 100_000]).len(), 1 << 16);
    }

    #[test]
    fn only_the_beginning_is_read_of_random_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut bytes = vec![0; 100_000];
        ChaCha8Rng::seed_from_u64(0).fill_bytes(&mut bytes);
        for first in 0..=u8::MAX {
            bytes[0] = first;
            fs::write(&path, &bytes).unwrap();
            assert_eq!(read_limited(&path).unwrap().len(), 1 << 16, "first byte {first}");
        }
    }

    #[test]
    fn what_is_too_large_is_refused_unread() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "{\"format\":\"").unwrap();
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_len(1 << 40)
            .unwrap();
        assert_eq!(read_limited(&path).unwrap_err().kind(), ErrorKind::FileTooLarge);
    }
}
