use super::{Posterior, expectation_propagation::TOLERANCE, linear_model::LinearModel, linearised::Point, pack::LANES};

impl Posterior {
    /// Computes the medians of the posterior linearised at the true deformation of the row whose nodes are at `truth_mm`
    /// (3·M2), given noisy readings of it: the answer of a decoder that knows where to linearise. Writes absolute
    /// coordinates (3·M2) and returns true; or writes the truth and returns false if the posterior did not converge.
    ///
    /// # Panics
    /// If `row` is none of the rows given.
    pub fn limit(&mut self, row: usize, readings_ohm: &[f64], truth_mm: &[f64], coordinates_mm: &mut [f64]) -> bool {
        self.limits(&[row], readings_ohm, truth_mm, coordinates_mm)
    }

    /// As [`Self::limit`], several rows side by side (rows × M4 readings, rows × 3·M2 coordinates). Returns `true` if all
    /// posteriors converged.
    ///
    /// # Panics
    /// If one of `rows` is none of the rows given.
    pub(crate) fn limits(
        &mut self,
        rows: &[usize],
        readings_ohm: &[f64],
        truths_mm: &[f64],
        coordinates_mm: &mut [f64],
    ) -> bool {
        let (channels, outputs) = (self.problem.equations(), self.problem.coordinates());
        coordinates_mm.copy_from_slice(truths_mm);
        let mut all_converged = true;
        let chunks = rows
            .chunks(LANES)
            .zip(readings_ohm.chunks(LANES * channels))
            .zip(coordinates_mm.chunks_mut(LANES * outputs));
        for ((rows, readings_ohm), coordinates_mm) in chunks {
            let mut lanes = [const { None }; LANES];
            let mut models = [const { None }; LANES];
            for (lane, &row) in rows.iter().enumerate() {
                let mut truth = Point {
                    displacements_mm: vec![0.0; self.ranges.len()],
                    drift: 0.0,
                };
                self.problem.read(row, &readings_ohm[lane * channels..][..channels]);
                self.problem.unknowns_of(
                    &coordinates_mm[lane * outputs..][..outputs],
                    &mut truth.displacements_mm,
                );
                self.problem.evaluate(&truth.displacements_mm);
                if self.likelihood.has_drift() {
                    truth.drift = self.likelihood.likeliest_drift(&self.problem);
                }
                let model = models[lane].insert(LinearModel::default());
                self.linearise(model, row, (&truth, 1.0), None);
                model.tolerance = TOLERANCE;
                lanes[lane] = Some((row, truth));
            }
            let found = self.propagation.marginals(&models);
            let lanes = lanes.into_iter().zip(&models).zip(found);
            for (((lane, model), marginals), coordinates_mm) in lanes.zip(coordinates_mm.chunks_exact_mut(outputs)) {
                let (Some((row, truth)), Some(model)) = (lane, model) else {
                    continue;
                };
                match marginals.filter(|marginals| marginals.converged) {
                    Some(marginals) => {
                        let found = self.linearised(model, &truth, 1.0, marginals);
                        self.problem.turn_to(row);
                        self.problem.coordinates_of(&self.medians_mm(&found), coordinates_mm);
                    }
                    None => all_converged = false,
                }
            }
        }
        all_converged
    }
}
