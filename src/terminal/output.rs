//! Output of the terminal, and readings of a file for a network, line by line.

use std::{
    fs::File,
    io::{self, Stderr, Write, stderr, stdout},
    path::Path,
    time::Duration,
};

use decoupler_core::{
    dataset::{DatasetError, Simulation},
    text::{is_unprintable, printable},
};
use decoupler_files::{
    export::NetworkFile,
    import::{self, InputTable, KeptColumn, ReadingsFile, Recipe},
};
use indicatif::{ProgressBar, ProgressStyle};
use ndarray::Array2;
use serde::Serialize;

use super::{failure::Failure, samples::with_bar};

/// Prints one JSON object on standard output.
pub(super) fn print_object(object: &impl Serialize) -> Result<(), Failure> {
    let mut output = stdout().lock();
    let written = serde_json::to_writer(&mut output, object).map_err(io::Error::from);
    written.and_then(|()| writeln!(output)).map_err(Failure::Output)
}

/// Prints the output of `write` on standard output.
pub(super) fn print(write: impl FnOnce(&mut Printable<io::StdoutLock>) -> io::Result<()>) -> Result<(), Failure> {
    write(&mut Printable(stdout().lock())).map_err(Failure::Output)
}

/// Returns standard error for messages.
pub(super) fn messages() -> Printable<Stderr> {
    Printable(stderr())
}

/// Output for people, which may quote names of files: control characters, which could drive the terminal, are escaped.
#[derive(Debug)]
pub(super) struct Printable<W>(W);

impl<W: Write> Write for Printable<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match std::str::from_utf8(bytes) {
            Ok(text) if text.contains(|c| is_unprintable(c) && !"\n\t".contains(c)) => {
                self.0.write_all(printable(text).as_bytes())?;
            }
            _ => self.0.write_all(bytes)?,
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Progress bar of `steps` with this template; hidden with JSON output and if standard error is not a terminal.
pub(super) fn progress_bar(is_hidden: bool, steps: usize, template: &str) -> ProgressBar {
    if is_hidden {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps as u64);
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Number of lines decoded and written together, which limits memory for large files.
const BLOCK: usize = 1024;

/// Readings of a block of lines.
pub(super) struct Readings {
    /// Lines × inputs of the network.
    pub(super) values: Array2<f64>,
    /// Line numbers, from 1.
    pub(super) lines: Vec<u64>,
    /// Index of the row-wire of each line among those that the network reads; 0 if one network reads all.
    pub(super) row_indices: Vec<usize>,
    /// Columns copied to the output.
    pub(super) kept: Vec<KeptColumn>,
}

/// Reads the file `input` for the network of `file` and passes its lines to `take`, block by block.
pub(super) fn read(
    file: &NetworkFile,
    input: &Path,
    take: &mut dyn FnMut(Readings) -> Result<(), Failure>,
) -> Result<(), Failure> {
    match (&file.recorded, file.settings.simulation()) {
        (Some(recorded), _) => take(read_columns(file, &recorded.plan.import, input)?),
        (None, Some(simulation)) => read_resistances(file, simulation, input, take),
        (None, None) => unreachable!("a file of a recording has its plan"),
    }
}

/// Reads the columns named like the inputs, or as many unnamed columns as there are inputs, from a file of any format.
fn read_columns(file: &NetworkFile, recipe: &Recipe, input: &Path) -> Result<Readings, Failure> {
    let has_rows = file.network.only().is_none();
    let table = with_bar(true, |watch| recipe.read_inputs(input, &file.problem, has_rows, watch))?;
    let InputTable {
        readings,
        row_wires,
        lines,
        torn_line,
        warnings,
        kept,
        times_s: _,
    } = table;
    warn_if_torn(input, torn_line);
    for warning in warnings {
        // There is no one to report to if this fails.
        let _ = writeln!(messages(), "warning: '{}': {warning}", input.display());
    }
    let row_indices = match (row_wires, &file.row_wires) {
        _ if !has_rows => vec![0; lines.len()],
        (Some(of_lines), Some(read)) => {
            let index = |(row_wire, &line): (usize, &u64)| {
                let index = read.binary_search(&row_wire);
                index.map_err(|_| Failure::UnknownRow {
                    path: input.to_owned(),
                    line,
                    row: row_wire + 1,
                })
            };
            of_lines.into_iter().zip(&lines).map(index).collect::<Result<_, _>>()?
        }
        _ => {
            return Err(Failure::NoRowWires {
                path: input.to_owned(),
                column: recipe.row_wire.clone().unwrap_or_default(),
            });
        }
    };
    Ok(Readings {
        values: readings,
        lines,
        row_indices,
        kept,
    })
}

/// Reports a last line that is cut off, as by a full disk, and was left out.
fn warn_if_torn(input: &Path, line: Option<u64>) {
    if let Some(line) = line {
        let input = input.display();
        // There is no one to report to if this fails.
        let _ = writeln!(
            messages(),
            "warning: '{input}': line {line}, the last, is cut off and left out"
        );
    }
}

/// Reads a CSV file of the resistances of an array. Lines without a row number form whole snapshots.
fn read_resistances(
    file: &NetworkFile,
    Simulation { sensor, scene, .. }: &Simulation,
    input: &Path,
    take: &mut dyn FnMut(Readings) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let opened = File::open(input).map_err(|source| Failure::Open {
        path: input.to_owned(),
        source,
    })?;
    let unreadable = |source| Failure::Resistances {
        path: input.to_owned(),
        source,
    };
    let read = scene.rows.read(sensor.scale.rows()).map_err(DatasetError::from)?;
    let mut readings = ReadingsFile::new(opened, file.line_parser(false, true)?);
    while let Some(block) = readings.read(BLOCK).map_err(unreadable)? {
        let import::Readings {
            values_ohm,
            lines,
            row_indices,
        } = block;
        take(Readings {
            values: values_ohm,
            lines,
            row_indices,
            kept: Vec::new(),
        })?;
    }
    warn_if_torn(input, readings.torn_line());
    let lines = readings.lines_in_turn();
    if readings.torn_line().is_none() && !lines.is_multiple_of(read.len()) {
        return Err(Failure::PartOfSnapshot {
            path: input.to_owned(),
            lines,
            rows: read.len(),
        });
    }
    Ok(())
}
