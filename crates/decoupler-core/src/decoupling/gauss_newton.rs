use super::{
    least_squares::Triangle,
    newton::LARGEST_ERROR,
    row_problem::{Range, RowProblem},
};
use crate::{
    scene::Scene,
    sensor::{Axes, SensorModel},
};

/// Equations linearised for one step, in units of the ranges of the unknowns. Reused between steps to avoid
/// allocation.
#[derive(Clone, Debug)]
pub(super) struct LinearisedRow {
    /// Unknowns that may move: all, or those not held at a bound.
    free: Vec<usize>,
    /// Jacobian with −ρ as its last column: readings × (free unknowns + 1), row by row.
    system: Vec<f64>,
    /// Largest diagonal entry of JᵀJ.
    scale: f64,
    triangle: Triangle,
    solution: Vec<f64>,
    /// Step of every unknown in millimetres, 0 for those that are held.
    pub(super) step_mm: Vec<f64>,
}

impl LinearisedRow {
    pub(super) fn new(unknowns: usize) -> Self {
        Self {
            free: Vec::with_capacity(unknowns),
            system: Vec::new(),
            scale: 0.0,
            triangle: Triangle::default(),
            solution: Vec::with_capacity(unknowns),
            step_mm: vec![0.0; unknowns],
        }
    }

    /// Linearises the equations at `unknowns_mm`. With `hold`, unknowns at a bound that would leave their range are
    /// held there.
    pub(super) fn linearise(&mut self, problem: &mut RowProblem, ranges: &[Range], unknowns_mm: &[f64], hold: bool) {
        problem.evaluate(unknowns_mm);
        let problem = &*problem;
        let residuals = problem.residuals();
        let is_free = |unknown: usize| {
            let Range { lowest, highest } = ranges[unknown];
            let slope = |(k, residual): (usize, &f64)| problem.derivative(k, unknown) * residual;
            let slope: f64 = residuals.iter().enumerate().map(slope).sum();
            !(unknowns_mm[unknown] <= lowest && slope >= 0.0 || unknowns_mm[unknown] >= highest && slope <= 0.0)
        };
        self.free.clear();
        self.free
            .extend((0..ranges.len()).filter(|&unknown| !hold || is_free(unknown)));
        let (free, width) = (&self.free, self.free.len() + 1);
        self.system.clear();
        self.system.resize(residuals.len() * width, 0.0);
        let mut squares = 0.0_f64;
        for (column, &unknown) in free.iter().enumerate() {
            let mut square = 0.0;
            for k in 0..residuals.len() {
                let slope = problem.derivative(k, unknown) * ranges[unknown].width();
                self.system[k * width + column] = slope;
                square += slope * slope;
            }
            squares = squares.max(square);
        }
        for (row, residual) in self.system.chunks_exact_mut(width).zip(residuals) {
            row[width - 1] = -residual;
        }
        self.scale = squares;
    }

    /// Returns `true` if no unknown may move.
    pub(super) fn is_held(&self) -> bool {
        self.free.is_empty()
    }

    /// Minimises `‖J δ + ρ‖² + μ ‖δ‖²`, with μ = `damping` times the largest diagonal entry of JᵀJ, and sets
    /// [`Self::step_mm`].
    pub(super) fn solve(&mut self, ranges: &[Range], damping: f64) {
        let width = self.free.len() + 1;
        self.triangle.factor(&self.system, width, (damping * self.scale).sqrt());
        self.triangle.solve(&mut self.solution);
        self.step_mm.fill(0.0);
        for (&unknown, &step) in self.free.iter().zip(&self.solution) {
            self.step_mm[unknown] = step * ranges[unknown].width();
        }
    }

    /// Returns the largest error of an unknown, relative to its range, caused to first order by errors of the
    /// readings with the norm `error`: `error` times the largest norm of a row of J⁺.
    pub(super) fn largest_error(&mut self, error: f64) -> f64 {
        let width = self.free.len() + 1;
        self.triangle.factor(&self.system, width, 0.0);
        error * self.triangle.largest_inverse_row()
    }

    /// Returns Σ_i |J_ki| of reading `k`, relative to the ranges: the maximum change of its residual if every unknown
    /// moves by at most 1.
    pub(super) fn reach(&self, k: usize) -> f64 {
        let width = self.free.len() + 1;
        self.system[k * width..(k + 1) * width - 1]
            .iter()
            .map(|slope| slope.abs())
            .sum()
    }
}

/// Deformations of a row-wire that give the same readings as another one, by symmetry: even exact readings do not
/// determine which is the true one.
///
/// The electrodes of a column-wire are evenly spaced, so a node may be mirrored about their middle, and two nodes may
/// be swapped. Both need nodes that can move that far sideways.
#[derive(Clone, Debug)]
pub(super) struct Twins {
    model: SensorModel,
    axes: Axes,
    largest_shift_mm: f64,
}

impl Twins {
    pub(super) fn new(model: &SensorModel, scene: &Scene) -> Self {
        Self {
            model: *model,
            axes: scene.movement.axes(),
            largest_shift_mm: scene.movement.largest_shift_mm(),
        }
    }

    /// Returns `true` if the deformation `unknowns_mm` of row-wire `row` has a twin within reach of the nodes.
    pub(super) fn has(&self, row: usize, unknowns_mm: &[f64]) -> bool {
        if self.axes == Axes::Z {
            return false;
        }
        let nodes = unknowns_mm.as_chunks::<3>().0;
        nodes.iter().any(|&[x, ..]| self.is_mirrored(row, x))
            || (1..nodes.len()).any(|apart| {
                let pairs = nodes.iter().zip(&nodes[apart..]);
                self.model.geometry.node_pitch_mm * apart as f64 <= 2.0 * self.largest_shift_mm
                    && pairs.into_iter().any(|(a, b)| self.is_exchanged(apart, *a, *b))
            })
    }

    fn is_within(&self, shift_mm: f64) -> bool {
        shift_mm.abs() <= self.largest_shift_mm
    }

    fn is_apart(&self, a_mm: f64, b_mm: f64) -> bool {
        (a_mm - b_mm).abs() > LARGEST_ERROR * 2.0 * self.largest_shift_mm
    }

    fn is_mirrored(&self, row: usize, x_mm: f64) -> bool {
        let geometry = &self.model.geometry;
        let electrodes = (self.model.scale.nodes_per_column() - 1) as f64;
        let middle_mm = (geometry.column_node_x0_mm - geometry.row_x0_mm)
            + (0.5 * geometry.column_node_pitch_mm * electrodes - geometry.row_pitch_mm * row as f64);
        let mirrored_mm = 2.0 * middle_mm - x_mm;
        self.is_within(mirrored_mm) && self.is_apart(mirrored_mm, x_mm)
    }

    /// Returns `true` if node `a` may take the position of node `b`, `apart` positions away, and vice versa.
    fn is_exchanged(&self, apart: usize, a: [f64; 3], b: [f64; 3]) -> bool {
        let distance_mm = self.model.geometry.node_pitch_mm * apart as f64;
        let differs = self.is_apart(a[0], b[0]) || self.is_apart(a[1], b[1] + distance_mm) || self.is_apart(a[2], b[2]);
        self.is_within(b[1] + distance_mm) && self.is_within(a[1] - distance_mm) && differs
    }
}
