//! A memory from the arguments to the answers: training, decoding of files and of streams.

use std::{collections::HashMap, fmt::Write, fs, path::Path};

use tempfile::TempDir;

use crate::{live, printed::json, terminal::decoupler};

const TRAIN: &str = "train --data press.csv --time t --inputs u --targets force --hidden 3 --starts 1 --epochs 60 \
                     --validation-fraction 0";

/// A reading that creeps: it follows the force by half at once, and by half with a time constant of 1 s. Of its 600 rows
/// at 20 Hz, which are also in readings.csv without the force, the last 120 are for testing.
pub(crate) fn creeping() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (mut text, mut readings) = ("t,u,force\n".to_owned(), "t,u\n".to_owned());
    let (mut crept, weight) = (0.0, 1.0 - f64::exp(-0.05));
    for row in 0..600 {
        let time_s = 0.05 * f64::from(row);
        let force = 2.0 + f64::sin(1.3 * time_s) + f64::sin(0.37 * time_s * time_s.sqrt());
        crept += weight * (force - crept);
        let reading = 0.5 * (force + crept);
        text += &format!("{time_s},{reading},{force}\n");
        readings += &format!("{time_s},{reading}\n");
    }
    fs::write(folder.path().join("press.csv"), text).unwrap();
    fs::write(folder.path().join("readings.csv"), readings).unwrap();
    folder
}

pub(crate) fn succeed(arguments: &str, folder: &Path) -> String {
    let output = decoupler(arguments, folder);
    assert!(
        output.status.success(),
        "{arguments}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &str, folder: &Path) -> String {
    let output = decoupler(arguments, folder);
    assert!(!output.status.success(), "{arguments}");
    String::from_utf8(output.stderr).unwrap()
}

/// Decoded target of a table, whose first column may be the time.
fn answers(text: &str) -> Vec<f64> {
    let column = text.split([',', '\n']).position(|name| name.starts_with("force"));
    let answer = |line: &str| line.split(',').nth(column.unwrap()).unwrap().parse().unwrap();
    text.lines().skip(1).map(answer).collect()
}

#[test]
fn a_memory_removes_creep_and_goes_with_the_network() {
    let folder = creeping();
    let rmse = |report: &serde_json::Value| report["targets"][0]["rmse"].as_f64().unwrap();
    let without = json(&format!("{TRAIN} --json"), folder.path());
    let with = json(&format!("{TRAIN} --history 0.5s,2s --out n.json --json"), folder.path());
    assert!(rmse(&with) < 0.2 * rmse(&without), "{} {}", rmse(&with), rmse(&without));
    let text = succeed(&format!("{TRAIN} --history 0.5s,2s"), folder.path());
    assert!(
        text.lines()
            .any(|line| line.starts_with("History") && line.ends_with("0.5s,2s")),
        "{text}"
    );
    succeed(
        "decode --network n.json --data readings.csv --out decoded.csv",
        folder.path(),
    );
    let decoded = answers(&fs::read_to_string(folder.path().join("decoded.csv")).unwrap());
    let squares = decoded.iter().enumerate().skip(480).map(|(row, found)| {
        let time_s = 0.05 * row as f64;
        (found - (2.0 + f64::sin(1.3 * time_s) + f64::sin(0.37 * time_s * time_s.sqrt()))).powi(2)
    });
    let found = (squares.sum::<f64>() / 120.0).sqrt();
    assert!(
        (found / rmse(&with) - 1.0).abs() < 1e-6,
        "{found}, in training {}",
        rmse(&with)
    );
    // A stream with times, and one without, at the interval of the training.
    let streamed = succeed("decode --network n.json --follow --data readings.csv", folder.path());
    let readings = fs::read_to_string(folder.path().join("readings.csv")).unwrap();
    let untimed = readings
        .lines()
        .map(|line| format!("{}\n", line.split_once(',').unwrap().1));
    fs::write(folder.path().join("untimed.csv"), untimed.collect::<String>()).unwrap();
    let without_times = succeed("decode --network n.json --follow --data untimed.csv", folder.path());
    // The times are copied as they came.
    let header = streamed.lines().next().unwrap();
    assert!(header.starts_with("t,"), "{header}");
    let times = |text: &str| {
        Vec::from_iter(
            text.lines()
                .skip(1)
                .map(|line| line.split(',').next().unwrap().to_owned()),
        )
    };
    assert_eq!(times(&streamed), times(&readings));
    let objects = succeed(
        "decode --network n.json --follow --format jsonl --data readings.csv",
        folder.path(),
    );
    let object: serde_json::Value = serde_json::from_str(objects.lines().nth(1).unwrap()).unwrap();
    assert_eq!(object["columns"]["t"], times(&readings)[1].as_str());
    for found in [answers(&streamed), answers(&without_times)] {
        assert_eq!(found.len(), decoded.len());
        assert!(
            found
                .iter()
                .zip(&decoded)
                .all(|(one, other)| (one - other).abs() < 1e-9)
        );
    }
}

#[test]
fn a_stream_is_decoded_like_a_file_with_derived_columns_and_a_memory() {
    let folder = creeping();
    let derive = "--derive d=u-start(1s) --derive q=u/start(5)";
    succeed(
        &format!(
            "{} {derive} --history 0.5s --out n.json",
            TRAIN.replace("--inputs u", "--inputs d,q")
        ),
        folder.path(),
    );
    let decode = "decode --network n.json --data readings.csv";
    succeed(&format!("{decode} --out decoded.csv"), folder.path());
    let decoded = answers(&fs::read_to_string(folder.path().join("decoded.csv")).unwrap());
    let output = decoupler(&format!("{decode} --follow"), folder.path());
    let warnings = String::from_utf8(output.stderr).unwrap();
    assert!(
        warnings.contains("line 2: the lines at the start give the means"),
        "{warnings}"
    );
    let streamed = answers(&String::from_utf8(output.stdout).unwrap());
    // The rows of the first second, which are over with that at 1.05 s.
    assert_eq!((decoded.len(), streamed.len()), (600, 579));
    for (found, expected) in streamed.iter().zip(&decoded[21..]) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    // A stream without one of the columns is refused with the reason.
    fs::write(folder.path().join("other.csv"), "t,v\n0,1\n").unwrap();
    let message = refused("decode --network n.json --follow --data other.csv", folder.path());
    assert!(message.contains("there is no column 'd'"), "{message}");
}

#[test]
fn memories_are_kept_in_recipes_and_refused_where_they_are_not_possible() {
    let folder = creeping();
    succeed(
        &format!("{TRAIN} --lags 5,0.5s --differences --recipe-out r.json --out a.json"),
        folder.path(),
    );
    let recipe = fs::read_to_string(folder.path().join("r.json")).unwrap();
    assert!(recipe.contains("\"lags\"") && recipe.contains("\"0.5s\""), "{recipe}");
    let message = refused(
        "train --data press.csv --inputs u --targets force --history 2s",
        folder.path(),
    );
    assert!(message.contains("a memory of 2s needs times"), "{message}");
    let message = refused(&format!("{TRAIN} --history 2h"), folder.path());
    assert!(message.contains("write a number of samples as in 20"), "{message}");
    let message = refused(
        "export --network a.json --format c99 --precision fixed16 --out c",
        folder.path(),
    );
    assert!(
        message.contains("no history of readings: give --precision f64 or f32"),
        "{message}"
    );
}

#[test]
fn every_format_exports_the_history_with_golden_readings_in_series() {
    let folder = creeping();
    let memory = "--history 0.5s,40 --lags 3,0.2s --differences --out n.json";
    succeed(&format!("{TRAIN} {memory}"), folder.path());
    for (format, precision, file) in [
        ("c99", "f64", "c99_f64_decode.c"),
        ("c99", "f32", "c99_f32_decode.c"),
        ("onnx", "f32", "network.onnx"),
        ("numpy", "f64", "decode.py"),
        ("matlab", "f64", "matlab_f64_decode.m"),
    ] {
        let out = format!("{format}_{precision}");
        let export = format!("export --network n.json --format {format} --precision {precision} --out {out} --json");
        let report = json(&export, folder.path());
        let limit = report["limit"].as_f64().unwrap();
        assert!(
            report["deviation"].as_f64().unwrap_or(0.0) <= limit && limit < 1e-2,
            "{format}: {report}"
        );
        let found = folder.path().join(&out);
        assert!(found.join(file).is_file(), "{format}");
        let golden = fs::read_to_string(found.join("golden.csv")).unwrap();
        assert!(golden.starts_with("new_series,time_s,u,force\n"), "{golden}");
        assert!(
            golden.lines().filter(|line| line.starts_with("1,")).count() >= 2,
            "{golden}"
        );
        let readme = fs::read_to_string(found.join("README.txt")).unwrap();
        let readme = readme.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            readme.contains("restarts by itself where the time steps back, and after a pause"),
            "{readme}"
        );
    }
}

/// A past of lags alone, or of averages alone, needs only a part of the state in C, which compiles without warnings.
#[test]
fn lags_and_averages_alone_are_exported_and_verified_in_c() {
    let folder = creeping();
    for (name, memory) in [("lags", "--lags 5"), ("averages", "--history 0.5s")] {
        succeed(&format!("{TRAIN} {memory} --out {name}.json"), folder.path());
        let export = format!("export --network {name}.json --format c99 --out {name} --json");
        let report = json(&export, folder.path());
        let limit = report["limit"].as_f64().unwrap();
        assert!(report["deviation"].as_f64().unwrap_or(0.0) <= limit, "{name}: {report}");
    }
}

#[test]
fn names_in_the_golden_sequence_are_no_formulas() {
    let folder = creeping();
    let path = folder.path().join("press.csv");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("t,u,", "t,=1+u,", 1)).unwrap();
    let train = TRAIN.replace("--inputs u", "--inputs =1+u");
    succeed(&format!("{train} --lags 3 --out n.json"), folder.path());
    succeed("export --network n.json --format numpy --out numpy", folder.path());
    let golden = fs::read_to_string(folder.path().join("numpy/golden.csv")).unwrap();
    assert!(golden.starts_with("new_series,time_s,'=1+u,force"), "{golden}");
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
    let folder = tempfile::tempdir().unwrap();
    let header = match clock {
        Clock::Seconds | Clock::Stamps => "time",
        Clock::Milliseconds => "time (ms)",
    };
    let mut text = format!("{header},press (id),row,u,force\n");
    let mut pasts: HashMap<(usize, usize), (f64, Vec<f64>)> = HashMap::new();
    let mut time_ms = 0_u32;
    for sample in 0..3000_usize {
        time_ms += match sample {
            1000 | 2200 => 60_000,
            _ => 20 + (sample * sample % 31) as u32,
        };
        if sample == 1500 {
            time_ms = 0;
        }
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
    for name in ["press.csv", "same.csv"] {
        fs::write(folder.path().join(name), &text).unwrap();
    }
    folder
}

const TRAIN_SERIES: &str = "train --data press.csv --test-data same.csv --time time --group press --row-wire row --inputs u \
                            --targets force --lags 2 --hidden 3 --starts 1 --epochs 60 --validation-fraction 0";

/// Numbers of the column of a CSV text whose name begins like this.
fn column(text: &str, name: &str) -> Vec<f64> {
    let mut lines = text.lines();
    let column = lines.next().unwrap().split(',').position(|cell| cell.starts_with(name));
    let number = |line: &str| line.split(',').nth(column.unwrap()).unwrap().parse().unwrap();
    lines.map(number).collect()
}

fn r2(found: &[f64], expected: &[f64]) -> f64 {
    let mean = expected.iter().sum::<f64>() / expected.len() as f64;
    let squares =
        |of: &dyn Fn(f64, f64) -> f64| found.iter().zip(expected).map(|(a, b)| of(*a, *b).powi(2)).sum::<f64>();
    1.0 - squares(&|found, expected| found - expected) / squares(&|_, expected| expected - mean)
}

/// Every way to decode continues the same states as the training.
#[test]
fn files_and_streams_are_decoded_with_the_past_of_training() {
    for clock in [Clock::Seconds, Clock::Milliseconds, Clock::Stamps] {
        let folder = several_series(clock);
        let report = json(&format!("{TRAIN_SERIES} --out n.json --json"), folder.path());
        let in_training = report["targets"][0]["r2"].as_f64().unwrap();
        assert!(in_training > 0.9999, "{clock:?}: R² {in_training} in training");
        let truth = column(&fs::read_to_string(folder.path().join("press.csv")).unwrap(), "force");
        succeed("decode --network n.json --data press.csv --out d.csv", folder.path());
        let decoded = column(&fs::read_to_string(folder.path().join("d.csv")).unwrap(), "force");
        let of_file = r2(&decoded, &truth);
        assert!(
            (of_file - in_training).abs() < 1e-9,
            "{clock:?}: R² {of_file} by decode, {in_training} in training"
        );
        let followed = column(
            &succeed("decode --network n.json --follow --data press.csv", folder.path()),
            "force",
        );
        assert_eq!(followed.len(), decoded.len());
        for (line, (found, expected)) in followed.iter().zip(&decoded).enumerate() {
            assert!(
                (found - expected).abs() < 1e-12,
                "{clock:?}, sample {line}: {found} and {expected}"
            );
        }
        for shown in live::answers(&folder.path().join("n.json"), &folder.path().join("press.csv")) {
            assert_eq!(shown.len(), decoded.len(), "{clock:?}");
            for (sample, (found, expected)) in shown.iter().zip(&decoded).enumerate() {
                assert!(
                    (found[0] - expected).abs() < 1e-12,
                    "{clock:?}, sample {sample}: {found:?} and {expected}"
                );
            }
        }
    }
}

#[test]
fn a_file_with_rows_out_of_order_is_decoded_in_order_of_time() {
    let folder = creeping();
    succeed(&format!("{TRAIN} --history 0.5s,2s --out n.json"), folder.path());
    let sorted = fs::read_to_string(folder.path().join("readings.csv")).unwrap();
    let (header, lines) = sorted.split_once('\n').unwrap();
    let lines = Vec::from_iter(lines.lines());
    let shuffled = Vec::from_iter((0..lines.len()).map(|row| lines[row * 181 % lines.len()]));
    fs::write(
        folder.path().join("shuffled.csv"),
        format!("{header}\n{}\n", shuffled.join("\n")),
    )
    .unwrap();
    let decode = |input: &str| {
        decoupler(
            &format!("decode --network n.json --data {input} --out d.csv"),
            folder.path(),
        )
    };
    let warnings = decode("shuffled.csv").stderr;
    let warnings = String::from_utf8_lossy(&warnings);
    assert!(warnings.contains("the rows are taken in order of time"), "{warnings}");
    let of_shuffled = answers(&fs::read_to_string(folder.path().join("d.csv")).unwrap());
    let warnings = decode("readings.csv").stderr;
    assert!(!String::from_utf8_lossy(&warnings).contains("backwards"));
    let of_sorted = answers(&fs::read_to_string(folder.path().join("d.csv")).unwrap());
    for (row, found) in of_shuffled.iter().enumerate() {
        let expected = of_sorted[row * 181 % lines.len()];
        assert!((found - expected).abs() < 1e-12, "row {row}: {found} and {expected}");
    }
}

#[test]
fn lines_without_a_time_are_left_out_by_file_and_stream_alike() {
    let folder = creeping();
    succeed(&format!("{TRAIN} --history 0.5s,2s --out n.json"), folder.path());
    let readings = fs::read_to_string(folder.path().join("readings.csv")).unwrap();
    let damaged = readings.replace("\n5.5,", "\nnan,").replace("\n7.25,", "\n,");
    fs::write(folder.path().join("damaged.csv"), damaged).unwrap();
    let output = decoupler("decode --network n.json --data damaged.csv --out d.csv", folder.path());
    let warnings = String::from_utf8_lossy(&output.stderr);
    assert!(
        warnings.contains("2 lines without a time") && warnings.contains("line 112"),
        "{warnings}"
    );
    let decoded = answers(&fs::read_to_string(folder.path().join("d.csv")).unwrap());
    let output = decoupler("decode --network n.json --follow --data damaged.csv", folder.path());
    let warnings = String::from_utf8_lossy(&output.stderr);
    assert!(
        warnings.contains("598 lines decoded") && warnings.contains("2 bad"),
        "{warnings}"
    );
    assert_eq!(answers(&String::from_utf8(output.stdout).unwrap()), decoded);
}

#[test]
fn a_memory_shorter_than_an_interval_is_refused() {
    let folder = creeping();
    let press = fs::read_to_string(folder.path().join("press.csv")).unwrap();
    let (header, lines) = press.split_once('\n').unwrap();
    let lines = lines.lines().map(|line| {
        let (time_s, rest) = line.split_once(',').unwrap();
        format!("{},{rest}\n", 1000.0 * time_s.parse::<f64>().unwrap())
    });
    fs::write(
        folder.path().join("press.csv"),
        format!("{header}\n{}", lines.collect::<String>()),
    )
    .unwrap();
    let message = refused(&format!("{TRAIN} --history 0.5s"), folder.path());
    assert!(
        message.contains("0.5s is shorter than the usual interval") && message.contains("50.0 s"),
        "{message}"
    );
    succeed(&format!("{TRAIN} --history 0.5s --unit t=ms"), folder.path());
}
