use std::{fmt, str::FromStr};

use rand::{Rng, seq::SliceRandom};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Dataset;

/// A set split into training and validation samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Samples that the training method fits.
    pub training: Dataset,
    /// Held-out samples that judge each epoch; `None` if nothing is held out.
    pub validation: Option<Dataset>,
}

/// Holds out `held_out` snapshots for validation, chosen by `rng`; at least one snapshot remains for training. Whole
/// snapshots are held out, so that no validation sample was read at the same moment as a training sample.
pub fn hold_out(set: Dataset, held_out: usize, rng: &mut impl Rng) -> Split {
    let snapshots = set.snapshots();
    let held_out = held_out.min(snapshots.len().saturating_sub(1));
    if held_out == 0 {
        return Split {
            training: set,
            validation: None,
        };
    }
    let mut order: Vec<usize> = (0..snapshots.len()).collect();
    order.shuffle(rng);
    let (validation, training) = order.split_at(held_out);
    let samples = |chosen: &[usize]| -> Vec<usize> {
        let mut samples: Vec<usize> = chosen
            .iter()
            .flat_map(|&snapshot| &snapshots[snapshot])
            .copied()
            .collect();
        samples.sort_unstable();
        samples
    };
    Split {
        training: set.select(&samples(training)),
        validation: Some(set.select(&samples(validation))),
    }
}

/// Rule by which the samples of a recording are divided into training, validation and test samples, or into folds.
///
/// Neighbouring frames of a recording are nearly the same, so a network that has trained on the neighbours of a test
/// sample is judged too well (Roberts et al. 2017, doi:10.1111/ecog.02881: blocks in time or by group).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SplitBy {
    /// Blocks in the order of the samples, the last for the test. Consecutive samples of one group stay together.
    #[default]
    Time,
    /// Whole groups, drawn at random: no group is in two parts.
    Group,
    /// Single samples, drawn at random. It is optimistic wherever neighbouring samples are alike.
    Random,
}

/// Error for a word that names no rule of division.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not a split: give time, group or random")]
pub struct SplitByError(String);

impl fmt::Display for SplitBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Time => "time",
            Self::Group => "group",
            Self::Random => "random",
        })
    }
}

impl FromStr for SplitBy {
    type Err = SplitByError;

    fn from_str(text: &str) -> Result<Self, SplitByError> {
        let found = Self::ALL.into_iter().find(|by| by.to_string() == text.trim());
        found.ok_or_else(|| SplitByError(text.to_owned()))
    }
}

impl SplitBy {
    /// Every rule, in the order offered.
    pub const ALL: [Self; 3] = [Self::Time, Self::Group, Self::Random];

    /// Returns the rule whose test samples are new to the fit: by group if samples of `set` are in groups, else by time.
    pub fn honest(set: &Dataset) -> Self {
        let groups = Self::Group.units(set).len();
        if (2..set.samples()).contains(&groups) {
            Self::Group
        } else {
            Self::Time
        }
    }

    /// Number of folds of `set`: as many as wanted, or as it has units.
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

    /// Returns [`Self::units`] in the order in which parts are taken from them.
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
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Scene,
        sensor::SensorModel,
    };

    fn split(samples: usize, held_out: usize) -> (Dataset, Split) {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(Stream::Training)).unwrap();
        (set.clone(), hold_out(set, held_out, &mut Seed(0).rng(Stream::Split)))
    }

    #[test]
    fn whole_snapshots_are_held_out_and_none_is_lost_or_shared() {
        let (set, split) = split(200, 3);
        let validation = split.validation.unwrap();
        assert_eq!((split.training.samples(), validation.samples()), (170, 30));
        // Every z is drawn afresh, so the first node's z names the sample.
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
    fn one_snapshot_always_stays_for_training() {
        assert_eq!(split(10, 1).1.validation, None);
        assert_eq!(split(20, 5).1.training.samples(), 10);
        assert_eq!(split(100, 0).1.validation, None);
    }
}
