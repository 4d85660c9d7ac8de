use decoupler_files::import::ResistanceReader;
use rand::RngExt;

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

const CHANNELS: usize = 3;

/// Reads all of `bytes` in blocks of at most `max_rows` rows.
fn check(bytes: &[u8], max_rows: usize) {
    let Ok(reader) = ResistanceReader::new(bytes, CHANNELS) else {
        return;
    };
    let mut reader = reader.with_row_wires(4);
    let mut last_line = 0;
    while let Ok(Some(block)) = reader.read(max_rows) {
        assert!(block.lines.len() <= max_rows);
        assert!(block.resistances_ohm.iter().all(|ohm| *ohm > 0.0 && ohm.is_finite()));
        assert!(block.row_wires.iter().flatten().all(|row_wire| *row_wire < 4));
        for line in block.lines {
            assert!(line > last_line);
            last_line = line;
        }
    }
}

#[test]
fn any_input() {
    replay!(|bytes: &[u8]| {
        for max_rows in [1, 2, 100] {
            check(bytes, max_rows);
        }
        for_each_seed(100, |rng| check(&mutated(bytes, rng), rng.random_range(1..5)));
    });
}

#[test]
fn random_bytes_give_only_valid_resistances() {
    for_each_seed(300, |rng| {
        let length = rng.random_range(0..200);
        let bytes: Vec<u8> = (0..length).map(|_| rng.random()).collect();
        check(&bytes, 2);
    });
}
