//! Golden pairs: readings of the caller with the answers of the decoder.

use decoupler_core::{
    decoupling::{DecodeError, Decoder, Program, ProgramDecoder},
    text::inert,
};

use super::{
    contents::Contents,
    exported_program::Limits,
    exporting::{as_it_is, in_f32},
};
use crate::export::write_csv_row;

/// Readings with the answers that the decoder gives to them.
#[derive(Clone, Debug)]
pub(super) struct Golden {
    rows: Vec<GoldenRow>,
    /// Number of them in the bundle.
    printed: usize,
}

/// Readings of a row.
#[derive(Clone, Debug)]
pub(super) struct GoldenRow {
    /// `true` if they do not continue the row before.
    pub(super) is_new_series: bool,
    /// Time in seconds; `None` if it does not matter.
    pub(super) time_s: Option<f64>,
    /// Index of the row-wire if it is an argument, otherwise 0.
    pub(super) row: usize,
    /// Readings of the caller, in double precision.
    pub(super) readings: Vec<f64>,
    /// Targets that the decoder gives; filled by [`Golden::of`].
    pub(super) targets: Vec<f64>,
}

impl GoldenRow {
    /// Readings of a row that continue those before, without a time.
    pub(super) fn new(row: usize, readings: Vec<f64>) -> Self {
        Self {
            is_new_series: false,
            time_s: None,
            row,
            readings,
            targets: Vec::new(),
        }
    }

    /// The same row with other readings.
    pub(super) fn rounded(&self, taken: impl Fn(usize, f64) -> f64) -> Self {
        let readings = self.readings.iter().enumerate();
        Self {
            readings: readings.map(|(channel, &reading)| taken(channel, reading)).collect(),
            ..self.clone()
        }
    }
}

impl Golden {
    /// Answers the rows by the decoder of `program` (of targets and perhaps more); the first `printed` are for the bundle.
    ///
    /// # Errors
    /// If a reading cannot be decoded.
    pub(super) fn of(
        mut rows: Vec<GoldenRow>,
        printed: usize,
        program: &Program,
        outputs: usize,
    ) -> Result<Self, DecodeError> {
        let answers = answers(&rows, program, as_it_is)?;
        for (row, answer) in rows.iter_mut().zip(answers) {
            row.targets = answer[..outputs].to_vec();
        }
        Ok(Self {
            printed: printed.min(rows.len()),
            rows,
        })
    }

    /// Leaves out the rows with a reading beyond its limits.
    pub(super) fn retain_within(&mut self, limits: &Limits) {
        let is_within = |row: &GoldenRow| {
            let mut readings = row.readings.iter().zip(&limits[row.row.min(limits.len() - 1)]);
            readings.all(|(reading, (low, high))| (low..=high).contains(&reading))
        };
        self.printed = self.printed().iter().filter(|row| is_within(row)).count();
        self.rows.retain(is_within);
    }

    /// Those in the bundle.
    pub(super) fn printed(&self) -> &[GoldenRow] {
        &self.rows[..self.printed]
    }

    /// All rows.
    pub(super) fn all(&self) -> &[GoldenRow] {
        &self.rows
    }

    /// Largest deviation of the targets of `program`, which takes each reading as `taken` says, relative to `scales`. NaN if an
    /// answer is NaN.
    ///
    /// # Errors
    /// If a reading cannot be decoded.
    pub(super) fn deviation(
        &self,
        program: &Program,
        scales: &[f64],
        taken: impl Fn(usize, f64) -> f64,
    ) -> Result<f64, DecodeError> {
        let changes = self.changes(program, taken)?;
        let pairs = changes.into_iter().flatten().zip(scales.iter().copied().cycle());
        Ok(largest(pairs))
    }

    /// Change of the targets by rounding the readings to single precision: at most, over all ways in which the readings may be
    /// rounded, to first order.
    ///
    /// # Errors
    /// If a reading cannot be decoded.
    pub(super) fn rounding(&self, program: &Program, scales: &[f64]) -> Result<f64, DecodeError> {
        let mut sums: Vec<Vec<f64>> = self.rows.iter().map(|row| vec![0.0; row.targets.len()]).collect();
        for nudged in 0..program.channels() {
            let taken = |channel: usize, reading: f64| match channel == nudged {
                true => reading + single_rounding(reading),
                false => reading,
            };
            for (sums, changes) in sums.iter_mut().zip(self.changes(program, taken)?) {
                let pairs = sums.iter_mut().zip(changes);
                pairs.for_each(|(sum, change)| *sum += change.abs());
            }
        }
        let at_most = largest(sums.into_iter().flatten().zip(scales.iter().copied().cycle()));
        let measured = self.deviation(program, scales, in_f32)?;
        Ok(larger(at_most, measured))
    }

    /// Changes of the targets if `program` decides and each reading is taken as `taken` says: rows × targets.
    fn changes(&self, program: &Program, taken: impl Fn(usize, f64) -> f64) -> Result<Vec<Vec<f64>>, DecodeError> {
        let mut changes = answers(&self.rows, program, taken)?;
        for (row, answer) in self.rows.iter().zip(&mut changes) {
            answer.truncate(row.targets.len());
            let pairs = answer.iter_mut().zip(&row.targets);
            pairs.for_each(|(answer, target)| *answer -= target);
        }
        Ok(changes)
    }

    /// The rows in the bundle as CSV: where a series begins and times if they matter, the row from 1 if it is an argument,
    /// readings, targets.
    pub(super) fn csv(&self, contents: &Contents) -> String {
        let meaning = &contents.meaning;
        let (is_sequence, takes_row) = (contents.history().is_some(), contents.takes_row());
        let mut names = Vec::new();
        if is_sequence {
            names.extend(["new_series", "time_s"].map(str::to_owned));
        }
        names.extend(takes_row.then(|| "row".to_owned()));
        let channels = meaning.inputs.iter().chain(&meaning.targets);
        names.extend(channels.map(|channel| inert(&channel.name)));
        // User-defined names may contain commas and quotation marks.
        let mut bytes = Vec::new();
        let mut write =
            |fields: Vec<String>| write_csv_row(fields, &mut bytes).expect("writing to memory does not fail");
        write(names);
        for row in self.printed() {
            let mut fields = Vec::new();
            if is_sequence {
                fields.push(u8::from(row.is_new_series).to_string());
                fields.push(row.time_s.map_or_else(String::new, |time_s| time_s.to_string()));
            }
            if takes_row {
                fields.push((row.row + 1).to_string());
            }
            fields.extend(row.readings.iter().chain(&row.targets).map(f64::to_string));
            write(fields);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

/// Answers of a program to all rows in their order.
fn answers(
    rows: &[GoldenRow],
    program: &Program,
    taken: impl Fn(usize, f64) -> f64,
) -> Result<Vec<Vec<f64>>, DecodeError> {
    let mut decoder = ProgramDecoder::new(program.clone());
    let mut series = 0;
    rows.iter()
        .map(|row| {
            series += u64::from(row.is_new_series);
            let mut answer = vec![0.0; decoder.outputs()];
            let readings = row.rounded(&taken).readings;
            decoder.step((series, row.time_s), row.row, &readings, &mut answer)?;
            Ok(answer)
        })
        .collect()
}

/// Largest error by rounding a number to single precision.
fn single_rounding(value: f64) -> f64 {
    let of_digits = value.abs() * 0.5 * f64::from(f32::EPSILON);
    // Subnormal numbers have fewer digits.
    of_digits.max(0.5 * f64::from(f32::from_bits(1)))
}

/// Largest size relative to its scale; NaN if one is NaN.
fn largest(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    pairs.fold(0.0, |most, (change, scale)| larger(most, change.abs() / scale))
}

/// Returns the larger of two deviations, or NaN if either is NaN.
fn larger(one: f64, other: f64) -> f64 {
    if one.is_nan() || one >= other { one } else { other }
}
