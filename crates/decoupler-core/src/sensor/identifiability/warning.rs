use std::fmt;

use super::{Identifiability, RowPair};

/// An obstacle to decoupling, and what to change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IdentifiabilityWarning {
    /// Fewer readings than unknowns.
    TooFewReadings {
        /// Readings of a row.
        equations: usize,
        /// Unknowns of a row.
        unknowns: usize,
    },
    /// Two rows read the same.
    RowsAlike {
        /// The two rows.
        pair: RowPair,
        /// Relative error of a reading.
        noise: f64,
    },
    /// Noise hides the deformation.
    Hopeless {
        /// Relative error of a reading.
        noise: f64,
        /// Share of the prior spread that remains.
        share: f64,
    },
    /// Some deformation pattern hardly changes the readings.
    IllConditioned {
        /// Largest singular value over the smallest.
        condition: f64,
    },
}

impl fmt::Display for IdentifiabilityWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFewReadings { equations, unknowns } => write!(
                f,
                "a row has {unknowns} unknowns but only {equations} readings: some deformations cannot be seen; use at \
                 least {unknowns} column-wires, or let nodes move along z only"
            ),
            Self::RowsAlike { pair, noise } => {
                let (first, second) = (pair.first + 1, pair.second + 1);
                write!(
                    f,
                    "row-wires {first} and {second} cannot be told apart: at rest their readings differ by {:.1e}, the \
                     noise is {noise:.1e}; shift the column nodes so that no row mirrors another, or use a known row",
                    pair.difference
                )
            }
            Self::Hopeless { noise, share } => write!(
                f,
                "with noise of {noise:.1e} the readings hardly narrow the deformation ({:.0} % of its spread remains); \
                 lower the noise, reduce the height, widen the node pitch, or add column-wires",
                100.0 * share
            ),
            Self::IllConditioned { condition } if condition.is_infinite() => f.write_str(
                "some deformation changes no reading at all; reduce the height, widen the node pitch, add column-wires, or \
                 let nodes move along z only",
            ),
            Self::IllConditioned { condition } => write!(
                f,
                "some deformation is seen {condition:.0e} times worse than another: even rounding blurs it; reduce the \
                 height, widen the node pitch, add column-wires, or let nodes move along z only"
            ),
        }
    }
}

impl Identifiability {
    /// The condition number from which [`IdentifiabilityWarning::IllConditioned`] is given: readings exact to 16
    /// digits then leave fewer than 6 in the worst-seen pattern.
    pub const LARGEST_CONDITION: f64 = 1e10;
    /// The share of the prior spread that remains from which noise is called hopeless: readings then tell less than
    /// a tenth of the variance.
    pub const HOPELESS_SHARE: f64 = 0.95;
    /// Warnings to the user, most severe first. `noise` is the relative error of a reading of its own (for a common error see
    /// [`Self::of_row_with_gain`] and [`Self::most_alike_rows`]), `prior_mm` the standard
    /// deviation of each unknown before reading; `alike` the most similar rows if the row is not known beforehand.
    pub fn warnings(&self, noise: f64, prior_mm: f64, alike: Option<RowPair>) -> Vec<IdentifiabilityWarning> {
        let condition = self.condition();
        let share = self.remaining_share(noise, prior_mm);
        let alike = alike.filter(|pair| pair.difference <= noise.max(Self::SAME_ROWS));
        let warnings = [
            (self.equations < self.unknowns()).then_some(IdentifiabilityWarning::TooFewReadings {
                equations: self.equations,
                unknowns: self.unknowns(),
            }),
            alike.map(|pair| IdentifiabilityWarning::RowsAlike { pair, noise }),
            (share >= Self::HOPELESS_SHARE).then_some(IdentifiabilityWarning::Hopeless { noise, share }),
            (condition >= Self::LARGEST_CONDITION).then_some(IdentifiabilityWarning::IllConditioned { condition }),
        ];
        warnings.into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{ArrayScale, Axes, SensorModel, identifiability::tests::at_rest};

    #[test]
    fn too_few_readings_leave_a_pattern_unseen() {
        let model = SensorModel::new("2x6_3x4".parse().unwrap());
        let seen = at_rest(&model, 1, Axes::Z);
        assert_eq!(seen.condition(), f64::INFINITY);
        assert_eq!(seen.unknowns(), 6);
        let length = seen.worst_pattern.iter().map(|p| p.length_squared()).sum::<f64>();
        assert!((length - 1.0).abs() < 1e-12);
        let warnings = seen.warnings(0.0, 0.3, None);
        assert!(matches!(
            warnings[0],
            IdentifiabilityWarning::TooFewReadings {
                equations: 4,
                unknowns: 6
            }
        ));
    }

    #[test]
    fn noise_is_hopeless_only_when_it_hides_nearly_everything() {
        let seen = at_rest(&SensorModel::new(ArrayScale::default()), 0, Axes::Z);
        assert_eq!(seen.remaining_share(0.0, 0.3), 0.0);
        assert!(seen.warnings(1e-4, 0.3, None).is_empty());
        assert!((seen.remaining_share(1e3, 0.3) - 1.0).abs() < 1e-6);
        let words = seen.warnings(1.0, 0.3, None)[0].to_string();
        assert!(words.contains("100 %") || words.contains("99 %"), "{words}");
    }
}
