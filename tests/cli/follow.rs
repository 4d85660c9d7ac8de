//! `decode --follow` over pipes, a pseudo-terminal and a socket.

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::TcpListener,
    process::{Child, ChildStderr, ChildStdin, ChildStdout},
};

use serialport::{SerialPort, TTYPort};
use tempfile::TempDir;

use crate::{
    calls::{SIGNALS, both, has, read, signal, spawn, success, write},
    files, live,
    terminal::decoupler,
};

const FOLLOW: &str = "decode --network n.json --follow";

/// A folder with a network, `n.json`, readings of 20 snapshots, `readings.csv`, and the output of `decode` for them,
/// `decoded.csv`.
fn trained(scene: &str) -> TempDir {
    let folder = files::trained(scene);
    success(
        "decode --network n.json --data readings.csv --out decoded.csv",
        folder.path(),
    );
    folder
}

/// Compares two tables. The compiled network rounds differently from `decode`, which computes in blocks.
fn assert_same<'a>(found: impl IntoIterator<Item = &'a str>, expected: impl IntoIterator<Item = &'a str>) {
    let (found, expected) = (Vec::from_iter(found), Vec::from_iter(expected));
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!(found.matches(',').count(), expected.matches(',').count());
        for (found, expected) in found.trim().split(',').zip(expected.trim().split(',')) {
            match (found.parse::<f64>(), expected.parse::<f64>()) {
                (Ok(one), Ok(other)) => assert!((one - other).abs() < 1e-9, "{found} {expected}"),
                _ => assert_eq!(found, expected),
            }
        }
    }
}

/// The coordinates of each line of `decoded.csv`.
fn decoded(folder: &TempDir) -> Vec<Vec<f64>> {
    let text = read(folder.path(), "decoded.csv");
    let numbers = |line: &str| line.split(',').take(6).map(|field| field.parse().unwrap()).collect();
    text.lines().skip(1).map(numbers).collect()
}

fn are_near(found: &[f64], expected: &[f64]) -> bool {
    let mut pairs = found.iter().zip(expected);
    found.len() == expected.len() && pairs.all(|(found, expected)| (found - expected).abs() < 1e-9)
}

/// The rows of `readings.csv` as a device sends them: row number, then resistances.
fn device_lines(folder: &TempDir) -> Vec<String> {
    let readings = read(folder.path(), "readings.csv");
    let line = |line: &str| Vec::from_iter(line.split(',').skip(1).take(7)).join(",") + "\n";
    readings.lines().skip(1).map(line).collect()
}

#[test]
fn frames_of_the_live_view_have_the_answers_of_decode() {
    let folder = trained("--rows known");
    let decoded = decoded(&folder);
    for answers in live::answers(&folder.path().join("n.json"), &folder.path().join("readings.csv")) {
        assert_eq!(answers.len(), 20);
        for (found, expected) in answers.iter().zip(decoded.chunks(2)) {
            assert!(are_near(found, &expected.concat()));
        }
    }
}

#[test]
fn a_file_or_pipe_is_decoded_as_by_decode() {
    let folder = trained("--rows known");
    let expected = read(folder.path(), "decoded.csv");
    let (found, report) = both(&format!("{FOLLOW} --data readings.csv"), folder.path());
    assert_same(found.lines(), expected.lines());
    let counts = ["40 lines decoded", "0 bad, 0 dropped; latency p50"];
    has(
        &report,
        &[&counts[..], &["trained without noise; give --fault-noise"]].concat(),
    );
    // Without names, in order; row numbers are not needed.
    let lines = device_lines(&folder);
    let plain = lines.iter().map(|line| line.split_once(',').unwrap().1);
    let mut child = spawn(FOLLOW, folder.path());
    child
        .stdin
        .take()
        .unwrap()
        .write_all(plain.collect::<String>().as_bytes())
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert_same(String::from_utf8(output.stdout).unwrap().lines(), expected.lines());
}

#[test]
fn whole_snapshots_and_json_are_supported() {
    let folder = trained("--rows known");
    let lines = device_lines(&folder);
    let readings = Vec::from_iter(lines.iter().map(|line| line.trim().split_once(',').unwrap().1));
    let snapshots: String = readings.chunks(2).map(|pair| pair.join(",") + "\n").collect();
    write(folder.path(), "snapshots.csv", snapshots);
    let answers = success(&format!("{FOLLOW} --format jsonl --data snapshots.csv"), folder.path());
    assert_eq!(answers.lines().count(), 20);
    for ((answer, pair), number) in answers.lines().zip(decoded(&folder).chunks(2)).zip(1..) {
        let answer: serde_json::Value = serde_json::from_str(answer).unwrap();
        assert_eq!(
            (&answer["line"], &answer["left_out"]),
            (&number.into(), &serde_json::Value::Null)
        );
        let found: Vec<f64> = serde_json::from_value(answer["coordinates_mm"].clone()).unwrap();
        assert!(are_near(&found, &pair.concat()));
    }
}

#[test]
fn garbage_is_counted_reported_and_skipped() {
    let folder = trained("--rows known");
    let mut lines = device_lines(&folder);
    let garbage = ["#!?\n", "1,2\n", "\u{0}\u{1}\n", "1,nan,2,3,4,5,6\n"];
    for (garbage, place) in garbage.iter().zip([9, 19, 29, 39]) {
        lines[place] = (*garbage).to_owned();
    }
    write(
        folder.path(),
        "noisy.csv",
        format!("{}{}\n", lines.concat(), "7".repeat(1 << 20)),
    );
    let (found, report) = both(&format!("{FOLLOW} --data noisy.csv"), folder.path());
    let decoded = read(folder.path(), "decoded.csv");
    let is_kept = |(index, _): &(usize, &str)| index % 10 != 0 || *index == 0;
    let expected = Vec::from_iter(decoded.lines().enumerate().filter(is_kept).map(|(_, line)| line));
    assert_same(found.lines(), expected);
    let words = [
        "warning: line 10: 1 cell where 7",
        "warning: line 20: 2 cells where 7",
        "warning: line 40, column 2: 'nan' is not a resistance",
        "warning: line 41: it is longer than 1048576 bytes",
        "36 lines decoded",
        "5 bad, 0 dropped",
    ];
    has(&report, &words);
}

#[test]
fn a_fault_is_named_and_left_out() {
    let noise = "--rows known --noise 1e-3";
    let folder = trained(noise);
    let simulate =
        format!("simulate --array 2x2_2x6 --samples 40 {noise} --seed 1 --fault stuck:4=low --out faulty.csv");
    success(&simulate, folder.path());
    let (answers, report) = both(&format!("{FOLLOW} --format jsonl --data faulty.csv"), folder.path());
    has(&report, &["column-wire 4: stuck"]);
    let last: serde_json::Value = serde_json::from_str(answers.lines().last().unwrap()).unwrap();
    assert_eq!(last["left_out"], "column-wire 4");
}

/// A running program with the pipes to it.
struct Running {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    errors: BufReader<ChildStderr>,
}

impl Running {
    fn new(arguments: &str, folder: &TempDir) -> Self {
        let mut child = spawn(arguments, folder.path());
        let input = child.stdin.take().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let errors = BufReader::new(child.stderr.take().unwrap());
        Self {
            child,
            input,
            output,
            errors,
        }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        line
    }

    /// The next line of standard error with these words.
    fn report(&mut self, words: &str) -> String {
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            assert!(self.errors.read_line(&mut line).unwrap() > 0, "{words}");
        }
        line
    }

    /// Waits for the end with this status; returns the rest of standard error.
    fn ended(&mut self, status: i32) -> String {
        let mut text = String::new();
        self.errors.read_to_string(&mut text).unwrap();
        assert_eq!(self.child.wait().unwrap().code(), Some(status), "{text}");
        text
    }
}

#[test]
fn answers_are_immediate_and_signals_are_handled() {
    let folder = trained("--rows known");
    let expected = read(folder.path(), "decoded.csv");
    let lines = device_lines(&folder);
    for (name, status) in SIGNALS {
        let mut expected = expected.lines();
        let mut running = Running::new(FOLLOW, &folder);
        running.input.write_all(lines[0].as_bytes()).unwrap();
        // The input is still open.
        assert_same([running.line().as_str()], expected.next());
        assert_same([running.line().as_str()], expected.next());
        signal("USR1", &running.child);
        let report = running.report("decoded");
        assert!(report.starts_with("1 line decoded"), "{report}");
        running.input.write_all(lines[1].as_bytes()).unwrap();
        assert_same([running.line().as_str()], expected.next());
        signal(name, &running.child);
        has(&running.ended(status), &["2 lines decoded"]);
    }
}

#[test]
fn a_closed_output_ends_the_program_silently() {
    let folder = trained("--rows known");
    let lines = device_lines(&folder).concat();
    let Running {
        mut child,
        mut input,
        output,
        mut errors,
    } = Running::new(FOLLOW, &folder);
    drop(output);
    // The program ends when it notices.
    while input.write_all(lines.as_bytes()).is_ok() {}
    let mut report = String::new();
    errors.read_to_string(&mut report).unwrap();
    assert!(child.wait().unwrap().success() && !report.contains("error"), "{report}");
}

#[test]
fn a_serial_device_is_read_from_a_line_end_on() {
    let folder = trained("--rows known");
    let (mut device, port) = TTYPort::pair().unwrap();
    let name = port.name().unwrap();
    // A device whose other end is closed cannot be written to.
    let _held = fs::File::open(&name).unwrap();
    drop(port);
    let mut running = Running::new(&format!("{FOLLOW} --data {name}:115200"), &folder);
    let lines = device_lines(&folder);
    device.write_all(b"3,4\n").unwrap();
    device.write_all(lines[..10].concat().as_bytes()).unwrap();
    for expected in read(folder.path(), "decoded.csv").lines().take(11) {
        assert_same([running.line().as_str()], [expected]);
    }
    signal("INT", &running.child);
    has(&running.ended(130), &["10 lines decoded", "0 bad, 0 dropped"]);
}

#[test]
fn a_socket_is_read_until_it_closes_and_sends_row_numbers() {
    let folder = trained("--rows known");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let arguments = format!("{FOLLOW} --data tcp:{}", listener.local_addr().unwrap());
    let mut running = Running::new(&arguments, &folder);
    let lines = device_lines(&folder);
    let (mut stream, _) = listener.accept().unwrap();
    let expected = read(folder.path(), "decoded.csv");
    let mut expected = expected.lines();
    stream.write_all(lines[0].as_bytes()).unwrap();
    assert_same([running.line().as_str()], expected.next());
    for line in &lines[1..] {
        // The test waits for each answer, so that no line is dropped.
        assert_same([running.line().as_str()], expected.next());
        stream.write_all(line.as_bytes()).unwrap();
    }
    drop(stream);
    assert_same([running.line().as_str()], expected.next());
    assert_eq!(running.line(), "");
    has(&running.ended(0), &["40 lines decoded"]);
    // Without the row number, the row with which a device begins is unknown.
    let mut running = Running::new(&arguments, &folder);
    let (mut stream, _) = listener.accept().unwrap();
    stream
        .write_all(lines[0].split_once(',').unwrap().1.as_bytes())
        .unwrap();
    has(&running.ended(1), &["line 1: it has no row number"]);
    // Lines that never end.
    let mut running = Running::new(&arguments, &folder);
    let (mut stream, _) = listener.accept().unwrap();
    let with_returns = lines.concat().replace('\n', "\r");
    stream.write_all(with_returns.as_bytes()).unwrap();
    let warning = running.report("no line has ended");
    assert!(
        warning.starts_with(&format!("warning: {} bytes", with_returns.len())),
        "{warning}"
    );
    signal("INT", &running.child);
    running.ended(130);
}

#[test]
fn a_header_without_a_resistance_and_a_stream_without_a_frame_end_with_an_error() {
    let folder = trained("--rows known");
    let readings = read(folder.path(), "readings.csv");
    for (text, words) in [
        (readings.replacen("r_3", "volt", 1), "line 1: there is no column 'r_3'"),
        (String::new(), "no line could be decoded: it has no line of readings"),
        (
            "hello\n1,2\n".to_owned(),
            "no line could be decoded: line 1: 1 cell where 6",
        ),
    ] {
        write(folder.path(), "bad.csv", &text);
        let output = decoupler(&format!("{FOLLOW} --fault-noise 1e-3 --data bad.csv"), folder.path());
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && output.stdout.is_empty(), "{message}");
        let errors = Vec::from_iter(message.lines().filter(|line| line.starts_with("error")));
        assert!(errors.len() == 1 && errors[0].contains(words), "{message}");
    }
}
