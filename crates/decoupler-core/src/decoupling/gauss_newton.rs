use super::{
    row_problem::{Range, RowProblem},
    triangle::Triangle,
};

/// Linearised equations for one step, in proportion to the ranges of the unknowns. Kept between steps so that none
/// allocates.
#[derive(Clone, Debug)]
pub(super) struct Linearised {
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

impl Linearised {
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

    /// Linearises the equations at `unknowns_mm`. Unknowns at a bound that would leave it are held there if `hold` says
    /// so.
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

    /// Returns the largest error of an unknown, in proportion to its range, that errors of the readings with the norm
    /// `error` make to first order: error times the largest norm of a row of J⁺.
    pub(super) fn largest_error(&mut self, error: f64) -> f64 {
        let width = self.free.len() + 1;
        self.triangle.factor(&self.system, width, 0.0);
        error * self.triangle.largest_inverse_row()
    }

    /// Returns Σ_i |J_ki| of reading `k`, in proportion to the ranges: the most by which its residual changes if every
    /// unknown moves by as much as 1.
    pub(super) fn reach(&self, k: usize) -> f64 {
        let width = self.free.len() + 1;
        self.system[k * width..(k + 1) * width - 1]
            .iter()
            .map(|slope| slope.abs())
            .sum()
    }
}
