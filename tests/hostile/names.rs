//! Names made to harm: of columns, entries and files.

use std::fs;

use crate::limited;

/// Drives the terminal, is ill-formed XML, is a formula, or is very long.
fn names() -> [String; 5] {
    [
        "\u{1b}[31mred\u{1b}[0m".to_owned(),
        "a\u{1}b\u{9b}c\u{202e}d".to_owned(),
        "=HYPERLINK(1)".to_owned(),
        "x".repeat(100_000),
        "ü".repeat(70_000),
    ]
}

fn has_control(text: &str) -> bool {
    text.contains(|c: char| (c.is_control() && !"\n\t".contains(c)) || c == '\u{202e}')
}

#[test]
fn names_in_headers_are_printed_without_control_characters_and_cut() {
    let folder = tempfile::tempdir().unwrap();
    let header = names().join(",");
    let rows: String = (0..20).map(|row| format!("{row},{row}.5,1,2,{row}\n")).collect();
    fs::write(folder.path().join("data.csv"), format!("{header}\n{rows}")).unwrap();
    for arguments in [
        &["inspect", "--data", "data.csv"][..],
        &["inspect", "--data", "data.csv", "--json"],
        // An unknown column: the message lists the others.
        &["train", "--data", "data.csv", "--inputs", "none", "--targets", "c1"],
    ] {
        let output = limited(arguments, folder.path());
        assert!(
            output.status.code().is_some_and(|code| code < 3),
            "{arguments:?}: {output:?}"
        );
        for text in [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)) {
            assert!(!has_control(&text), "{arguments:?}: {text:?}");
            // The JSON on one line has the beginnings of the originals, too.
            assert!(text.lines().all(|line| line.len() < 10_000), "{arguments:?}");
        }
    }
}

#[test]
fn names_of_files_are_printed_without_control_characters() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["\u{1b}[2Jwiped.csv", "a\rb\u{8}c.csv"] {
        fs::write(folder.path().join(name), "a,b\n1,2\n3,4\n5,x\n").unwrap();
        for arguments in [
            &["inspect", "--data", name][..],
            &["train", "--data", name, "--inputs", "a", "--targets", "b"],
            &["decode", "--network", name, "--data", name, "--out", "out.csv"],
        ] {
            let output = limited(arguments, folder.path());
            for text in [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)) {
                assert!(!has_control(&text), "{arguments:?}: {text:?}");
            }
        }
    }
}

#[test]
fn the_original_of_a_changed_name_is_kept_and_finds_its_column() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..40).map(|row| format!("{row},{}\n", 2 * row)).collect();
    fs::write(
        folder.path().join("data.csv"),
        format!("u\u{7}1,for\u{1b}ce (N)\n{rows}"),
    )
    .unwrap();
    let run = |arguments: &[&str]| {
        let output = limited(arguments, folder.path());
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let inspected = run(&["inspect", "--data", "data.csv"]);
    assert!(inspected.contains("in the file: u\\u{7}1"), "{inspected}");
    let columns = ["--inputs", "u\u{7}1", "--targets", "for\u{1b}ce"];
    let small = [
        "--hidden",
        "2",
        "--epochs",
        "1",
        "--decoder",
        "mean",
        "--intervals",
        "never",
    ];
    let train = [
        &["train", "--data", "data.csv", "--out", "n.json"][..],
        &columns,
        &small,
    ]
    .concat();
    run(&train);
    let text = fs::read_to_string(folder.path().join("n.json")).unwrap();
    for (name, original) in [("u 1", "u\\\\u{7}1"), ("for ce", "for\\\\u{1b}ce (N)")] {
        for wanted in [name, original].map(|text| format!("\"{text}\"")) {
            assert!(text.contains(&wanted), "{wanted} is missing");
        }
    }
    assert!(!has_control(&text), "{text}");
    run(&[
        "decode",
        "--network",
        "n.json",
        "--data",
        "data.csv",
        "--out",
        "out.csv",
    ]);
}
