use std::io::{self, Write};

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Run, StartRecord},
    sensor::ArrayScale,
    training::{EpochRecord, Stage, StopReason},
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::PastNetwork;

/// Writes the names of the columns of [`write_samples`], with or without those of decoded coordinates, and ends the
/// line.
///
/// # Errors
/// Any error of `writer`.
pub fn write_samples_header(scale: ArrayScale, with_decoded: bool, writer: &mut dyn Write) -> io::Result<()> {
    write!(writer, "snapshot,row,")?;
    for column in 1..=scale.columns() {
        write!(writer, "r_{column},")?;
    }
    if with_decoded {
        for node in 1..=scale.nodes_per_row() {
            write!(writer, "x_{node},y_{node},z_{node},")?;
        }
        write_names("decoded_", scale.nodes_per_row(), writer)?;
    } else {
        write_names("", scale.nodes_per_row(), writer)?;
    }
    writeln!(writer)
}

/// Writes the samples of `set` as CSV: snapshot and row-wire, M4 resistances in ohm, x, y, z of each node in
/// millimetres, and the decoded coordinates `decoded_mm` (samples × 3·M2). Row-wires are written counted from 1,
/// snapshots from `first_snapshot`; the row-wire is empty where it is not known.
///
/// # Errors
/// Any error of `writer`.
pub fn write_samples(
    set: &Dataset,
    decoded_mm: Option<&Array2<f64>>,
    first_snapshot: usize,
    writer: &mut dyn Write,
) -> io::Result<()> {
    for sample in 0..set.samples() {
        write!(writer, "{},", first_snapshot + set.groups()[sample])?;
        if let Some(row_wire) = set.row_wire(sample) {
            write!(writer, "{}", row_wire + 1)?;
        }
        write!(writer, ",")?;
        let decoded_mm = decoded_mm.map(|decoded_mm| decoded_mm.row(sample));
        let decoded_mm = decoded_mm.iter().flatten();
        let measured = set.sample_readings(sample).iter().chain(set.sample_targets(sample));
        write_numbers(measured.chain(decoded_mm), writer)?;
        writeln!(writer)?;
    }
    Ok(())
}

/// Writes the names of the columns of [`write_decoded`], and ends the line.
///
/// # Errors
/// Any error of `writer`.
pub fn write_decoded_header(nodes: usize, writer: &mut dyn Write) -> io::Result<()> {
    write_names("", nodes, writer)?;
    writeln!(writer, ",readings_outside,coordinates_outside")
}

/// Writes decoded coordinates in millimetres, how many of the readings were outside the range seen in training, empty if
/// that is not known, and how many of the coordinates.
///
/// # Errors
/// Any error of `writer`.
pub fn write_decoded(
    coordinates_mm: ndarray::ArrayView1<'_, f64>,
    readings_outside: Option<usize>,
    coordinates_outside: usize,
    writer: &mut dyn Write,
) -> io::Result<()> {
    write_numbers(coordinates_mm, writer)?;
    write!(writer, ",")?;
    if let Some(count) = readings_outside {
        write!(writer, "{count}")?;
    }
    writeln!(writer, ",{coordinates_outside}")
}

/// Writes `x_1,y_1,z_1,…` for the nodes of a row-wire, each name prefixed with `before`.
fn write_names(before: &str, nodes: usize, writer: &mut dyn Write) -> io::Result<()> {
    for node in 1..=nodes {
        let separator = if node == 1 { "" } else { "," };
        write!(writer, "{separator}{before}x_{node},{before}y_{node},{before}z_{node}")?;
    }
    Ok(())
}

/// Writes numbers separated by commas; they read back bit for bit.
fn write_numbers<'a>(numbers: impl IntoIterator<Item = &'a f64>, writer: &mut dyn Write) -> io::Result<()> {
    let mut separator = "";
    for number in numbers {
        write!(writer, "{separator}{number:?}")?;
        separator = ",";
    }
    Ok(())
}

/// Record of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingRecord {
    /// Reason why training ended; `None` while it runs.
    pub stop_reason: Option<StopReason>,
    /// Epoch of the best network.
    pub best_epoch: usize,
    /// Number of epochs run: the last of the history.
    pub epochs: usize,
    /// Training time on one thread in seconds, summed over the networks of all rows.
    pub seconds: f64,
    /// Record of every epoch, from the initial weights on.
    #[serde(with = "decoupler_core::training::epoch_columns")]
    pub history: Vec<EpochRecord>,
    /// Training methods in the order in which they were used.
    pub stages: Vec<Stage>,
    /// All starts of the run; the network is from the best one. Empty for the network of a past epoch.
    pub starts: Vec<StartRecord>,
}

impl TrainingRecord {
    /// Captures the record of `run` so far.
    pub(super) fn of(run: &Run) -> Self {
        let trainer = run.leader();
        Self {
            stop_reason: run.stop_reason(),
            best_epoch: trainer.best_epoch(),
            epochs: last_epoch(trainer.history()),
            seconds: trainer.elapsed().as_secs_f64(),
            history: trainer.history().to_vec(),
            stages: trainer.stages().to_vec(),
            starts: run.starts(),
        }
    }

    /// Captures the record, until a past epoch, of the start that was best at that epoch.
    pub(super) fn until(run: &Run, past: &PastNetwork) -> Self {
        let trainer = run.trainers().get(past.start).unwrap_or_else(|| run.leader());
        let epochs = trainer.history().partition_point(|record| record.epoch <= past.epoch);
        let stages = trainer
            .stages()
            .partition_point(|stage| stage.first_epoch <= past.epoch);
        Self {
            stop_reason: Some(StopReason::Stopped),
            best_epoch: past.best_epoch,
            epochs: last_epoch(&trainer.history()[..epochs]),
            seconds: past.elapsed.as_secs_f64(),
            history: trainer.history()[..epochs].to_vec(),
            stages: trainer.stages()[..stages].to_vec(),
            // The states of the other starts at that epoch are not kept.
            starts: Vec::new(),
        }
    }
}

fn last_epoch(history: &[EpochRecord]) -> usize {
    history.last().map_or(0, |record| record.epoch)
}
