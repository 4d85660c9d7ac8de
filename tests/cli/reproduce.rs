//! `decoupler reproduce`: the paper's tables in the terminal.

use std::fs;

use decoupler_core::sensor::ArrayScale;
use serde_json::Value;

use crate::terminal::decoupler;

#[test]
fn the_terminal_prints_every_cell_next_to_the_published_figures() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        "reproduce --seeds 2 --epochs 3 --starts 1 --folds 3 --repeats 2 --hidden 6,7 --out tables/new --json";
    let output = decoupler(arguments, folder.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let tables = report["tables"].as_array().unwrap();
    let published: Vec<Vec<_>> = tables
        .iter()
        .map(|table| {
            let cells = table["cells"].as_array().unwrap();
            for z in cells.iter().map(|cell| &cell["z_percent"]) {
                let [min, median, max] = ["min", "median", "max"].map(|name| z[name].as_f64().unwrap());
                assert!(min <= median && median <= max);
            }
            cells
                .iter()
                .map(|cell| cell["z_percent"]["published"].as_f64())
                .collect()
        })
        .collect();
    assert_eq!(
        published,
        [
            vec![Some(3.57), None],
            vec![Some(2.01), Some(3.35)],
            vec![Some(1.41), Some(1.63), Some(2.28)]
        ]
    );
    assert_eq!(
        tables[1]["cells"][0]["z_percent"]["values"].as_array().unwrap().len(),
        4
    );
    for number in 1..=3 {
        let file = |name: &str| fs::read_to_string(folder.path().join("tables/new").join(name)).unwrap();
        let cells = tables[number - 1]["cells"].as_array().unwrap();
        let csv = file(&format!("table_{number}.csv"));
        assert_eq!(csv.lines().count(), 1 + cells.len());
        let [heading, first] = [0, 1].map(|line| csv.lines().nth(line).unwrap().split(',').collect::<Vec<_>>());
        let column = heading.iter().position(|name| *name == "z_percent_median").unwrap();
        assert_eq!(first[column].parse().ok(), cells[0]["z_percent"]["median"].as_f64());
        let trials: u64 = cells.iter().map(|cell| cell["trials"].as_u64().unwrap()).sum();
        assert_eq!(
            file(&format!("table_{number}_trials.csv")).lines().count() as u64,
            1 + trials
        );
        assert!(file(&format!("table_{number}.md")).contains("| Z % publ. |"));
        assert!(file(&format!("table_{number}.svg")).contains("published"));
        let png = fs::read(folder.path().join(format!("tables/new/table_{number}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
    }
}

#[test]
fn smaller_arrays_are_decoupled_better() {
    let folder = tempfile::tempdir().unwrap();
    let output = decoupler(
        "reproduce --table 3 --seeds 1 --epochs 60 --starts 1 --json",
        folder.path(),
    );
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let cells = report["tables"][0]["cells"].as_array().unwrap();
    let errors: Vec<f64> = cells
        .iter()
        .map(|cell| cell["z_percent"]["median"].as_f64().unwrap())
        .collect();
    assert!(errors.is_sorted(), "{errors:?}");
    let first = &cells[0];
    assert_eq!(first["array"], ArrayScale::PRESETS[0].to_string());
}

#[test]
fn invalid_reproductions_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    let cases = [
        ("--table 4", 2, "possible values: 1, 2, 3, all"),
        ("--hidden 6,0", 2, "'0' for '--hidden"),
        ("--arrays 10x6", 2, "not an array scale"),
        ("--seeds 0", 2, "from 1"),
        ("--folds 11 --fold-unit snapshot", 2, "11 folds of 10 snapshots"),
        ("--out file", 1, "cannot create the folder 'file'"),
    ];
    for (arguments, status, expected) in cases {
        let output = decoupler(&format!("reproduce {arguments}"), folder.path());
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(status), "{arguments}: {text}");
        assert!(
            text.contains(expected) && text.lines().count() == 1,
            "{arguments}: {text}"
        );
        assert!(output.stdout.is_empty());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_that_cannot_be_written_affects_neither_the_report_nor_the_other_files() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("table_1.csv")).unwrap();
    let arguments = "reproduce --table 1 --seeds 1 --epochs 2 --starts 1 --hidden 6 --out .";
    for json in ["", " --json"] {
        let output = decoupler(&format!("{arguments}{json}"), folder.path());
        let [report, message] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(report.contains("Table 1") || report.contains("\"table\":1"), "{report}");
        assert!(
            message.contains("table_1.csv") && message.contains("disk is full"),
            "{message}"
        );
        for name in ["table_1_trials.csv", "table_1.md", "table_1.svg", "table_1.png"] {
            let path = folder.path().join(name);
            assert!(fs::metadata(&path).is_ok_and(|file| file.len() > 0), "{name}");
            fs::remove_file(path).unwrap();
        }
    }
}
