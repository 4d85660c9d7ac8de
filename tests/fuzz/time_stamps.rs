//! Time stamps in a column of a recording.

use std::{fs, ops::ControlFlow, path::Path};

use decoupler_files::import::{DialectChoice, Separator, read_table};
use rand::{Rng, RngExt};

use crate::{
    corpus::replay,
    mutation::{accepted, mutated},
};

/// Seconds from a stamp of the same zone to the one given, if that is read as a time stamp.
fn seconds(stamp: &str, path: &Path) -> Option<f64> {
    let zone = if stamp.trim_end().ends_with(['Z', 'z']) || stamp.get(16..)?.contains(['+', '-']) {
        "Z"
    } else {
        ""
    };
    fs::write(path, format!("t,x\n2000-01-01T00:00:00{zone},1\n{stamp},2\n")).unwrap();
    let choice = DialectChoice {
        separator: Some(Separator::Comma),
        header: Some(true),
        ..DialectChoice::default()
    };
    let table = read_table(path, choice, &mut |_| ControlFlow::Continue(())).ok()?;
    match table.columns.first()?.numbers[..] {
        [0.0, seconds] => Some(seconds).filter(|seconds| !seconds.is_nan()),
        _ => None,
    }
}

/// Numbers in a text, in their order.
fn numbers(text: &str) -> Vec<u64> {
    let parts = text
        .split(|c: char| !c.is_ascii_digit())
        .filter(|part| !part.is_empty());
    parts.map(|part| part.parse().unwrap_or(u64::MAX)).collect()
}

/// Checks the fields of a stamp that is accepted. Returns true if it is.
fn check(stamp: &str, path: &Path) -> bool {
    let stamp = &stamp.replace(['"', '\n', '\r', ','], "");
    let Some(seconds) = seconds(stamp, path) else {
        return false;
    };
    // From the year 0 to the year 9999, with all zones.
    assert!((-6.4e10..2.6e11).contains(&seconds), "{stamp}: {seconds}");
    let numbers = numbers(stamp);
    let [_, month, day, hour, minute, rest @ ..] = &numbers[..] else {
        panic!("{stamp}")
    };
    assert!((1..=12).contains(month) && (1..=31).contains(day), "{stamp}");
    assert!(*hour < 24 || (*hour == 24 && *minute == 0), "{stamp}");
    assert!(*minute < 60, "{stamp}");
    let clock = stamp.trim().get(16..).unwrap_or_default();
    if clock.starts_with(':') {
        assert!(rest.first().is_some_and(|second| *second <= 60), "{stamp}");
    }
    if let Some((_, zone)) = clock.rsplit_once(['+', '-']) {
        let digits: String = zone.chars().filter(char::is_ascii_digit).collect();
        let (hours, minutes) = digits.split_at(2);
        assert!(hours.parse::<u32>().unwrap() < 24, "{stamp}");
        assert!(minutes.is_empty() || minutes.parse::<u32>().unwrap() < 60, "{stamp}");
    }
    true
}

/// Returns a stamp of random numbers, most of which are possible.
fn random_stamp(rng: &mut impl Rng) -> String {
    let [year, month, day] = [
        rng.random_range(0..10_000),
        rng.random_range(0..14),
        rng.random_range(0..33),
    ];
    let [hour, minute, second] = [
        rng.random_range(0..26),
        rng.random_range(0..62),
        rng.random_range(0..72),
    ];
    let zone = ["", "Z", "z", "+01", "-0530", "+23:59", "+24:00", "-99:99", " +05:30"];
    let fraction = ["", ".5", ",25", ".123456789123"];
    let (zone, fraction) = (
        zone[rng.random_range(0..zone.len())],
        fraction[rng.random_range(0..fraction.len())],
    );
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}{fraction}{zone}")
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data.csv");
    let check = |stamp: &str| check(stamp, &path);
    replay!(100, |bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes);
        let count = |stamp: &str| {
            let mutations = accepted(30, |rng| {
                check(&String::from_utf8_lossy(&mutated(stamp.as_bytes(), rng)))
            });
            usize::from(check(stamp)) + mutations
        };
        text.lines().map(count).sum::<usize>()
    });
    assert!(accepted(500, |rng| check(&random_stamp(rng))) > 20);
}
