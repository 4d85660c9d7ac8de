use glam::DVec3;

use super::faults::{Diagnosis, FaultCause, FaultyWire, GaussianPrior, RowFit, View};
use crate::{
    dataset::{Seed, Stream},
    decoupling::{DecodeError, Decoder},
    scene::{Loading, Scene},
    sensor::{SensorError, SensorModel},
};

/// Decodes with the wires of a named fault left out, if there is one: the most probable deformation given the other readings, the noise and
/// the prior of the scene, by the Gauss-Newton method.
///
/// A broken row-wire is decoded from the nodes before its break, and two that touch from the mean of both. A row-wire of
/// which nothing is known takes the mean of its neighbours' latest answers, or of the prior where nodes are independent.
/// Decoding allocates nothing.
#[derive(Clone, Debug)]
pub struct LeftOutDecoder {
    model: SensorModel,
    fault: Option<Diagnosis>,
    rows: Vec<usize>,
    priors: Vec<GaussianPrior>,
    one: RowFit,
    two: RowFit,
    /// True if rows tell about their neighbours.
    has_neighbours: bool,
    /// Latest z displacements: rows × M2, in millimetres.
    depths_mm: Vec<f64>,
}

impl LeftOutDecoder {
    /// Prepares to decode `rows` of `model` in `scene`, first with all wires.
    ///
    /// # Errors
    /// A sensor without resistances.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        Ok(Self {
            model: *model,
            fault: None,
            rows: rows.to_vec(),
            priors: GaussianPrior::of_rows(model, scene, rows, &mut Seed(0).rng(Stream::Expectation)),
            one: RowFit::new(model, scene, 1)?,
            two: RowFit::new(model, scene, 2)?,
            has_neighbours: scene.loading != Loading::RandomNodes,
            depths_mm: vec![0.0; rows.len() * model.scale.nodes_per_row()],
        })
    }

    /// Sets the fault whose wires are left out from now on; `None` for none.
    pub fn leave_out(&mut self, fault: Option<Diagnosis>) {
        self.fault = fault;
    }

    /// Returns the fault whose wires are left out.
    pub fn fault(&self) -> Option<Diagnosis> {
        self.fault
    }

    fn remember(&mut self, row_index: usize, targets: &[f64]) {
        let nodes = self.model.scale.nodes_per_row();
        let height_mm = self.model.geometry.height_mm;
        let depths_mm = self.depths_mm[row_index * nodes..].iter_mut();
        depths_mm
            .zip(targets.chunks_exact(3))
            .for_each(|(depth, node)| *depth = height_mm - node[2]);
    }

    /// The mean of the neighbours' latest answers.
    fn interpolate(&self, row_index: usize, targets: &mut [f64]) {
        let nodes = self.model.scale.nodes_per_row();
        let row = self.rows[row_index];
        for (node, target) in targets.chunks_exact_mut(3).enumerate() {
            let mut neighbours = (0.0, 0.0);
            for (index, &other) in self.rows.iter().enumerate() {
                if other.abs_diff(row) == 1 {
                    neighbours.0 += self.depths_mm[index * nodes + node];
                    neighbours.1 += 1.0;
                }
            }
            let depth_mm = if neighbours.1 > 0.0 {
                neighbours.0 / neighbours.1
            } else {
                0.0
            };
            target.copy_from_slice(&self.model.displaced_mm(row, node, DVec3::Z * depth_mm).to_array());
        }
    }
}

impl Decoder for LeftOutDecoder {
    fn channels(&self) -> usize {
        self.model.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.model.scale.coordinates_per_row()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        DecodeError::check(readings)?;
        let row = self.rows[row_index];
        let nodes = self.model.scale.nodes_per_row();
        let prior = &self.priors[row_index];
        let wire = self.fault.map(|fault| fault.wire);
        let whole = View {
            rows: &[(row, prior)],
            readings_ohm: readings,
            left_out: wire.map_or([None; 2], FaultyWire::columns),
            nodes,
        };
        match (wire, self.fault.map(|fault| fault.cause)) {
            (Some(FaultyWire::Row(faulty)), Some(FaultCause::Broken { before_node: nodes })) if faulty == row => {
                self.one.solve(View { nodes, ..whole });
                self.one.coordinates(row, 0, targets);
            }
            (Some(FaultyWire::Row(faulty)), _) if faulty == row && self.has_neighbours => {
                self.interpolate(row_index, targets);
            }
            (Some(FaultyWire::Row(faulty)), _) if faulty == row => {
                self.one.set_to(prior);
                self.one.coordinates(row, 0, targets);
            }
            (Some(FaultyWire::Rows(first)), _) if (first..=first + 1).contains(&row) => {
                let place = row - first;
                let first_index = row_index - place;
                let rows = [
                    (first, &self.priors[first_index]),
                    (first + 1, &self.priors[first_index + 1]),
                ];
                self.two.solve(View { rows: &rows, ..whole });
                self.two.coordinates(row, place, targets);
            }
            _ => {
                self.one.solve(whole);
                self.one.coordinates(row, 0, targets);
            }
        }
        self.remember(row_index, targets);
        Ok(())
    }
}
