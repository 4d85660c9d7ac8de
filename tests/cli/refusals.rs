//! Calls that cannot work end with a status and one line that names the cause and the remedy, and leave nothing.

use std::fs;

use crate::{
    calls::{refused, said, success},
    conventions::{in_full, prepared},
    folders::names,
    terminal::decoupler,
};

/// Arguments that end with status 2, and part of the message.
const INVALID: &[&str] = &[
    "trian => 'train'",
    "train --sed 1 => --seed",
    "train --hidden 0 => from 1 to 512",
    "train --hidden twelve => from 1 to 512",
    "train --samples 0 => from 1 to 1000000",
    "train --samples -5 => not a whole number",
    "train --set test-samples=0 => from 1",
    "train --set validation-samples=1000001 => from 0 to 1000000",
    "train --epochs 0 => from 1",
    "train --seed -1 => not a whole number",
    "train --seed 18446744073709551616 => not a whole number",
    "train --array 10x6 => M1xM2_M3xM4",
    "train --array 10x6_3x0 => column-wires (M4)",
    "train --method adam => lm, br, scg",
    "train --set mu => NAME=VALUE",
    "train --set mu=small => not a number",
    "train --set mu=NaN => mu is NaN",
    "train --set mu=-1 => mu is -1: it must be from 1e-20",
    "train --set momentum=0.5 => mu, mu-decrease, mu-increase, largest-mu",
    "train --method gdm --set momentum=1.5 => from 0 to 1",
    "train --method gdx --set momentum=1 => momentum is 1: it must be from 0 to 0.999999",
    "train --set mu=1e12 => mu is 1e12, above largest mu, which is 1e10: lower mu, or raise largest mu",
    "train --set goal=-1 => it must be",
    "train --set goal=NaN => it must be",
    "train --set max-fail=0 => it must be",
    "train --set min-gradient=inf => it must be",
    "train --array 10x2_2x6 --hidden 512 --starts 100 --method br => use",
    "train --array 10x2_2x6 --samples 100000 --set validation-samples=900010 => held together as whole snapshots of 10 rows, are 1000010: the limit is 1000000; give fewer for validation",
    "train --preset worst => paper or best",
    "train --rows some => all, known",
    "train --rows 11 => row 11 does not exist: the array has rows 1 to 10",
    "train --axes xy => z or xyz",
    "train --loading smooth => smooth:MM",
    "train --inputs volts => resistance, conductance or log",
    "train --scaling none => minmax or whiten",
    "train --noise -1 => 0 or more",
    "train --noise 2 => from 0 to 1",
    "train --noise 0,1 => is not a number",
    "train --noise 1e300 => the relative noise is 1e300: give from 0 to 1",
    "train --set noise-ohm=1e308 => from 0 to 1e150",
    "train --decoder knn => newton or polish",
    "train --resume => --checkpoint <FILE>",
    "train --out r.html --report ./r.html => --out and --report name the same file",
    "simulate --rows 11 => row 11 does not exist: the array has rows 1 to 10",
    "simulate --samples 0 => from 1",
    "simulate --array 0x1_1x1 => row-wires (M1)",
    "simulate --set noise-ohm=1e308 --out x.csv => additive noise",
    "simulate --decoder mean,ridge => only one here",
    "simulate --array 2x2_2x6 --fault stuck:7=low => --fault: there is no column-wire 7; give 1 to 6",
    "trade --hidden 0 => from 1",
    "trade --method lm => the presets name the methods",
    "decode --network n.json => --data <FILE>",
    "decode --network n.json --follow --out x.csv => cannot be used with",
    "decode --network n.json --data x.csv --out y.csv --status 1 => cannot be used with '--status",
    "decode --network n.json --follow --fault-noise 1e-3 --data /dev/ttyUSB77 => needs its baud rate: give /dev/ttyUSB77:115200",
    "decode --network n.json --follow --fault-noise 1e-3 --data tcp:localhost => give tcp:HOST:PORT",
    "decode --network recording.json --data data.csv --out x.csv --fault-noise 1 => cannot be used with '--fault-noise",
    "export --network n.json --format tflite --out b => give onnx, c99, matlab or numpy",
    "export --network n.json --format json --out b => is not a format",
    "export --network n.json --format onnx --precision f16 --out b => give f64, f32 or fixed16",
    "export --network n.json --format onnx --precision fixed16 --out b => give f64 or f32",
    "export --network n.json --format onnx --out n.json => name the same file",
    "export --network n.json --decoder newton --format c99 --out b => solves the equations of the sensor",
    "export --network n.json --decoder fuzzy --format c99 --out b => only for comparison",
    "export --network n.json --decoder rbf --format c99 --precision fixed16 --out b => no Gaussians",
    "export --network n.json --decoder knn --format c99 --out b => ridge",
    "export --network recording.json --decoder newton --format c99 --out b => solves the equations of the sensor",
    "reproduce --table 4 => possible values: 1, 2, 3, all",
    "reproduce --hidden 6,0 => '0' for '--hidden",
    "reproduce --arrays 10x6 => not an array scale",
    "reproduce --seeds 0 => from 1",
    "reproduce --folds 11 --fold-unit snapshot => 11 folds of 10 snapshots",
    // Options of a simulated sensor together with a recording, and of a recording without one.
    "train @recording --array 2x2_2x6 => --array: a recording (--data) has no array",
    "train @recording --noise 0.1 => --noise: a recording (--data) has its own noise",
    "train @recording --loading random => --loading: a recording (--data) has no scene",
    "train @recording --samples 10 => --samples: all rows",
    "train @recording --rows known => --row-wire",
    "train @recording --decoder newton => --decoder newton: it solves the equations of a simulated array",
    "train @recording --split group => --group",
    "train --data data.csv --inputs t --targets x => there is no column 'x'",
    "train --data data.csv --inputs t => --targets: name the columns",
    "train --inputs t,u => columns need --data",
    "train --split time => --split needs --data or --recipe",
    "trade @recording --array 2x3_2x9 => no array",
    "trade @recording --samples 10 => --where",
    "trade @recording --set test-samples=10 => --test-fraction",
    "trade @recording --preset best => no scene",
    "trade @recording --noise 0,1e-3 => its own noise",
    "trade @recording --decoder ridge,newton => --decoder newton: it solves the equations of a simulated array",
    "trade @recording --rows known => --row-wire",
    "trade --data data.csv --inputs t => --targets",
    "trade --split time => --split needs --data",
    "inspect => --data: name the file",
    "inspect --data data.csv --inputs t => --targets: name the columns",
    "inspect --data data.csv --split time => --split needs --inputs and --targets",
    "inspect @recording --test-data data.csv => --test-data: a recording is analysed by cross-validation",
    "inspect @recording --test-fraction 0.3 => --test-fraction: a recording is analysed by cross-validation",
    "inspect --data data.csv --positions taxels.csv => --targets <COLUMNS>",
    // Frames.
    "calibrate --array 2x2_2x9 @frames => --inputs: 6 columns, where a row-wire of the array 2×2_2×9 needs 9",
    "calibrate --array 1x2_2x6 @frames => 'row' has row 2, and the array 1×2_2×6 has 1",
    "calibrate --array 2x2_2x6 --data presses.csv --inputs r_1..r_6 --targets x_1..z_2 => --row-wire: name the column",
    "calibrate --array 2x2_2x6 --data presses.csv --inputs r_1..r_6 --targets x_1..x_2 --row-wire row => --targets: 4 columns",
    "calibrate --array 2x2_2x6 --sensor nominal.json @frames => cannot be used with",
    "calibrate --array 2x2_2x6 @frames --split time => error: --split: calibrate fits all frames",
    "calibrate --array 2x2_2x6 @frames --test-data none.csv => error: --test-data: calibrate fits all frames",
    "fine-tune --network fitted.json @frames --epochs 1 --out x.json --split time => error: --split: calibrate fits all frames",
    "fine-tune --network fitted.json @frames --epochs 1 --out x.json --test-data none.csv => error: --test-data: calibrate fits all frames",
    // A checkpoint determines what was drawn.
    "train @array --checkpoint begun.json => exists: add --resume",
    "train --checkpoint begun.json --resume --hidden 5 => --hidden 5: the checkpoint has 2",
    "train --checkpoint begun.json --resume --array 10x8_4x24 => --array 10x8_4x24: the checkpoint has 2x2_2x6",
    "train --checkpoint begun.json --resume --seed 6 => --seed 6: the checkpoint has 0",
    "train --checkpoint begun.json --resume --samples 200 => --samples 200: the checkpoint has 40",
    "train --checkpoint begun.json --resume --set test-samples=20 => the checkpoint has 10",
    "train --checkpoint begun.json --resume --set validation-samples=10 => the checkpoint has 0",
    "train --checkpoint begun.json --resume --starts 2 => --starts 2: the checkpoint has 1",
    "train --checkpoint begun.json --resume --set momentum=0.5 => lm has no such setting",
    "train --checkpoint begun.json --resume --out ./begun.json => name the same file",
];

/// Options that a checkpoint of a recording does not take, each with a value.
const OF_CHECKPOINTS: &str = "--split random --inputs u --scaling whiten --folds 3 --test-data data.csv --rows known --noise 0.1 \
                              --set drift=0.1 --array 4x3_2x8 --samples 10 --loading indenter --preset best --decoder newton \
                              --recipe r.json --hidden 99 --starts 9 --seed 99";

/// Files and devices that cannot be read or written, with status 1.
const UNUSABLE: &[&str] = &[
    "train --data none.csv --inputs a --targets b => there is no such file or folder; check the name",
    "train --recipe none.json => none.json",
    "train --sensor none.json => none.json",
    "train --sensor sweep.json => is not a sensor file",
    "train --checkpoint none.json --resume => cannot read 'none.json'",
    "train --checkpoint torn.json --resume => 'torn.json' is cut off at line 1",
    "train @array --out none/a.json => the folder 'none' does not exist; make it first",
    "train @array --out runs => it is a folder",
    "train --epochs 1000000 --out fixed.json => read-only",
    "train --epochs 1000000 --report none/r.html => does not exist",
    "simulate --out fixed.json => read-only",
    "inspect --data none.csv => none.csv",
    "decode --network none.json --data readings.csv --out x.csv => none.json",
    "decode --network runs --data readings.csv --out x.csv => it is a folder; give the name of a file",
    "decode --network n.json/a --data readings.csv --out x.csv => a part of the path is a file, not a folder",
    "decode --network data.csv --data readings.csv --out x.csv => not a network file",
    "decode --network n.json --data none.csv --out x.csv => cannot open 'none.csv'",
    "decode --network n.json --data late.csv --out x.csv => 'late.csv': line 3001, column 1",
    "decode --network recording.json --data none.csv --out x.csv => none.csv",
    "decode --network n.json --follow --fault-noise 1e-3 --data none.csv => cannot open 'none.csv'",
    "decode --network n.json --follow --fault-noise 1e-3 --data none.csv:1 => cannot open 'none.csv:1'",
    "decode --network n.json --follow --fault-noise 1e-3 --data COMPARISON.csv => cannot open 'COMPARISON.csv'",
    "decode --network n.json --follow --fault-noise 1e-3 --data /dev/no-such-tty:9600 => there is no device '/dev/no-such-tty'",
    "decode --network n.json --follow --fault-noise 1e-3 --data tcp:127.0.0.1:1 => cannot connect to 'tcp:127.0.0.1:1': Connection refused; check that the sender listens there",
    "export --network none.json --format numpy --out x => none.json",
    "export --network n.json --format onnx --out runs => is there already",
    "export --network n.json --format onnx --out none/b => does not exist",
    "calibrate --data none.csv --inputs a --targets b --row-wire c => none.csv",
    "calibrate --sensor none.json @frames => none.json",
    "fine-tune --network none.json @frames --out x.json => none.json",
    "trade --data none.csv --inputs a --targets b => none.csv",
    "sweep --spec none.json --out x => cannot read 'none.json'",
    "sweep --merge none --out x.csv => none",
    "reproduce --table 1 --out data.csv => cannot create the folder 'data.csv'",
];

#[test]
fn every_call_that_cannot_work_ends_with_a_status_and_one_line() {
    let prepared = prepared();
    let folder = prepared.path();
    for arguments in [
        "train @array --decoder mean --checkpoint begun.json",
        "train @recording --hidden 2 --epochs 1 --checkpoint recorded.json",
    ] {
        success(&in_full(arguments), folder);
    }
    let begun = fs::read(folder.join("begun.json")).unwrap();
    fs::write(folder.join("torn.json"), &begun[..begun.len() / 2]).unwrap();
    let row = ["600"; 6].join(",");
    let late = format!("{}NaN{}\n", format!("{row}\n").repeat(3000), &row[3..]);
    fs::write(folder.join("late.csv"), late).unwrap();
    let fixed = folder.join("fixed.json");
    fs::write(&fixed, "old").unwrap();
    let mut permissions = fs::metadata(&fixed).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&fixed, permissions).unwrap();
    let before = names(folder);
    let cases = |cases: &[&'static str], status| {
        let case = |case: &&'static str| case.split_once(" => ").unwrap();
        Vec::from_iter(
            cases
                .iter()
                .map(case)
                .map(|(arguments, words)| (arguments.to_owned(), words, status)),
        )
    };
    let options = Vec::from_iter(OF_CHECKPOINTS.split_whitespace());
    let of_checkpoints = options.chunks(2).map(|option| {
        let arguments = format!("train --checkpoint recorded.json --resume {}", option.join(" "));
        (arguments, option[0], 2)
    });
    let mut wrong = Vec::new();
    for (arguments, words, status) in [cases(INVALID, 2), cases(UNUSABLE, 1), of_checkpoints.collect()].concat() {
        let output = decoupler(&in_full(&arguments), folder);
        let message = String::from_utf8(output.stderr).unwrap();
        // For a large run an estimate is printed first, if the machine has enough memory.
        let last = message.lines().last().unwrap_or_default();
        let is_one = message.lines().filter(|line| line.starts_with("error: ")).count() == 1;
        let is_plain = is_one && last.starts_with("error: ") && last.len() < 500 && !last.contains("os error");
        if output.status.code() != Some(status) || !output.stdout.is_empty() || !is_plain || !last.contains(words) {
            wrong.push(format!("{arguments} => {words}: {:?}, {message}", output.status));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(names(folder), before);
    assert_eq!(fs::read(folder.join("begun.json")).unwrap(), begun);
    assert_eq!(fs::read(&fixed).unwrap(), b"old");
    let long = format!("train --out {}", "n".repeat(300));
    refused(&long, folder, 1, "the name is too long");
}

/// The causes are tested in the core for every method.
#[test]
fn an_untrained_network_is_reported_with_cause_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let small = "train --array 2x3_2x9 --samples 40 --set test-samples=10 --hidden 2 --decoder mean --epochs 30";
    for (settings, cause, cure) in [
        (
            "--method gd --set learning-rate=1e300",
            "diverged in epoch 1",
            "learning rate to 0.01 (now 1e300)",
        ),
        (
            "--method lm --set goal=1e9",
            "no better than its random start after 0 epochs (goal reached)",
            "set a lower goal",
        ),
    ] {
        let message = said(&format!("{small} {settings}"), folder.path());
        let is_cause = |line: &str| line.starts_with("warning: ") && line.contains(cause) && line.contains(cure);
        assert!(message.lines().any(is_cause), "{message}");
    }
    assert!(!success(&format!("{small} --set validation-samples=0"), folder.path()).contains("random start"));
}
