//! Decoding with networks of own data.

use std::{
    io::{self, BufWriter, StdoutLock, Write, stderr, stdout},
    path::Path,
};

use super::{failure::Failure, follow_answers::Form, import_arguments::with_bar};
use crate::{
    dataset::CsvFields,
    decoupling::{CompiledNetworks, Decoder},
    export::{AtomicFile, MeasuredNetworkFile, WriteError},
    import::clean_name::inert,
    network::DecouplingNetwork,
};

/// Decodes the file `input` into the file `output`.
pub(super) fn decode_file(file: &MeasuredNetworkFile, input: &Path, output: &Path) -> Result<(), Failure> {
    let recipe = &file.plan.import;
    let table = with_bar(true, |watch| recipe.read_inputs(input, &file.inputs, watch))?;
    let mut compiled = CompiledNetworks::<f64>::new(&file.network, rows(file));
    let refused = |source| WriteError::io(output, source);
    let mut written = AtomicFile::create(output)?;
    write_heading(file, &mut written).map_err(refused)?;
    let mut answer = vec![0.0; file.targets.len()];
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

/// Number of row-wires that are told apart.
fn rows(file: &MeasuredNetworkFile) -> usize {
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

fn write_heading(file: &MeasuredNetworkFile, out: &mut impl Write) -> io::Result<()> {
    let titles = file.targets.iter().map(|target| inert(&target.title()));
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
    file: &'a MeasuredNetworkFile,
    compiled: CompiledNetworks<f64>,
    fields: CsvFields,
    readings: Vec<f64>,
    answer: Vec<f64>,
    form: Form,
    has_heading: bool,
    is_first: bool,
    output: BufWriter<StdoutLock<'static>>,
}

/// Outcome of a line.
pub(super) enum Answered {
    /// It was decoded.
    Yes,
    /// It has the names of the columns.
    Heading,
    /// It cannot be decoded.
    Bad(String),
}

impl<'a> MeasuredAnswers<'a> {
    pub(super) fn new(file: &'a MeasuredNetworkFile, form: Form) -> Self {
        Self {
            file,
            compiled: CompiledNetworks::new(&file.network, rows(file)),
            fields: CsvFields::default(),
            readings: Vec::new(),
            answer: vec![0.0; file.targets.len()],
            form,
            has_heading: form == Form::Jsonl,
            is_first: true,
            output: BufWriter::with_capacity(1 << 16, stdout().lock()),
        }
    }

    /// Decodes a line: the inputs in their order, after the number of the row-wire where each has a network.
    pub(super) fn write(&mut self, line: u64, text: &[u8]) -> io::Result<Answered> {
        self.fields.split(text);
        let is_first = std::mem::replace(&mut self.is_first, false);
        self.readings.clear();
        for (index, field) in self.fields.iter().enumerate() {
            let number = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
            match number.filter(|number: &f64| number.is_finite()) {
                Some(number) => self.readings.push(number),
                None if is_first => return Ok(Answered::Heading),
                None => return Ok(Answered::Bad(format!("cell {} is not a finite number", index + 1))),
            }
        }
        let has_rows = self.file.network.only().is_none();
        let expected = self.file.inputs.len() + usize::from(has_rows);
        if self.readings.len() != expected {
            return Ok(Answered::Bad(format!(
                "{} cells where {expected} are needed",
                self.readings.len()
            )));
        }
        let row_index = match (&self.file.row_wires, has_rows) {
            (Some(read), true) => match read.iter().position(|row| (*row + 1) as f64 == self.readings[0]) {
                Some(index) => index,
                None => {
                    return Ok(Answered::Bad(format!(
                        "there is no network for row {}",
                        self.readings[0]
                    )));
                }
            },
            _ => 0,
        };
        let readings = &self.readings[usize::from(has_rows)..];
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
                let names = self.file.targets.iter().map(|target| target.name.as_str());
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
