//! `decode --follow` over pipes, a pseudo-terminal and a socket.

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::TcpListener,
    path::Path,
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

use serialport::{SerialPort, TTYPort};
use tempfile::TempDir;

use crate::{live, terminal::decoupler};

const SMALL: &str =
    "--array 2x2_2x6 --samples 400 --set validation-samples=0 --set test-samples=10 --hidden 3 --epochs 5";

/// A folder with a network, `n.json`, readings of 20 snapshots, `readings.csv`, and the output of `decode` for them,
/// `decoded.csv`.
fn trained(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        format!("train {SMALL} {scene} --decoder mean --out n.json"),
        format!("simulate --array 2x2_2x6 --samples 40 {scene} --seed 1 --out readings.csv"),
        "decode --network n.json --data readings.csv --out decoded.csv".to_owned(),
    ] {
        let output = decoupler(&arguments, folder.path());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    folder
}

fn read(folder: &TempDir, name: &str) -> String {
    fs::read_to_string(folder.path().join(name)).unwrap()
}

/// Compares two tables. The compiled network rounds differently from `decode`, which computes in blocks.
fn assert_same<'a>(found: impl IntoIterator<Item = &'a str>, expected: impl IntoIterator<Item = &'a str>) {
    let (found, expected): (Vec<&str>, Vec<&str>) = (found.into_iter().collect(), expected.into_iter().collect());
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        let fields = found.trim().split(',').zip(expected.trim().split(','));
        for (found, expected) in fields {
            match (found.parse::<f64>(), expected.parse::<f64>()) {
                (Ok(one), Ok(other)) => assert!((one - other).abs() < 1e-9, "{found} {expected}"),
                _ => assert_eq!(found, expected),
            }
        }
        assert_eq!(found.matches(',').count(), expected.matches(',').count());
    }
}

fn spawn(arguments: &str, folder: &Path) -> Child {
    let mut command = Command::new("env");
    // A hangup is ignored if the tests run in the background.
    command.args(["--default-signal", env!("CARGO_BIN_EXE_decoupler")]);
    command.args(arguments.split_whitespace()).current_dir(folder);
    let command = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// The rows of `readings.csv` as a device sends them: row number, then resistances.
fn device_lines(folder: &TempDir) -> Vec<String> {
    let readings = read(folder, "readings.csv");
    let fields = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let line = |line: &str| fields(line)[1..8].join(",") + "\n";
    readings.lines().skip(1).map(line).collect()
}

#[test]
fn frames_of_the_live_view_have_the_answers_of_decode() {
    let folder = trained("--rows known");
    let decoded = read(&folder, "decoded.csv");
    let decoded = Vec::from_iter(decoded.lines().skip(1).map(|line| {
        let fields = line.split(',').take(6);
        Vec::from_iter(fields.map(|field| field.parse::<f64>().unwrap()))
    }));
    for answers in live::answers(&folder.path().join("n.json"), &folder.path().join("readings.csv")) {
        assert_eq!(answers.len(), 20);
        for (found, expected) in answers.iter().zip(decoded.chunks(2)) {
            let pairs = found.iter().zip(expected.iter().flatten());
            assert!(
                pairs
                    .into_iter()
                    .all(|(found, expected)| (found - expected).abs() < 1e-9)
            );
        }
    }
}

#[test]
fn a_file_or_pipe_is_decoded_as_by_decode() {
    let folder = trained("--rows known");
    let expected = read(&folder, "decoded.csv");
    let output = decoupler("decode --network n.json --follow --data readings.csv", folder.path());
    assert_same(String::from_utf8(output.stdout).unwrap().lines(), expected.lines());
    let report = String::from_utf8(output.stderr).unwrap();
    assert!(
        report.contains("40 lines decoded") && report.contains("0 bad, 0 dropped; latency p50"),
        "{report}"
    );
    assert!(report.contains("trained without noise; give --fault-noise"), "{report}");
    // Without names, in order; row numbers are not needed.
    let lines = device_lines(&folder);
    let plain = lines.iter().map(|line| line.split_once(',').unwrap().1.to_owned());
    let mut child = spawn("decode --network n.json --follow", folder.path());
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
    let snapshot = |pair: &[String]| {
        let of_row = |line: &String| line.trim().split_once(',').unwrap().1.to_owned();
        format!("{},{}\n", of_row(&pair[0]), of_row(&pair[1]))
    };
    let snapshots: String = lines.chunks(2).map(snapshot).collect();
    fs::write(folder.path().join("snapshots.csv"), snapshots).unwrap();
    let output = decoupler(
        "decode --network n.json --follow --format jsonl --data snapshots.csv",
        folder.path(),
    );
    let decoded = read(&folder, "decoded.csv");
    let decoded: Vec<Vec<f64>> = decoded
        .lines()
        .skip(1)
        .map(|line| line.split(',').take(6).map(|field| field.parse().unwrap()).collect())
        .collect();
    let answers = String::from_utf8(output.stdout).unwrap();
    assert_eq!(answers.lines().count(), 20);
    for ((answer, pair), number) in answers.lines().zip(decoded.chunks(2)).zip(1..) {
        let answer: serde_json::Value = serde_json::from_str(answer).unwrap();
        assert_eq!(answer["line"], number);
        assert_eq!(answer["left_out"], serde_json::Value::Null);
        let found: Vec<f64> = serde_json::from_value(answer["coordinates_mm"].clone()).unwrap();
        let pairs = found.iter().zip(pair.concat());
        assert!(
            pairs
                .into_iter()
                .all(|(found, expected)| (found - expected).abs() < 1e-9)
        );
        assert_eq!(found.len(), 12);
    }
}

#[test]
fn garbage_is_counted_reported_and_skipped() {
    let folder = trained("--rows known");
    let mut lines = device_lines(&folder);
    let garbage = [
        "#!?\n",
        "1,2\n",
        "\u{0}\u{1}\n",
        "1,nan,2,3,4,5,6\n",
        "99,1,2,3,4,5,6\n",
    ];
    for (index, line) in lines.iter_mut().enumerate().filter(|(index, _)| index % 10 == 9) {
        *line = garbage[index / 10 % garbage.len()].to_owned();
    }
    let long = "7".repeat(1 << 20) + "\n";
    let text = format!("{}{long}", lines.concat());
    fs::write(folder.path().join("noisy.csv"), text).unwrap();
    let output = decoupler("decode --network n.json --follow --data noisy.csv", folder.path());
    assert!(output.status.success());
    let decoded = read(&folder, "decoded.csv");
    let kept = decoded
        .lines()
        .enumerate()
        .filter(|(index, _)| index % 10 != 0 || *index == 0);
    let expected: Vec<&str> = kept.map(|(_, line)| line).collect();
    let found = String::from_utf8(output.stdout).unwrap();
    assert_same(found.lines(), expected);
    let report = String::from_utf8(output.stderr).unwrap();
    for words in [
        "warning: line 10: 1 cell where 7",
        "warning: line 20: 2 cells where 7",
        "warning: line 40, column 2: 'nan' is not a resistance",
        "warning: line 41: it is longer than 1048576 bytes",
        "36 lines decoded",
        "5 bad, 0 dropped",
    ] {
        assert!(report.contains(words), "{words}: {report}");
    }
}

#[test]
fn a_fault_is_named_and_left_out() {
    let noise = "--rows known --noise 1e-3";
    let folder = trained(noise);
    let simulate =
        format!("simulate --array 2x2_2x6 --samples 40 {noise} --seed 1 --fault stuck:4=low --out faulty.csv");
    assert!(decoupler(&simulate, folder.path()).status.success());
    let output = decoupler(
        "decode --network n.json --follow --format jsonl --data faulty.csv",
        folder.path(),
    );
    let report = String::from_utf8(output.stderr).unwrap();
    assert!(report.contains("column-wire 4: stuck"), "{report}");
    let last = String::from_utf8(output.stdout).unwrap();
    let last: serde_json::Value = serde_json::from_str(last.lines().last().unwrap()).unwrap();
    assert_eq!(last["left_out"], "column-wire 4");
    let refused = decoupler(&simulate.replace("stuck:4", "stuck:7"), folder.path());
    let message = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        message.contains("--fault: there is no column-wire 7; give 1 to 6"),
        "{message}"
    );
}

/// A running program with the pipes to it.
struct Running {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Running {
    fn new(arguments: &str, folder: &TempDir) -> Self {
        let mut child = spawn(arguments, folder.path());
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        Self {
            child,
            input,
            output: BufReader::new(output),
        }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        line
    }

    fn signal(&self, name: &str) {
        let status = Command::new("kill").args([name, &self.child.id().to_string()]).status();
        assert!(status.unwrap().success());
    }

    fn stderr(&mut self) -> String {
        let mut text = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        text
    }
}

#[test]
fn answers_are_immediate_and_signals_are_handled() {
    let folder = trained("--rows known");
    let expected = read(&folder, "decoded.csv");
    let mut expected = expected.lines();
    let lines = device_lines(&folder);
    let mut running = Running::new("decode --network n.json --follow", &folder);
    running.input.write_all(lines[0].as_bytes()).unwrap();
    // The input is still open.
    assert_same([running.line().as_str()], expected.next());
    assert_same([running.line().as_str()], expected.next());
    running.signal("-USR1");
    let mut stderr = BufReader::new(running.child.stderr.take().unwrap());
    let mut report = String::new();
    while !report.contains("decoded") {
        report.clear();
        stderr.read_line(&mut report).unwrap();
    }
    assert!(report.starts_with("1 line decoded"), "{report}");
    running.input.write_all(lines[1].as_bytes()).unwrap();
    assert_same([running.line().as_str()], expected.next());
    running.signal("-INT");
    assert_eq!(running.child.wait().unwrap().code(), Some(130));
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).unwrap();
    assert!(rest.contains("2 lines decoded"), "{rest}");
}

#[test]
fn a_terminated_program_prints_its_report() {
    let folder = trained("--rows known");
    let lines = device_lines(&folder);
    let mut running = Running::new("decode --network n.json --follow", &folder);
    running.input.write_all(lines[0].as_bytes()).unwrap();
    running.line();
    running.line();
    running.signal("-TERM");
    assert_eq!(running.child.wait().unwrap().code(), Some(143));
    let report = running.stderr();
    assert!(report.contains("1 line decoded"), "{report}");
    // As when the terminal is closed.
    let mut running = Running::new("decode --network n.json --follow", &folder);
    running.input.write_all(lines[0].as_bytes()).unwrap();
    running.line();
    running.line();
    running.signal("-HUP");
    assert_eq!(running.child.wait().unwrap().code(), Some(129));
    assert!(running.stderr().contains("1 line decoded"));
}

#[test]
fn a_stream_without_line_ends_is_reported() {
    let folder = trained("--rows known");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let arguments = format!(
        "decode --network n.json --follow --data tcp:{}",
        listener.local_addr().unwrap()
    );
    let mut running = Running::new(&arguments, &folder);
    let (mut stream, _) = listener.accept().unwrap();
    let with_returns = device_lines(&folder).concat().replace('\n', "\r");
    stream.write_all(with_returns.as_bytes()).unwrap();
    let mut warning = String::new();
    let mut stderr = BufReader::new(running.child.stderr.take().unwrap());
    while !warning.contains("no line has ended") {
        warning.clear();
        assert!(stderr.read_line(&mut warning).unwrap() > 0);
    }
    assert!(
        warning.starts_with(&format!("warning: {} bytes", with_returns.len())),
        "{warning}"
    );
    running.signal("-INT");
    assert_eq!(running.child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_closed_output_ends_the_program_silently() {
    let folder = trained("--rows known");
    let lines = device_lines(&folder).concat();
    let Running {
        mut child,
        mut input,
        output,
    } = Running::new("decode --network n.json --follow", &folder);
    drop(output);
    // The program ends when it notices.
    while input.write_all(lines.as_bytes()).is_ok() {}
    let mut report = String::new();
    child.stderr.take().unwrap().read_to_string(&mut report).unwrap();
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
    let mut running = Running::new(
        &format!("decode --network n.json --follow --data {name}:115200"),
        &folder,
    );
    let lines = device_lines(&folder);
    device.write_all(b"3,4\n").unwrap();
    device.write_all(lines[..10].concat().as_bytes()).unwrap();
    let expected = read(&folder, "decoded.csv");
    for expected in expected.lines().take(11) {
        assert_same([running.line().as_str()], [expected]);
    }
    running.signal("-INT");
    let report = running.stderr();
    assert!(
        report.contains("10 lines decoded") && report.contains("0 bad, 0 dropped"),
        "{report}"
    );
    assert_eq!(running.child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_socket_is_read_until_it_closes_and_sends_row_numbers() {
    let folder = trained("--rows known");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let arguments = format!("decode --network n.json --follow --data tcp:{address}");
    let mut running = Running::new(&arguments, &folder);
    let lines = device_lines(&folder);
    let (mut stream, _) = listener.accept().unwrap();
    let expected = read(&folder, "decoded.csv");
    let mut expected = expected.lines();
    assert!(stream.write_all(lines[0].as_bytes()).is_ok());
    assert_same([running.line().as_str()], expected.next());
    for line in &lines[1..] {
        // The test waits for each answer, so that no line is dropped.
        assert_same([running.line().as_str()], expected.next());
        stream.write_all(line.as_bytes()).unwrap();
    }
    drop(stream);
    assert_same([running.line().as_str()], expected.next());
    assert_eq!(running.line(), "");
    assert!(running.child.wait().unwrap().success());
    assert!(running.stderr().contains("40 lines decoded"));
    // Without the row number, the row with which a device begins is unknown.
    let mut running = Running::new(&arguments, &folder);
    let (mut stream, _) = listener.accept().unwrap();
    stream
        .write_all(lines[0].split_once(',').unwrap().1.as_bytes())
        .unwrap();
    assert_eq!(running.child.wait().unwrap().code(), Some(1));
    let message = running.stderr();
    assert!(message.contains("line 1: it has no row number"), "{message}");
}

#[test]
fn a_header_without_a_resistance_and_a_stream_without_a_frame_end_with_an_error() {
    let folder = trained("--rows known");
    let readings = read(&folder, "readings.csv");
    let names = readings.lines().next().unwrap();
    for (text, words) in [
        (readings.replacen("r_3", "volt", 1), "line 1: there is no column 'r_3'"),
        (
            "R1,R2,R3,R4,R5,R6\n1,2,3,4,5,6\n".to_owned(),
            "line 1: there is no column 'r_1'",
        ),
        (String::new(), "no line could be decoded: it has no line of readings"),
        (format!("{names}\n"), "no line could be decoded"),
        (
            "hello\n1,2\n".to_owned(),
            "no line could be decoded: line 1: 1 cell where 6",
        ),
    ] {
        fs::write(folder.path().join("bad.csv"), &text).unwrap();
        let output = decoupler(
            "decode --network n.json --follow --fault-noise 1e-3 --data bad.csv",
            folder.path(),
        );
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), &output.stdout[..]),
            (Some(1), &b""[..]),
            "{message}"
        );
        let errors: Vec<&str> = message.lines().filter(|line| line.starts_with("error")).collect();
        assert!(errors.len() == 1 && errors[0].contains(words), "{message}");
    }
}

#[test]
fn sources_that_cannot_be_opened_are_explained_in_one_line() {
    let folder = trained("");
    for (input, status, words) in [
        ("/dev/no-such-tty:9600", 1, "there is no device '/dev/no-such-tty'"),
        ("/dev/ttyUSB77", 2, "needs its baud rate: give /dev/ttyUSB77:115200"),
        ("tcp:localhost", 2, "give tcp:HOST:PORT"),
        (
            "tcp:127.0.0.1:1",
            1,
            "cannot connect to 'tcp:127.0.0.1:1': Connection refused; check that the sender listens there",
        ),
        ("no-such-file.csv", 1, "cannot open 'no-such-file.csv'"),
        ("COMPARISON.csv", 1, "cannot open 'COMPARISON.csv'"),
        ("missing.csv:1", 1, "cannot open 'missing.csv:1'"),
    ] {
        let output = decoupler(
            &format!("decode --network n.json --follow --fault-noise 1e-3 --data {input}"),
            folder.path(),
        );
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(status), "{message}");
        assert!(message.contains(words) && message.lines().count() == 1, "{message}");
    }
    let output = decoupler("decode --network n.json --follow --out x.csv", folder.path());
    assert_eq!(output.status.code(), Some(2));
    let output = decoupler(
        "decode --network n.json --data x.csv --out y.csv --status 1",
        folder.path(),
    );
    assert_eq!(output.status.code(), Some(2));
}
