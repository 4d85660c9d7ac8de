use std::{fmt, str::FromStr};

use rand::{Rng, seq::SliceRandom};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Dataset;

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
