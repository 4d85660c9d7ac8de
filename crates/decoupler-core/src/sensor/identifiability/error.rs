use thiserror::Error;

use crate::sensor::SensorError;

/// Error of an identifiability analysis.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum IdentifiabilityError {
    /// The model has no resistance for the deformation.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The array has no such row-wire.
    #[error("row {} does not exist: the array has rows 1 to {rows}", row + 1)]
    Row {
        /// Row-wire asked for, from 0.
        row: usize,
        /// Row-wires of the array.
        rows: usize,
    },
    /// The decomposition did not converge.
    #[error("the singular values of row {} did not converge: use lengths of similar size in the geometry", .0 + 1)]
    NotConverged(usize),
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::sensor::{ArrayScale, Axes, Identifiability, SensorModel};

    #[test]
    fn rows_that_do_not_exist_are_counted_from_one() {
        let model = SensorModel::new(ArrayScale::default());
        let error = Identifiability::of_row(&model, 10, &[DVec3::ZERO; 10], Axes::Z).unwrap_err();
        assert_eq!(error.to_string(), "row 11 does not exist: the array has rows 1 to 10");
        assert!(IdentifiabilityError::NotConverged(0).to_string().contains("row 1 "));
    }
}
