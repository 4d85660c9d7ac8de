use rand::{Rng, seq::SliceRandom};
use serde::{Deserialize, Serialize};

use super::{Dataset, DatasetError, Seed, Stream};
use crate::text::Named;

/// Division of a measured set into training, validation and test samples.
///
/// The samples are assumed to be in the order in which they were recorded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Division {
    /// Rule by which samples are assigned to the parts.
    pub by: SplitBy,
    /// Share of the samples held out for the test, above 0 and below 1.
    pub test_fraction: f64,
    /// Share of the other samples held out for validation, from 0 to below 1. With 0, nothing is held out; if absent, a run
    /// holds out what its method needs, see
    /// [`RunSettings::validation_fraction`](crate::evaluation::RunSettings::validation_fraction), and nothing is held out
    /// without a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation_fraction: Option<f64>,
}

/// Samples of each part of a divided set, as ascending indices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DividedSamples {
    /// Samples that the training method fits.
    pub training: Vec<usize>,
    /// Samples that select the best weights; empty if nothing is held out.
    pub validation: Vec<usize>,
    /// Samples that no fit has seen; empty if the test set is a separate file.
    pub test: Vec<usize>,
}

impl Default for Division {
    /// Returns the division in time: the last fifth is the test set, and the method determines what is held out for
    /// validation.
    fn default() -> Self {
        Self {
            by: SplitBy::Time,
            test_fraction: 0.2,
            validation_fraction: None,
        }
    }
}

impl Division {
    /// Divides `set` for a run with this seed, and returns its training, validation and test samples: those of `test` if it is
    /// given.
    ///
    /// The training and the test set get at least one unit (a sample or a group) each; a part that cannot be filled exactly
    /// with whole groups gets the number of samples nearest to its share. Nothing is held out for validation if only one
    /// unit remains.
    ///
    /// If every target would be constant in the training samples, as with a single press near the end of a recording, the
    /// first units are held out in place of the last.
    ///
    /// # Errors
    /// If a share is out of range, the set is a single unit, or `test` has other row-wires.
    pub fn sets(&self, set: &Dataset, test: Option<&Dataset>, seed: Seed) -> Result<(Split, Dataset), DatasetError> {
        let parts = self.divide(set, test.is_some(), seed)?;
        let test = match test {
            None => set.select(&parts.test),
            Some(test) => test.clone().among_rows(set.row_wires_read().unwrap_or_default())?,
        };
        Ok((parts.split(set), test))
    }

    /// Returns the samples of each part of [`Self::sets`].
    ///
    /// # Errors
    /// If a share is out of range, or the set is a single unit.
    pub fn divide(&self, set: &Dataset, has_test_set: bool, seed: Seed) -> Result<DividedSamples, DatasetError> {
        self.check()?;
        let test_fraction = if has_test_set { 0.0 } else { self.test_fraction };
        let mut units = self.by.ordered_units(set, &mut seed.rng(Stream::Split));
        if !has_test_set && units.len() < 2 {
            let samples = set.samples();
            let unit = self.by.unit_name(1, samples);
            return Err(DatasetError::TooFew { samples, unit });
        }
        let hold_out_last = |mut units: Vec<Vec<usize>>| DividedSamples {
            test: take_last(&mut units, test_fraction),
            validation: take_last(&mut units, self.validation_fraction.unwrap_or(0.0)),
            training: ascending(units.concat()),
        };
        let targets = set.targets();
        let varies = |parts: &DividedSamples| {
            let mut pairs = parts.training.windows(2);
            pairs.any(|pair| targets.row(pair[0]) != targets.row(pair[1]))
        };
        let parts = hold_out_last(units.clone());
        if varies(&parts) {
            return Ok(parts);
        }
        units.reverse();
        Ok(Some(hold_out_last(units)).filter(varies).unwrap_or(parts))
    }

    /// Checks the shares.
    ///
    /// # Errors
    /// If a share is out of range.
    pub fn check(&self) -> Result<(), DatasetError> {
        let check = |part, value: f64, smallest: f64, least| {
            let valid = (smallest..1.0).contains(&value).then_some(());
            valid.ok_or(DatasetError::Fraction { part, value, least })
        };
        check("test", self.test_fraction, f64::MIN_POSITIVE, "above 0")?;
        check("validation", self.validation_fraction.unwrap_or(0.0), 0.0, "0")
    }
}

impl DividedSamples {
    /// Returns the training and validation samples of `set`, the set that was divided.
    ///
    /// # Panics
    /// If the set has fewer samples.
    pub(crate) fn split(&self, set: &Dataset) -> Split {
        Split {
            training: set.select(&self.training),
            validation: (!self.validation.is_empty()).then(|| set.select(&self.validation)),
        }
    }
}

/// Moves the last units to a part with about this share of all samples: at least one unit, and never all. Takes none if
/// the share is 0, or there is only one unit.
fn take_last(units: &mut Vec<Vec<usize>>, share: f64) -> Vec<usize> {
    if share == 0.0 || units.len() < 2 {
        return Vec::new();
    }
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
    ascending(units.split_off(first).concat())
}

/// Samples in ascending order.
pub(super) fn ascending(samples: impl IntoIterator<Item = usize>) -> Vec<usize> {
    let mut samples = Vec::from_iter(samples);
    samples.sort_unstable();
    samples
}

/// A set split into training and validation samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Samples that the training method fits.
    pub training: Dataset,
    /// Held-out samples that judge each epoch; `None` if nothing is held out.
    pub validation: Option<Dataset>,
}

/// Rule by which the samples of a recording are divided into training, validation and test samples, or into folds.
///
/// Neighbouring frames of a recording are nearly the same, so a test sample whose neighbours are in the training set
/// gives an optimistic error (Roberts et al. 2017, doi:10.1111/ecog.02881: blocks in time or by group).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, strum::Display, strum::IntoStaticStr,
)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case")]
pub enum SplitBy {
    /// Blocks in the order of the samples, the last one for the test (the first, if only the last has changes of the
    /// targets). Consecutive samples of one group stay together.
    #[default]
    Time,
    /// Whole groups, drawn at random: no group is in two parts. The groups of a simulated array are its snapshots.
    #[serde(alias = "snapshot")]
    Group,
    /// Single samples, drawn at random, as in the cross-validation of the paper. Optimistic if neighbouring samples are
    /// alike, or row-wires of one snapshot.
    #[serde(alias = "sample")]
    Random,
}

impl Named for SplitBy {
    const WHAT: &'static str = "a split";
    const ALL: &'static [Self] = &SplitBy::ALL;
}

impl SplitBy {
    /// All rules, in the order offered.
    pub const ALL: [Self; 3] = [Self::Time, Self::Group, Self::Random];

    /// Returns the rule that keeps related samples together: by group if samples of `set` are in groups, else by
    /// time.
    pub fn honest(set: &Dataset) -> Self {
        let groups = Self::Group.units(set).len();
        if (2..set.samples()).contains(&groups) {
            Self::Group
        } else {
            Self::Time
        }
    }

    /// Number of folds of `set`: `wanted`, or the number of units if there are fewer.
    pub fn folds_of(self, set: &Dataset, wanted: usize) -> usize {
        wanted.min(self.units(set).len())
    }

    /// Returns the samples that stay together, in the order of the samples.
    pub(super) fn units(self, set: &Dataset) -> Vec<Vec<usize>> {
        match self {
            Self::Time => {
                let runs = (0..set.samples()).collect::<Vec<_>>();
                let runs = runs.chunk_by(|&one, &next| set.groups()[one] == set.groups()[next]);
                runs.map(<[usize]>::to_vec).collect()
            }
            Self::Group => set.snapshots(),
            Self::Random => (0..set.samples()).map(|sample| vec![sample]).collect(),
        }
    }

    /// Holds out `held_out` units of `set` for validation, drawn at random unless in order of time; at least one unit
    /// remains for training.
    pub fn hold_out(self, set: &Dataset, held_out: usize, rng: &mut impl Rng) -> Split {
        let mut validation = self.ordered_units(set, rng);
        let training = validation.split_off(held_out.min(validation.len().saturating_sub(1)));
        if validation.is_empty() {
            // Large sets need not be copied.
            return Split {
                training: set.clone(),
                validation: None,
            };
        }
        Split {
            training: set.select(&ascending(training.concat())),
            validation: Some(set.select(&ascending(validation.concat()))),
        }
    }

    /// Returns [`Self::units`] in the order in which they are assigned to the parts.
    pub(super) fn ordered_units(self, set: &Dataset, rng: &mut impl Rng) -> Vec<Vec<usize>> {
        let mut units = self.units(set);
        if self != Self::Time {
            units.shuffle(rng);
        }
        units
    }

    /// Name of one of `units` of a set of `samples` samples.
    pub(super) fn unit_name(self, units: usize, samples: usize) -> &'static str {
        match self {
            Self::Time | Self::Group if units < samples => "group",
            _ => "sample",
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Scene,
        sensor::SensorModel,
    };

    fn set(groups: Vec<usize>) -> Dataset {
        let values = Array2::from_shape_fn((groups.len(), 1), |(sample, _)| sample as f64);
        Dataset::new(values.clone(), values, None, groups).unwrap()
    }

    fn divide(set: &Dataset, by: SplitBy, seed: u64) -> Result<DividedSamples, DatasetError> {
        let division = Division {
            by,
            test_fraction: 0.2,
            validation_fraction: Some(0.2),
        };
        division.divide(set, false, Seed(seed))
    }

    #[test]
    fn in_time_the_last_part_is_for_testing_and_the_one_before_for_validation() {
        let set = set((0..100).collect());
        let parts = divide(&set, SplitBy::Time, 0).unwrap();
        assert_eq!(parts.training, Vec::from_iter(0..64));
        assert_eq!(parts.validation, Vec::from_iter(64..80));
        assert_eq!(parts.test, Vec::from_iter(80..100));
        assert_eq!(
            parts,
            divide(&set, SplitBy::Time, 1).unwrap(),
            "no random numbers are used"
        );
        assert_eq!(set.select(&parts.test).targets()[[0, 0]], 80.0);
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
    fn splits_in_time_fall_between_groups() {
        // Runs of 30, 30, 30 and 10: 20 samples of 100 would cut the third.
        let groups = (0..100).map(|sample| sample / 30).collect();
        let parts = divide(&set(groups), SplitBy::Time, 0).unwrap();
        assert_eq!(parts.test, Vec::from_iter(90..100));
        assert_eq!(parts.validation, Vec::from_iter(60..90));
    }

    #[test]
    fn the_only_change_of_the_targets_is_in_the_training_samples() {
        let pressed = |press: std::ops::Range<usize>| {
            let targets = Array2::from_shape_fn((100, 1), |(sample, _)| f64::from(u8::from(press.contains(&sample))));
            Dataset::new(targets.clone(), targets, None, (0..100).collect()).unwrap()
        };
        for (press, test) in [(10..20, 80..100), (50..85, 80..100), (85..95, 0..20), (66..78, 0..20)] {
            let set = pressed(press.clone());
            let parts = divide(&set, SplitBy::Time, 0).unwrap();
            assert_eq!(parts.test, Vec::from_iter(test), "{press:?}");
            assert!(set.select(&parts.training).has_varying_target(), "{press:?}");
        }
    }

    #[test]
    fn every_sample_is_in_exactly_one_part() {
        for samples in [2, 3, 5, 97] {
            let set = set((0..samples).map(|sample| sample / 2).collect());
            for by in SplitBy::ALL {
                let Ok(parts) = divide(&set, by, 3) else {
                    assert_eq!(samples, 2, "{by:?}");
                    continue;
                };
                let mut all = [&parts.training[..], &parts.validation, &parts.test].concat();
                all.sort_unstable();
                assert_eq!(all, Vec::from_iter(0..samples), "{by:?}");
                assert!(!parts.training.is_empty() && !parts.test.is_empty(), "{by:?}");
            }
        }
    }

    #[test]
    fn a_random_split_is_seeded_and_uniform() {
        let set = set((0..1000).collect());
        let parts = divide(&set, SplitBy::Random, 4).unwrap();
        assert_eq!(parts, divide(&set, SplitBy::Random, 4).unwrap());
        assert_ne!(parts, divide(&set, SplitBy::Random, 5).unwrap());
        let early = parts.test.iter().filter(|&&sample| sample < 500).count();
        assert!(parts.test.len() == 200 && (70..130).contains(&early), "{early}");
    }

    #[test]
    fn a_separate_test_set_leaves_all_samples_for_training_and_validation() {
        let set = set((0..50).collect());
        let a_fifth_held_out = Division {
            validation_fraction: Some(0.2),
            ..Division::default()
        };
        let parts = a_fifth_held_out.divide(&set, true, Seed(0)).unwrap();
        assert_eq!(
            (parts.training.len(), parts.validation.len(), parts.test.len()),
            (40, 10, 0)
        );
        let parts = Division::default().divide(&set, true, Seed(0)).unwrap();
        assert_eq!(parts.split(&set).validation, None);
    }

    #[test]
    fn invalid_divisions_are_refused() {
        let one_group = divide(&set(vec![7; 10]), SplitBy::Group, 0).unwrap_err().to_string();
        assert!(one_group.contains("all 10 samples are one group"), "{one_group}");
        for (test_fraction, validation_fraction) in [(0.0, 0.2), (1.0, 0.2), (f64::NAN, 0.2), (0.2, 1.0), (0.2, -0.1)] {
            let division = Division {
                by: SplitBy::Time,
                test_fraction,
                validation_fraction: Some(validation_fraction),
            };
            let error = division.divide(&set(vec![0, 1]), false, Seed(0));
            assert!(matches!(error, Err(DatasetError::Fraction { .. })), "{division:?}");
        }
        assert!(SplitBy::parse("block").is_err());
        assert!(SplitBy::ALL.iter().all(|by| SplitBy::parse(by.name()) == Ok(*by)));
    }

    fn split(samples: usize, held_out: usize) -> (Dataset, Split) {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(Stream::Training)).unwrap();
        let split = SplitBy::Group.hold_out(&set, held_out, &mut Seed(0).rng(Stream::Split));
        (set, split)
    }

    #[test]
    fn whole_snapshots_are_held_out_and_none_is_lost_or_shared() {
        let (set, split) = split(200, 3);
        let validation = split.validation.unwrap();
        assert_eq!((split.training.samples(), validation.samples()), (170, 30));
        // Every z is drawn independently, so the first node's z identifies the sample.
        let z = |set: &Dataset| set.targets().column(2).to_vec();
        let mut apart = [z(&split.training), z(&validation)].concat();
        let mut whole = z(&set);
        apart.sort_by(f64::total_cmp);
        whole.sort_by(f64::total_cmp);
        assert_eq!(apart, whole);
        for (row, coordinates) in validation.targets().rows().into_iter().enumerate() {
            assert_eq!(
                coordinates[0],
                8.0 + (row % 10) as f64,
                "snapshots stay whole and in order"
            );
        }
    }

    #[test]
    fn at_least_one_snapshot_remains_for_training() {
        assert_eq!(split(10, 1).1.validation, None);
        assert_eq!(split(20, 5).1.training.samples(), 10);
        assert_eq!(split(100, 0).1.validation, None);
    }
}
