use glam::DVec3;

use crate::{
    scene::Scene,
    sensor::{Axes, RowConductance, SensorModel},
};

/// Eq. (2) of one row-wire as equations for the displacements that the scene allows: `ρ_k(u) = m_k · s_k(u)/g − 1 = 0`
/// with m the readings and g/s the model's resistances.
///
/// For a reading `m = R · (1 + ε)` of a true resistance R, ρ at the true deformation is ε: the residual is
/// the relative error of the reading, with no approximation. And s is a plain sum over nodes, nearly linear in u.
#[derive(Clone, Debug)]
pub(crate) struct RowProblem {
    model: SensorModel,
    axes: Axes,
    conductance: RowConductance,
    displacements_mm: Vec<DVec3>,
    readings_ohm: Vec<f64>,
    row: usize,
    residuals: Vec<f64>,
}

/// The range of one unknown in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) lowest: f64,
    pub(crate) highest: f64,
}

impl Range {
    pub(crate) fn middle(self) -> f64 {
        0.5 * (self.lowest + self.highest)
    }

    pub(crate) fn width(self) -> f64 {
        self.highest - self.lowest
    }

    /// The nearest value within the range; its middle for NaN.
    pub(crate) fn clamp(self, value: f64) -> f64 {
        if value.is_nan() {
            self.middle()
        } else {
            value.clamp(self.lowest, self.highest)
        }
    }
}

/// The ranges of the unknowns of a row-wire in a scene: node by node, the axes of each node together.
pub(crate) fn ranges(model: &SensorModel, scene: &Scene) -> Vec<Range> {
    let stroke_mm = scene.stroke_mm(&model.geometry);
    let shift_mm = scene.movement.largest_shift_mm();
    let of_axis = |axis: usize| match axis {
        2 => Range {
            lowest: 0.0,
            highest: stroke_mm,
        },
        _ => Range {
            lowest: -shift_mm,
            highest: shift_mm,
        },
    };
    let axes = scene.movement.axes().indices();
    let nodes = 0..model.scale.nodes_per_row();
    nodes.flat_map(|_| axes.iter().map(|&axis| of_axis(axis))).collect()
}

/// [`ranges`] widened by their width on both sides, but not as far as the column-wires.
pub(crate) fn wide_ranges(model: &SensorModel, scene: &Scene) -> Vec<Range> {
    let height_mm = model.geometry.height_mm;
    let lowest_gap_mm = 0.5 * (height_mm - scene.stroke_mm(&model.geometry));
    let axes = scene.movement.axes().indices();
    let widened = |(unknown, range): (usize, Range)| Range {
        lowest: range.lowest - range.width(),
        highest: match axes[unknown % axes.len()] {
            2 => (range.highest + range.width()).min(height_mm - lowest_gap_mm),
            _ => range.highest + range.width(),
        },
    };
    ranges(model, scene).into_iter().enumerate().map(widened).collect()
}

/// Smallest height of a node above the column-wires in the wide ranges.
pub(super) fn smallest_gap_mm(model: &SensorModel, scene: &Scene) -> f64 {
    let wide = wide_ranges(model, scene);
    let axes = scene.movement.axes().count();
    let heights = wide.iter().skip(axes - 1).step_by(axes);
    model.geometry.height_mm - heights.map(|range| range.highest).fold(0.0, f64::max)
}

impl RowProblem {
    pub(crate) fn new(model: &SensorModel, axes: Axes) -> Self {
        Self {
            model: *model,
            axes,
            conductance: RowConductance::new(model, axes),
            displacements_mm: vec![DVec3::ZERO; model.scale.nodes_per_row()],
            readings_ohm: vec![0.0; model.scale.columns()],
            row: 0,
            residuals: vec![0.0; model.scale.columns()],
        }
    }

    /// As [`Self::new`], evaluated in half the time; `None` if the wide ranges of `scene` are not within reach of the
    /// method.
    pub(super) fn refined(model: &SensorModel, scene: &Scene) -> Option<Self> {
        let wide = wide_ranges(model, scene);
        let largest_mm = wide
            .iter()
            .fold(0.0, |most: f64, range| most.max(-range.lowest).max(range.highest));
        RowConductance::is_within_reach(model, smallest_gap_mm(model, scene), largest_mm).then(|| Self {
            conductance: RowConductance::new(model, scene.movement.axes()).refined(),
            ..Self::new(model, scene.movement.axes())
        })
    }

    pub(crate) fn unknowns(&self) -> usize {
        self.displacements_mm.len() * self.axes.count()
    }

    pub(crate) fn equations(&self) -> usize {
        self.readings_ohm.len()
    }

    /// True if there are more readings than unknowns. With as many equations as unknowns there are often several
    /// solutions that nothing distinguishes; with one unknown, the resistance is monotonic in the compression.
    pub(super) fn is_redundant(&self, readings: usize) -> bool {
        readings > self.unknowns() || readings > 0 && self.unknowns() == 1
    }

    /// Number of coordinates.
    pub(crate) fn coordinates(&self) -> usize {
        3 * self.displacements_mm.len()
    }

    /// The current row-wire.
    pub(super) fn row(&self) -> usize {
        self.row
    }

    /// Makes `row` the current row-wire.
    pub(crate) fn turn_to(&mut self, row: usize) {
        self.row = row;
    }

    /// Sets the readings of row-wire `row`, for which the equations are solved.
    pub(crate) fn read(&mut self, row: usize, readings_ohm: &[f64]) {
        self.row = row;
        self.readings_ohm.copy_from_slice(readings_ohm);
    }

    /// Evaluates residuals and derivatives at `unknowns_mm`; returns the rms residual.
    pub(crate) fn evaluate(&mut self, unknowns_mm: &[f64]) -> f64 {
        self.displace(unknowns_mm);
        (self.conductance).evaluate(&self.model, self.row, &self.displacements_mm);
        self.write_residuals()
    }

    /// Evaluates only the residuals at `unknowns_mm`; derivatives remain those of the last [`Self::evaluate`].
    pub(crate) fn evaluate_residuals(&mut self, unknowns_mm: &[f64]) -> f64 {
        self.displace(unknowns_mm);
        (self.conductance).evaluate_sums(&self.model, self.row, &self.displacements_mm);
        self.write_residuals()
    }

    fn displace(&mut self, unknowns_mm: &[f64]) {
        let axes = self.axes.indices();
        let nodes = unknowns_mm.chunks_exact(axes.len());
        for (displacement, values) in self.displacements_mm.iter_mut().zip(nodes) {
            for (&axis, &value) in axes.iter().zip(values) {
                displacement[axis] = value;
            }
        }
    }

    fn write_residuals(&mut self) -> f64 {
        let per_sum = 1.0 / self.model.resistivity_ohm_per_mm;
        let mut squares = 0.0;
        let pairs = self.readings_ohm.iter().zip(self.conductance.sums());
        for (residual, (reading, sum)) in self.residuals.iter_mut().zip(pairs) {
            *residual = reading * per_sum * sum - 1.0;
            squares += *residual * *residual;
        }
        (squares / self.residuals.len() as f64).sqrt()
    }

    /// ρ, one for each reading.
    pub(crate) fn residuals(&self) -> &[f64] {
        &self.residuals
    }

    /// ∂ρ_k/∂u in 1/mm.
    pub(crate) fn derivative(&self, reading: usize, unknown: usize) -> f64 {
        self.readings_ohm[reading] / self.model.resistivity_ohm_per_mm * self.conductance.derivatives(unknown)[reading]
    }

    /// Writes ∂ρ_k/∂u of one unknown for steps relative to `width_mm`, one for each reading.
    pub(super) fn write_slopes(&self, unknown: usize, width_mm: f64, slopes: &mut [f64]) {
        let factor = 1.0 / self.model.resistivity_ohm_per_mm * width_mm;
        let derivatives = self.conductance.derivatives(unknown).iter().zip(&self.readings_ohm);
        for (slope, (derivative, ohm)) in slopes.iter_mut().zip(derivatives) {
            *slope = factor * ohm * derivative;
        }
    }

    /// Reading m_k in ohm.
    pub(crate) fn reading_ohm(&self, reading: usize) -> f64 {
        self.readings_ohm[reading]
    }

    /// The unknowns that correspond to absolute coordinates (3·M2) of nodes on the current row-wire.
    pub(crate) fn unknowns_of(&self, coordinates_mm: &[f64], unknowns_mm: &mut [f64]) {
        let axes = self.axes.indices();
        for (node, values) in unknowns_mm.chunks_exact_mut(axes.len()).enumerate() {
            let at = DVec3::from_slice(&coordinates_mm[3 * node..]);
            let displacement = self.model.displacement_mm(self.row, node, at);
            for (&axis, value) in axes.iter().zip(values) {
                *value = displacement[axis];
            }
        }
    }

    /// Absolute coordinates (3·M2) of nodes on the current row-wire.
    pub(crate) fn coordinates_of(&self, unknowns_mm: &[f64], coordinates_mm: &mut [f64]) {
        let axes = self.axes.indices();
        for (node, values) in unknowns_mm.chunks_exact(axes.len()).enumerate() {
            let mut displacement = DVec3::ZERO;
            for (&axis, &value) in axes.iter().zip(values) {
                displacement[axis] = value;
            }
            let at = self.model.displaced_mm(self.row, node, displacement);
            coordinates_mm[3 * node..3 * node + 3].copy_from_slice(&at.to_array());
        }
    }
}
