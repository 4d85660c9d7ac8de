use std::io::{self, BufWriter, StdoutLock, Write, stdout};

use clap::ValueEnum;
use decoupler_files::{
    export::{NetworkFile, write_decoded},
    live::Answer,
};
use ndarray::ArrayView1;
use serde_json::{Map, Value, json};

use super::decode::{OutsideTraining, with_half_widths, write_cell, write_heading};

/// Output format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Form {
    /// CSV with the columns of `decode`.
    #[default]
    Csv,
    /// One JSON object per line.
    Jsonl,
}

/// Writes answers to standard output; without allocation in steady state for CSV or an array.
pub(super) struct Answers<'a> {
    file: &'a NetworkFile,
    /// Answers with the half-widths of their intervals.
    values: Vec<f64>,
    outside: OutsideTraining<'a>,
    form: Form,
    has_heading: bool,
    output: BufWriter<StdoutLock<'static>>,
}

impl<'a> Answers<'a> {
    pub(super) fn new(file: &'a NetworkFile, form: Form) -> Self {
        Self {
            file,
            values: Vec::new(),
            outside: OutsideTraining::new(&file.problem),
            form,
            has_heading: form == Form::Jsonl,
            output: BufWriter::with_capacity(1 << 16, stdout().lock()),
        }
    }

    /// Writes and flushes an answer, after the cells kept from its line.
    pub(super) fn write(&mut self, answer: &Answer) -> io::Result<()> {
        let problem = &self.file.problem;
        let Answer {
            line,
            first_row,
            readings,
            kept,
            values,
            left_out,
            ..
        } = answer;
        let rows = values.len() / problem.targets.len();
        let (mut readings_outside, mut targets_outside) = (Some(0), 0);
        let of_rows = readings.chunks_exact(readings.len() / rows);
        let of_rows = of_rows.zip(values.chunks_exact(problem.targets.len()));
        for (row, (readings, values)) in (first_row.unwrap_or(0)..).zip(of_rows) {
            let of_row = self.outside.count(self.file.network.at(row), *line, readings, values);
            readings_outside = readings_outside.zip(of_row.readings).map(|(sum, count)| sum + count);
            targets_outside += of_row.targets;
        }
        if !self.has_heading {
            let titles = Vec::from_iter(kept.iter().map(|kept| kept.title.clone()));
            write_heading(self.file, &titles, rows, &mut self.output)?;
            self.has_heading = true;
        }
        match self.form {
            Form::Csv => {
                for cell in kept {
                    write_cell(&cell.text, &mut self.output)?;
                }
                with_half_widths(self.file, values, &mut self.values);
                write_decoded(
                    ArrayView1::from(&self.values),
                    readings_outside,
                    targets_outside,
                    &mut self.output,
                )?;
            }
            Form::Jsonl if problem.has_nodes() => {
                write!(self.output, "{{\"line\":{line},\"coordinates_mm\":[")?;
                for (index, coordinate) in values.iter().enumerate() {
                    let separator = if index == 0 { "" } else { "," };
                    write!(self.output, "{separator}{coordinate:?}")?;
                }
                let outside = json!(readings_outside);
                let left_out = json!(left_out.map(|wire| wire.to_string()));
                write!(self.output, "],\"readings_outside\":{outside},")?;
                writeln!(
                    self.output,
                    "\"coordinates_outside\":{targets_outside},\"left_out\":{left_out}}}"
                )?;
            }
            Form::Jsonl => {
                let named = || problem.targets.iter().map(|target| target.name.clone()).zip(values);
                let targets = named().map(|(name, value)| (name, json!(value)));
                let half_widths = named().enumerate().filter_map(|(index, (name, value))| {
                    let half_width = self.file.intervals.as_ref()?.half_width(index, *value)?;
                    Some((name, json!(half_width)))
                });
                let half_widths = half_widths.collect::<Map<String, Value>>();
                let mut answer = json!({
                    "line": line,
                    "targets": targets.collect::<Map<String, Value>>(),
                    "readings_outside": readings_outside,
                    "targets_outside": targets_outside,
                });
                if !kept.is_empty() {
                    let cells = kept.iter().map(|kept| (kept.title.clone(), kept.text.clone().into()));
                    answer["columns"] = cells.collect::<Map<String, Value>>().into();
                }
                if !half_widths.is_empty() {
                    answer["half_widths_90"] = half_widths.into();
                }
                writeln!(self.output, "{answer}")?;
            }
        }
        self.output.flush()
    }

    /// Warns of lines outside the range seen in training.
    pub(super) fn warn(&self) {
        self.outside.warn();
    }
}
