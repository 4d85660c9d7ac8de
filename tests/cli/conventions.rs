//! What every command does alike: JSON and warnings, `-`, `--force`, and failures of files.

use std::{
    fs,
    io::Write,
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;
use tempfile::TempDir;

use crate::calls::{has, piped};

const ARRAY: &str =
    "--array 2x2_2x6 --samples 40 --set validation-samples=0 --set test-samples=10 --hidden 2 --epochs 1";
const RECORDING: &str = "--data data.csv --inputs t,u --targets d";
const FRAMES: &str = "--data presses.csv --inputs r_1..r_6 --targets x_1..z_2 --row-wire row --group snapshot";

/// The arguments that replace `@array`, `@recording` and `@frames`.
pub(crate) fn in_full(arguments: &str) -> String {
    let arguments = arguments.replace("@array", ARRAY).replace("@recording", RECORDING);
    arguments.replace("@frames", FRAMES)
}

/// Runs the program, which replaces files only with an option.
fn run(arguments: &str, folder: &Path, input: &[u8]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args(in_full(arguments).split_whitespace()).current_dir(folder);
    let mut child = piped(&mut command);
    // A command that fails early does not read.
    let _ = child.stdin.take().unwrap().write_all(input);
    child.wait_with_output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A folder with what the commands read.
pub(crate) fn prepared() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..60).map(|k| format!("{k},{},{}\n", k * k % 7, 2 * k)).collect();
    fs::write(folder.path().join("data.csv"), format!("t,u,d\n{rows}")).unwrap();
    let specification = r#"{"train": {"array": "2x2_2x6", "samples": 40, "epochs": 1, "decoder": ["mean"]}, "axes": {"hidden": [2, 3]}}"#;
    fs::write(folder.path().join("sweep.json"), specification).unwrap();
    for arguments in [
        "train @array --decoder mean --out n.json",
        "train @recording --hidden 2 --epochs 1 --out recording.json",
        "simulate --array 2x2_2x6 --samples 4 --out readings.csv",
        "simulate --array 2x2_2x6 --samples 40 --out presses.csv",
        "calibrate --array 2x2_2x6 @frames --out nominal.json",
        "train --sensor nominal.json --rows known --samples 40 --hidden 2 --epochs 1 --decoder mean --out fitted.json",
        "sweep --spec sweep.json --out runs",
    ] {
        let output = run(arguments, folder.path(), b"");
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    }
    folder
}

/// Calls of every command that prints an object.
const OBJECTS: [&str; 16] = [
    "train @array --decoder mean,ridge",
    "train @array --noise 0.3 --set noise-in=test --decoder ridge",
    "train @recording --hidden 2 --epochs 5",
    "train @recording --split random --hidden 2 --epochs 5",
    "train @recording --hidden 2 --epochs 5 --folds 3",
    "inspect --data data.csv",
    "inspect @recording",
    "inspect @recording --recipe-out recipe.json",
    "decode --network n.json --data readings.csv --out decoded.csv",
    "decode --network recording.json --data data.csv --out own.csv",
    "simulate --array 2x2_2x6 --samples 4 --out drawn.csv",
    "export --network n.json --format numpy --out bundle",
    "calibrate --array 2x2_2x6 @frames",
    "fine-tune --network fitted.json @frames --epochs 1 --out tuned.json",
    "trade @recording --hidden 2 --epochs 1",
    "trade --array 2x2_2x6 --samples 20 --set test-samples=10 --hidden 2 --epochs 1 --noise 0,0.3 --decoder mean,ridge",
];

#[test]
fn every_object_parses_and_lists_the_warnings_that_were_printed() {
    let folder = prepared();
    let of_sweeps = [
        "sweep --spec sweep.json --out runs",
        "sweep --merge runs --out table.csv",
        "reproduce --table 1 --seeds 1 --epochs 1 --starts 1 --hidden 2",
    ];
    let mut warned = 0;
    for arguments in OBJECTS.into_iter().chain(of_sweeps) {
        let output = run(&format!("{arguments} --json"), folder.path(), b"");
        let errors = text(&output.stderr);
        assert!(output.status.success(), "{arguments}: {errors}");
        let object: Value = serde_json::from_slice(&output.stdout).unwrap();
        let listed = object["warnings"].as_array().unwrap();
        let listed = Vec::from_iter(listed.iter().map(|warning| warning.as_str().unwrap()));
        let printed = Vec::from_iter(errors.lines().filter_map(|line| line.strip_prefix("warning: ")));
        assert_eq!(listed, printed, "{arguments}");
        warned += printed.len();
        // As text, the same warnings, in the same form.
        let arguments = arguments.replace("--out bundle", "--out again");
        let output = run(&format!("{arguments} --force"), folder.path(), b"");
        let again = text(&output.stderr);
        let again = Vec::from_iter(again.lines().filter_map(|line| line.strip_prefix("warning: ")));
        assert_eq!(again.len(), printed.len(), "{arguments}");
        assert!(!text(&output.stdout).contains("Warning"), "{arguments}");
    }
    assert!(warned > 3, "{warned}");
}

/// Commands that write a file, the last argument.
const FILES: [(&str, &str); 9] = [
    ("simulate --array 2x2_2x6 --samples 6 --out", "out.csv"),
    ("train @array --decoder mean -o", "out.json"),
    ("train @array --decoder mean --report", "report.html"),
    ("inspect @recording --recipe-out", "recipe.json"),
    ("decode --network n.json --data readings.csv --out", "decoded.csv"),
    ("calibrate --array 2x2_2x6 @frames --out", "sensor.json"),
    ("fine-tune --network fitted.json @frames --epochs 1 --out", "tuned.json"),
    ("sweep --merge runs --out", "table.csv"),
    ("sweep --merge runs --out", "table.json"),
];

#[test]
fn a_file_is_replaced_only_by_force() {
    let folder = prepared();
    for (arguments, name) in FILES {
        let path = folder.path().join(name);
        fs::write(&path, "precious").unwrap();
        let output = run(&format!("{arguments} {name}"), folder.path(), b"");
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(
            message.contains("--force to replace it") && message.lines().count() == 1,
            "{message}"
        );
        assert_eq!(fs::read(&path).unwrap(), b"precious", "{arguments}");
        let output = run(&format!("{arguments} {name} --force"), folder.path(), b"");
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
        assert_ne!(fs::read(&path).unwrap(), b"precious", "{arguments}");
    }
    let output = run(
        "reproduce --table 1 --seeds 1 --epochs 1 --starts 1 --hidden 2 --out tables",
        folder.path(),
        b"",
    );
    assert!(output.status.success());
    let output = run("reproduce --table 1 --seeds 1 --out tables", folder.path(), b"");
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}

#[test]
fn a_place_that_cannot_be_written_is_one_line_and_status_1() {
    let folder = prepared();
    fs::create_dir(folder.path().join("taken.csv")).unwrap();
    fs::create_dir(folder.path().join("taken.json")).unwrap();
    for (arguments, name) in FILES {
        let taken = if name.ends_with(".csv") {
            "taken.csv"
        } else {
            "taken.json"
        };
        for place in [format!("missing/{name}"), taken.to_owned()] {
            let output = run(&format!("{arguments} {place}"), folder.path(), b"");
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{arguments} {place}: {message}");
            assert!(
                message.starts_with("error: cannot write") && message.lines().count() == 1,
                "{arguments} {place}: {message}"
            );
        }
    }
}

#[cfg(unix)]
#[test]
fn a_dash_is_standard_input_or_output() {
    let folder = prepared();
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    for (arguments, name, input) in [
        ("simulate --array 2x2_2x6 --samples 6 --out", "simulated.csv", ""),
        ("train @array --decoder mean -o", "network.json", ""),
        ("inspect @recording --recipe-out", "r.json", ""),
        ("decode --network n.json --data - --out", "decoded.csv", "readings.csv"),
        ("decode --network recording.json --data - --out", "own.csv", "data.csv"),
        ("calibrate --array 2x2_2x6 @frames --out", "sensor.json", ""),
    ] {
        let input = if input.is_empty() { Vec::new() } else { read(input) };
        let to_file = run(&format!("{arguments} {name}"), folder.path(), &input);
        assert!(to_file.status.success(), "{arguments}: {}", text(&to_file.stderr));
        let to_output = run(&format!("{arguments} -"), folder.path(), &input);
        assert!(to_output.status.success(), "{arguments}: {}", text(&to_output.stderr));
        let (file, printed) = (text(&read(name)), text(&to_output.stdout));
        if name == "network.json" {
            // It has times of its own.
            assert!(serde_json::from_str::<Value>(&printed).is_ok(), "{printed}");
        } else {
            assert_eq!(file, printed, "{arguments}");
        }
    }
    let train = "train --inputs t,u --targets d --hidden 2 --epochs 5 --json --data";
    let errors = |data: &str, input: &[u8]| {
        let output = run(&format!("{train} {data}"), folder.path(), input);
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["targets"].take()
    };
    assert_eq!(errors("data.csv", b""), errors("-", &read("data.csv")));
}

/// The most that a user can take in.
#[test]
fn help_is_short_and_names_settings_formats_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let help = |arguments: &str| text(&run(arguments, folder.path(), b"").stdout);
    // Options are indented by six columns, or by two with a short form; explanations by more.
    let is_option = |line: &&str| line.starts_with("      --") || line.starts_with("  -");
    let options = |arguments: &str| help(arguments).lines().filter(is_option).count();
    assert!((8..=13).contains(&options("train -h")), "{}", options("train -h"));
    assert!(
        (30..=42).contains(&options("train --help")),
        "{}",
        options("train --help")
    );
    let train = help("train --help");
    let last = train
        .lines()
        .rfind(|line| line.ends_with(':') && !line.starts_with(' '));
    assert_eq!(last, Some("Rarely needed:"));
    has(&train, &["mu-decrease", "largest-mu", "learning-rate", "momentum"]);
    let export = ["ohm", "mm", "opset 13", "fixed16", "1e-12", "README.txt", "nanometres"];
    has(&help("export --help"), &export);
    has(&help("--version"), &["decoupler "]);
    has(&help("completions bash"), &["decoupler"]);
}
