use std::{
    collections::VecDeque,
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::DatasetError,
    live::{FaultEvent, FaultyWire, LiveError, WireCheck, ZeroGains},
    scene::{Deformation, NoiseSource, Scene},
    sensor::SensorModel,
};
use glam::DVec3;
use ndarray::Array2;

use super::{Answer, SessionError};

/// An array whose frames are decoded: its latest readings, the unloaded state, and the check of its wires.
#[derive(Debug)]
pub struct LiveArray {
    /// Its model.
    pub sensor: SensorModel,
    /// Row-wires read, from 0.
    pub rows: Arc<[usize]>,
    /// State of its wires.
    pub watched: Watched,
    /// Readings without load: rows × M4, in ohm.
    rest_ohm: Vec<f64>,
    noise: NoiseSource,
    /// Gains of the unloaded state by which readings are divided.
    pub zero: Option<ZeroGains>,
    /// Latest whole frames as received, for [`ZeroGains::estimate`].
    latest_ohm: VecDeque<Vec<f64>>,
    /// Latest readings of every row read, as received until the frame is whole: rows × M4.
    pub(super) frame_ohm: Vec<f64>,
    /// Rows with readings since the last whole frame.
    is_new: Vec<bool>,
    check: Option<WireCheck>,
    checked: Option<Instant>,
}

/// Result of fault detection.
#[derive(Clone, Debug, PartialEq)]
pub enum Watched {
    /// Faults are not looked for, because the noise of the readings is not known.
    NoNoise,
    /// Faults are not looked for, because there are too many readings.
    TooLarge,
    /// Last event; [`FaultEvent::Recovered`] at first. The readings of a named wire are left out.
    Checked(FaultEvent),
}

impl Watched {
    /// Returns the wire of the fault that was named.
    pub fn wire(&self) -> Option<FaultyWire> {
        match *self {
            Self::Checked(FaultEvent::Named { wire, .. }) => Some(wire),
            Self::NoNoise | Self::TooLarge | Self::Checked(_) => None,
        }
    }

    /// Returns `true` for a reading that is left out.
    pub fn leaves_out(&self, row: usize, column: usize) -> bool {
        (self.wire()).is_some_and(|wire| wire == FaultyWire::Row(row) || wire.columns().contains(&column))
    }
}

/// Minimum time between checks of the wires where frames cannot wait, so that none is dropped because of them.
const BETWEEN_CHECKS: Duration = Duration::from_millis(10);

impl LiveArray {
    /// Prepares for frames of `sensor` with the rows and the noise of `scene`.
    pub(super) fn new(sensor: &SensorModel, scene: &Scene, zero: Option<ZeroGains>) -> Result<Self, SessionError> {
        let scale = sensor.scale;
        let rows = scene.rows.read(scale.rows()).map_err(DatasetError::from)?;
        let at_rest = vec![DVec3::ZERO; scale.nodes_per_row()];
        let of_rows = rows.iter().map(|&row| sensor.row_resistances(row, &at_rest));
        let rest_ohm = of_rows.collect::<Result<Vec<_>, _>>()?.concat();
        let watched = match scene.noise.is_none() {
            true => Watched::NoNoise,
            false if !WireCheck::is_affordable(scale, scene) => Watched::TooLarge,
            false => Watched::Checked(FaultEvent::Recovered),
        };
        let check = matches!(watched, Watched::Checked(_)).then(|| WireCheck::new(sensor, scene, &rows));
        Ok(Self {
            sensor: *sensor,
            noise: scene.noise.source(sensor)?,
            zero: zero.filter(|zero| zero.is_sound(rows.len(), scale.columns())),
            latest_ohm: VecDeque::with_capacity(ZeroGains::FRAMES),
            frame_ohm: rest_ohm.clone(),
            rest_ohm,
            is_new: vec![false; rows.len()],
            watched,
            check: check.transpose()?,
            checked: None,
            rows: rows.into(),
        })
    }

    /// Takes readings of the rows from `first_row` on; returns `true` if every row now has new ones.
    pub(super) fn take(&mut self, first_row: usize, readings: &[f64]) -> bool {
        let columns = self.sensor.scale.columns();
        self.frame_ohm[first_row * columns..][..readings.len()].copy_from_slice(readings);
        self.is_new[first_row..][..readings.len() / columns].fill(true);
        let is_whole = self.is_new.iter().all(|is_new| *is_new);
        if is_whole {
            self.is_new.fill(false);
        }
        is_whole
    }

    /// Keeps the frame, which is whole, among those from which the unloaded state is taken, and divides it by the gains of the
    /// unloaded state.
    pub(super) fn whole(&mut self) {
        let oldest = (self.latest_ohm.len() == ZeroGains::FRAMES).then(|| self.latest_ohm.pop_front());
        let mut latest = oldest.flatten().unwrap_or_default();
        latest.clone_from(&self.frame_ohm);
        self.latest_ohm.push_back(latest);
        if let Some(zero) = &self.zero {
            zero.apply(&mut self.frame_ohm);
        }
    }

    /// Checks the wires with the frame, which is whole; unless `checks_all`, not if that was done just before `now`. Returns a change.
    pub(super) fn check(&mut self, checks_all: bool, now: Instant) -> Option<FaultEvent> {
        let check = self.check.as_mut()?;
        let is_due = |checked: Instant| now.saturating_duration_since(checked) >= BETWEEN_CHECKS;
        if !checks_all && !self.checked.is_none_or(is_due) {
            return None;
        }
        let begun = Instant::now();
        let event = check.check(&self.frame_ohm);
        self.checked = Some(now + begun.elapsed());
        self.watched = Watched::Checked(event?);
        event
    }

    /// Decodes rows of the latest frame without the wire of the named fault, which is returned; `None` if there is no fault, or
    /// no answer.
    pub(super) fn decode(
        &mut self,
        first_row: usize,
        readings: &[f64],
        answer_mm: &mut Vec<f64>,
    ) -> Option<FaultyWire> {
        let check = self.check.as_mut()?;
        let wire = check.named()?;
        let rows = readings.len() / self.sensor.scale.columns();
        answer_mm.resize(rows * self.sensor.scale.coordinates_per_row(), 0.0);
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

    /// Returns the mean |error| of z over all nodes of an answer for a whole frame, in millimetres.
    pub(super) fn error_mm(&self, answer_mm: &[f64], truth: &Deformation) -> f64 {
        let nodes = self.rows.len() * self.sensor.scale.nodes_per_row();
        let truth_mm = self
            .rows
            .iter()
            .flat_map(|&row| truth.row_positions_mm(&self.sensor, row));
        let errors = answer_mm.chunks_exact(3).zip(truth_mm);
        errors.map(|(node, truth_mm)| (node[2] - truth_mm.z).abs()).sum::<f64>() / nodes as f64
    }

    /// Returns the drop of each reading of a whole frame from its value without load, in percent: rows × columns.
    pub fn drops_percent(&self, frame_ohm: &[f64]) -> Array2<f64> {
        let columns = self.sensor.scale.columns();
        Array2::from_shape_fn((self.rows.len(), columns), |(row, column)| {
            let index = row * columns + column;
            100.0 * (1.0 - frame_ohm[index] / self.rest_ohm[index])
        })
    }

    /// Returns the root mean square of m/R − 1 over the readings m of a whole frame that are not left out, with R from
    /// Eq. (2) at the answer; infinite if the model has no resistance there.
    pub fn residual(&self, answer: &Answer) -> f64 {
        let scale = self.sensor.scale;
        let mut squares = Vec::with_capacity(answer.readings.len());
        let of_rows = answer.readings.chunks_exact(scale.columns());
        let of_rows = of_rows.zip(answer.values.chunks_exact(scale.coordinates_per_row()));
        for ((ohm, mm), &row) in of_rows.zip(self.rows.iter()) {
            let nodes = mm.chunks_exact(3).map(DVec3::from_slice).enumerate();
            let displacements_mm = nodes.map(|(node, at_mm)| self.sensor.displacement_mm(row, node, at_mm));
            let modelled = self.sensor.row_resistances(row, &Vec::from_iter(displacements_mm));
            let Ok(model_ohm) = modelled else { return f64::INFINITY };
            let used = (0..scale.columns()).filter(|&column| !self.watched.leaves_out(row, column));
            squares.extend(used.map(|column| (ohm[column] / model_ohm[column] - 1.0).powi(2)));
        }
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }
}
