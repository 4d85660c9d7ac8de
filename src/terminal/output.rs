//! Output of the terminal, and readings of a file for a network, line by line.

use std::{
    fmt::Display,
    fs::File,
    io::{self, Stderr, Write, stderr, stdout},
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use decoupler_core::{
    dataset::{DatasetError, Simulation},
    text::{is_unprintable, printable},
};
use decoupler_files::{
    export::{NetworkFile, check_writable},
    import::{self, InputTable, ReadingsFile, Recipe},
};
use indicatif::{ProgressBar, ProgressStyle};
use ndarray::Array2;
use serde::Serialize;
use serde_json::Value;

use super::{failure::Failure, samples::with_bar};

/// Options of every command that say how it writes.
#[derive(clap::Args, Default)]
pub(super) struct OutputArguments {
    /// Print one JSON object instead of text and progress
    #[arg(long, global = true, hide_short_help = true)]
    json: bool,
    /// Show no progress and no notes, only results, warnings and errors
    #[arg(short, long, global = true, hide_short_help = true)]
    quiet: bool,
    /// Replace files that exist
    #[arg(long, global = true, overrides_with = "force", hide_short_help = true)]
    force: bool,
}

static IS_JSON: AtomicBool = AtomicBool::new(false);
static IS_QUIET: AtomicBool = AtomicBool::new(false);
static IS_FORCED: AtomicBool = AtomicBool::new(false);
/// True if a file is written to standard output, and what is printed goes to standard error.
static IS_TAKEN: AtomicBool = AtomicBool::new(false);
/// Warnings so far.
static WARNINGS: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Forgets an earlier command of the same process, before arguments are parsed.
pub(crate) fn begin() {
    IS_TAKEN.store(false, Ordering::Relaxed);
    WARNINGS.lock().unwrap_or_else(PoisonError::into_inner).clear();
}

impl OutputArguments {
    pub(super) fn apply(&self) {
        IS_JSON.store(self.json, Ordering::Relaxed);
        IS_QUIET.store(self.quiet, Ordering::Relaxed);
        IS_FORCED.store(self.force, Ordering::Relaxed);
    }
}

pub(super) fn is_json() -> bool {
    IS_JSON.load(Ordering::Relaxed)
}

/// Parses the name of a file to read; `-` is standard input.
pub(super) fn input(text: &str) -> Result<PathBuf, String> {
    Ok(if text == "-" { "/dev/stdin" } else { text }.into())
}

/// Parses the name of a file to write; `-` is standard output.
pub(super) fn output(text: &str) -> Result<PathBuf, String> {
    let is_standard = text == "-";
    IS_TAKEN.fetch_or(is_standard, Ordering::Relaxed);
    Ok(if is_standard { "/dev/stdout" } else { text }.into())
}

/// Checks that a file can be written, and replaces no other without `--force`.
pub(super) fn check_output(option: &str, path: &Path) -> Result<(), Failure> {
    check_writable(path)?;
    if path != Path::new("/dev/stdout") && path.is_file() && !IS_FORCED.load(Ordering::Relaxed) {
        let path = path.display();
        let message = format!("{option} '{path}' exists: give another name, or --force to replace it");
        return Err(Failure::Arguments(message));
    }
    Ok(())
}

/// Warns on standard error; the object that `--json` prints lists all warnings.
pub(super) fn warn(message: impl Display) {
    let message = message.to_string();
    // There is no one to report to if this fails.
    let _ = writeln!(messages(), "warning: {message}");
    WARNINGS.lock().unwrap_or_else(PoisonError::into_inner).push(message);
}

/// Returns the warnings so far.
pub(crate) fn warnings() -> Vec<String> {
    WARNINGS.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Says something on standard error that is neither a warning nor a result.
pub(super) fn note(message: impl Display) {
    if !IS_QUIET.load(Ordering::Relaxed) {
        // There is no one to report to if this fails.
        let _ = writeln!(messages(), "{message}");
    }
}

/// Prints a result: with `--json` one object, to which the warnings are added, otherwise as text.
pub(super) fn print(
    object: impl FnOnce() -> Value,
    text: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Failure> {
    let mut out: Box<dyn Write> = match IS_TAKEN.load(Ordering::Relaxed) {
        true => Box::new(stderr()),
        false => Box::new(stdout().lock()),
    };
    let written = if is_json() {
        let mut object = object();
        object["warnings"] = warnings().into();
        writeln!(out, "{object}")
    } else {
        text(&mut Printable(out))
    };
    written.map_err(Failure::Output)
}

/// Returns an object with the fields of all `parts`.
pub(super) fn joined(parts: impl IntoIterator<Item = Value>) -> Value {
    let objects = parts.into_iter().filter_map(|part| match part {
        Value::Object(fields) => Some(fields),
        _ => None,
    });
    Value::Object(objects.flatten().collect())
}

/// Serialises a result, which has only text keys.
pub(super) fn value(of: &impl Serialize) -> Value {
    serde_json::to_value(of).expect("a result has only text keys")
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

/// Progress bar of `steps` with this template; hidden with `--json` or `--quiet`, and if standard error is not a terminal.
pub(super) fn progress_bar(steps: usize, template: &str) -> ProgressBar {
    if is_json() || IS_QUIET.load(Ordering::Relaxed) {
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
    /// Titles and cells of the columns copied to the output.
    pub(super) kept: Vec<(String, Vec<String>)>,
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
    let table = with_bar(|watch| recipe.read_inputs(input, &file.problem, has_rows, watch))?;
    warn_if_torn(input, table.torn_line);
    for warning in &table.warnings {
        warn(format_args!("'{}': {warning}", input.display()));
    }
    let row_indices = file.row_indices(&table).map_err(|reason| Failure::at(input, reason))?;
    let InputTable {
        readings, lines, kept, ..
    } = table;
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
        warn(format_args!(
            "'{}': line {line}, the last, is cut off and left out",
            input.display()
        ));
    }
}

/// Reads a CSV file of the resistances of an array. Lines without a row number form whole snapshots.
fn read_resistances(
    file: &NetworkFile,
    Simulation { sensor, scene, .. }: &Simulation,
    input: &Path,
    take: &mut dyn FnMut(Readings) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let opened = File::open(input).map_err(|error| Failure::Path("open", input.to_owned(), error))?;
    let unreadable = |error| Failure::at(input, error);
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
    warn_if_torn(input, readings.torn_line);
    let lines = readings.lines_in_turn();
    if readings.torn_line.is_none() && !lines.is_multiple_of(read.len()) {
        let rows = read.len();
        return Err(Failure::at(
            input,
            format_args!(
                "{lines} lines are not a multiple of {rows} rows: each snapshot needs one line per row-wire; add the missing \
                 lines, or a column named row with the row number of each line"
            ),
        ));
    }
    Ok(())
}
