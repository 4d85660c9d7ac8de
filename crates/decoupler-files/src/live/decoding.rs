use std::{
    collections::VecDeque,
    fmt,
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    decoupling::{Decoder, ProgramDecoder},
    live::{DriftMonitor, FaultEvent, FaultyWire, LiveError, WireCheck, ZeroGains},
    scene::{Deformation, NoiseSource, Scene},
    sensor::SensorModel,
};
use glam::DVec3;
use ndarray::Array2;

use super::SessionError;
use crate::export::NetworkFile;

/// Decodes rows of readings with the network of a file or, on an array with a faulty wire, without that wire.
#[derive(Debug)]
pub(super) struct Decoding {
    pub(super) file: Arc<NetworkFile>,
    decoder: ProgramDecoder,
    pub(super) drift: Result<DriftMonitor, LiveError>,
    /// Answer for the last rows: rows × targets.
    pub(super) values: Vec<f64>,
    /// Wire that it was decoded without.
    pub(super) left_out: Option<FaultyWire>,
}

/// Readings so far from the training range that they have no answer.
pub(super) const NO_ANSWER: &str =
    "the readings are so far outside the training range that the network's output is not a finite number";

impl Decoding {
    pub(super) fn new(file: Arc<NetworkFile>) -> Self {
        Self {
            decoder: file.decoder(),
            drift: file.drift.clone().map(DriftMonitor::new),
            values: Vec::new(),
            left_out: None,
            file,
        }
    }

    /// Number of readings of a row.
    pub(super) fn channels(&self) -> usize {
        self.decoder.channels()
    }

    /// Decodes the latest readings of `rows` rows from `first_row` on without the wire of the fault that was named. Returns
    /// `false` if there is no such fault, or no answer without it.
    pub(super) fn leave_out(&mut self, first_row: usize, rows: usize, array: &mut LiveArray) -> bool {
        self.values.resize(rows * self.file.problem.targets.len(), 0.0);
        self.left_out = array.decode(first_row, &mut self.values);
        self.left_out.is_some()
    }

    /// Decodes `readings` of the rows from `first_row` on with the network. Returns `false` if there is no finite answer.
    pub(super) fn decode(&mut self, first_row: usize, readings: &[f64]) -> bool {
        let (channels, targets) = (self.channels(), self.file.problem.targets.len());
        self.left_out = None;
        self.values.resize(readings.len() / channels * targets, 0.0);
        let answers = self.values.chunks_exact_mut(targets);
        for (row, (readings, answer)) in readings.chunks_exact(channels).zip(answers).enumerate() {
            if self.decoder.decode_row(first_row + row, readings, answer).is_err() {
                return false;
            }
        }
        self.values.iter().all(|value| value.is_finite())
    }

    /// Answer of the network for a whole frame, with all wires.
    fn by_all(&mut self, frame_ohm: &[f64]) -> Option<Vec<f64>> {
        let mut answer_mm = vec![0.0; self.values.len()];
        self.decoder.decode(frame_ohm, &mut answer_mm).ok()?;
        Some(answer_mm)
    }

    /// Returns the numbers of readings and of targets outside the range seen in training of rows from `first_row` on, except
    /// readings that `is_left_out` names by row and channel; the first is `None` if that range is not known.
    pub(super) fn outside(
        &self,
        first_row: usize,
        readings: &[f64],
        values: &[f64],
        is_left_out: impl Fn(usize, usize) -> bool,
    ) -> (Option<usize>, usize) {
        let mut outside = (Some(0), 0);
        let rows = readings.chunks_exact(self.channels());
        let rows = rows.zip(values.chunks_exact(self.file.problem.targets.len()));
        for (row, (readings, values)) in rows.enumerate() {
            let row = first_row + row;
            let network = self.file.network.at(row);
            let inputs = network.inputs();
            let of_row = inputs.range().map(|range| {
                let outside = range.outside(inputs.quantity(), readings);
                outside.filter(|&channel| !is_left_out(row, channel)).count()
            });
            outside.0 = outside.0.zip(of_row).map(|(sum, count)| sum + count);
            outside.1 += network.outputs().far_outside(values).count();
        }
        outside
    }
}

/// An array whose frames are decoded: its latest readings, the unloaded state, and the check of its wires.
#[derive(Debug)]
pub struct LiveArray {
    /// Its model.
    pub sensor: SensorModel,
    /// Row-wires read, from 0.
    pub rows: Arc<[usize]>,
    /// Readings without load: rows × M4, in ohm.
    rest_ohm: Vec<f64>,
    noise: NoiseSource,
    zero: Option<ZeroGains>,
    /// Latest whole frames as received, for [`ZeroGains::estimate`].
    latest_ohm: VecDeque<Vec<f64>>,
    /// Latest readings of every row read, as received: rows × M4.
    pub(super) raw_ohm: Vec<f64>,
    /// The same, divided by the gains of the unloaded state.
    pub(super) frame_ohm: Vec<f64>,
    /// Rows with readings since the last whole frame.
    is_new: Vec<bool>,
    /// State of its wires.
    pub watched: Watched,
    check: Option<WireCheck>,
    checked: Option<Instant>,
    /// Sums of the errors since a fault was named, with all wires and without the faulty ones, and their number.
    since_named: ([f64; 2], u64),
}

/// Result of fault detection.
#[derive(Clone, Debug, PartialEq)]
pub enum Watched {
    /// Faults are not looked for, with the reason.
    Off(Unwatched),
    /// Last event; [`FaultEvent::Recovered`] at first. The readings of a named wire are left out.
    Checked(FaultEvent),
}

/// Reason why faults of wires are not looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unwatched {
    /// The noise of the readings is not known.
    NoNoise,
    /// There are too many readings.
    TooLarge,
}

impl fmt::Display for Unwatched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoNoise => "not looked for: without noise, deviations cannot be judged; give the noise of a reading",
            Self::TooLarge => "not looked for: the array is too large to check every frame",
        })
    }
}

impl Watched {
    /// Returns the wire of the fault that was named.
    pub fn wire(&self) -> Option<FaultyWire> {
        match *self {
            Self::Checked(FaultEvent::Named { wire, .. }) => Some(wire),
            Self::Off(_) | Self::Checked(_) => None,
        }
    }

    /// Returns `true` for a reading that is left out.
    pub fn leaves_out(&self, row: usize, column: usize) -> bool {
        (self.wire()).is_some_and(|wire| wire == FaultyWire::Row(row) || wire.columns().contains(&column))
    }
}

/// Mean |error| of z over all nodes, in millimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TruthErrors {
    /// Over the last second or so, of the displayed answers.
    pub shown_mm: Option<f64>,
    /// Since a fault was named: of the network with all wires, and with the faulty wires left out.
    pub since_named_mm: Option<[f64; 2]>,
}

/// Minimum time between checks of the wires where frames cannot wait, so that none is dropped because of them.
const BETWEEN_CHECKS: Duration = Duration::from_millis(10);

impl LiveArray {
    /// Prepares for frames of `sensor` with the rows and the noise of `scene`.
    pub(super) fn new(sensor: &SensorModel, scene: &Scene, zero: Option<ZeroGains>) -> Result<Self, SessionError> {
        let scale = sensor.scale;
        let rows = scene.rows.read(scale.rows())?;
        let at_rest = vec![DVec3::ZERO; scale.nodes_per_row()];
        let mut rest_ohm = Vec::with_capacity(rows.len() * scale.columns());
        for &row in &rows {
            rest_ohm.extend(sensor.row_resistances(row, &at_rest)?);
        }
        let (watched, check) = if scene.noise.is_none() {
            (Watched::Off(Unwatched::NoNoise), None)
        } else if !WireCheck::is_affordable(scale, scene) {
            (Watched::Off(Unwatched::TooLarge), None)
        } else {
            let check = WireCheck::new(sensor, scene, &rows)?;
            (Watched::Checked(FaultEvent::Recovered), Some(check))
        };
        let mut array = Self {
            sensor: *sensor,
            noise: scene.noise.source(sensor)?,
            zero: None,
            latest_ohm: VecDeque::with_capacity(ZeroGains::FRAMES),
            raw_ohm: rest_ohm.clone(),
            frame_ohm: rest_ohm.clone(),
            rest_ohm,
            is_new: vec![false; rows.len()],
            watched,
            check,
            checked: None,
            since_named: Default::default(),
            rows: rows.into(),
        };
        array.use_zero(zero);
        Ok(array)
    }

    /// Takes the readings of the rows from `first_row` on; returns `true` if every row now has new readings. The latest frame
    /// changes with every row, or with `by_frame` only once it is whole.
    pub(super) fn take(&mut self, first_row: usize, readings: &[f64], by_frame: bool) -> bool {
        let columns = self.sensor.scale.columns();
        let place = first_row * columns..first_row * columns + readings.len();
        self.raw_ohm[place.clone()].copy_from_slice(readings);
        self.is_new[first_row..][..readings.len() / columns].fill(true);
        let is_whole = self.is_new.iter().all(|is_new| *is_new);
        if is_whole {
            self.is_new.fill(false);
        }
        if !by_frame {
            self.frame_ohm[place].copy_from_slice(readings);
        } else if is_whole {
            self.frame_ohm.copy_from_slice(&self.raw_ohm);
            if let Some(zero) = &self.zero {
                zero.apply(&mut self.frame_ohm);
            }
        }
        is_whole
    }

    /// Keeps the frame among those from which the unloaded state is taken.
    pub(super) fn remember(&mut self) {
        let oldest = (self.latest_ohm.len() == ZeroGains::FRAMES).then(|| self.latest_ohm.pop_front());
        let mut latest = oldest.flatten().unwrap_or_default();
        latest.clear();
        latest.extend_from_slice(&self.raw_ohm);
        self.latest_ohm.push_back(latest);
    }

    /// Checks the wires with the latest frame; unless `checks_all`, not if that was done just before `now`. Returns a change.
    pub(super) fn check(&mut self, checks_all: bool, now: Instant) -> Option<FaultEvent> {
        let check = self.check.as_mut()?;
        let is_due = |checked: Instant| now.saturating_duration_since(checked) >= BETWEEN_CHECKS;
        if !checks_all && !self.checked.is_none_or(is_due) {
            return None;
        }
        let begun = Instant::now();
        let event = check.check(&self.frame_ohm);
        self.checked = Some(now + begun.elapsed());
        let event = event?;
        self.watched = Watched::Checked(event);
        if matches!(event, FaultEvent::Named { .. }) {
            self.since_named = Default::default();
        }
        Some(event)
    }

    /// Decodes rows of the latest frame without the wire of the named fault, which is returned; `None` if there is no fault, or
    /// no answer.
    fn decode(&mut self, first_row: usize, answer_mm: &mut [f64]) -> Option<FaultyWire> {
        let check = self.check.as_mut()?;
        let wire = check.named()?;
        let rows = answer_mm.len() / self.sensor.scale.coordinates_per_row();
        let decoded = check.decode(&self.frame_ohm, first_row..first_row + rows, answer_mm);
        (decoded.is_ok() && answer_mm.iter().all(|mm| mm.is_finite())).then_some(wire)
    }

    /// Takes the unloaded state from the latest frames, and divides readings by its gains from now on.
    ///
    /// # Errors
    /// If there are too few frames, or the array is loaded.
    pub fn take_zero(&mut self) -> Result<ZeroGains, LiveError> {
        let columns = self.sensor.scale.columns();
        let gains = ZeroGains::estimate(&self.latest_ohm, &self.rest_ohm, columns, &self.noise)?;
        self.zero = Some(gains.clone());
        Ok(gains)
    }

    /// Divides readings by these gains from now on, if they are of this array.
    pub fn use_zero(&mut self, zero: Option<ZeroGains>) {
        let columns = self.sensor.scale.columns();
        self.zero = zero.filter(|zero| zero.is_sound(self.rows.len(), columns));
    }

    /// Compares the answer for the latest frame with the truth; returns its mean |error| of z in millimetres.
    pub(super) fn compare(&mut self, decoding: &mut Decoding, truth: &Deformation) -> f64 {
        let shown_mm = self.error_mm(&decoding.values, truth);
        if decoding.left_out.is_some()
            && let Some(by_all_mm) = decoding.by_all(&self.frame_ohm)
        {
            let by_all_mm = self.error_mm(&by_all_mm, truth);
            let (sums, count) = &mut self.since_named;
            *sums = [sums[0] + by_all_mm, sums[1] + shown_mm];
            *count += 1;
        }
        shown_mm
    }

    fn error_mm(&self, answer_mm: &[f64], truth: &Deformation) -> f64 {
        let nodes = self.sensor.scale.nodes_per_row();
        let height_mm = self.sensor.geometry.height_mm;
        let truth_mm = self.rows.iter().flat_map(|&row| truth.row_mm(row));
        let errors = answer_mm.chunks_exact(3).zip(truth_mm);
        let sum: f64 = errors.map(|(node, u)| (node[2] - (height_mm - u.z)).abs()).sum();
        sum / (self.rows.len() * nodes) as f64
    }

    /// Returns the errors where the truth is known; `shown_mm` is the recent mean error.
    pub(super) fn truth_errors(&self, shown_mm: Option<f64>) -> TruthErrors {
        let (sums, count) = self.since_named;
        TruthErrors {
            shown_mm,
            since_named_mm: (self.watched.wire().is_some() && count > 0).then(|| sums.map(|sum| sum / count as f64)),
        }
    }

    /// Returns the drop of each reading of the latest frame from its value without load, in percent: rows × columns.
    pub fn drops_percent(&self) -> Array2<f64> {
        let columns = self.sensor.scale.columns();
        Array2::from_shape_fn((self.rows.len(), columns), |(row, column)| {
            let index = row * columns + column;
            100.0 * (1.0 - self.frame_ohm[index] / self.rest_ohm[index])
        })
    }

    /// Returns the root mean square of m/R − 1 over the readings m of the latest frame that are not left out, with R from
    /// Eq. (2) at this answer; infinite if the model has no resistance there.
    pub fn residual(&self, answer_mm: &[f64]) -> f64 {
        let scale = self.sensor.scale;
        let (mut sum, mut count) = (0.0, 0);
        let mut model_ohm = vec![0.0; scale.columns()];
        let of_rows = self.frame_ohm.chunks_exact(scale.columns());
        let of_rows = of_rows.zip(answer_mm.chunks_exact(scale.coordinates_per_row()));
        for ((ohm, mm), &row) in of_rows.zip(self.rows.iter()) {
            let nodes = mm.chunks_exact(3).map(DVec3::from_slice).enumerate();
            let displacements_mm: Vec<DVec3> = nodes
                .map(|(node, position_mm)| self.sensor.displacement_mm(row, node, position_mm))
                .collect();
            let modelled = self.sensor.row_resistances_into(row, &displacements_mm, &mut model_ohm);
            if modelled.is_err() {
                return f64::INFINITY;
            }
            let used = (0..scale.columns()).filter(|&column| !self.watched.leaves_out(row, column));
            for column in used {
                sum += (ohm[column] / model_ohm[column] - 1.0).powi(2);
                count += 1;
            }
        }
        (sum / f64::from(count.max(1))).sqrt()
    }
}
