use super::{
    Newton, NewtonRules,
    row_problem::{Range, ranges, wide_ranges},
};
use crate::{
    scene::Scene,
    sensor::{Axes, SensorModel},
};

/// Gauss-Newton iteration on Eq. (2) of a row-wire, in plain numbers.
///
/// The unknowns are the displacements of the nodes along the axes that move, node by node. A step minimises ‖J δ + ρ‖ with
/// ρ the residuals m·s/g − 1 of the readings m, is shortened to stay within the wide ranges, and the answer is cut to the
/// ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct RowProblemDescription {
    /// Positions of the nodes and resistance per millimetre.
    pub model: SensorModel,
    /// Axes along which the nodes move.
    pub axes: Axes,
    /// Row-wires read, from 0.
    pub rows: Vec<usize>,
    /// How the row-wire of a reading is known.
    pub row_choice: RowChoice,
    /// Smallest and largest value of each unknown in millimetres.
    pub ranges: Vec<(f64, f64)>,
    /// Values of each unknown that a step may not leave.
    pub wide_ranges: Vec<(f64, f64)>,
    /// Largest number of steps from one start.
    pub steps: usize,
    /// Step length, in proportion to the range of the unknown, below which the iteration ends.
    pub tolerance: f64,
    /// True if other starts are tried where the first leads to no solution, which are then an error.
    pub seeks_solution: bool,
}

/// How the row-wire of a reading is known.
#[derive(Clone, Debug, PartialEq)]
pub enum RowChoice {
    /// Given with the readings, or the only one.
    Given,
    /// The row-wire whose x is nearest to that of the first answer.
    Nearest,
    /// By trial, in the order of similarity with the readings at rest.
    Tried {
        /// Logarithms of the resistances in ohm of each row-wire at rest.
        rest: Vec<Vec<f64>>,
    },
}

impl RowProblemDescription {
    /// Describes the iteration for `rows` of `model` in `scene` by these rules.
    pub(super) fn new(
        (model, scene): (&SensorModel, &Scene),
        (rows, row_choice): (&[usize], RowChoice),
        rules: NewtonRules,
        seeks_solution: bool,
    ) -> Self {
        let pairs = |ranges: Vec<Range>| ranges.iter().map(|range| (range.lowest, range.highest)).collect();
        Self {
            model: *model,
            axes: scene.movement.axes(),
            rows: rows.to_vec(),
            row_choice,
            ranges: pairs(ranges(model, scene)),
            wide_ranges: pairs(wide_ranges(model, scene)),
            steps: rules.steps.min(Newton::MAX_PLAIN_STEPS),
            tolerance: rules.tolerance,
            seeks_solution,
        }
    }
}
