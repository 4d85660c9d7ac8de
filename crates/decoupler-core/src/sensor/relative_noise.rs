/// Noise of a reading relative to the reading, from all sources of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelativeNoise {
    /// Standard deviation of each reading's own error.
    pub own: f64,
    /// Standard deviation of the error common to all readings of a snapshot.
    pub common: f64,
}

impl RelativeNoise {
    /// Standard deviation of a reading's whole error.
    pub fn total(self) -> f64 {
        libm::hypot(self.own, self.common)
    }

    /// Factor on the part that `readings` have in common, by which readings with a common error count as if each had its own
    /// alone: own / √(own² + readings · common²), from the eigenvalues of the covariance own² I + common² 1 1ᵀ. Exact
    /// readings have the rounding of double precision as their own error.
    pub(super) fn weight_of_mean(self, readings: usize) -> f64 {
        if self.common == 0.0 {
            return 1.0;
        }
        let own = self.own.max(f64::EPSILON);
        own / libm::hypot(own, self.common * (readings as f64).sqrt())
    }
}
