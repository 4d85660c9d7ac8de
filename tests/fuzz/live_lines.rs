//! Lines of resistances as they arrive from a device, a socket or a pipe.

use std::{
    io::{self, Cursor, Read},
    time::Duration,
};

use decoupler_core::scene::Rows;
use decoupler_files::{
    import::{LineParser, ParsedLine},
    live::{Keeping, Lines},
};
use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::{
    corpus::replay,
    mutation::{accepted, mutated},
};

/// Row-wires and column-wires of the array.
const ROWS: usize = 2;
const COLUMNS: usize = 3;

/// A source that returns few bytes at once, as a serial port does, and is interrupted at times.
struct Chunks {
    bytes: Cursor<Vec<u8>>,
    rng: ChaCha8Rng,
}

impl Read for Chunks {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.rng.random_ratio(1, 8) {
            return Err(io::ErrorKind::TimedOut.into());
        }
        let most = self.rng.random_range(1..=17).min(buffer.len());
        self.bytes.read(&mut buffer[..most])
    }
}

/// Reads the lines however their bytes arrive: they are those between the line breaks.
fn split(bytes: &[u8], rng: &mut impl Rng) -> Vec<(u64, Vec<u8>)> {
    let source = Chunks {
        bytes: Cursor::new(bytes.to_vec()),
        rng: ChaCha8Rng::seed_from_u64(rng.random()),
    };
    let mut lines = Lines::spawn(|| Ok(source), Keeping::All, false).unwrap();
    let mut found = Vec::new();
    loop {
        match lines.next(Duration::from_secs(600)) {
            Ok(Some(line)) => found.push((line.number, lines.text(&line).unwrap().to_vec())),
            Ok(None) => panic!("no line and no end"),
            Err(error) => {
                assert!(error.is_none());
                break;
            }
        }
    }
    let mut expected: Vec<&[u8]> = bytes.split(|&byte| byte == b'\n').collect();
    expected.pop_if(|last| last.is_empty());
    assert!({ expected.into_iter() }.eq(found.iter().map(|(_, text)| text.as_slice())));
    found
}

/// Parses the lines; returns the number of frames or rows.
fn check(lines: &[(u64, Vec<u8>)], rows: Rows, is_complete: bool) -> usize {
    let mut parser = LineParser::of_array("2x1_1x3".parse().unwrap(), rows, is_complete).unwrap();
    let read = rows.read(ROWS).unwrap().len();
    let mut found = 0;
    for (number, text) in lines {
        let readings_ohm = match parser.parse(*number, text) {
            Ok(ParsedLine::NoReadings | ParsedLine::Start { .. }) => continue,
            Ok(ParsedLine::Row {
                row_index, readings, ..
            }) => {
                assert!(row_index.is_none_or(|index| index < read));
                assert_eq!(readings.len(), COLUMNS);
                readings
            }
            Ok(ParsedLine::Snapshot(readings_ohm)) => {
                assert_eq!(readings_ohm.len(), read * COLUMNS);
                readings_ohm
            }
            Err(error) => {
                let message = error.to_string();
                assert!(message.len() < 1000 && !message.contains('\n'), "{message:?}");
                assert!(message.contains(&format!("line {number}")), "{message}");
                if error.is_final() {
                    break;
                }
                continue;
            }
        };
        assert!(readings_ohm.iter().all(|ohm| *ohm > 0.0 && ohm.is_finite()));
        found += 1;
    }
    found
}

#[test]
fn any_input() {
    let all = |bytes: &[u8], rng: &mut ChaCha8Rng| {
        let lines = split(bytes, rng);
        let parse = |rows| check(&lines, rows, true) + check(&lines, rows, false);
        [Rows::All, Rows::Known, Rows::One(1)].map(parse).iter().sum::<usize>() > 0
    };
    replay!(50, |bytes: &[u8]| {
        let mutations = accepted(60, |rng| {
            let bytes = mutated(bytes, rng);
            all(&bytes, rng)
        });
        accepted(1, |rng| all(bytes, rng)) + mutations
    });
}
