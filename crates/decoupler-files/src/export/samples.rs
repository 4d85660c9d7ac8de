use std::io::{self, Write};

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Run, StartRecord},
    sensor::ArrayScale,
    training::{EpochRecord, Stage, StopReason},
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::{PastNetwork, write_csv_row};

/// Writes the names of the columns of [`write_samples`], with or without those of decoded coordinates, and ends the
/// line.
///
/// # Errors
/// Any error of `writer`.
pub fn write_samples_header(scale: ArrayScale, with_decoded: bool, writer: &mut dyn Write) -> io::Result<()> {
    let nodes = scale.nodes_per_row();
    let readings = (1..=scale.columns()).map(|column| format!("r_{column}"));
    let names = ["snapshot", "row"].map(str::to_owned).into_iter().chain(readings);
    let decoded = coordinates("decoded_", nodes).take(if with_decoded { 3 * nodes } else { 0 });
    write_csv_row(names.chain(coordinates("", nodes)).chain(decoded), writer)
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
        let decoded_mm = decoded_mm.map(|decoded_mm| decoded_mm.row(sample));
        let measured = set.sample_readings(sample).iter().chain(set.sample_targets(sample));
        for number in measured.chain(decoded_mm.iter().flatten()) {
            write!(writer, ",{number:?}")?;
        }
        writeln!(writer)?;
    }
    Ok(())
}

/// Writes the names of the columns of [`write_decoded`], and ends the line.
///
/// # Errors
/// Any error of `writer`.
pub fn write_decoded_header(nodes: usize, writer: &mut dyn Write) -> io::Result<()> {
    let counts = ["readings_outside", "coordinates_outside"].map(str::to_owned);
    write_csv_row(coordinates("", nodes).chain(counts), writer)
}

/// Writes decoded coordinates in millimetres, which read back bit for bit, how many of the readings were outside the range seen
/// in training, empty if that is not known, and how many of the coordinates.
///
/// # Errors
/// Any error of `writer`.
pub fn write_decoded(
    coordinates_mm: ndarray::ArrayView1<'_, f64>,
    readings_outside: Option<usize>,
    coordinates_outside: usize,
    writer: &mut dyn Write,
) -> io::Result<()> {
    for number in coordinates_mm {
        write!(writer, "{number:?},")?;
    }
    if let Some(count) = readings_outside {
        write!(writer, "{count}")?;
    }
    writeln!(writer, ",{coordinates_outside}")
}

/// Names `x_1`, `y_1`, `z_1`, … of the nodes of a row-wire, each prefixed with `before`.
fn coordinates(before: &str, nodes: usize) -> impl Iterator<Item = String> {
    (1..=nodes).flat_map(move |node| ["x", "y", "z"].map(|axis| format!("{before}{axis}_{node}")))
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
    /// Training time in seconds: [`Run::training_time`].
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
            epochs: trainer.history().last().map_or(0, |record| record.epoch),
            seconds: run.training_time().as_secs_f64(),
            history: trainer.history().to_vec(),
            stages: trainer.stages().to_vec(),
            starts: run.starts(),
        }
    }

    /// Captures the record, until a past epoch, of the start that was best at that epoch.
    pub(super) fn until(run: &Run, past: &PastNetwork) -> Self {
        let trainer = run.trainers().get(past.start).unwrap_or_else(|| run.leader());
        let history = { trainer.history().iter() }.filter(|record| record.epoch <= past.epoch);
        let stages = { trainer.stages().iter() }.filter(|stage| stage.first_epoch <= past.epoch);
        let history = Vec::from_iter(history.copied());
        Self {
            stop_reason: Some(StopReason::Stopped),
            best_epoch: past.best_epoch,
            epochs: history.last().map_or(0, |record| record.epoch),
            seconds: past.elapsed.as_secs_f64(),
            history,
            stages: stages.copied().collect(),
            // The states of the other starts at that epoch are not kept.
            starts: Vec::new(),
        }
    }
}
