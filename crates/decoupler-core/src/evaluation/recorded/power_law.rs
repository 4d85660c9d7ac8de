/// Error as a function of the number of training samples: floor + scale · n^(−exponent), the form that learning curves
/// follow (Viering and Loog 2023, doi:10.1109/TPAMI.2022.3220744).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// Error that no number of samples falls below.
    pub floor: f64,
    /// Error above the floor at one sample.
    pub scale: f64,
    /// Exponent of the decrease; 0.5 is that of averaging noise.
    pub exponent: f64,
}

impl PowerLaw {
    /// Fits the law to errors at numbers of samples, in proportion to the errors; `None` with fewer than three different
    /// numbers or without errors above 0. Points weigh in proportion to their samples, as the law is to be extended from
    /// the largest number on.
    ///
    /// For each exponent of a grid, floor and scale are those of least squares that are not negative.
    pub(super) fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let mut numbers: Vec<f64> = points.iter().map(|(number, _)| *number).collect();
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        if numbers.len() < 3 || points.iter().any(|(_, error)| !(*error > 0.0 && error.is_finite())) {
            return None;
        }
        let exponents = (1..=40).map(|step| f64::from(step) * 0.05);
        let laws = exponents.map(|exponent| Self::with_exponent(points, exponent));
        let best = laws.min_by(|(_, one), (_, other)| one.total_cmp(other));
        best.map(|(law, _)| law)
    }

    /// The best law of this exponent, and its sum of squared relative errors.
    fn with_exponent(points: &[(f64, f64)], exponent: f64) -> (Self, f64) {
        // Weighted sums of 1·1, 1·x, x·x, 1·y and x·y, with x = n^(−exponent).
        let mut sums = [0.0; 5];
        for (number, error) in points {
            let (x, weight) = (number.powf(-exponent), number / (error * error));
            let terms = [1.0, x, x * x, *error, x * error];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
        }
        let [one, x, xx, y, xy] = sums;
        let determinant = one * xx - x * x;
        let free = ((y * xx - x * xy) / determinant, (one * xy - x * y) / determinant);
        let candidates = [free, (y / one, 0.0), (0.0, xy / xx)];
        let laws = candidates
            .into_iter()
            .filter(|(floor, scale)| *floor >= 0.0 && *scale >= 0.0);
        let judged = laws.map(|(floor, scale)| {
            let law = Self { floor, scale, exponent };
            let misses = points
                .iter()
                .map(|(number, error)| number * (law.at(*number) / error - 1.0).powi(2));
            (law, misses.sum::<f64>())
        });
        let best = judged.min_by(|(_, one), (_, other)| one.total_cmp(other));
        best.expect("the constant law of positive errors is not negative")
    }

    /// Error at this number of samples.
    pub fn at(&self, samples: f64) -> f64 {
        self.floor + self.scale * samples.powf(-self.exponent)
    }

    /// Error with twice this many samples in proportion to that with this many: 1 where more bring nothing.
    pub fn doubling(&self, samples: f64) -> f64 {
        self.at(2.0 * samples) / self.at(samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_found_again_from_its_values() {
        for law in [
            PowerLaw {
                floor: 0.2,
                scale: 3.0,
                exponent: 0.5,
            },
            PowerLaw {
                floor: 0.0,
                scale: 1.0,
                exponent: 0.3,
            },
            PowerLaw {
                floor: 0.5,
                scale: 0.0,
                exponent: 1.0,
            },
        ] {
            let points: Vec<(f64, f64)> = (5..12).map(|k| 2.0_f64.powi(k)).map(|n| (n, law.at(n))).collect();
            let found = PowerLaw::fit(&points).unwrap();
            for samples in [50.0, 1e3, 1e4] {
                assert!(
                    (found.at(samples) / law.at(samples) - 1.0).abs() < 1e-6,
                    "{law:?}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn a_rising_curve_brings_nothing_and_two_numbers_tell_no_law() {
        let rising = [(10.0, 1.0), (20.0, 1.1), (40.0, 1.3)];
        assert_eq!(PowerLaw::fit(&rising).unwrap().doubling(40.0), 1.0);
        assert_eq!(PowerLaw::fit(&[(10.0, 1.0), (20.0, 0.9), (20.0, 0.8)]), None);
        assert_eq!(PowerLaw::fit(&[(10.0, 1.0), (20.0, 0.0), (40.0, 0.5)]), None);
    }
}
