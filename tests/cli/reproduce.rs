//! `decoupler reproduce`: the paper's tables in the terminal.

use std::fs;

use crate::{
    calls::{column, has, json, number, read},
    terminal::decoupler,
};
use decoupler_core::sensor::ArrayScale;

#[test]
fn the_terminal_prints_every_cell_next_to_the_published_figures() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        "reproduce --seeds 2 --epochs 3 --starts 1 --folds 3 --repeats 2 --hidden 6,7 --out tables/new --json";
    let report = json(arguments, folder.path());
    let tables = report["tables"].as_array().unwrap();
    let published: Vec<Vec<_>> = tables
        .iter()
        .map(|table| {
            let cells = table["cells"].as_array().unwrap();
            for z in cells.iter().map(|cell| &cell["z_percent"]) {
                let [min, median, max] = ["min", "median", "max"].map(|name| number(z, name));
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
    for (place, table) in (1..).zip(tables) {
        let file = |name: &str| read(&folder.path().join("tables/new"), &format!("table_{place}{name}"));
        let cells = table["cells"].as_array().unwrap();
        let medians = column(&file(".csv"), "z_percent_median");
        assert!(
            medians
                .into_iter()
                .eq(cells.iter().map(|cell| number(&cell["z_percent"], "median")))
        );
        let trials: u64 = cells.iter().map(|cell| cell["trials"].as_u64().unwrap()).sum();
        assert_eq!(file("_trials.csv").lines().count() as u64, 1 + trials);
        has(&file(".md"), &["| Z % publ. |"]);
        has(&file(".svg"), &["published"]);
        let png = fs::read(folder.path().join(format!("tables/new/table_{place}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
    }
}

#[test]
fn smaller_arrays_are_decoupled_better() {
    let folder = tempfile::tempdir().unwrap();
    let report = json(
        "reproduce --table 3 --seeds 1 --epochs 60 --starts 1 --json",
        folder.path(),
    );
    let cells = report["tables"][0]["cells"].as_array().unwrap();
    let errors = Vec::from_iter(cells.iter().map(|cell| number(&cell["z_percent"], "median")));
    assert!(errors.is_sorted(), "{errors:?}");
    assert_eq!(cells[0]["array"], ArrayScale::PRESETS[0].to_string());
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
