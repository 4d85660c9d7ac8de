//! Files in the terminal: input is limited in size, output does not overwrite other files, and values that are not finite
//! are refused or explained.

use std::{
    fs::{self, File},
    io::Write,
};

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    calls::{both, has, json, read, refused, said, success, write},
    folders::names,
    terminal::decoupler,
};

const SMALL: &str =
    "--array 2x2_2x6 --samples 400 --set validation-samples=0 --set test-samples=10 --hidden 3 --epochs 5";

/// A folder with a network, `n.json`, and readings, `readings.csv`, that it can decode.
pub(crate) fn trained(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    success(
        &format!("train {SMALL} {scene} --decoder mean --out n.json"),
        folder.path(),
    );
    let simulate = format!("simulate --array 2x2_2x6 --samples 40 {scene} --seed 1 --out readings.csv");
    success(&simulate, folder.path());
    folder
}

#[cfg(unix)]
#[test]
fn an_input_is_never_overwritten_by_the_output() {
    let folder = trained("");
    let path = |name: &str| folder.path().join(name);
    std::os::unix::fs::symlink("readings.csv", path("link.csv")).unwrap();
    fs::hard_link(path("n.json"), path("hard.json")).unwrap();
    let contents = || ["readings.csv", "n.json"].map(|name| fs::read(path(name)).unwrap());
    let before = contents();
    for output in ["readings.csv", "./readings.csv", "link.csv", "n.json", "hard.json"] {
        let decode = format!("decode --network n.json --data readings.csv --out {output}");
        refused(&decode, folder.path(), 2, "same file");
        assert_eq!(contents(), before, "{output}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn endless_input_is_refused_at_a_stated_limit() {
    let folder = trained("");
    write(folder.path(), "line.csv", vec![b'1'; 3 << 20]);
    write(folder.path(), "blank.csv", vec![b'\n'; 3 << 20]);
    // A sparse file that begins like a valid one: it needs little space on disk.
    let mut file = File::create(folder.path().join("endless.json")).unwrap();
    file.write_all(b"{\"format\":\"decoupler network\",\"program\":\"")
        .unwrap();
    file.set_len(1 << 40).unwrap();
    let decode = |network: &str, data: &str| format!("decode --network {network} --data {data} --out out.csv");
    for (arguments, words) in [
        (decode("n.json", "line.csv"), "line 1: no row ends within 1 MiB"),
        (decode("n.json", "/dev/zero"), "line 1: no row ends within 1 MiB"),
        (decode("n.json", "blank.csv"), "no row ends within 1 MiB"),
        (decode("n.json", "/dev/urandom"), ""),
        (decode("/dev/zero", "readings.csv"), "is not a network file"),
        (decode("/dev/urandom", "readings.csv"), "is not a network file"),
        (decode("endless.json", "readings.csv"), "GiB"),
        (
            "train --checkpoint /dev/zero --resume".to_owned(),
            "is not a checkpoint",
        ),
        (
            "train --checkpoint /dev/urandom --resume".to_owned(),
            "is not a checkpoint",
        ),
    ] {
        refused(&arguments, folder.path(), 1, words);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn figures_are_printed_even_if_the_network_cannot_be_saved() {
    let folder = tempfile::tempdir().unwrap();
    for json in ["", "--json"] {
        let output = decoupler(
            &format!("train {SMALL} --decoder mean --out /dev/full {json}"),
            folder.path(),
        );
        let [figures, message] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        assert_eq!(output.status.code(), Some(1), "{message}");
        has(&figures, &["network", "mean"]);
        has(&message, &["\nerror: cannot write '/dev/full'"]);
    }
}

#[test]
fn only_what_a_killed_program_left_is_removed_by_the_next() {
    let folder = trained("");
    let path = |name: &str| folder.path().join(name);
    for (command, is_folder) in [
        ("simulate --array 2x2_2x6 --samples 2 --out new", false),
        ("export --network n.json --format onnx --out new", true),
    ] {
        for name in [
            ".decoupler-abc123.part",
            ".decoupler-atwork.part",
            ".decoupler-notes",
            ".other-abc123.part",
        ] {
            if is_folder {
                fs::create_dir(path(name)).unwrap();
                fs::write(path(name).join("network.onnx"), "half").unwrap();
            } else {
                fs::write(path(name), "half").unwrap();
            }
        }
        let at_work = File::open(path(".decoupler-atwork.part")).unwrap();
        at_work.lock().unwrap();
        success(command, folder.path());
        let stay = [".decoupler-atwork.part", ".decoupler-notes", ".other-abc123.part"];
        assert_eq!(
            names(folder.path()),
            [&stay[..], &["n.json", "new", "readings.csv"]].concat()
        );
        for name in [&stay[..], &["new"]].concat() {
            let _ = fs::remove_file(path(name));
            let _ = fs::remove_dir_all(path(name));
        }
    }
}

#[test]
fn readings_outside_the_training_range_are_flagged_by_line() {
    for scene in ["", "--rows known --inputs conductance --scaling whiten", "--inputs log"] {
        let folder = trained(scene);
        let folder = folder.path();
        let decode = |input: &str| format!("decode --network n.json --data {input} --out out.csv");
        let flags = || {
            let text = read(folder, "out.csv");
            assert!(
                text.lines()
                    .next()
                    .unwrap()
                    .ends_with(",readings_outside,coordinates_outside")
            );
            let flag = |line: &str| line.rsplit(',').nth(1).unwrap().to_owned();
            Vec::from_iter(text.lines().skip(1).map(flag))
        };
        // Readings of the same scene are within the range.
        assert_eq!(said(&decode("readings.csv"), folder), "", "{scene}");
        assert!(flags().iter().all(|flag| flag == "0"), "{scene}");
        let readings = read(folder, "readings.csv");
        let lines = Vec::from_iter(readings.lines());
        let with = |value: &str| {
            let mut fields = Vec::from_iter(lines[3].split(','));
            fields[6] = value;
            let changed = fields.join(",");
            let lines = lines
                .iter()
                .enumerate()
                .map(|(line, text)| if line == 3 { &changed } else { *text });
            write(folder, "odd.csv", Vec::from_iter(lines).join("\n"));
        };
        for value in ["1e300", "1e-300", "1e4"] {
            with(value);
            let output = decoupler(&decode("odd.csv"), folder);
            let message = String::from_utf8(output.stderr).unwrap();
            has(&message, &["line 4", "training"]);
            assert!(message.lines().count() < 15, "{scene}, {value}: {message}");
            if output.status.success() {
                has(&message, &["r_5"]);
                assert_eq!(flags()[2], "1", "{scene}, {value}");
            } else {
                // So far outside that the output of the network is not finite.
                assert_eq!((output.status.code(), value), (Some(1), "1e-300"), "{scene}: {message}");
            }
        }
        for value in ["0", "-1", "NaN", "inf"] {
            with(value);
            refused(&decode("odd.csv"), folder, 1, "line 4, column 7");
        }
    }
}

#[test]
fn overflow_in_single_precision_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = format!("train {SMALL} --set noise-ohm=1e39 --decoder network --json");
    let (printed, message) = both(&arguments, folder.path());
    has(&message, &["Network f32: ", "single precision"]);
    let report: Value = serde_json::from_str(&printed).unwrap();
    let [single, double] = ["network_f32", "network"].map(|name| &report["decoders"][name]);
    assert_eq!(single["z_percent"], Value::Null);
    has(single["remarks"][0].as_str().unwrap(), &["single precision"]);
    assert!(!double["remarks"].to_string().contains("single precision"));
}

#[test]
fn a_report_with_json_has_the_same_figures_and_the_command_that_repeats_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let printed = json(
        &format!("train {SMALL} --seed 3 --decoder ridge --json --report r.html"),
        folder.path(),
    );
    let html = read(folder.path(), "r.html");
    for value in [
        &printed["errors"]["z_percent"],
        &printed["errors"]["worst_mm"],
        &printed["baselines"]["mean"]["z_mm"],
        &printed["decoders"]["ridge"]["residual"],
    ] {
        let rounded = decoupler_files::export::format_number(value.as_f64().unwrap());
        has(&html, &[&format!("<td>{rounded}</td>")]);
    }
    let (_, command) = html.split_once("<pre>decoupler ").unwrap();
    let (command, _) = command.split_once("</pre>").unwrap();
    let again = json(&format!("{command} --decoder ridge --json"), folder.path());
    assert_eq!(again["errors"], printed["errors"]);
}
