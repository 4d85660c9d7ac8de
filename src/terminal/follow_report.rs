use std::{
    fmt::Display,
    io::{self, BufWriter, StdoutLock, Write, stdout},
    time::{Duration, Instant},
};

use clap::ValueEnum;
use decoupler_core::{
    decoupling::{Decoder, ProgramDecoder},
    live::WireCheck,
    text::counted,
};
use decoupler_files::{
    export::{NetworkFile, write_decoded},
    import::ParsedLine,
    live::{Latencies, Source},
};
use ndarray::ArrayView1;
use serde_json::{Map, Value, json};

use super::{
    decode::{OutsideTraining, rows_read, with_half_widths, write_cell, write_heading},
    failure::Failure,
    intervals::DriftWarnings,
    output::messages,
};

/// Counts of decoded and bad lines, and messages on standard error.
pub(super) struct Report {
    source: Source,
    begin: Instant,
    last: Instant,
    latencies: Latencies,
    bad: u64,
    /// Error in the first bad line.
    first_bad: Option<String>,
    /// True once it was reported that no line ends.
    has_warned_of_ends: bool,
    /// Number of bad lines since the last message.
    unreported: u64,
    last_reported: Instant,
}

/// Number of bad lines that are reported individually; after them at most one per second.
const MAX_REPORTED: u64 = 10;
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

impl Report {
    pub(super) fn new(source: Source) -> Self {
        let now = Instant::now();
        Self {
            source,
            begin: now,
            last: now,
            latencies: Latencies::default(),
            bad: 0,
            first_bad: None,
            has_warned_of_ends: false,
            unreported: 0,
            last_reported: now,
        }
    }

    pub(super) fn source(&self) -> &Source {
        &self.source
    }

    /// Counts an answer and its latency, from reading the line to flushing the answer.
    pub(super) fn good(&mut self, latency: Duration) {
        self.latencies.add(latency);
    }

    /// Counts a bad line and reports it, unless there are too many.
    pub(super) fn bad(&mut self, reason: &dyn Display) {
        self.bad += 1;
        self.first_bad.get_or_insert_with(|| reason.to_string());
        if self.bad > MAX_REPORTED && self.last_reported.elapsed() < REPORT_INTERVAL {
            self.unreported += 1;
            return;
        }
        self.last_reported = Instant::now();
        let mut stderr = messages();
        // There is no one to report to if writing fails.
        let _ = match self.unreported {
            0 => writeln!(stderr, "warning: {reason}"),
            unreported => writeln!(
                stderr,
                "warning: {reason} ({unreported} other bad lines since the last message)"
            ),
        };
        self.unreported = 0;
        if let Source::Serial { baud, .. } = self.source
            && self.bad == MAX_REPORTED
            && self.latencies.count() == 0
        {
            let _ = writeln!(
                stderr,
                "warning: none of the first {MAX_REPORTED} lines is a frame: does the device send at {baud} baud?"
            );
        }
    }

    /// Reports once that bytes arrive but no line ends; `unended` bytes have arrived since the last line.
    pub(super) fn waiting(&mut self, unended: usize) {
        /// More than the time between two lines of any device.
        const PATIENCE: Duration = Duration::from_secs(2);
        let has_lines = self.latencies.count() > 0 || self.bad > 0;
        if has_lines || unended == 0 || self.has_warned_of_ends || self.begin.elapsed() < PATIENCE {
            return;
        }
        self.has_warned_of_ends = true;
        // There is no one to report to if this fails.
        let _ = writeln!(
            messages(),
            "warning: {unended} bytes have arrived, but no line has ended: does the sender end lines with LF or CR LF?"
        );
    }

    /// Returns `true` once per interval.
    pub(super) fn is_due(&mut self, every: Duration) -> bool {
        let is_due = self.last.elapsed() >= every;
        if is_due {
            self.last = Instant::now();
        }
        is_due
    }

    /// Result at the end of the source.
    ///
    /// # Errors
    /// If no line was decoded.
    pub(super) fn end(&self) -> Result<(), Failure> {
        if self.latencies.count() > 0 {
            return Ok(());
        }
        let reason = self.first_bad.clone();
        Err(Failure::NothingDecoded {
            input: self.source.clone(),
            reason: reason.unwrap_or_else(|| "it has no line of readings".to_owned()),
        })
    }

    /// Prints the counts and latencies so far.
    pub(super) fn print(&self, dropped: u64) {
        let (decoded, seconds) = (self.latencies.count(), self.begin.elapsed().as_secs_f64());
        let (rate, bad, latencies) = (decoded as f64 / seconds.max(1e-9), self.bad, &self.latencies);
        // There is no one to report to if this fails.
        let _ = writeln!(
            messages(),
            "{} decoded in {seconds:.1} s ({rate:.0} per second), {bad} bad, {dropped} dropped; {latencies}",
            counted(decoded, "line")
        );
    }
}

/// Output format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Form {
    /// CSV with the columns of `decode`.
    #[default]
    Csv,
    /// One JSON object per line.
    Jsonl,
}

/// Decodes lines and writes their answers to standard output; without allocation in steady state for CSV or an array.
pub(super) struct Answers<'a> {
    file: &'a NetworkFile,
    decoder: ProgramDecoder,
    rows: usize,
    answer: Vec<f64>,
    /// Answers with the half-widths of their intervals.
    values: Vec<f64>,
    drift: DriftWarnings<'a>,
    outside: OutsideTraining<'a>,
    form: Form,
    has_heading: bool,
    output: BufWriter<StdoutLock<'static>>,
}

impl<'a> Answers<'a> {
    pub(super) fn new(file: &'a NetworkFile, form: Form) -> Result<Self, Failure> {
        let rows = rows_read(file)?;
        Ok(Self {
            file,
            decoder: file.decoder(),
            rows,
            answer: vec![0.0; rows * file.problem.targets.len()],
            values: Vec::new(),
            drift: DriftWarnings::new(file, true),
            outside: OutsideTraining::new(&file.problem),
            form,
            has_heading: form == Form::Jsonl,
            output: BufWriter::with_capacity(1 << 16, stdout().lock()),
        })
    }

    /// Number of row-wires read.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// Decodes a line, using `left_out` with the latest readings of every row read if given, and writes and flushes the
    /// answer after the cells kept from the line. Returns `false` if there is none.
    pub(super) fn write(
        &mut self,
        line: u64,
        parsed: ParsedLine<'_>,
        left_out: Option<(&mut WireCheck, &[f64])>,
    ) -> io::Result<bool> {
        let outputs = self.file.problem.targets.len();
        let (first_row, readings, kept) = match parsed {
            ParsedLine::NoReadings | ParsedLine::Start { .. } => return Ok(true),
            ParsedLine::Row {
                row_index,
                readings,
                kept,
                ..
            } => (row_index, readings, kept),
            ParsedLine::Snapshot(readings) => (Some(0), readings, &[][..]),
        };
        let channels = self.decoder.channels();
        let rows = readings.len() / channels;
        let answer = &mut self.answer[..rows * outputs];
        // A wire can be left out only if the row is known.
        let fault = left_out
            .as_ref()
            .and_then(|(check, _)| check.named())
            .filter(|_| first_row.is_some());
        let first_row = first_row.unwrap_or(0);
        let lines = || readings.chunks_exact(channels);
        let is_answered = match left_out {
            Some((check, frame_ohm)) if fault.is_some() => check.decode(frame_ohm, first_row..first_row + rows, answer),
            _ => {
                let mut rows = lines().zip(answer.chunks_exact_mut(outputs)).enumerate();
                rows.try_for_each(|(row, (readings, answer))| {
                    self.decoder.decode_row(first_row + row, readings, answer)
                })
            }
        };
        if is_answered.is_err() {
            return Ok(false);
        }
        if answer.iter().any(|value| !value.is_finite()) {
            return Ok(false);
        }
        let (mut readings_outside, mut targets_outside) = (Some(0), 0);
        for (row, (readings, answer)) in lines().zip(answer.chunks_exact(outputs)).enumerate() {
            let network = self.file.network.at(first_row + row);
            let of_row = self.outside.count(network, line, readings, answer);
            readings_outside = readings_outside.zip(of_row.readings).map(|(sum, count)| sum + count);
            targets_outside += of_row.targets;
            self.drift.take(line, readings);
        }
        let problem = &self.file.problem;
        if !self.has_heading {
            let titles = Vec::from_iter(kept.iter().map(|kept| kept.title.clone()));
            write_heading(self.file, &titles, rows, &mut self.output)?;
            self.has_heading = true;
        }
        let answer = &self.answer[..rows * outputs];
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
                match fault {
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
        self.output.flush()?;
        Ok(true)
    }

    /// Warns of lines outside the range seen in training.
    pub(super) fn warn(&self) {
        self.outside.warn();
    }
}
