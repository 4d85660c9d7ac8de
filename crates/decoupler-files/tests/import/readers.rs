//! Every reader of tables: the same table has the same numbers in every format, and hostile names are harmless.
//! Damage, false claims and any bytes are the subject of `damage`, and of the suites `hostile` and `fuzz`.

use std::{
    fs,
    io::{Cursor, Write},
    path::Path,
};

use decoupler_files::import::Recipe;
use zip::{ZipWriter, write::SimpleFileOptions};

use crate::support::{column, fixture, folder, import, names, numbers, read, reading, recipe, target, words};

/// Row r, column c is r + c / 4, as in the fixtures: exact in every type.
fn cell(row: usize, column: usize) -> f64 {
    row as f64 + column as f64 / 4.0
}

fn expected() -> Vec<Vec<f64>> {
    let column = |column| (0..5).map(|row| cell(row, column)).collect();
    (0..3).map(column).collect()
}

/// The table as text: rows of cells with a separator, a decimal separator, and the end of a line.
fn text(separator: &str, decimal: &str, line_end: &str) -> String {
    let row = |row: usize| {
        let cells = (0..3).map(|column| cell(row, column).to_string().replace('.', decimal));
        Vec::from_iter(cells).join(separator)
    };
    let header = ["x1(µm)", "x2(µm)", "x3(µm)"].join(separator);
    let lines = std::iter::once(header).chain((0..5).map(row));
    lines.map(|line| line + line_end).collect()
}

fn utf16(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    text.encode_utf16().flat_map(unit).collect()
}

#[test]
fn a_table_has_the_same_numbers_in_every_layout_of_text() {
    let plain = text(",", ".", "\n");
    let with_mark = format!("\u{feff}{plain}");
    let layouts: [(&str, Vec<u8>); 20] = [
        ("commas", plain.clone().into()),
        ("no header", plain.split_once('\n').unwrap().1.into()),
        ("semicolons and decimal commas", text(";", ",", "\n").into()),
        ("tabs", text("\t", ".", "\n").into()),
        ("tabs and decimal commas", text("\t", ",", "\n").into()),
        ("bars", text("|", ".", "\n").into()),
        ("spaces", text("   ", ".", "\n").into()),
        ("indented", text("  ", ".", "\n").replace('\n', "\n ").trim_end().into()),
        ("CR LF", text(",", ".", "\r\n").into()),
        ("CR", text(",", ".", "\r").into()),
        ("a separator at the end of each row", text(",", ".", ",\n").into()),
        ("exponents", plain.replace("1.25", "125e-2").into()),
        (
            "quotes",
            plain
                .replace("1.25", "\"1.25\"")
                .replace("x2(µm)", "\"x2 [µm]\"")
                .into(),
        ),
        ("blank lines", plain.replace('\n', "\n\n").into()),
        ("a sep= line", format!("sep=;\n{}", text(";", ".", "\n")).into()),
        ("Latin-1", plain.chars().map(|letter| letter as u8).collect()),
        (
            "no end of the last line, a byte-order mark",
            with_mark.trim_end().into(),
        ),
        ("UTF-16, little-endian", utf16(&plain, u16::to_le_bytes)),
        ("UTF-16, big-endian", utf16(&plain, u16::to_be_bytes)),
        ("UTF-16 with a byte-order mark", utf16(&with_mark, u16::to_le_bytes)),
    ];
    let folder = folder(&[]);
    for (layout, bytes) in layouts {
        let path = folder.path().join("table.csv");
        fs::write(&path, bytes).unwrap();
        let table = read(&path).unwrap();
        assert_eq!(numbers(&table, ""), expected(), "{layout}: {:?}", table.format);
        if layout != "no header" {
            assert_eq!(names(&table), ["x1", "x2", "x3"], "{layout}");
            assert_eq!(table.columns[1].unit.as_deref(), Some("µm"), "{layout}");
        }
    }
}

/// The fixtures are written by NumPy, SciPy, openpyxl and odfpy.
#[test]
fn a_table_has_the_same_numbers_in_every_format() {
    for (name, columns, left_out) in [
        ("f8.npy", "c", &[][..]),
        ("f4_columns_big.npy", "c", &[]),
        ("plain.npz", "x.c", &["rate is one number"]),
        ("deflated.npz", "x.c", &[]),
        ("plain.mat", "x.c", &["who is text", "s.a is 1 × 1"]),
        ("deflated.mat", "x.c", &[]),
    ] {
        let table = read(&fixture(name)).unwrap();
        assert_eq!(numbers(&table, columns), expected(), "{name}");
        if columns == "x.c" {
            assert_eq!(column(&table, "t"), [0.0, 1.0, 2.0, 3.0, 4.0], "{name}");
        }
        for note in left_out {
            assert!(
                table.notes.iter().any(|found| found.contains(note)),
                "{:?}",
                table.notes
            );
        }
    }
    let integers = read(&fixture("i2.npy")).unwrap();
    assert_eq!(column(&integers, "c1"), [-2.0, -1.0, 0.0, 1.0, 2.0]);
    for (name, cause) in [("complex.npy", "'<c16' is not supported"), ("level4.mat", "-v7")] {
        assert!(read(&fixture(name)).unwrap_err().contains(cause), "{name}");
    }
}

#[test]
fn sheets_are_read_like_the_text_they_are_saved_as() {
    let imported = ["press.xlsx", "press.ods"].map(|name| {
        let table = read(&fixture(name)).unwrap();
        assert_eq!(names(&table), ["time", "r1", "force", "note"], "{name}");
        assert_eq!((table.line(0), table.format.to_string().as_str()), (2, "sheet 'Data'"));
        let is_left_out = table.notes.iter().any(|note| note.contains("sheet 'About' is 1 × 1"));
        assert_eq!(is_left_out, name == "press.xlsx", "{:?}", table.notes);
        let recipe = Recipe {
            data: fixture(name),
            time: Some("time".to_owned()),
            ..recipe("r1", "force")
        };
        import(&recipe, Path::new("")).unwrap()
    });
    for recording in &imported {
        // Programs write 15 or 17 digits.
        let force = target(recording, 0);
        let is_force = |(row, found): (usize, &f64)| (found - 0.1 * row as f64).abs() < 1e-14;
        assert!(force.len() == 20 && force.iter().enumerate().all(is_force), "{force:?}");
        assert_eq!(recording.problem.inputs[0].unit.as_deref(), Some("kOhm"));
        assert_eq!(reading(recording, 0), reading(&imported[0], 0));
        assert_eq!(
            (&recording.lines, &recording.times),
            (&imported[0].lines, &imported[0].times)
        );
    }
    let stamps = read(&fixture("stamps.xlsx")).unwrap();
    assert_eq!(
        numbers(&stamps, "")[0],
        Vec::from_iter((0..12).map(|row| 0.25 * f64::from(row)))
    );
}

#[test]
fn variables_of_a_workspace_are_chosen_by_their_columns() {
    let path = fixture("workspace.mat");
    let table = read(&path).unwrap();
    assert_eq!(table.rows, 12, "{:?}", table.notes);
    type Press = fn(f64) -> f64;
    let columns: [(&str, Press); 7] = [
        ("positions.c2", |press| 0.5 * press),
        // Two rows per press, side by side: the columns of the first row, then those of the second.
        ("pairs.c2", |press| 100.0 * press),
        ("pairs.c3", |press| 10.0 * press + 1.0),
        // In the order of MATLAB: the second dimension varies fastest.
        ("cube.c4", |press| 100.0 * press + 10.0 + 1.0),
        ("log.force", |press| 0.25 * press),
        ("log.nested.z", |press| press),
        ("records.xy.c2", |press| 2.0 * press),
    ];
    for (name, of) in columns {
        let expected = Vec::from_iter((0..12).map(|press| of(f64::from(press))));
        assert_eq!(column(&table, name), expected, "{name}");
    }
    for note in [
        "log.label is text",
        "calibration is 5 × 1",
        "cube is 12 × 2 × 3, read as 12 × 6",
        "2 rows per sample",
    ] {
        assert!(
            table.notes.iter().any(|found| found.contains(note)),
            "{note}: {:?}",
            table.notes
        );
    }
    // The named columns determine the rows: each of a pair is a sample of its own.
    let recipe = Recipe {
        data: path,
        ..recipe("pairs.c1", "pairs.c2")
    };
    assert_eq!(import(&recipe, Path::new("")).unwrap().set.samples(), 24);
}

#[test]
fn files_of_other_kinds_are_refused_by_name() {
    let folder = folder(&[]);
    let path = folder.path().join("data.csv");
    for (start, expected) in [
        (
            &b"\x89HDF\r\n\x1a\n\0\0\0\0\0\0\0\0"[..],
            "an HDF5 file, which is not read; save it as .npz",
        ),
        (b"PAR1\x15\x04\x15", "a Parquet file"),
        (b"\x89PNG\r\n\x1a\n", "a PNG image"),
        (b"\x80\x04\x95\x10", "a Python pickle"),
        (
            b"\x1f\x8b\x08\x00",
            "compressed with gzip, which is not read; unpack it",
        ),
        (b"%PDF-1.7", "a PDF document"),
    ] {
        fs::write(&path, start).unwrap();
        let error = read(&path).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn names_of_entries_are_shown_without_control_characters_and_are_no_paths() {
    let folder = folder(&[]);
    let path = folder.path().join("names.npz");
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let names = "../../escaped.npy /rooted.npy \u{1b}[2Jred.npy a\u{202e}b.npy \u{7}note.txt";
    for name in words(names) {
        archive.start_file(name, SimpleFileOptions::default()).unwrap();
        archive.write_all(&fs::read(fixture("i2.npy")).unwrap()).unwrap();
    }
    fs::write(&path, archive.finish().unwrap().into_inner()).unwrap();
    let table = read(&path).unwrap();
    assert_eq!((table.columns.len(), table.rows), (4, 5));
    let names = table.columns.iter().map(|column| &column.name);
    for text in names.chain(&table.notes) {
        assert!(!text.contains(|c: char| c.is_control() || c == '\u{202e}'), "{text:?}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}
