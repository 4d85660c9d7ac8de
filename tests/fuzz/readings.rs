use decoupler_core::scene::Rows;
use decoupler_files::import::{LineParser, ReadingsFile};
use rand::RngExt;

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

/// Reads all of `bytes` in blocks of at most `max_lines` lines, as readings of an array of four row-wires and three
/// column-wires.
fn check(bytes: &[u8], max_lines: usize) {
    for rows in [Rows::All, Rows::Known, Rows::One(1)] {
        let parser = LineParser::of_array("4x1_1x3".parse().unwrap(), rows, true).unwrap();
        let mut file = ReadingsFile::new(bytes, parser);
        let mut last_line = 0;
        loop {
            match file.read(max_lines) {
                Ok(None) => break,
                Ok(Some(block)) => {
                    assert!(block.lines.len() <= 4 * max_lines);
                    assert!(block.values_ohm.iter().all(|ohm| *ohm > 0.0 && ohm.is_finite()));
                    assert!(block.row_indices.iter().all(|row| *row < 4));
                    assert!(block.lines.is_sorted() && block.lines[0] > last_line);
                    last_line = block.lines[block.lines.len() - 1];
                }
                Err(error) => {
                    let message = error.to_string();
                    assert!(message.len() < 1000 && !message.contains('\n'), "{message}");
                    break;
                }
            }
        }
    }
}

#[test]
fn any_input() {
    replay!(0, |bytes: &[u8]| {
        for max_lines in [1, 2, 100] {
            check(bytes, max_lines);
        }
        for_each_seed(100, |rng| check(&mutated(bytes, rng), rng.random_range(1..5)));
        0
    });
}
