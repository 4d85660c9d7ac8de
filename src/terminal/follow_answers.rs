use std::io::{self, BufWriter, StdoutLock, Write, stdout};

use clap::ValueEnum;
use decoupler_files::{
    export::{NetworkFile, write_decoded},
    live::Session,
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

    /// Writes and flushes the last answer of `session`, after the cells kept from its line.
    pub(super) fn write(&mut self, session: &Session) -> io::Result<()> {
        let problem = &self.file.problem;
        let (line, answer, kept) = (session.line(), session.values(), session.kept());
        let first_row = session.first_row();
        let rows = answer.len() / problem.targets.len();
        let (mut readings_outside, mut targets_outside) = (Some(0), 0);
        let of_rows = session.readings().chunks_exact(session.readings().len() / rows);
        for (row, (readings, answer)) in of_rows.zip(answer.chunks_exact(problem.targets.len())).enumerate() {
            let network = self.file.network.at(first_row + row);
            let of_row = self.outside.count(network, line, readings, answer);
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
                with_half_widths(self.file, answer, &mut self.values);
                write_decoded(
                    ArrayView1::from(&self.values),
                    readings_outside,
                    targets_outside,
                    &mut self.output,
                )?;
            }
            Form::Jsonl if problem.has_nodes() => {
                write!(self.output, "{{\"line\":{line},\"coordinates_mm\":[")?;
                for (index, coordinate) in answer.iter().enumerate() {
                    let separator = if index == 0 { "" } else { "," };
                    write!(self.output, "{separator}{coordinate:?}")?;
                }
                match readings_outside {
                    Some(count) => write!(self.output, "],\"readings_outside\":{count}")?,
                    None => write!(self.output, "],\"readings_outside\":null")?,
                }
                write!(self.output, ",\"coordinates_outside\":{targets_outside}")?;
                match session.left_out() {
                    Some(wire) => writeln!(self.output, ",\"left_out\":\"{wire}\"}}")?,
                    None => writeln!(self.output, ",\"left_out\":null}}")?,
                }
            }
            Form::Jsonl => {
                let targets = problem.targets.iter().zip(answer);
                let targets = targets.map(|(target, value)| (target.name.clone(), (*value).into()));
                let half_widths = problem.targets.iter().zip(answer).enumerate();
                let half_widths = half_widths.filter_map(|(index, (target, value))| {
                    let half_width = self.file.intervals.as_ref()?.half_width(index, *value)?;
                    Some((target.name.clone(), half_width.into()))
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
