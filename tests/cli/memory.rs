//! A memory from the arguments to the answers: training, decoding of files and of streams.

use std::{collections::HashMap, fmt::Write, path::Path};

use tempfile::TempDir;

use crate::{
    calls::{both, column, has, json, number, read, refused, said, success, write},
    live,
    terminal::decoupler,
};

const TRAIN: &str = "train --data press.csv --time t --inputs u --targets force --hidden 3 --starts 1 --epochs 60 \
                     --validation-fraction 0";

/// A reading that creeps: it follows the force by half at once, and by half with a time constant of 1 s. Of its 600 rows
/// at 20 Hz, which are also in readings.csv without the force, the last 120 are for testing.
pub(crate) fn creeping() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (mut text, mut readings) = ("t,u,force\n".to_owned(), "t,u\n".to_owned());
    let (mut crept, weight) = (0.0, 1.0 - f64::exp(-0.05));
    for row in 0..600 {
        let (time_s, force) = (0.05 * f64::from(row), force(row));
        crept += weight * (force - crept);
        let reading = 0.5 * (force + crept);
        text += &format!("{time_s},{reading},{force}\n");
        readings += &format!("{time_s},{reading}\n");
    }
    write(folder.path(), "press.csv", text);
    write(folder.path(), "readings.csv", readings);
    folder
}

fn force(row: u32) -> f64 {
    let time_s = 0.05 * f64::from(row);
    2.0 + f64::sin(1.3 * time_s) + f64::sin(0.37 * time_s * time_s.sqrt())
}

const FOLLOW: &str = "decode --network n.json --follow --data";

/// The decoded forces of a file.
fn decoded(input: &str, folder: &Path) -> Vec<f64> {
    column(
        &success(&format!("decode --network n.json --data {input} --out -"), folder),
        "force",
    )
}

fn followed(input: &str, folder: &Path) -> Vec<f64> {
    column(&success(&format!("{FOLLOW} {input}"), folder), "force")
}

#[track_caller]
fn assert_near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (place, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(
            (found - expected).abs() < tolerance,
            "sample {place}: {found} and {expected}"
        );
    }
}

#[test]
fn a_memory_removes_creep_and_goes_with_the_network() {
    let folder = creeping();
    let folder = folder.path();
    let rmse = |arguments: &str| {
        number(
            &json(&format!("{TRAIN} {arguments} --json"), folder)["targets"][0],
            "rmse",
        )
    };
    let (without, with) = (rmse(""), rmse("--history 0.5s,2s --out n.json"));
    assert!(with < 0.2 * without, "{with} {without}");
    let text = success(&format!("{TRAIN} --history 0.5s,2s"), folder);
    let is_named = |line: &str| line.starts_with("History") && line.ends_with("0.5s,2s");
    assert!(text.lines().any(is_named), "{text}");
    let of_file = decoded("readings.csv", folder);
    let squares = (480..600).map(|row| (of_file[row as usize] - force(row)).powi(2));
    let found = (squares.sum::<f64>() / 120.0).sqrt();
    assert!((found / with - 1.0).abs() < 1e-6, "{found}, in training {with}");
    // A stream with times, and one without, at the interval of the training.
    let readings = read(folder, "readings.csv");
    let untimed = readings
        .lines()
        .map(|line| format!("{}\n", line.split_once(',').unwrap().1));
    write(folder, "untimed.csv", untimed.collect::<String>());
    for input in ["readings.csv", "untimed.csv"] {
        assert_near(&followed(input, folder), &of_file, 1e-9);
    }
    // The times are copied as they came.
    let times = |text: &str| Vec::from_iter(text.lines().map(|line| line.split(',').next().unwrap().to_owned()));
    assert_eq!(
        times(&success(&format!("{FOLLOW} readings.csv"), folder)),
        times(&readings)
    );
    let objects = success(&format!("{FOLLOW} readings.csv --format jsonl"), folder);
    let object: serde_json::Value = serde_json::from_str(objects.lines().nth(1).unwrap()).unwrap();
    assert_eq!(object["columns"]["t"], times(&readings)[2].as_str());
}

#[test]
fn a_stream_is_decoded_like_a_file_with_derived_columns_and_a_memory() {
    let folder = creeping();
    let train = TRAIN.replace("--inputs u", "--inputs d,q");
    let derive = "--derive d=u-start(1s) --derive q=u/start(5)";
    success(&format!("{train} {derive} --history 0.5s --out n.json"), folder.path());
    let of_file = decoded("readings.csv", folder.path());
    let (text, warnings) = both(&format!("{FOLLOW} readings.csv"), folder.path());
    has(&warnings, &["line 2: the lines at the start give the means"]);
    // Without the rows of the first second, which are over with that at 1.05 s.
    assert_near(&column(&text, "force"), &of_file[21..], 1e-9);
    // A stream without one of the columns is refused with the reason.
    write(folder.path(), "other.csv", "t,v\n0,1\n");
    let output = decoupler(&format!("{FOLLOW} other.csv"), folder.path());
    assert_eq!(output.status.code(), Some(1));
    has(
        &String::from_utf8(output.stderr).unwrap(),
        &["error: 'other.csv': line 1: there is no column 'd'"],
    );
}

#[test]
fn memories_are_kept_in_recipes_and_refused_where_they_are_not_possible() {
    let folder = creeping();
    let recipe = "--lags 5,0.5s --differences --recipe-out r.json --out a.json";
    success(&format!("{TRAIN} {recipe}"), folder.path());
    has(&read(folder.path(), "r.json"), &["\"lags\"", "\"0.5s\""]);
    let without_time = TRAIN.replace("--time t ", "");
    for (arguments, status, cause) in [
        (
            format!("{without_time} --history 2s"),
            2,
            "a history of 2 s needs times",
        ),
        (format!("{TRAIN} --history 2h"), 2, "write a number of samples as in 20"),
        (
            format!("{TRAIN} --history 0.01s"),
            2,
            "0.01 s is shorter than the usual interval",
        ),
        (
            "export --network a.json --format c99 --precision fixed16 --out c".to_owned(),
            1,
            "no history of readings: choose precision f64 or f32",
        ),
    ] {
        refused(&arguments, folder.path(), status, cause);
    }
}

#[test]
fn every_format_exports_the_history_with_golden_readings_in_series() {
    let folder = creeping();
    // A name that is a formula.
    let text = read(folder.path(), "press.csv").replacen("t,u,", "t,=1+u,", 1);
    write(folder.path(), "press.csv", text);
    let train = TRAIN.replace("--inputs u", "--inputs =1+u");
    // A past of lags alone, or of averages alone, needs only a part of the state in C, which compiles without warnings.
    let all = "--history 0.5s,40 --lags 3,0.2s --differences";
    for (memory, format, precision, file) in [
        ("--lags 5", "c99", "f64", "lags_decode.c"),
        ("--history 0.5s", "c99", "f64", "averages_decode.c"),
        (all, "c99", "f64", "all_decode.c"),
        (all, "c99", "f32", "single_decode.c"),
        (all, "onnx", "f32", "network.onnx"),
        (all, "numpy", "f64", "decode.py"),
        (all, "matlab", "f64", "matlab_decode.m"),
    ] {
        let out = file.split('_').next().unwrap().replace('.', "_");
        success(&format!("{train} {memory} --out n.json"), folder.path());
        let export = format!("export --network n.json --format {format} --precision {precision} --out {out} --json");
        let report = json(&export, folder.path());
        let limit = number(&report, "limit");
        let deviation = report["deviation"].as_f64().unwrap_or(0.0);
        assert!(deviation <= limit && limit < 1e-2, "{format}: {report}");
        let found = folder.path().join(&out);
        assert!(found.join(file).is_file(), "{format}");
        let golden = read(&found, "golden.csv");
        assert!(golden.starts_with("new_series,time_s,'=1+u,force\n"), "{golden}");
        assert!(
            golden.lines().filter(|line| line.starts_with("1,")).count() >= 2,
            "{golden}"
        );
        let readme = read(&found, "README.txt");
        let readme = Vec::from_iter(readme.split_whitespace()).join(" ");
        has(
            &readme,
            &["restarts by itself where the time steps back, and after a pause"],
        );
    }
}

/// How the times of a recording are written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Clock {
    Seconds,
    Milliseconds,
    Stamps,
}

/// 3000 samples of two interleaved groups with three row-wires each, at irregular intervals, with two pauses, and a clock that
/// starts again in the middle. The target is the reading and, by half, that two samples before in the same group and
/// row-wire, or the first after a pause or a restart of the clock.
fn several_series(clock: Clock) -> TempDir {
    let unit = if clock == Clock::Milliseconds { " (ms)" } else { "" };
    let mut text = format!("time{unit},press (id),row,u,force\n");
    let mut pasts: HashMap<(usize, usize), (f64, Vec<f64>)> = HashMap::new();
    let mut time_ms = 0_u32;
    for sample in 0..3000_usize {
        time_ms = match sample {
            1000 | 2200 => time_ms + 60_000,
            1500 => 0,
            _ => time_ms + 20 + (sample * sample % 31) as u32,
        };
        let series = ((sample / 3) % 2, sample % 3);
        let reading = f64::sin(0.37 * sample as f64) + f64::sin(1.9 * (sample as f64).sqrt());
        let time_s = f64::from(time_ms) / 1000.0;
        let (before_s, past) = pasts.entry(series).or_default();
        if time_s < *before_s || time_s > *before_s + 30.0 {
            past.clear();
        }
        *before_s = time_s;
        past.push(reading);
        let force = reading + 0.5 * past[past.len().saturating_sub(3)];
        let time = match clock {
            Clock::Seconds => format!("{time_s}"),
            Clock::Milliseconds => format!("{time_ms}"),
            Clock::Stamps => {
                let (minutes, ms) = (time_ms / 60_000, time_ms % 60_000);
                format!("2026-11-24T10:{minutes:02}:{:02}.{:03}", ms / 1000, ms % 1000)
            }
        };
        let press = ["first", "second"][series.0];
        writeln!(text, "{time},{press},{},{reading},{force}", series.1 + 1).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["press.csv", "same.csv"] {
        write(folder.path(), name, &text);
    }
    folder
}

/// Every way to decode continues the same states as the training.
#[test]
fn files_and_streams_are_decoded_with_the_past_of_training() {
    for clock in [Clock::Seconds, Clock::Milliseconds, Clock::Stamps] {
        let folder = several_series(clock);
        let folder = folder.path();
        let train = "train --data press.csv --test-data same.csv --time time --group press --row-wire row --inputs u \
                     --targets force --lags 2 --hidden 3 --starts 1 --epochs 60 --validation-fraction 0 --out n.json";
        let target = &json(&format!("{train} --json"), folder)["targets"][0];
        assert!(number(target, "r2") > 0.9999, "{clock:?}: {target}");
        let truth = column(&read(folder, "press.csv"), "force");
        let of_file = decoded("press.csv", folder);
        let squares = of_file.iter().zip(&truth).map(|(found, force)| (found - force).powi(2));
        let rmse = (squares.sum::<f64>() / truth.len() as f64).sqrt();
        assert!(
            (rmse / number(target, "rmse") - 1.0).abs() < 1e-6,
            "{clock:?}: {rmse}, in training {target}"
        );
        assert_near(&followed("press.csv", folder), &of_file, 1e-12);
        for shown in live::answers(&folder.join("n.json"), &folder.join("press.csv")) {
            assert_near(&shown.concat(), &of_file, 1e-12);
        }
    }
}

#[test]
fn rows_out_of_order_are_taken_in_order_of_time_and_rows_without_a_time_left_out() {
    let folder = creeping();
    let folder = folder.path();
    success(&format!("{TRAIN} --history 0.5s,2s --out n.json"), folder);
    let decode = "decode --network n.json --out d.csv --data";
    assert!(!said(&format!("{decode} readings.csv"), folder).contains("backwards"));
    let sorted = decoded("readings.csv", folder);
    let readings = read(folder, "readings.csv");
    let (header, lines) = readings.split_once('\n').unwrap();
    let lines = Vec::from_iter(lines.lines());
    let place = |row: usize| row * 181 % lines.len();
    let shuffled = Vec::from_iter((0..lines.len()).map(|row| lines[place(row)]));
    write(folder, "shuffled.csv", format!("{header}\n{}\n", shuffled.join("\n")));
    has(
        &said(&format!("{decode} shuffled.csv"), folder),
        &["the rows are taken in order of time"],
    );
    let expected = Vec::from_iter((0..lines.len()).map(|row| sorted[place(row)]));
    assert_near(&decoded("shuffled.csv", folder), &expected, 1e-12);
    let damaged = readings.replace("\n5.5,", "\nnan,").replace("\n7.25,", "\n,");
    write(folder, "damaged.csv", damaged);
    has(
        &said(&format!("{decode} damaged.csv"), folder),
        &["2 lines without a time", "line 112"],
    );
    let (text, warnings) = both(&format!("{FOLLOW} damaged.csv"), folder);
    has(&warnings, &["598 lines decoded", "2 bad"]);
    assert_eq!(column(&text, "force"), decoded("damaged.csv", folder));
}
