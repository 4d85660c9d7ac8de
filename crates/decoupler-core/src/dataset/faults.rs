use glam::DVec3;

use super::Dataset;
use crate::{
    scene::{Deformation, FaultySensor},
    sensor::SensorModel,
};

impl Dataset {
    /// Replaces the readings of simulated snapshots by what the wires and amplifiers of a faulty sensor make of them, before
    /// noise is added. `model` is the sensor without its fault.
    pub fn break_before_noise(&mut self, model: &SensorModel, faulty: &FaultySensor) {
        let deformations: Vec<Deformation> = (0..self.samples())
            .step_by(self.row_count())
            .map(|first| self.simulated_deformation(model, first))
            .collect();
        let read = self.row_wires_read().map_or_else(Vec::new, <[usize]>::to_vec);
        let length = read.len() * self.channels();
        let snapshots = self.readings_mut().chunks_exact_mut(length);
        for (snapshot, deformation) in snapshots.zip(&deformations) {
            faulty.before_noise(&read, deformation, snapshot);
        }
    }

    /// Replaces the readings of simulated snapshots by what the converter of a faulty sensor makes of them, after noise was
    /// added.
    pub fn break_after_noise(&mut self, faulty: &FaultySensor) {
        let read = self.row_wires_read().map_or_else(Vec::new, <[usize]>::to_vec);
        let length = read.len() * self.channels();
        for snapshot in self.readings_mut().chunks_exact_mut(length) {
            faulty.after_noise(&read, snapshot);
        }
    }

    /// Deformation of the simulated snapshot that begins with sample `first`. Row-wires that are not read are at rest.
    fn simulated_deformation(&self, model: &SensorModel, first: usize) -> Deformation {
        let read = self.row_wires_read().unwrap_or_default();
        Deformation::from_fn(model.scale, |row, node| {
            let index = read.iter().position(|&other| other == row);
            index.map_or(DVec3::ZERO, |index| {
                let coordinates_mm = &self.sample_targets(first + index)[3 * node..];
                model.displacement_mm(row, node, DVec3::from_slice(coordinates_mm))
            })
        })
    }
}
