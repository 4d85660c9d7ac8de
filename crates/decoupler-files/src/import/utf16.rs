use std::io::{self, Read};

/// Number of bytes taken from the source at once; even.
const BLOCK: usize = 1 << 15;

/// UTF-8 text of a source in UTF-16. Unpaired surrogates become U+FFFD.
pub(super) struct Utf16<R> {
    source: R,
    is_little_endian: bool,
    raw: Vec<u8>,
    /// High surrogate that waits for its second half.
    waiting: Option<u16>,
    text: Vec<u8>,
    taken: usize,
}

impl<R: Read> Utf16<R> {
    pub(super) fn new(source: R, is_little_endian: bool) -> Self {
        Self {
            source,
            is_little_endian,
            raw: Vec::with_capacity(BLOCK),
            waiting: None,
            text: Vec::new(),
            taken: 0,
        }
    }

    /// Refills the text; empty at the end.
    fn refill(&mut self) -> io::Result<()> {
        self.text.clear();
        self.taken = 0;
        while self.text.is_empty() {
            let kept = self.raw.len();
            let read = (&mut self.source)
                .take((BLOCK - kept) as u64)
                .read_to_end(&mut self.raw)?;
            let whole = self.raw.len() / 2 * 2;
            let from = if self.is_little_endian {
                u16::from_le_bytes
            } else {
                u16::from_be_bytes
            };
            let pairs = self.raw[..whole].chunks_exact(2);
            let mut units: Vec<u16> = self.waiting.take().into_iter().collect();
            units.extend(pairs.map(|pair| from([pair[0], pair[1]])));
            self.raw.drain(..whole);
            let is_end = read == 0;
            if !is_end && units.last().is_some_and(|unit| (0xd800..0xdc00).contains(unit)) {
                self.waiting = units.pop();
            }
            for character in char::decode_utf16(units) {
                let character = character.unwrap_or(char::REPLACEMENT_CHARACTER);
                self.text.extend(character.encode_utf8(&mut [0; 4]).bytes());
            }
            if is_end {
                // Half of a unit is a defect like an unpaired surrogate.
                if !self.raw.is_empty() {
                    self.raw.clear();
                    self.text.extend("\u{fffd}".bytes());
                }
                break;
            }
        }
        Ok(())
    }
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.text.len() {
            self.refill()?;
        }
        let count = buffer.len().min(self.text.len() - self.taken);
        buffer[..count].copy_from_slice(&self.text[self.taken..self.taken + count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_both_byte_orders_is_decoded_across_blocks() {
        let text = format!("{}𝒳;°C\n", "ä1,5;".repeat(10_000));
        for is_little_endian in [true, false] {
            let to = if is_little_endian {
                u16::to_le_bytes
            } else {
                u16::to_be_bytes
            };
            // One byte more shifts the surrogates over the end of a block.
            let bytes: Vec<u8> = text.encode_utf16().flat_map(to).collect();
            let mut decoded = String::new();
            Utf16::new(&bytes[..], is_little_endian)
                .read_to_string(&mut decoded)
                .unwrap();
            assert!(decoded == text);
        }
    }

    #[test]
    fn damage_becomes_replacement_characters() {
        let mut decoded = String::new();
        let bytes = [0x41, 0x00, 0x00, 0xd8, 0x42, 0x00, 0x00, 0xd8, 0x43];
        Utf16::new(&bytes[..], true).read_to_string(&mut decoded).unwrap();
        assert_eq!(decoded, "A\u{fffd}B\u{fffd}\u{fffd}");
    }
}
