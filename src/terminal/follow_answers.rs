use std::io::{self, BufWriter, StdoutLock, Write, stdout};

use clap::ValueEnum;
use decoupler_files::{
    export::{NetworkFile, write_decoded},
    live::Answer,
};
use ndarray::ArrayView1;
use serde_json::{Map, json};

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
    pub(super) outside: OutsideTraining<'a>,
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
        let (problem, output) = (&self.file.problem, &mut self.output);
        let (line, values, kept) = (answer.line, &answer.values, &answer.kept);
        let rows = values.len() / problem.targets.len();
        let (mut readings_outside, mut targets_outside) = (Some(0), 0);
        let of_rows = answer.readings.chunks_exact(answer.readings.len() / rows);
        let of_rows = of_rows.zip(values.chunks_exact(problem.targets.len()));
        for (row, (readings, values)) in (answer.first_row.unwrap_or(0)..).zip(of_rows) {
            let of_row = self.outside.count(self.file.network.at(row), line, readings, values);
            readings_outside = readings_outside.zip(of_row.readings).map(|(sum, count)| sum + count);
            targets_outside += of_row.targets;
        }
        if !self.has_heading {
            let titles = Vec::from_iter(kept.iter().map(|kept| kept.title.clone()));
            write_heading(self.file, &titles, rows, output)?;
            self.has_heading = true;
        }
        match self.form {
            Form::Csv => {
                for cell in kept {
                    write_cell(&cell.text, output)?;
                }
                with_half_widths(self.file, values, &mut self.values);
                let values = ArrayView1::from(&self.values);
                write_decoded(values, readings_outside, targets_outside, output)?;
            }
            Form::Jsonl if problem.has_nodes() => {
                write!(output, "{{\"line\":{line},\"coordinates_mm\":[")?;
                for (index, coordinate) in values.iter().enumerate() {
                    let separator = if index == 0 { "" } else { "," };
                    write!(output, "{separator}{coordinate:?}")?;
                }
                let outside = json!(readings_outside);
                let left_out = json!(answer.left_out.map(|wire| wire.to_string()));
                write!(output, "],\"readings_outside\":{outside},\"coordinates_outside\":")?;
                writeln!(output, "{targets_outside},\"left_out\":{left_out}}}")?;
            }
            Form::Jsonl => {
                let named = || problem.targets.iter().map(|target| target.name.clone()).zip(values);
                let half_width = |(index, (name, value)): (usize, (String, &f64))| {
                    let half_width = self.file.intervals.as_ref()?.half_width(index, *value)?;
                    Some((name, json!(half_width)))
                };
                let half_widths = Map::from_iter(named().enumerate().filter_map(half_width));
                let mut object = json!({
                    "line": line,
                    "targets": Map::from_iter(named().map(|(name, value)| (name, json!(value)))),
                    "readings_outside": readings_outside,
                    "targets_outside": targets_outside,
                });
                if !kept.is_empty() {
                    let cells = kept.iter().map(|kept| (kept.title.clone(), json!(kept.text)));
                    object["columns"] = Map::from_iter(cells).into();
                }
                if !half_widths.is_empty() {
                    object["half_widths_90"] = half_widths.into();
                }
                writeln!(output, "{object}")?;
            }
        }
        output.flush()
    }
}
