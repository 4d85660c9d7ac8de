use super::{
    estimator::TOLERANCE,
    row_problem::{Range, ranges, wide_ranges},
};
use crate::{
    scene::Scene,
    sensor::{Axes, SensorModel},
};

/// Gauss-Newton iteration on Eq. (2) of a row-wire, as plain numbers.
///
/// The unknowns are the displacements of the nodes along the axes that move, node by node. A step minimises ‖J δ + ρ‖
/// with ρ the residuals m·s/g − 1 of the readings m and is shortened to stay within the wide ranges; the answer is
/// clamped to the ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct RowProblemDescription {
    /// Positions of the nodes and resistance per millimetre.
    pub model: SensorModel,
    /// Axes along which the nodes move.
    pub axes: Axes,
    /// Row-wires read, from 0.
    pub rows: Vec<usize>,
    /// How the row-wire of a reading is determined.
    pub row_choice: RowChoice,
    /// Smallest and largest value of each unknown in millimetres.
    pub ranges: Vec<(f64, f64)>,
    /// Range of each unknown that a step may not leave.
    pub wide_ranges: Vec<(f64, f64)>,
    /// Maximum number of steps from one start.
    pub steps: usize,
    /// Step length, relative to the range of the unknown, below which the iteration ends.
    pub tolerance: f64,
    /// True if the method restarts when a start leads to no solution, and failure of all starts is an error.
    pub seeks_solution: bool,
}

/// How the row-wire of a reading is determined.
#[derive(Clone, Debug, PartialEq)]
pub enum RowChoice {
    /// Given with the readings, or the only one.
    Given,
    /// The row-wire whose x is nearest to that of the first answer.
    Nearest,
    /// By trial, in order of similarity with the readings at rest.
    Tried {
        /// Logarithms of the resistances in ohm of each row-wire at rest.
        rest: Vec<Vec<f64>>,
    },
}

impl RowProblemDescription {
    /// Maximum number of steps from one start: quadratic convergence needs no more.
    const MAX_STEPS: usize = 25;

    /// Describes the iteration for `rows` of `model` in `scene`: at most `steps` steps after another decoder, or a search
    /// for a solution if there is none.
    pub(in crate::decoupling) fn new(
        (model, scene): (&SensorModel, &Scene),
        (rows, row_choice): (&[usize], RowChoice),
        steps: Option<usize>,
    ) -> Self {
        let pairs = |ranges: Vec<Range>| ranges.iter().map(|range| (range.lowest, range.highest)).collect();
        Self {
            model: *model,
            axes: scene.movement.axes(),
            rows: rows.to_vec(),
            row_choice,
            ranges: pairs(ranges(model, scene)),
            wide_ranges: pairs(wide_ranges(model, scene)),
            steps: steps.unwrap_or(Self::MAX_STEPS).min(Self::MAX_STEPS),
            tolerance: TOLERANCE,
            seeks_solution: steps.is_none(),
        }
    }
}
