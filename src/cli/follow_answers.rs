use std::io::{self, BufWriter, StdoutLock, Write, stdout};

use clap::ValueEnum;
use ndarray::ArrayView1;

use super::{failure::Failure, outside_training::OutsideTraining};
use crate::{
    dataset::SimulationError,
    decoupling::{CompiledNetworks, Decoder},
    export::{NetworkFile, write_decoded, write_decoded_header},
    live::{LeftOutDecoder, ParsedLine},
    network::Networks,
};

/// Form of the answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Form {
    /// Lines of CSV in the columns of decode.
    #[default]
    Csv,
    /// One JSON object a line.
    Jsonl,
}

/// Decodes lines and writes their answers to standard output, without allocation in steady state.
pub(super) struct Answers<'a> {
    networks: &'a Networks,
    compiled: CompiledNetworks<f64>,
    rows: usize,
    nodes_per_row: usize,
    answer_mm: Vec<f64>,
    outside: OutsideTraining,
    form: Form,
    has_heading: bool,
    output: BufWriter<StdoutLock<'static>>,
}

impl<'a> Answers<'a> {
    pub(super) fn new(file: &'a NetworkFile, form: Form) -> Result<Self, Failure> {
        let source = file.settings.simulated().expect("the network is of an array").source;
        let scale = source.sensor.scale;
        let read = source.scene.rows.read(scale.rows());
        let rows = read.map_err(SimulationError::from)?.len();
        Ok(Self {
            networks: &file.network,
            compiled: CompiledNetworks::new(&file.network, rows),
            rows,
            nodes_per_row: scale.nodes_per_row(),
            answer_mm: vec![0.0; rows * scale.coordinates_per_row()],
            outside: OutsideTraining::default(),
            form,
            has_heading: form == Form::Jsonl,
            output: BufWriter::with_capacity(1 << 16, stdout().lock()),
        })
    }

    /// Number of row-wires read.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// Decodes a line, by `left_out` and the latest readings of every row read if they are given, and writes and flushes the answer. Returns `false` if there is none.
    pub(super) fn write(
        &mut self,
        line: u64,
        parsed: ParsedLine<'_>,
        left_out: Option<(&mut LeftOutDecoder, &[f64])>,
    ) -> io::Result<bool> {
        let outputs = 3 * self.nodes_per_row;
        let (first_row, readings_ohm) = match parsed {
            ParsedLine::NoReadings => return Ok(true),
            ParsedLine::Row {
                row_index,
                readings_ohm,
            } => (row_index, readings_ohm),
            ParsedLine::Snapshot(readings_ohm) => (Some(0), readings_ohm),
        };
        let channels = self.compiled.channels();
        let rows = readings_ohm.len() / channels;
        let answer_mm = &mut self.answer_mm[..rows * outputs];
        // A wire can be left out of a row that is known only.
        let fault = left_out
            .as_ref()
            .and_then(|(left_out, _)| left_out.fault())
            .filter(|_| first_row.is_some());
        let first_row = first_row.unwrap_or(0);
        let lines = || readings_ohm.chunks_exact(channels);
        let is_answered = match left_out {
            Some((left_out, frame_ohm)) if fault.is_some() => match parsed {
                ParsedLine::Snapshot(_) => left_out.decode(readings_ohm, answer_mm),
                _ => left_out.decode_row_of(frame_ohm, first_row, answer_mm),
            },
            _ => {
                let mut rows = lines().zip(answer_mm.chunks_exact_mut(outputs)).enumerate();
                rows.try_for_each(|(row, (readings_ohm, answer_mm))| {
                    self.compiled.decode_row(first_row + row, readings_ohm, answer_mm)
                })
            }
        };
        if is_answered.is_err() {
            return Ok(false);
        }
        if answer_mm.iter().any(|coordinate| !coordinate.is_finite()) {
            return Ok(false);
        }
        let (mut readings_outside, mut coordinates_outside) = (Some(0), 0);
        for (row, (readings_ohm, answer_mm)) in lines().zip(answer_mm.chunks_exact(outputs)).enumerate() {
            let network = self.networks.at(first_row + row);
            let of_row = self.outside.count(network, line, readings_ohm, answer_mm);
            readings_outside = readings_outside.zip(of_row.readings).map(|(sum, count)| sum + count);
            coordinates_outside += of_row.coordinates;
        }
        if !self.has_heading {
            write_decoded_header(rows * self.nodes_per_row, &mut self.output)?;
            self.has_heading = true;
        }
        let answer_mm = &self.answer_mm[..rows * outputs];
        match self.form {
            Form::Csv => write_decoded(
                ArrayView1::from(answer_mm),
                readings_outside,
                coordinates_outside,
                &mut self.output,
            )?,
            Form::Jsonl => {
                write!(self.output, "{{\"line\":{line},\"coordinates_mm\":[")?;
                for (index, coordinate) in answer_mm.iter().enumerate() {
                    let separator = if index == 0 { "" } else { "," };
                    write!(self.output, "{separator}{coordinate:?}")?;
                }
                match readings_outside {
                    Some(count) => write!(self.output, "],\"readings_outside\":{count}")?,
                    None => write!(self.output, "],\"readings_outside\":null")?,
                }
                write!(self.output, ",\"coordinates_outside\":{coordinates_outside}")?;
                match fault {
                    Some(fault) => writeln!(self.output, ",\"left_out\":\"{}\"}}", fault.wire)?,
                    None => writeln!(self.output, ",\"left_out\":null}}")?,
                }
            }
        }
        self.output.flush()?;
        Ok(true)
    }

    /// Warns of lines outside the range seen in training.
    pub(super) fn warn(&self) {
        self.outside.warn();
    }
}
