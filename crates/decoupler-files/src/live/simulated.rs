use std::f64::consts::TAU;

use decoupler_core::{
    dataset::{DatasetError, Seed, Stream},
    scene::{Deformation, Indenter, Loading, Noise, NoiseSource, Scene},
    sensor::{SensorError, SensorModel},
};
use glam::{DVec2, DVec3};
use rand::{Rng, RngExt, rngs::ChaCha8Rng};

use super::{Fault, FaultySensor, SessionError};

/// Source of frames without hardware: an indenter that moves over the array, pressing and lifting.
///
/// Its position and depth are sums of sines whose phases are drawn from the seed, so that the state at any time can be
/// computed. Frames of all row-wires read have a given rate; time is simulated, and the caller paces them. At any time a
/// fault can be switched on or off, and the indenter held or lifted.
#[derive(Debug)]
pub struct Simulated {
    model: SensorModel,
    indenter: Indenter,
    rows: Vec<usize>,
    stroke_mm: f64,
    path: PressPath,
    source: NoiseSource,
    noise: Noise,
    noise_rng: ChaCha8Rng,
    fault: Option<FaultySensor>,
    /// Motion of the indenter from the next frame on.
    pub motion: Motion,
    pub(super) frames_per_second: f64,
    frames: u64,
    /// Number of frames during which the indenter did not move along its path.
    frames_at_rest: u64,
    deformation: Deformation,
}

/// Motion of the indenter of a [`Simulated`] source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// Moves along its path, pressing and lifting.
    #[default]
    Wandering,
    /// Held at its current position and depth.
    Held,
    /// Lifted from the array; it resumes from its last position.
    Lifted,
}

impl Simulated {
    /// Prepares frames of `model` with the rows, stroke and noise of `scene`, and its indenter, or a ball if it has
    /// another loading.
    ///
    /// # Errors
    /// If the scene or the rate is invalid, or the array has no resistance at rest.
    pub fn new(model: &SensorModel, scene: &Scene, seed: Seed, frames_per_second: f64) -> Result<Self, SessionError> {
        scene.check().map_err(DatasetError::from)?;
        if !(frames_per_second > 0.0 && frames_per_second <= 1e6) {
            return Err(SessionError::Rate(frames_per_second));
        }
        let noise = scene.noise.in_test();
        let indenter = match scene.loading {
            Loading::Indenter(indenter) => indenter,
            Loading::RandomNodes | Loading::SmoothField { .. } => Indenter::default(),
        };
        Ok(Self {
            model: *model,
            indenter,
            rows: scene.rows.read(model.scale.rows()).map_err(DatasetError::from)?,
            stroke_mm: scene.stroke_mm(&model.geometry),
            path: PressPath::new(model, &mut seed.rng(Stream::Live)),
            source: noise.source(model)?,
            noise,
            noise_rng: seed.rng(Stream::LiveNoise),
            fault: None,
            frames_per_second,
            frames: 0,
            motion: Motion::default(),
            frames_at_rest: 0,
            deformation: Deformation::from_fn(model.scale, |_, _| DVec3::ZERO),
        })
    }

    /// Returns the row-wires read, from 0.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    /// Returns the number of readings in a frame: rows × M4.
    pub fn readings(&self) -> usize {
        self.rows.len() * self.model.scale.columns()
    }

    /// Skips `frames` frames, without drawing their noise.
    pub fn skip(&mut self, frames: u64) {
        self.frames += frames;
        if self.motion != Motion::Wandering {
            self.frames_at_rest += frames;
        }
    }

    /// Sets the fault of the following frames; `None` for none.
    ///
    /// # Errors
    /// If the array does not have its wires.
    pub fn set_fault(&mut self, fault: Option<Fault>) -> Result<(), SessionError> {
        if let Some(fault) = fault {
            fault.check(self.model.scale, &self.rows)?;
        }
        let prepared = fault.map(|fault| FaultySensor::new(&self.model, self.noise, fault));
        self.fault = prepared.transpose()?;
        Ok(())
    }

    /// Writes the next frame, rows × M4 readings in ohm, and returns its time in seconds.
    ///
    /// # Errors
    /// If the model has no resistance for the deformation.
    ///
    /// # Panics
    /// If the slice has the wrong length.
    pub fn next_frame(&mut self, readings_ohm: &mut [f64]) -> Result<f64, SensorError> {
        assert_eq!(readings_ohm.len(), self.readings());
        let time_s = self.frames as f64 / self.frames_per_second;
        let along_path_s = (self.frames - self.frames_at_rest) as f64 / self.frames_per_second;
        self.skip(1);
        let (place_mm, depth) = self.path.at(along_path_s);
        let depth = if self.motion == Motion::Lifted { 0.0 } else { depth };
        self.deformation = self.indenter.press(&self.model, place_mm, depth * self.stroke_mm);
        let columns = self.model.scale.columns();
        for (&row, readings_ohm) in self.rows.iter().zip(readings_ohm.chunks_exact_mut(columns)) {
            self.model
                .row_resistances_into(row, self.deformation.row_mm(row), readings_ohm)?;
        }
        let at = (&*self.rows, &self.deformation);
        match &self.fault {
            Some(fault) => fault.disturb_snapshot(at, readings_ohm, &self.source, &mut self.noise_rng),
            None => self.source.disturb(readings_ohm, &mut self.noise_rng),
        }
        Ok(time_s)
    }

    /// Returns the true deformation of the last frame; the undeformed state before the first frame.
    pub fn deformation(&self) -> &Deformation {
        &self.deformation
    }
}

/// Path of the indenter over the array.
#[derive(Clone, Copy, Debug)]
struct PressPath {
    middle_mm: DVec2,
    reach_mm: DVec2,
    /// Phases of the sines of x, y and depth in radians, two of each.
    phases: [[f64; 2]; 3],
}

/// Frequencies of the sines of x, y and depth in Hz, with ratios chosen for a long period.
const FREQUENCIES_HZ: [[f64; 2]; 3] = [[0.11, 0.29], [0.13, 0.31], [0.37, 0.89]];

impl PressPath {
    fn new(model: &SensorModel, rng: &mut impl Rng) -> Self {
        let (geometry, scale) = (&model.geometry, model.scale);
        let node_mm = |row, node| geometry.row_node_mm(scale, row, node).truncate();
        let (first_mm, last_mm) = (node_mm(0, 0), node_mm(scale.rows() - 1, scale.nodes_per_row() - 1));
        Self {
            middle_mm: 0.5 * (first_mm + last_mm),
            reach_mm: 0.5 * (last_mm - first_mm),
            phases: FREQUENCIES_HZ.map(|pair| pair.map(|_| TAU * rng.random::<f64>())),
        }
    }

    /// Position at a time, and depth as a fraction of the stroke: 0 while the indenter is lifted.
    fn at(&self, time_s: f64) -> (DVec2, f64) {
        let wave = |axis: usize| {
            let pairs = FREQUENCIES_HZ[axis].iter().zip(self.phases[axis]).zip([0.6, 0.4]);
            pairs
                .map(|((frequency, phase), share)| share * (TAU * frequency * time_s + phase).sin())
                .sum::<f64>()
        };
        let place_mm = self.middle_mm + self.reach_mm * DVec2::new(wave(0), wave(1));
        (place_mm, (0.4 + 0.6 * wave(2)).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source() -> Simulated {
        let scene = Scene {
            noise: Noise::default(),
            ..Scene::default()
        };
        Simulated::new(&SensorModel::new("4x4_2x12".parse().unwrap()), &scene, Seed(3), 50.0).unwrap()
    }

    fn next(source: &mut Simulated) -> (f64, Vec<f64>) {
        let mut ohm = vec![0.0; source.readings()];
        (source.next_frame(&mut ohm).unwrap(), ohm)
    }

    #[test]
    fn a_held_indenter_stays_a_lifted_one_leaves_no_trace_and_both_resume() {
        let (mut source, mut wandering) = (source(), source());
        let path: Vec<Vec<f64>> = (0..40).map(|_| next(&mut wandering).1).collect();
        for frame in &path[..20] {
            assert_eq!(&next(&mut source).1, frame);
        }
        source.motion = Motion::Held;
        for frame in 20..25 {
            let (time_s, ohm) = next(&mut source);
            assert_eq!((time_s, &ohm), (f64::from(frame) / 50.0, &path[20]));
        }
        source.motion = Motion::Lifted;
        next(&mut source);
        assert!((0..4).all(|row| source.deformation().row_mm(row).iter().all(|u| u.length() == 0.0)));
        source.motion = Motion::Wandering;
        for frame in &path[20..] {
            assert_eq!(&next(&mut source).1, frame);
        }
    }

    #[test]
    fn skipped_frames_leave_the_others_unchanged() {
        let (mut source, mut whole) = (source(), source());
        source.skip(7);
        (0..7).for_each(|_| drop(next(&mut whole)));
        assert_eq!(next(&mut source), next(&mut whole));
    }
}
