//! Files in the terminal: input is limited in size, output does not overwrite other files, and values that are not finite
//! are refused or explained.

use std::{
    fs::{self, File},
    io::Write,
    path::Path,
};

use serde_json::Value;
use tempfile::TempDir;

use crate::{folders::names, terminal::decoupler};

const SMALL: &str =
    "--array 2x2_2x6 --samples 400 --set validation-samples=0 --set test-samples=10 --hidden 3 --epochs 5";

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Standard error of a call that must fail with `status` in one line.
fn failure(arguments: &str, folder: &Path, status: i32) -> String {
    let output = decoupler(arguments, folder);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{arguments}: {message}");
    assert_eq!(message.lines().count(), 1, "{arguments}: {message}");
    assert!(message.len() < 1000, "{arguments}: {message}");
    message
}

/// A folder with a network, `n.json`, and readings, `readings.csv`, that it can decode.
fn trained(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        format!("train {SMALL} {scene} --decoder mean --out n.json"),
        format!("simulate --array 2x2_2x6 --samples 40 {scene} --seed 1 --out readings.csv"),
    ] {
        let output = decoupler(&arguments, folder.path());
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    folder
}

#[cfg(unix)]
#[test]
fn an_input_is_never_overwritten_by_the_output() {
    let folder = trained("");
    let path = |name: &str| folder.path().join(name);
    std::os::unix::fs::symlink("readings.csv", path("link.csv")).unwrap();
    std::os::unix::fs::symlink("n.json", path("link.json")).unwrap();
    fs::hard_link(path("readings.csv"), path("hard.csv")).unwrap();
    fs::hard_link(path("n.json"), path("hard.json")).unwrap();
    let before = [
        fs::read(path("readings.csv")).unwrap(),
        fs::read(path("n.json")).unwrap(),
    ];
    let outputs = [
        "readings.csv",
        "./readings.csv",
        "link.csv",
        "hard.csv",
        "n.json",
        "./n.json",
        "link.json",
        "hard.json",
    ];
    for output in outputs {
        let message = failure(
            &format!("decode --network n.json --data readings.csv --out {output}"),
            folder.path(),
            2,
        );
        assert!(message.contains("same file"), "{output}: {message}");
        assert_eq!(fs::read(path("readings.csv")).unwrap(), before[0], "{output}");
        assert_eq!(fs::read(path("n.json")).unwrap(), before[1], "{output}");
    }
    let copied = decoupler(
        "decode --network n.json --data readings.csv --out new.csv",
        folder.path(),
    );
    assert!(copied.status.success());
}

#[cfg(target_os = "linux")]
#[test]
fn endless_input_is_refused_at_a_stated_limit() {
    let folder = trained("");
    let mut line = vec![b'1'; 3 << 20];
    fs::write(folder.path().join("line.csv"), &line).unwrap();
    line.fill(b'\n');
    fs::write(folder.path().join("blank.csv"), &line).unwrap();
    for (input, expected) in [
        ("line.csv", "line 1: no row ends within 1 MiB"),
        ("/dev/zero", "line 1: no row ends within 1 MiB"),
        ("blank.csv", "no row ends within 1 MiB"),
        ("/dev/urandom", "error: "),
    ] {
        let message = failure(
            &format!("decode --network n.json --data {input} --out out.csv"),
            folder.path(),
            1,
        );
        assert!(message.contains(expected), "{input}: {message}");
    }
    for endless in ["/dev/zero", "/dev/urandom"] {
        let message = failure(
            &format!("decode --network {endless} --data readings.csv --out out.csv"),
            folder.path(),
            1,
        );
        assert!(message.contains("is not a network file"), "{endless}: {message}");
        let message = failure(&format!("train --checkpoint {endless} --resume"), folder.path(), 1);
        assert!(message.contains("is not a checkpoint"), "{endless}: {message}");
    }
    // A sparse file that begins like a valid one: it needs little space on disk.
    let mut file = File::create(folder.path().join("endless.json")).unwrap();
    file.write_all(b"{\"format\":\"decoupler network\",\"program\":\"")
        .unwrap();
    file.set_len(1 << 40).unwrap();
    let message = failure(
        "decode --network endless.json --data readings.csv --out out.csv",
        folder.path(),
        1,
    );
    assert!(message.contains("GiB"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn figures_are_printed_even_if_the_network_cannot_be_saved() {
    let folder = tempfile::tempdir().unwrap();
    for json in ["", "--json"] {
        let arguments = format!("train {SMALL} --decoder mean --out /dev/full {json}");
        let output = decoupler(&arguments, folder.path());
        let (figures, message) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(figures.contains("network") && figures.contains("mean"), "{figures}");
        assert!(message.contains("\nerror: cannot write '/dev/full'"), "{message}");
    }
}

#[cfg(unix)]
#[test]
fn a_link_to_a_missing_file_stays_and_its_target_is_written() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("data")).unwrap();
    let link = folder.path().join("link.csv");
    std::os::unix::fs::symlink("data/new.csv", &link).unwrap();
    let output = decoupler("simulate --array 2x2_2x6 --samples 2 --out link.csv", folder.path());
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(link.symlink_metadata().unwrap().is_symlink());
    let written = fs::read_to_string(folder.path().join("data/new.csv")).unwrap();
    assert_eq!(written.lines().count(), 3);
    let astray = folder.path().join("astray.csv");
    std::os::unix::fs::symlink("missing/new.csv", &astray).unwrap();
    let message = failure(
        "simulate --array 2x2_2x6 --samples 2 --out astray.csv",
        folder.path(),
        1,
    );
    assert!(message.contains("does not exist"), "{message}");
    assert!(astray.symlink_metadata().unwrap().is_symlink());
}

#[test]
fn only_files_left_by_a_killed_program_are_removed_by_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let at_work = File::create(path(".decoupler-atwork.part")).unwrap();
    at_work.lock().unwrap();
    for name in [
        ".decoupler-abc123.part",
        ".decoupler-notes.txt",
        ".other-abc123.part",
        "decoupler-abc123.part",
    ] {
        fs::write(path(name), "half").unwrap();
    }
    let output = decoupler("simulate --array 2x2_2x6 --samples 2 --out new.csv", folder.path());
    assert!(output.status.success());
    let expected = [
        ".decoupler-atwork.part",
        ".decoupler-notes.txt",
        ".other-abc123.part",
        "decoupler-abc123.part",
        "new.csv",
    ];
    assert_eq!(names(folder.path()), expected);
}

#[test]
fn readings_outside_the_training_range_are_flagged_by_line() {
    for scene in ["", "--rows known --inputs conductance --scaling whiten", "--inputs log"] {
        let folder = trained(scene);
        let path = |name: &str| folder.path().join(name);
        let decode = |input: &str| {
            let output = decoupler(
                &format!("decode --network n.json --data {input} --out out.csv"),
                folder.path(),
            );
            let (message, decoded) = (text(&output.stderr), fs::read_to_string(path("out.csv")));
            if !output.status.success() {
                // So far outside that the output of the network is not finite.
                assert_eq!(output.status.code(), Some(1), "{scene}: {message}");
                return (message, None);
            }
            (message, Some(decoded.unwrap()))
        };
        let flags = |decoded: &str| -> Vec<String> {
            assert!(
                decoded
                    .lines()
                    .next()
                    .unwrap()
                    .ends_with(",readings_outside,coordinates_outside"),
                "{decoded}"
            );
            let lines = decoded.lines().skip(1);
            lines.map(|line| line.rsplit(',').nth(1).unwrap().to_owned()).collect()
        };
        // Readings of the same scene are within the range.
        let (message, decoded) = decode("readings.csv");
        assert_eq!(message, "", "{scene}");
        assert!(flags(&decoded.unwrap()).iter().all(|flag| flag == "0"), "{scene}");
        let lines: Vec<String> = fs::read_to_string(path("readings.csv"))
            .unwrap()
            .lines()
            .map(str::to_owned)
            .collect();
        let with = |line: usize, column: usize, value: &str| {
            let mut fields: Vec<&str> = lines[line].split(',').collect();
            fields[column] = value;
            fields.join(",")
        };
        for value in ["1e300", "1e-300", "1e4"] {
            let mut changed = lines.clone();
            changed[3] = with(3, 2 + 4, value);
            fs::write(path("odd.csv"), changed.join("\n")).unwrap();
            let (message, decoded) = decode("odd.csv");
            assert!(message.contains("line 4"), "{scene}, {value}: {message}");
            assert!(message.contains("training"), "{scene}, {value}: {message}");
            assert!(message.lines().count() < 15, "{scene}, {value}: {message}");
            assert!(decoded.is_some() || value == "1e-300", "{scene}, {value}: {message}");
            if let Some(decoded) = decoded {
                assert!(message.contains("r_5"), "{scene}, {value}: {message}");
                assert_eq!(flags(&decoded)[2], "1", "{scene}, {value}");
            }
        }
        for value in ["0", "-1", "NaN", "inf"] {
            let mut changed = lines.clone();
            changed[3] = with(3, 2 + 4, value);
            fs::write(path("odd.csv"), changed.join("\n")).unwrap();
            let message = failure(
                "decode --network n.json --data odd.csv --out out2.csv",
                folder.path(),
                1,
            );
            assert!(message.contains("line 4, column 7"), "{scene}, {value}: {message}");
        }
    }
}

#[test]
fn infinite_noise_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        "simulate --array 2x2_2x6 --samples 40 --set noise-ohm=1e308 --out out.csv".to_owned(),
        format!("train {SMALL} --set noise-ohm=1e308 --decoder mean"),
    ] {
        let message = failure(&arguments, folder.path(), 2);
        assert!(
            message.contains("additive noise") && message.contains("from 0 to 1e150"),
            "{message}"
        );
    }
    assert!(!folder.path().join("out.csv").exists());
}

#[test]
fn overflow_in_single_precision_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = format!("train {SMALL} --set noise-ohm=1e39 --decoder network");
    let output = decoupler(&arguments, folder.path());
    let figures = text(&output.stderr);
    assert!(
        figures.contains("Network f32: ") && figures.contains("single precision"),
        "{figures}"
    );
    let output = decoupler(&format!("{arguments} --json"), folder.path());
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let single = &report["decoders"]["network_f32"];
    assert_eq!(single["z_percent"], Value::Null);
    assert!(
        single["remarks"][0].as_str().unwrap().contains("single precision"),
        "{single}"
    );
    let double = report["decoders"]["network"]["remarks"].as_array().unwrap();
    let words = "single precision";
    assert!(double.iter().all(|remark| !remark.as_str().unwrap().contains(words)));
}

#[test]
fn a_report_with_json_has_the_same_figures_and_needs_its_own_path() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = format!("train {SMALL} --seed 3 --decoder ridge --json --report r.html");
    let output = decoupler(&arguments, folder.path());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    let html = fs::read_to_string(folder.path().join("r.html")).unwrap();
    for value in [
        &printed["errors"]["z_percent"],
        &printed["errors"]["worst_mm"],
        &printed["baselines"]["mean"]["z_mm"],
        &printed["decoders"]["ridge"]["residual"],
    ] {
        let rounded = decoupler_files::export::format_number(value.as_f64().unwrap());
        assert!(html.contains(&format!("<td>{rounded}</td>")), "{value}");
    }
    // The command in it repeats the run.
    let (_, command) = html.split_once("<pre>decoupler ").unwrap();
    let (command, _) = command.split_once("</pre>").unwrap();
    let again = decoupler(&format!("{command} --decoder ridge --json"), folder.path());
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(again["errors"], printed["errors"]);

    let message = failure(
        &format!("train {SMALL} --out r.html --report ./r.html"),
        folder.path(),
        2,
    );
    assert!(message.contains("--out and --report name the same file"), "{message}");
    assert_eq!(fs::read_to_string(folder.path().join("r.html")).unwrap(), html);
    let message = failure(&format!("train {SMALL} --report none/r.html"), folder.path(), 1);
    assert!(message.contains("does not exist"), "{message}");
}
