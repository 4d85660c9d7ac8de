//! Small files that need much memory.

use std::{
    fs::{self, File},
    io::{self, Read, Write},
    path::Path,
};

use flate2::{Compression, write::ZlibEncoder};
use zip::{ZipWriter, write::SimpleFileOptions};

use crate::{ended, refused};

/// Part of the message on a file that needs more memory than reading may take.
const OVER_BUDGET: &str = "raise the memory limit";

/// Bytes of a `.npy` file up to its numbers.
fn npy_header(shape: &str) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes
}

fn zeros(bytes: u64) -> impl Read {
    io::repeat(0).take(bytes)
}

/// Writes an archive with these entries: a name, and a beginning followed by zeros.
fn archive(path: &Path, entries: &[(&str, &[u8], u64)]) {
    let mut archive = ZipWriter::new(File::create(path).unwrap());
    for (name, beginning, rest) in entries {
        archive.start_file(*name, SimpleFileOptions::default()).unwrap();
        archive.write_all(beginning).unwrap();
        io::copy(&mut zeros(*rest), &mut archive).unwrap();
    }
    archive.finish().unwrap();
}

/// Element of a MAT-file: its tag and `data`.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

/// Writes a MAT-file with one compressed variable: a matrix of `class` with `contents`, which state `stated` bytes of data that
/// follow as zeros.
fn matlab(path: &Path, class: u32, shape: [i32; 2], contents: &[u8], stated: u64) {
    let flags = [class.to_le_bytes(), [0; 4]].concat();
    let shape = shape.map(i32::to_le_bytes).concat();
    let mut body = [element(6, &flags), element(5, &shape), element(1, b"bomb")].concat();
    body.extend(contents);
    let size = body.len() as u64 + stated;
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&14_u32.to_le_bytes()).unwrap();
    encoder.write_all(&(size as u32).to_le_bytes()).unwrap();
    encoder.write_all(&body).unwrap();
    io::copy(&mut zeros(stated), &mut encoder).unwrap();
    let compressed = encoder.finish().unwrap();
    let mut header = vec![b' '; 124];
    header[..6].copy_from_slice(b"MATLAB");
    header.extend([0, 1, b'I', b'M']);
    header.extend(15_u32.to_le_bytes());
    header.extend((compressed.len() as u32).to_le_bytes());
    fs::write(path, [header, compressed].concat()).unwrap();
}

/// Writes an Excel file with these cells and shared strings.
fn excel(path: &Path, rows: &str, strings: &str, spaces: u64) {
    let workbook = r#"<workbook xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships"><sheets><sheet name="a" sheetId="1" r:id="r1"/></sheets></workbook>"#;
    let package = r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r1" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/officeDocument" Target="xl/workbook.xml"/></Relationships>"#;
    let relations = r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r1" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet" Target="worksheets/sheet1.xml"/></Relationships>"#;
    let sheet = format!("<worksheet><sheetData>{rows}</sheetData></worksheet>");
    archive(
        path,
        &[
            ("_rels/.rels", package.as_bytes(), 0),
            ("xl/workbook.xml", workbook.as_bytes(), 0),
            ("xl/_rels/workbook.xml.rels", relations.as_bytes(), 0),
            ("xl/worksheets/sheet1.xml", sheet.as_bytes(), spaces),
            ("xl/sharedStrings.xml", strings.as_bytes(), 0),
        ],
    );
}

/// Writes an OpenDocument file with these rows.
fn open_document(path: &Path, rows: &str) {
    let content = format!(
        "<office:document-content><office:body><office:spreadsheet><table:table table:name=\"a\">{rows}</table:table>\
         </office:spreadsheet></office:body></office:document-content>"
    );
    archive(
        path,
        &[
            ("mimetype", b"application/vnd.oasis.opendocument.spreadsheet", 0),
            ("META-INF/manifest.xml", b"<manifest:manifest/>", 0),
            ("content.xml", content.as_bytes(), 0),
        ],
    );
}

/// A file, and the part of the message with which it is refused.
type Bomb = (&'static str, fn(&Path), &'static str);

const CELL: &str = r#"<table:table-cell table:number-columns-repeated="16384" office:value-type="float" office:value="1"></table:table-cell>"#;

const BOMBS: [Bomb; 19] = [
    (
        "sparse.npy",
        |path| {
            let mut file = File::create(path).unwrap();
            file.write_all(&npy_header("(2000000000, 1)")).unwrap();
            file.set_len(16_000_000_200).unwrap();
        },
        OVER_BUDGET,
    ),
    (
        "claim.npy",
        |path| fs::write(path, npy_header("(1000000000000, 4)")).unwrap(),
        OVER_BUDGET,
    ),
    (
        "one_entry.npz",
        |path| archive(path, &[("x.npy", &npy_header("(100000000,)"), 800_000_000)]),
        OVER_BUDGET,
    ),
    (
        "all_entries.npz",
        |path| {
            let header = npy_header("(15000000,)");
            let names = ["a", "b", "c", "d"].map(|name| format!("{name}.npy"));
            archive(
                path,
                &names.each_ref().map(|name| (name.as_str(), &header[..], 120_000_000)),
            );
        },
        OVER_BUDGET,
    ),
    (
        "after_its_end.npz",
        |path| archive(path, &[("x.npy", &npy_header("(2,)"), 500_000_000)]),
        "bytes more than its header states",
    ),
    (
        "numbers.mat",
        |path| {
            let data = [9_u32.to_le_bytes(), 800_000_000_u32.to_le_bytes()].concat();
            matlab(path, 6, [100_000_000, 1], &data, 800_000_000);
        },
        OVER_BUDGET,
    ),
    (
        // Each byte becomes a number.
        "bytes.mat",
        |path| {
            let data = [2_u32.to_le_bytes(), 100_000_000_u32.to_le_bytes()].concat();
            matlab(path, 9, [100_000_000, 1], &data, 100_000_000);
        },
        OVER_BUDGET,
    ),
    (
        "field_names.mat",
        |path| {
            let length = element(5, &1_i32.to_le_bytes());
            let names = [1_u32.to_le_bytes(), 900_000_000_u32.to_le_bytes()].concat();
            matlab(path, 2, [1, 1], &[length, names].concat(), 900_000_000);
        },
        OVER_BUDGET,
    ),
    (
        // Rows of two cells in a table of many columns: 4 bytes become 160 000.
        "short_rows.csv",
        |path| {
            let header = Vec::from_iter((0..20_000).map(|column| format!("x{column}"))).join(",");
            fs::write(path, format!("{header}\n{}", "1,2\n".repeat(20_000))).unwrap();
        },
        OVER_BUDGET,
    ),
    (
        "endless.csv",
        |path| File::create(path).unwrap().set_len(30_000_000_000).unwrap(),
        "not text",
    ),
    (
        "far_cells.xlsx",
        |path| {
            let far = r#"<row r="1"><c r="A1"><v>1</v></c></row><row r="1048576"><c r="XFD1048576"><v>1</v></c></row>"#;
            excel(path, far, "<sst/>", 0);
        },
        OVER_BUDGET,
    ),
    (
        // As 32 bits, a row far below.
        "below_the_sheet.xlsx",
        |path| {
            excel(
                path,
                r#"<row><c r="A1"><v>1</v></c><c r="A99999999999999999999"><v>1</v></c></row>"#,
                "<sst/>",
                0,
            );
        },
        "cell A99999999999999999999 is outside of a sheet",
    ),
    (
        // As 32 bits, the first row.
        "wrapped.xlsx",
        |path| excel(path, r#"<row><c r="A4294967297"><v>1</v></c></row>"#, "<sst/>", 0),
        "cell A4294967297 is outside of a sheet",
    ),
    (
        "row_below_the_sheet.xlsx",
        |path| {
            excel(
                path,
                r#"<row r="1"><c><v>1</v></c></row><row r="A99999999"><c><v>1</v></c></row>"#,
                "<sst/>",
                0,
            );
        },
        "A99999999 is outside of a sheet",
    ),
    (
        "many_strings.xlsx",
        |path| {
            excel(
                path,
                r#"<row><c><v>1</v></c></row>"#,
                r#"<sst uniqueCount="100000000000"></sst>"#,
                0,
            );
        },
        OVER_BUDGET,
    ),
    (
        "large_sheet.xlsx",
        |path| excel(path, "<row><c><v>1</v></c></row>", "<sst/>", 900_000_000),
        OVER_BUDGET,
    ),
    (
        "repeated_rows.ods",
        |path| {
            let row = format!("<table:table-row table:number-rows-repeated=\"100000\">{CELL}</table:table-row>");
            open_document(path, &row);
        },
        OVER_BUDGET,
    ),
    (
        "wide_rows.ods",
        |path| open_document(path, &format!("<table:table-row>{CELL}</table:table-row>").repeat(2000)),
        OVER_BUDGET,
    ),
    (
        "claims.xls",
        |path| {
            let mut bytes = vec![0xff; 4096];
            bytes[..8].copy_from_slice(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1");
            fs::write(path, bytes).unwrap();
        },
        "a file of Excel up to 2003, which is not read; save it as .xlsx or CSV",
    ),
];

#[test]
fn small_files_that_need_much_memory_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for (name, write, expected) in BOMBS {
        let path = folder.path().join(name);
        write(&path);
        let message = refused(&["inspect", "--data", name], folder.path());
        assert!(
            message.contains(name) && message.contains(expected),
            "{name}: {message}"
        );
        fs::remove_file(path).unwrap();
    }
}

#[test]
fn the_limit_can_be_raised_and_lowered() {
    let folder = tempfile::tempdir().unwrap();
    archive(
        &folder.path().join("large.npz"),
        &[("x.npy", &npy_header("(3000000,)"), 24_000_000)],
    );
    let inspect = ["inspect", "--data", "large.npz", "--json"];
    let message = refused(&[&inspect[..], &["--memory-limit", "0.01"]].concat(), folder.path());
    assert!(
        message.contains("needs 48 MB of memory, and reading may use 10 MB"),
        "{message}"
    );
    let (read, message) = ended(&[&inspect[..], &["--memory-limit", "0.2"]].concat(), folder.path());
    assert!(read, "{message}");
}

/// The memory of a network has a state of 1.6 MB for each row-wire, and the file has row-wires of high numbers, or many.
#[test]
fn row_wires_in_readings_claim_only_the_memory_that_they_need() {
    let folder = tempfile::tempdir().unwrap();
    let rows = (0..60).map(|row| format!("{row},{},{},{},{}\n", row % 2 + 1, row % 7, row % 5, row % 3));
    let header = "t (s),row,a,b,force\n";
    fs::write(
        folder.path().join("press.csv"),
        header.to_owned() + &rows.collect::<String>(),
    )
    .unwrap();
    let inspect = "inspect --data press.csv --inputs a,b --targets force --time t --row-wire row --lags 100000 --recipe-out r.json";
    let train = "train --recipe r.json --hidden 1 --epochs 1 --out n.json";
    for command in [inspect, train] {
        let (is_done, message) = ended(&Vec::from_iter(command.split_whitespace()), folder.path());
        assert!(is_done, "{command}: {message}");
    }
    let decode = "decode --network n.json --data in.csv --out out.csv --force".split(' ');
    let decode = Vec::from_iter(decode);
    fs::write(folder.path().join("in.csv"), "t (s),row,a,b\n0,1,1,2\n1,10000,1,2\n").unwrap();
    let (is_read, message) = ended(&decode, folder.path());
    assert!(is_read, "{message}");
    // Each row-wire comes again when all have begun.
    let rows = (0..20_000).map(|row| format!("{row},{},1,2\n", row % 10_000 + 1));
    fs::write(
        folder.path().join("in.csv"),
        "t (s),row,a,b\n".to_owned() + &rows.collect::<String>(),
    )
    .unwrap();
    let (is_read, message) = ended(&decode, folder.path());
    assert!(is_read, "{message}");
}
