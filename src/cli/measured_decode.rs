//! Decoding with networks of own data.

use std::{
    io::{self, BufWriter, StdoutLock, Write, stderr, stdout},
    path::Path,
};

use super::{failure::Failure, follow_answers::Form, samples::with_bar};
use crate::{
    dataset::clean_name::inert,
    dataset::{CsvFields, number},
    decoupling::{CompiledNetworks, Decoder},
    export::{AtomicFile, NetworkFile, WriteError},
    import::{InputColumns, InputError, Recipe},
    network::DecouplingNetwork,
};

/// Decodes the file `input` into the file `output`.
pub(super) fn decode_file(file: &NetworkFile, input: &Path, output: &Path) -> Result<(), Failure> {
    let recipe = recipe(file);
    let table = with_bar(true, |watch| {
        recipe.read_inputs(input, &file.problem.inputs, file.network.only().is_none(), watch)
    })?;
    let mut compiled = CompiledNetworks::<f64>::new(&file.network, rows(file));
    let refused = |source| WriteError::io(output, source);
    let mut written = AtomicFile::create(output)?;
    write_heading(file, &mut written).map_err(refused)?;
    let mut answer = vec![0.0; file.problem.targets.len()];
    let mut lines_outside = 0;
    for (sample, &line) in table.lines.iter().enumerate() {
        let row_index = match (&table.row_wires, &file.row_wires) {
            _ if file.network.only().is_some() => 0,
            (Some(of_samples), Some(read)) => {
                read.binary_search(&of_samples[sample])
                    .map_err(|_| Failure::UnknownRow {
                        path: input.to_owned(),
                        line,
                        row: of_samples[sample] + 1,
                    })?
            }
            _ => {
                return Err(Failure::NoRowWires {
                    path: input.to_owned(),
                    column: recipe.row_wire.clone().unwrap_or_default(),
                });
            }
        };
        let readings = table.readings.row(sample);
        let readings = readings.to_slice().expect("a row of a standard array is contiguous");
        let is_answered = compiled.decode_row(row_index, readings, &mut answer) == Ok(());
        if !is_answered || answer.iter().any(|value| !value.is_finite()) {
            let path = input.to_owned();
            return Err(Failure::NoAnswer { path, line });
        }
        let (readings_outside, targets_outside) = outside(file.network.at(row_index), readings, &answer);
        lines_outside += usize::from(readings_outside + targets_outside > 0);
        write_answer(&answer, readings_outside, targets_outside, &mut written).map_err(refused)?;
    }
    written.commit()?;
    if lines_outside > 0 {
        // Nobody is left to tell if this fails.
        let _ = writeln!(
            stderr(),
            "warning: {lines_outside} of {} lines are outside the range seen in training, where the network extrapolates; \
             the last two columns count such readings and targets",
            table.lines.len()
        );
    }
    Ok(())
}

/// Recipe by which the samples of the network were read.
fn recipe(file: &NetworkFile) -> &Recipe {
    let recorded = file.recorded.as_ref();
    &recorded.expect("the network is of a recording").plan.import
}

/// Number of row-wires that are told apart.
fn rows(file: &NetworkFile) -> usize {
    file.network.values().len()
}

/// Number of readings and targets outside the range seen in training.
fn outside(network: &DecouplingNetwork, readings: &[f64], answer: &[f64]) -> (usize, usize) {
    let inputs = network.inputs();
    let readings = inputs
        .range()
        .map_or(0, |range| range.outside(inputs.quantity(), readings).count());
    (readings, network.outputs().far_outside(answer).count())
}

fn write_heading(file: &NetworkFile, out: &mut impl Write) -> io::Result<()> {
    let titles = file.problem.targets.iter().map(|target| inert(&target.title()));
    let names = titles.chain(["readings_outside".to_owned(), "targets_outside".to_owned()]);
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(names).map_err(io::Error::other)?;
    writer.flush()
}

fn write_answer(
    answer: &[f64],
    readings_outside: usize,
    targets_outside: usize,
    out: &mut impl Write,
) -> io::Result<()> {
    for value in answer {
        write!(out, "{value:?},")?;
    }
    writeln!(out, "{readings_outside},{targets_outside}")
}

/// Decodes lines as they come and writes their answers to standard output.
pub(super) struct MeasuredAnswers<'a> {
    file: &'a NetworkFile,
    compiled: CompiledNetworks<f64>,
    fields: CsvFields,
    /// Columns of the lines, by their header or else by the first line that was decoded.
    columns: Option<InputColumns>,
    /// Cells of the line as numbers, NaN where they are none.
    readings: Vec<f64>,
    /// Readings in the order of the network's inputs.
    inputs: Vec<f64>,
    answer: Vec<f64>,
    form: Form,
    has_heading: bool,
    output: BufWriter<StdoutLock<'static>>,
}

/// Outcome of a line.
pub(super) enum Answered {
    /// It was decoded.
    Yes,
    /// It has the names of the columns, or nothing.
    NoReadings,
    /// It cannot be decoded.
    Bad(String),
    /// It is a header without the inputs of the network.
    OtherColumns(InputError),
}

impl<'a> MeasuredAnswers<'a> {
    pub(super) fn new(file: &'a NetworkFile, form: Form) -> Self {
        Self {
            file,
            compiled: CompiledNetworks::new(&file.network, rows(file)),
            fields: CsvFields::default(),
            columns: None,
            readings: Vec::new(),
            inputs: Vec::new(),
            answer: vec![0.0; file.problem.targets.len()],
            form,
            has_heading: form == Form::Jsonl,
            output: BufWriter::with_capacity(1 << 16, stdout().lock()),
        }
    }

    /// Decodes a line: the inputs under their names or, without a header, in their order, after the number of the row-wire
    /// where each has a network.
    pub(super) fn write(&mut self, line: u64, text: &[u8]) -> io::Result<Answered> {
        let byte_order_mark: &[u8] = if line == 1 { b"\xef\xbb\xbf" } else { b"" };
        let text = text.strip_prefix(byte_order_mark).unwrap_or(text).trim_ascii();
        if text.is_empty() {
            return Ok(Answered::NoReadings);
        }
        self.fields.split(text);
        let recipe = recipe(self.file);
        let (inputs, row_wire) = (&self.file.problem.inputs, recipe.row_wire.as_deref());
        self.readings.clear();
        self.readings
            .extend(self.fields.iter().map(|field| number(field).unwrap_or(f64::NAN)));
        // Only a line that is not made of numbers, or the first, may be a header: the others need no strings.
        if self.columns.is_none() || self.readings.iter().any(|value| value.is_nan()) {
            let cells: Vec<String> = self
                .fields
                .iter()
                .map(|field| String::from_utf8_lossy(field).into_owned())
                .collect();
            if InputColumns::is_header(&cells, inputs, line == 1) {
                return Ok(match InputColumns::of_header(&cells, inputs, row_wire) {
                    Ok(columns) => {
                        self.columns = Some(columns);
                        Answered::NoReadings
                    }
                    Err(error) => Answered::OtherColumns(error),
                });
            }
        }
        let has_rows = self.file.network.only().is_none();
        let columns = match &self.columns {
            Some(columns) => columns,
            None => match InputColumns::unnamed(self.readings.len(), inputs, row_wire, has_rows) {
                Ok(columns) => self.columns.insert(columns),
                Err(error) => return Ok(Answered::Bad(error.to_string())),
            },
        };
        if self.readings.len() != columns.width {
            let (found, expected) = (self.readings.len(), columns.width);
            return Ok(Answered::Bad(format!("{found} cells where {expected} are needed")));
        }
        let used = columns
            .inputs
            .iter()
            .chain(columns.row_wire.iter().filter(|_| has_rows));
        if let Some(column) = used.copied().find(|&column| !self.readings[column].is_finite()) {
            return Ok(Answered::Bad(format!("cell {} is not a finite number", column + 1)));
        }
        let row_index = match (&self.file.row_wires, columns.row_wire) {
            (Some(read), Some(column)) if has_rows => {
                let row = self.readings[column];
                match read.iter().position(|read| (*read + 1) as f64 == row) {
                    Some(index) => index,
                    None => return Ok(Answered::Bad(format!("there is no network for row {row}"))),
                }
            }
            _ if has_rows => {
                let name = row_wire.unwrap_or("row").to_owned();
                let near = "it has the number of the row-wire, and there is a network for each".to_owned();
                return Ok(Answered::OtherColumns(InputError::Missing { name, near }));
            }
            _ => 0,
        };
        self.inputs.clear();
        self.inputs
            .extend(columns.inputs.iter().map(|&column| self.readings[column]));
        let readings = &self.inputs[..];
        let is_answered = self.compiled.decode_row(row_index, readings, &mut self.answer) == Ok(());
        if !is_answered || self.answer.iter().any(|value| !value.is_finite()) {
            return Ok(Answered::Bad(
                "so far from the training range that the network has no answer".to_owned(),
            ));
        }
        let (readings_outside, targets_outside) = outside(self.file.network.at(row_index), readings, &self.answer);
        if !self.has_heading {
            write_heading(self.file, &mut self.output)?;
            self.has_heading = true;
        }
        match self.form {
            Form::Csv => write_answer(&self.answer, readings_outside, targets_outside, &mut self.output)?,
            Form::Jsonl => {
                let names = self.file.problem.targets.iter().map(|target| target.name.as_str());
                let targets: serde_json::Map<String, serde_json::Value> = names
                    .zip(&self.answer)
                    .map(|(name, value)| (name.to_owned(), (*value).into()))
                    .collect();
                let answer = serde_json::json!({
                    "line": line,
                    "targets": targets,
                    "readings_outside": readings_outside,
                    "targets_outside": targets_outside,
                });
                writeln!(self.output, "{answer}")?;
            }
        }
        self.output.flush()?;
        Ok(Answered::Yes)
    }
}
