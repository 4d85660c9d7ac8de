use std::io::{self, Write};

use clap::ValueEnum;
use decoupler_core::{live::FaultyWire, text::inert};
use decoupler_files::export::{NetworkFile, csv_cell, write_decoded};
use ndarray::ArrayView1;
use serde_json::{Map, json};

use super::decode::{OutsideTraining, with_half_widths, write_heading};

/// Output format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Form {
    /// CSV with the columns of `decode`.
    #[default]
    Csv,
    /// One JSON object per line.
    Jsonl,
}

/// Writes answers, without allocation in steady state for CSV.
pub(super) struct Answers<'a, W> {
    file: &'a NetworkFile,
    /// Answers with the half-widths of their intervals.
    values: Vec<f64>,
    pub(super) outside: OutsideTraining<'a>,
    form: Form,
    has_heading: bool,
    pub(super) output: W,
}

/// An answer, for one or more row-wires of a line.
pub(super) struct Answer<'a> {
    pub(super) line: u64,
    /// Index of the first row-wire among those that the network reads.
    pub(super) first_row: usize,
    pub(super) readings: &'a [f64],
    pub(super) values: &'a [f64],
    /// Wire that was left out because of its fault.
    pub(super) left_out: Option<FaultyWire>,
}

impl<'a, W: Write> Answers<'a, W> {
    pub(super) fn new(file: &'a NetworkFile, form: Form, output: W) -> Self {
        Self {
            file,
            values: Vec::new(),
            outside: OutsideTraining::new(&file.problem),
            form,
            has_heading: form == Form::Jsonl,
            output,
        }
    }

    /// Writes an answer after the cells kept from its line, each with its title.
    pub(super) fn write<'b>(
        &mut self,
        answer: &Answer,
        kept: impl ExactSizeIterator<Item = (&'b str, &'b str)> + Clone,
    ) -> io::Result<()> {
        let (
            problem,
            &Answer {
                line, readings, values, ..
            },
        ) = (&self.file.problem, answer);
        let rows = values.len() / problem.targets.len();
        let (mut readings_outside, mut targets_outside) = (Some(0), 0);
        let of_rows = readings.chunks_exact(readings.len() / rows);
        for (row, (readings, values)) in of_rows.zip(values.chunks_exact(problem.targets.len())).enumerate() {
            let network = self.file.network.at(answer.first_row + row);
            let of_row = self.outside.count(network, line, readings, values);
            readings_outside = readings_outside.zip(of_row.readings).map(|(sum, count)| sum + count);
            targets_outside += of_row.targets;
        }
        if self.form == Form::Csv {
            if !std::mem::replace(&mut self.has_heading, true) {
                write_heading(self.file, kept.clone().map(|(title, _)| title), rows, &mut self.output)?;
            }
            for (_, cell) in kept {
                write!(self.output, "{},", csv_cell(&inert(cell)))?;
            }
            with_half_widths(self.file, values, &mut self.values);
            let values = ArrayView1::from(&self.values);
            return write_decoded(values, readings_outside, targets_outside, &mut self.output);
        }
        let mut object = json!({"line": line, "readings_outside": readings_outside});
        if problem.has_nodes() {
            object["coordinates_mm"] = values.into();
            object["coordinates_outside"] = targets_outside.into();
            object["left_out"] = answer.left_out.map(|wire| wire.to_string()).into();
        } else {
            let names = || problem.targets.iter().map(|target| target.name.clone());
            object["targets"] = names()
                .zip(values.iter().map(|value| (*value).into()))
                .collect::<Map<_, _>>()
                .into();
            object["targets_outside"] = targets_outside.into();
            let half_width = |(index, value): (usize, &f64)| self.file.intervals.as_ref()?.half_width(index, *value);
            let half_widths = names().zip(values.iter().enumerate().map(half_width));
            let half_widths = half_widths.filter_map(|(name, half_width)| Some((name, half_width?.into())));
            let half_widths = half_widths.collect::<Map<_, _>>();
            if !half_widths.is_empty() {
                object["half_widths_90"] = half_widths.into();
            }
        }
        if kept.len() > 0 {
            object["columns"] = kept
                .map(|(title, cell)| (title.to_owned(), cell.into()))
                .collect::<Map<_, _>>()
                .into();
        }
        writeln!(self.output, "{object}")
    }
}
