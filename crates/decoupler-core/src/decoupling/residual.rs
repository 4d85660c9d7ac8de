use super::row_problem::RowProblem;
use crate::sensor::{Axes, SensorModel};

/// Root mean square of m/R − 1 over the readings m of a row, with R the model's resistances at the decoded coordinates.
///
/// It needs no ground truth, so it tells how far to trust any decoder; 1 and above explains nothing. Infinite if the
/// model has no resistance at these coordinates.
///
/// # Panics
/// If there are not M4 readings and 3·M2 coordinates.
pub fn resistance_residual(model: &SensorModel, readings_ohm: &[f64], coordinates_mm: &[f64]) -> f64 {
    assert_eq!(coordinates_mm.len(), model.scale.coordinates_per_row());
    let mut problem = RowProblem::new(model, Axes::Xyz);
    // Displacements are measured from the first row, wherever the nodes are.
    problem.read(0, readings_ohm);
    let mut unknowns = vec![0.0; problem.unknowns()];
    problem.unknowns_of(coordinates_mm, &mut unknowns);
    let residual = problem.evaluate(&unknowns);
    if residual.is_finite() { residual } else { f64::INFINITY }
}
