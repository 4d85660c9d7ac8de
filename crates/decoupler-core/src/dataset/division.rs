use rand::Rng;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Dataset, DatasetError, Seed, Split, SplitBy, Stream};

/// Division of a measured set into training, validation and test samples.
///
/// The samples are taken to be in the order in which they were recorded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Division {
    /// Rule by which samples are assigned to the parts.
    pub by: SplitBy,
    /// Share of the samples for the test, above 0 and below 1.
    pub test_fraction: f64,
    /// Share of the other samples that is held out for validation, from 0 to below 1. With 0, nothing is held out; see
    /// [`RunSettings::validation_fraction`](crate::evaluation::RunSettings::validation_fraction).
    pub validation_fraction: f64,
}

/// Samples of each part of a divided set, as ascending indices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DividedSamples {
    /// Samples that the training method fits.
    pub training: Vec<usize>,
    /// Samples that select the best weights; empty if nothing is held out.
    pub validation: Vec<usize>,
    /// Samples that no fit has seen; empty if the test set is given apart.
    pub test: Vec<usize>,
}

/// Error for a set that cannot be divided.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum DivisionError {
    /// A share is out of range.
    #[error("{part} fraction {value}: give a number from {least} to below 1, such as 0.2")]
    Fraction {
        /// Part at fault: test or validation.
        part: &'static str,
        /// Share given.
        value: f64,
        /// Smallest share possible.
        least: &'static str,
    },
    /// There are not two units, so that one could be the test.
    #[error("all {samples} samples are one {unit}: a test set needs another; give a test file, or split another way")]
    TooFew {
        /// Number of samples.
        samples: usize,
        /// Name of the unit of division: sample or group.
        unit: &'static str,
    },
    /// The test samples are of other row-wires.
    #[error(transparent)]
    Rows(#[from] DatasetError),
}

impl Default for Division {
    /// Returns the division in time: the last fifth for the test, and nothing held out for validation, since the default
    /// method of measured runs needs none.
    fn default() -> Self {
        Self {
            by: SplitBy::Time,
            test_fraction: 0.2,
            validation_fraction: 0.0,
        }
    }
}

impl Division {
    /// Divides `set` into training, validation and test samples. At least one unit (a sample or a group) trains and one
    /// tests; a part that cannot be filled exactly with whole groups gets the number of samples nearest to its share.
    /// Nothing is held out for validation if only one unit remains.
    ///
    /// # Errors
    /// If a share is out of range, or the set is a single unit.
    pub fn divide(&self, set: &Dataset, rng: &mut impl Rng) -> Result<DividedSamples, DivisionError> {
        self.check()?;
        let mut units = self.by.ordered_units(set, rng);
        if units.len() < 2 {
            return Err(DivisionError::TooFew {
                samples: set.samples(),
                unit: self.by.unit_name(units.len(), set.samples()),
            });
        }
        let test = take_last(&mut units, self.test_fraction);
        Ok(self.parts(units, test))
    }

    /// Divides `set` into training and validation samples, where the test set is given apart; see [`Self::divide`].
    ///
    /// # Errors
    /// If a share is out of range.
    pub fn divide_for_training(&self, set: &Dataset, rng: &mut impl Rng) -> Result<DividedSamples, DivisionError> {
        self.check()?;
        Ok(self.parts(self.by.ordered_units(set, rng), Vec::new()))
    }

    /// Divides `set` for a run with this seed, and returns its training, validation and test samples: those of `test` if it is
    /// given.
    ///
    /// # Errors
    /// If a share is out of range, the set is a single unit, or `test` has other row-wires.
    pub fn sets(&self, set: &Dataset, test: Option<&Dataset>, seed: Seed) -> Result<(Split, Dataset), DivisionError> {
        let mut rng = seed.rng(Stream::Split);
        Ok(match test {
            None => {
                let parts = self.divide(set, &mut rng)?;
                (parts.split(set), parts.test_set(set))
            }
            Some(test) => {
                let parts = self.divide_for_training(set, &mut rng)?;
                let read = set.row_wires_read().unwrap_or_default();
                (parts.split(set), test.clone().among_rows(read)?)
            }
        })
    }

    fn parts(&self, mut units: Vec<Vec<usize>>, test: Vec<usize>) -> DividedSamples {
        let validation = if units.len() > 1 && self.validation_fraction > 0.0 {
            take_last(&mut units, self.validation_fraction)
        } else {
            Vec::new()
        };
        DividedSamples {
            training: ascending(units),
            validation,
            test,
        }
    }

    /// Checks the shares.
    ///
    /// # Errors
    /// If a share is out of range.
    pub fn check(&self) -> Result<(), DivisionError> {
        let fractions = [
            ("test", self.test_fraction, f64::MIN_POSITIVE, "above 0"),
            ("validation", self.validation_fraction, 0.0, "0"),
        ];
        for (part, value, smallest, least) in fractions {
            if !(smallest..1.0).contains(&value) {
                return Err(DivisionError::Fraction { part, value, least });
            }
        }
        Ok(())
    }
}

impl DividedSamples {
    /// Returns the training and validation samples of `set`, the set that was divided.
    ///
    /// # Panics
    /// If the set has fewer samples.
    pub fn split(&self, set: &Dataset) -> Split {
        Split {
            training: set.select(&self.training),
            validation: (!self.validation.is_empty()).then(|| set.select(&self.validation)),
        }
    }

    /// Returns the test samples of `set`, the set that was divided.
    ///
    /// # Panics
    /// If the set has fewer samples.
    pub fn test_set(&self, set: &Dataset) -> Dataset {
        set.select(&self.test)
    }
}

/// Moves the last units to a part with about this share of all samples, at least one unit and not all.
fn take_last(units: &mut Vec<Vec<usize>>, share: f64) -> Vec<usize> {
    let samples: usize = units.iter().map(Vec::len).sum();
    let wanted = share * samples as f64;
    let (mut first, mut taken) = (units.len() - 1, units[units.len() - 1].len());
    while first > 1 {
        let more = taken + units[first - 1].len();
        if (more as f64 - wanted).abs() > (wanted - taken as f64).abs() {
            break;
        }
        (first, taken) = (first - 1, more);
    }
    ascending(units.split_off(first))
}

fn ascending(units: Vec<Vec<usize>>) -> Vec<usize> {
    let mut samples: Vec<usize> = units.into_iter().flatten().collect();
    samples.sort_unstable();
    samples
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::dataset::{Seed, Stream};

    fn set(groups: Vec<usize>) -> Dataset {
        let values = Array2::from_shape_fn((groups.len(), 1), |(sample, _)| sample as f64);
        Dataset::new(values.clone(), values, None, groups).unwrap()
    }

    fn divide(set: &Dataset, by: SplitBy, seed: u64) -> Result<DividedSamples, DivisionError> {
        let division = Division {
            by,
            test_fraction: 0.2,
            validation_fraction: 0.2,
        };
        division.divide(set, &mut Seed(seed).rng(Stream::Split))
    }

    #[test]
    fn in_time_the_last_part_tests_and_the_one_before_it_validates() {
        let set = set((0..100).collect());
        let parts = divide(&set, SplitBy::Time, 0).unwrap();
        assert_eq!(parts.training, Vec::from_iter(0..64));
        assert_eq!(parts.validation, Vec::from_iter(64..80));
        assert_eq!(parts.test, Vec::from_iter(80..100));
        assert_eq!(parts, divide(&set, SplitBy::Time, 1).unwrap(), "nothing is drawn");
        assert_eq!(parts.test_set(&set).targets()[[0, 0]], 80.0);
        assert_eq!(parts.split(&set).validation.unwrap().samples(), 16);
    }

    #[test]
    fn no_group_is_in_two_parts() {
        let groups: Vec<usize> = (0..120).map(|sample| sample % 12).collect();
        let set = set(groups.clone());
        for seed in 0..20 {
            let parts = divide(&set, SplitBy::Group, seed).unwrap();
            let of = |samples: &[usize]| -> std::collections::BTreeSet<usize> {
                samples.iter().map(|&sample| groups[sample]).collect()
            };
            let [training, validation, test] = [&parts.training, &parts.validation, &parts.test].map(|part| of(part));
            assert_eq!((training.len(), validation.len(), test.len()), (8, 2, 2), "seed {seed}");
            assert!(training.is_disjoint(&validation) && training.is_disjoint(&test) && validation.is_disjoint(&test));
        }
        assert_ne!(divide(&set, SplitBy::Group, 0), divide(&set, SplitBy::Group, 1));
    }

    #[test]
    fn a_cut_in_time_goes_between_groups() {
        // Runs of 30, 30, 30 and 10: 20 samples of 100 would cut the third.
        let groups = (0..100).map(|sample| sample / 30).collect();
        let parts = divide(&set(groups), SplitBy::Time, 0).unwrap();
        assert_eq!(parts.test, Vec::from_iter(90..100));
        assert_eq!(parts.validation, Vec::from_iter(60..90));
    }

    #[test]
    fn every_sample_is_in_one_part_whatever_the_rule() {
        for samples in [2, 3, 5, 97] {
            let set = set((0..samples).map(|sample| sample / 2).collect());
            for by in SplitBy::ALL {
                let Ok(parts) = divide(&set, by, 3) else {
                    assert_eq!(samples, 2, "{by}");
                    continue;
                };
                let mut all = [&parts.training[..], &parts.validation, &parts.test].concat();
                all.sort_unstable();
                assert_eq!(all, Vec::from_iter(0..samples), "{by}");
                assert!(!parts.training.is_empty() && !parts.test.is_empty(), "{by}");
            }
        }
    }

    #[test]
    fn a_random_split_is_seeded_and_spread() {
        let set = set((0..1000).collect());
        let parts = divide(&set, SplitBy::Random, 4).unwrap();
        assert_eq!(parts, divide(&set, SplitBy::Random, 4).unwrap());
        assert_ne!(parts, divide(&set, SplitBy::Random, 5).unwrap());
        let early = parts.test.iter().filter(|&&sample| sample < 500).count();
        assert!(parts.test.len() == 200 && (70..130).contains(&early), "{early}");
    }

    #[test]
    fn a_given_test_set_leaves_the_rest_for_training_and_validation() {
        let set = set((0..50).collect());
        let rng = &mut Seed(0).rng(Stream::Split);
        let a_fifth_held_out = Division {
            validation_fraction: 0.2,
            ..Division::default()
        };
        let parts = a_fifth_held_out.divide_for_training(&set, rng).unwrap();
        assert_eq!(
            (parts.training.len(), parts.validation.len(), parts.test.len()),
            (40, 10, 0)
        );
        let parts = Division::default().divide_for_training(&set, rng).unwrap();
        assert_eq!(parts.split(&set).validation, None);
    }

    #[test]
    fn what_cannot_be_divided_is_named() {
        let one_group = divide(&set(vec![7; 10]), SplitBy::Group, 0).unwrap_err().to_string();
        assert!(one_group.contains("all 10 samples are one group"), "{one_group}");
        for (test_fraction, validation_fraction) in [(0.0, 0.2), (1.0, 0.2), (f64::NAN, 0.2), (0.2, 1.0), (0.2, -0.1)] {
            let division = Division {
                by: SplitBy::Time,
                test_fraction,
                validation_fraction,
            };
            let error = division.divide(&set(vec![0, 1]), &mut Seed(0).rng(Stream::Split));
            assert!(matches!(error, Err(DivisionError::Fraction { .. })), "{division:?}");
        }
        assert!("block".parse::<SplitBy>().is_err());
        assert!(SplitBy::ALL.iter().all(|by| by.to_string().parse() == Ok(*by)));
    }
}
