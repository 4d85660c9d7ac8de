//! Every reader of tables: the same table has the same numbers in every format, and hostile names are harmless.
//! Damage, false claims and any bytes are the subject of `damage`, and of the suites `hostile` and `fuzz`.

use std::{
    fs,
    io::{Cursor, Write},
    ops::ControlFlow,
    path::Path,
};

use decoupler_files::import::{DialectChoice, Recipe, Table, read_table};
use zip::{ZipWriter, write::SimpleFileOptions};

fn read(path: &Path) -> Result<Table, String> {
    let read = read_table(path, DialectChoice::default(), &mut |_| ControlFlow::Continue(()));
    read.map_err(|error| error.to_string())
}

/// Numbers of the columns whose names contain `name`.
fn numbers(table: &Table, name: &str) -> Vec<Vec<f64>> {
    let columns = table.columns.iter().filter(|column| column.name.contains(name));
    columns.map(|column| column.numbers.clone()).collect()
}

/// Row r, column c is r + c / 4, as in the fixtures: exact in every type.
fn cell(row: usize, column: usize) -> f64 {
    row as f64 + column as f64 / 4.0
}

fn expected() -> Vec<Vec<f64>> {
    (0..3)
        .map(|column| (0..5).map(|row| cell(row, column)).collect())
        .collect()
}

/// The table as text: rows of cells with a separator, a decimal separator, and the end of a line.
fn text(header: &str, separator: &str, decimal: &str, line_end: &str) -> String {
    let row = |row: usize| {
        let cells = (0..3).map(|column| cell(row, column).to_string().replace('.', decimal));
        Vec::from_iter(cells).join(separator)
    };
    let names = ["x1", "x2", "x3"].join(separator);
    let first = (!header.is_empty()).then(|| names.replace('x', header));
    let lines = first.into_iter().chain((0..5).map(row));
    lines.map(|line| line + line_end).collect()
}

fn utf16(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    text.encode_utf16().flat_map(unit).collect()
}

#[test]
fn a_table_has_the_same_numbers_in_every_layout_of_text() {
    let folder = tempfile::tempdir().unwrap();
    let plain = text("x", ",", ".", "\n");
    let cases: [(&str, Vec<u8>); 16] = [
        ("commas", plain.clone().into()),
        ("no header", text("", ",", ".", "\n").into()),
        ("semicolons and decimal commas", text("x", ";", ",", "\n").into()),
        ("tabs", text("x", "\t", ".", "\n").into()),
        ("tabs and decimal commas", text("x", "\t", ",", "\n").into()),
        ("bars", text("x", "|", ".", "\n").into()),
        ("spaces", text("x", "   ", ".", "\n").into()),
        ("CR LF", text("x", ",", ".", "\r\n").into()),
        ("CR", text("x", ",", ".", "\r").into()),
        ("a separator at the end of each row", text("x", ",", ".", ",\n").into()),
        (
            "quotes",
            plain.replace("1.25", "\"1.25\"").replace("x2", "\"x2\"").into(),
        ),
        ("blank lines", plain.replace('\n', "\n\n").into()),
        ("a byte-order mark", format!("\u{feff}{plain}").into()),
        ("a sep= line", format!("sep=;\n{}", text("x", ";", ".", "\n")).into()),
        ("Latin-1", [&b"\xb5"[..], text("x", ",", ".", "\n").as_bytes()].concat()),
        ("no end of the last line", plain.trim_end().into()),
    ];
    let wide = [
        ("UTF-16, little-endian", utf16(&plain, u16::to_le_bytes)),
        ("UTF-16, big-endian", utf16(&plain, u16::to_be_bytes)),
        (
            "UTF-16 with a byte-order mark",
            utf16(&format!("\u{feff}{plain}"), u16::to_le_bytes),
        ),
    ];
    for (layout, bytes) in cases.into_iter().chain(wide) {
        let path = folder.path().join("table.csv");
        fs::write(&path, bytes).unwrap();
        let table = read(&path).unwrap();
        assert_eq!(numbers(&table, ""), expected(), "{layout}: {:?}", table.format);
    }
}

/// The fixtures are written by NumPy, SciPy, openpyxl and odfpy.
#[test]
fn a_table_has_the_same_numbers_in_every_format() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import");
    for (name, column) in [
        ("f8.npy", "c"),
        ("f4_columns_big.npy", "c"),
        ("plain.npz", "x.c"),
        ("deflated.npz", "x.c"),
        ("plain.mat", "x.c"),
        ("deflated.mat", "x.c"),
    ] {
        let table = read(&fixtures.join(name)).unwrap();
        assert_eq!(numbers(&table, column), expected(), "{name}");
    }
    // The same press in two spreadsheets: samples, units and lines.
    let import = |name: &str| {
        let recipe = Recipe {
            data: fixtures.join(name),
            inputs: vec!["r1".to_owned()],
            targets: vec!["force".to_owned()],
            time: Some("time".to_owned()),
            ..Recipe::default()
        };
        recipe
            .import(Path::new(""), &mut |_| ControlFlow::Continue(()))
            .unwrap()
    };
    let (one, other) = (import("press.xlsx"), import("press.ods"));
    assert_eq!(one.set.readings(), other.set.readings());
    assert!(
        (&one.set.targets() - &other.set.targets())
            .iter()
            .all(|error| error.abs() < 1e-14)
    );
    assert_eq!(
        (&one.problem.inputs, &one.lines, &one.times),
        (&other.problem.inputs, &other.lines, &other.times)
    );
}

fn npy(numbers: &[f64]) -> Vec<u8> {
    let header = format!(
        "{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}\n",
        numbers.len()
    );
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    bytes
}

#[test]
fn names_of_entries_are_shown_without_control_characters_and_are_no_paths() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("names.npz");
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let entries = [
        "../../escaped.npy",
        "/rooted.npy",
        "\u{1b}[2Jred.npy",
        "a\u{202e}b.npy",
        "\u{7}note.txt",
    ];
    for name in entries {
        archive.start_file(name, SimpleFileOptions::default()).unwrap();
        archive.write_all(&npy(&[1.0, 2.0, 3.0])).unwrap();
    }
    fs::write(&path, archive.finish().unwrap().into_inner()).unwrap();
    let table = read(&path).unwrap();
    assert_eq!((table.columns.len(), table.rows), (4, 3));
    let names = table.columns.iter().map(|column| &column.name);
    for text in names.chain(&table.notes) {
        assert!(!text.contains(|c: char| c.is_control() || c == '\u{202e}'), "{text:?}");
    }
    let left = Vec::from_iter(
        fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name()),
    );
    assert_eq!(left, ["names.npz"]);
}
