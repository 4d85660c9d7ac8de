//! Valid checksums for mutated files, so that the code after the checksum is tested too.

use rand::{Rng, RngExt};

use crate::mutation::{mutated, mutated_document};

/// Returns the file with a valid checksum; `None` if its layout is damaged.
pub(crate) fn resealed(file: &[u8]) -> Option<Vec<u8>> {
    let find = |text: &[u8]| file.windows(text.len()).position(|window| window == text);
    let sum = find(b"\"crc32\":\"")? + 9;
    let run = find(b"\"run\":")? + 6;
    let end = file.iter().rposition(|&byte| byte == b'}')?;
    let text = file.get(run..end)?.trim_ascii();
    let mut sealed = file.to_vec();
    let crc32 = format!("{:08x}", crc32fast::hash(text));
    sealed.get_mut(sum..sum + 8)?.copy_from_slice(crc32.as_bytes());
    Some(sealed)
}

/// Returns the file with changes of its heading or of its record, and a valid checksum; `None` if its layout is damaged.
pub(crate) fn mutated_and_sealed(file: &[u8], rng: &mut impl Rng) -> Option<Vec<u8>> {
    let mark = b"\"run\":";
    let run = file.windows(mark.len()).position(|window| window == mark);
    let end = file.iter().rposition(|&byte| byte == b'}');
    match (run, end) {
        (Some(run), Some(end)) if run + mark.len() < end && rng.random() => {
            let (heading, record) = (&file[..run + mark.len()], &file[run + mark.len()..end]);
            resealed(&[heading, &mutated_document(record, rng), b"}"].concat())
        }
        _ => resealed(&mutated(file, rng)),
    }
}
