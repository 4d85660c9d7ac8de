//! Random changes of a valid input.

use std::{
    ops::Range,
    time::{Duration, Instant},
};

use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::Value;

/// Text that parsers have failed on.
const TOKENS: [&str; 30] = [
    "0",
    "-1",
    "-",
    "1e308",
    "-1e308",
    "1e-308",
    "1e999",
    "5e-324",
    "NaN",
    "inf",
    "null",
    "18446744073709551616",
    "99999999",
    "\"",
    "\\u0000",
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "\n",
    "\r",
    "\u{feff}",
    "×",
    "\0",
    "1.",
    ".5",
    "[[[[",
    "true",
];

/// After this time for one input of a few kilobytes a reader hangs, also on a busy machine.
const LONGEST: Duration = Duration::from_secs(600);

/// Calls `check` with `default` seeded generators, or with `FUZZ_ROUNDS` times as many.
///
/// # Panics
/// If a call takes longer than [`LONGEST`].
pub(crate) fn for_each_seed(default: u64, mut check: impl FnMut(&mut ChaCha8Rng)) {
    let rounds = std::env::var("FUZZ_ROUNDS").ok().and_then(|text| text.parse().ok());
    for seed in 0..default * rounds.unwrap_or(1) {
        let start = Instant::now();
        check(&mut ChaCha8Rng::seed_from_u64(seed));
        assert!(start.elapsed() < LONGEST, "seed {seed} takes {:?}", start.elapsed());
    }
}

/// Returns how often `check` accepts what it makes of the generators of [`for_each_seed`].
pub(crate) fn accepted(default: u64, mut check: impl FnMut(&mut ChaCha8Rng) -> bool) -> usize {
    let mut count = 0;
    for_each_seed(default, |rng| count += usize::from(check(rng)));
    count
}

/// Returns `valid` with one to four random changes.
pub(crate) fn mutated(valid: &[u8], rng: &mut impl Rng) -> Vec<u8> {
    let mut bytes = valid.to_vec();
    for _ in 0..rng.random_range(1..=4) {
        change(&mut bytes, rng);
    }
    bytes
}

/// Returns the JSON document with one to four random changes: of its text, or of values, so that it stays JSON.
pub(crate) fn mutated_document(valid: &[u8], rng: &mut impl Rng) -> Vec<u8> {
    match serde_json::from_slice::<Value>(valid) {
        Ok(mut document) if rng.random() => {
            for _ in 0..rng.random_range(1..=4) {
                change_value(&mut document, rng);
            }
            document.to_string().into_bytes()
        }
        _ => mutated(valid, rng),
    }
}

/// Changes a value of a document, or one within it.
fn change_value(value: &mut Value, rng: &mut impl Rng) {
    match value {
        Value::Object(fields) if !fields.is_empty() && rng.random_ratio(19, 20) => {
            let place = rng.random_range(0..fields.len());
            let name = fields.keys().nth(place).cloned().unwrap_or_default();
            if rng.random_ratio(1, 20) {
                fields.remove(&name);
            } else if let Some(field) = fields.get_mut(&name) {
                change_value(field, rng);
            }
        }
        Value::Array(values) if !values.is_empty() && rng.random_ratio(9, 10) => {
            let place = rng.random_range(0..values.len());
            match rng.random_range(0..10) {
                0 => drop(values.remove(place)),
                1 => values.push(values[place].clone()),
                _ => change_value(&mut values[place], rng),
            }
        }
        Value::String(text) if rng.random_ratio(9, 10) => {
            *text = String::from_utf8_lossy(&mutated(text.as_bytes(), rng)).into_owned();
        }
        value => {
            let token = TOKENS[rng.random_range(0..TOKENS.len())];
            *value = serde_json::from_str(token).unwrap_or_else(|_| token.into());
        }
    }
}

fn change(bytes: &mut Vec<u8>, rng: &mut impl Rng) {
    if bytes.is_empty() {
        bytes.push(rng.random());
        return;
    }
    let place = rng.random_range(0..bytes.len());
    match rng.random_range(0..10) {
        0 => bytes[place] ^= 1 << rng.random_range(0..8),
        1 => bytes[place] = rng.random(),
        2 => bytes.truncate(place),
        3 => {
            let end = (place + rng.random_range(1..40)).min(bytes.len());
            bytes.drain(place..end);
        }
        4 => {
            let end = (place + rng.random_range(1..40)).min(bytes.len());
            let part = bytes[place..end].to_vec();
            bytes.splice(place..place, part);
        }
        5 => replace_digit(bytes, rng),
        6 => swap(bytes, b'\n', rng),
        7 => swap(bytes, b',', rng),
        8 => {
            let token = TOKENS[rng.random_range(0..TOKENS.len())].bytes();
            bytes.splice(place..place, token);
        }
        _ => {
            let token = TOKENS[rng.random_range(0..TOKENS.len())].bytes();
            let number = number_at(bytes, place);
            bytes.splice(number, token);
        }
    }
}

/// Replaces a digit by another digit.
fn replace_digit(bytes: &mut [u8], rng: &mut impl Rng) {
    let digits: Vec<usize> = (0..bytes.len())
        .filter(|&place| bytes[place].is_ascii_digit())
        .collect();
    if let Some(&place) = digits.get(rng.random_range(0..digits.len().max(1))) {
        bytes[place] = b'0' + (bytes[place] - b'0' + rng.random_range(1..10)) % 10;
    }
}

/// Swaps two of the parts between separators.
fn swap(bytes: &mut Vec<u8>, separator: u8, rng: &mut impl Rng) {
    let mut parts: Vec<&[u8]> = bytes.split(|&byte| byte == separator).collect();
    let (one, other) = (rng.random_range(0..parts.len()), rng.random_range(0..parts.len()));
    parts.swap(one, other);
    *bytes = parts.join(&separator);
}

/// Returns the range of the number that begins at `place` or later.
fn number_at(bytes: &[u8], place: usize) -> Range<usize> {
    let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.e".contains(byte);
    let begin = place + bytes[place..].iter().position(is_part).unwrap_or(0);
    let length = bytes[begin..].iter().position(|byte| !is_part(byte));
    begin..length.map_or(bytes.len(), |length| begin + length)
}
