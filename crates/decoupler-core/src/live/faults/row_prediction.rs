use glam::DVec3;

use super::row_fit::RowFit;

/// Predictions of readings that were left out of a fit.
impl RowFit {
    /// Logarithm of the reading from which on the converter clips.
    pub(super) fn log_full_scale(&self) -> f64 {
        self.full_scale_ohm.ln()
    }

    /// Returns `true` for a reading at the end of the converter's range of a resistance that is beyond it.
    pub(super) fn is_clipped(&self, log_reading: f64, log_ohm: f64) -> bool {
        log_reading >= self.log_full_scale() && log_ohm >= self.log_full_scale()
    }

    /// Variance of ln R in a direction of the unknowns, given by its slopes; they are overwritten.
    pub(super) fn variance(&self, slopes: &mut [f64]) -> f64 {
        self.cholesky.solve_lower(slopes);
        slopes.iter().map(|entry| entry * entry).sum()
    }

    /// Slopes of −ln R of a column by all unknowns, into `slopes`.
    pub(super) fn slopes_of(&self, column: usize, slopes: &mut [f64]) {
        let of_column = self.slopes.iter().skip(column).step_by(self.model.scale.columns());
        slopes.iter_mut().zip(of_column).for_each(|(to, slope)| *to = *slope);
    }

    /// ln R of a column that is broken before node `electrodes`, with its slopes as in [`Self::slopes_of`], after a fit of
    /// one row-wire.
    pub(super) fn broken_column(&self, (row, column, electrodes): (usize, usize, usize), slopes: &mut [f64]) -> f64 {
        slopes.fill(0.0);
        let nodes = (row, 0..self.model.scale.nodes_per_row());
        let add = |node: usize, slope: DVec3| {
            for (place, &axis) in self.axes.iter().enumerate() {
                slopes[node * self.axes.len() + place] += slope[axis];
            }
        };
        let sum = self
            .model
            .partial_sum(nodes, (column, 0..electrodes), &self.displacements_mm, add);
        slopes.iter_mut().for_each(|slope| *slope /= sum);
        let gain = match slopes.last_mut().zip(self.unknowns.last()) {
            Some((slope, gain)) if self.common > 0.0 => {
                *slope = -1.0;
                *gain
            }
            _ => 0.0,
        };
        (self.model.resistivity_ohm_per_mm / sum).ln() + gain
    }
}
