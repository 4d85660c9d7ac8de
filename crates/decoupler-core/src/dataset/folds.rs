use rand::Rng;

use super::{Dataset, DatasetError, DividedSamples, SplitBy, division::ascending};

/// Folds of a k-fold cross-validation: every sample is in exactly one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folds(
    /// Indices of the samples in each fold, ascending.
    Vec<Vec<usize>>,
);

impl Folds {
    /// Divides `set` into `folds` folds by the rule of a split: consecutive blocks of about the same number of samples,
    /// whole groups at random, or single samples at random.
    ///
    /// # Errors
    /// If there are fewer than two folds, or more folds than samples (or groups).
    pub fn by(set: &Dataset, folds: usize, by: SplitBy, rng: &mut impl Rng) -> Result<Self, DatasetError> {
        let units = by.ordered_units(set, rng);
        DatasetError::check_folds(folds, units.len(), by.unit_name(units.len(), set.samples()))?;
        let deal = |fold| ascending(units.iter().skip(fold).step_by(folds).flatten().copied());
        Ok(match by {
            SplitBy::Time => Self::blocks(&units, folds),
            SplitBy::Group | SplitBy::Random => Self((0..folds).map(deal).collect()),
        })
    }

    /// Divides samples, numbered in order, into consecutive blocks.
    pub(crate) fn consecutive(samples: usize, folds: usize) -> Self {
        let units: Vec<Vec<usize>> = (0..samples).map(|sample| vec![sample]).collect();
        Self::blocks(&units, folds)
    }

    /// Blocks of consecutive units, at least one each.
    fn blocks(units: &[Vec<usize>], folds: usize) -> Self {
        let samples: usize = units.iter().map(Vec::len).sum();
        let (mut blocks, mut first, mut before) = (Vec::with_capacity(folds), 0, 0);
        for fold in 0..folds {
            // Each later fold needs at least one unit.
            let most = units.len() - (folds - fold - 1);
            let end_of_fold = samples as f64 * (fold + 1) as f64 / folds as f64;
            let (mut end, mut within) = (first + 1, before + units[first].len());
            while end < most && within as f64 + 0.5 * units[end].len() as f64 <= end_of_fold {
                within += units[end].len();
                end += 1;
            }
            let end = if fold + 1 == folds { units.len() } else { end };
            blocks.push(units[first..end].concat());
            (first, before) = (end, within);
        }
        Self(blocks)
    }

    /// The folds of some of the samples, by their places among `samples`; `None` if fewer than two folds have any.
    pub(crate) fn among(&self, samples: &[usize]) -> Option<Self> {
        let places = |fold: &Vec<usize>| {
            let is_in = |place: &usize| fold.binary_search(&samples[*place]).is_ok();
            Vec::from_iter((0..samples.len()).filter(is_in))
        };
        let folds = self.0.iter().map(places).filter(|fold| !fold.is_empty());
        Some(Self(folds.collect())).filter(|folds: &Self| folds.count() >= 2)
    }

    /// Number of folds, k.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Indices of the test samples of fold `fold`.
    pub fn test(&self, fold: usize) -> &[usize] {
        &self.0[fold]
    }

    /// Divides the samples with fold `fold` for the test. If `holds_out` and there are at least three folds, the next fold
    /// is the validation set.
    pub(crate) fn divided(&self, fold: usize, holds_out: bool) -> DividedSamples {
        let next = (fold + 1) % self.count();
        let validation = (holds_out && self.count() > 2).then_some(next);
        DividedSamples {
            training: self.without(&[fold, validation.unwrap_or(fold)]),
            validation: validation.map_or_else(Vec::new, |next| self.test(next).to_vec()),
            test: self.test(fold).to_vec(),
        }
    }

    /// Indices of the samples in all folds except those given, ascending.
    pub fn without(&self, folds: &[usize]) -> Vec<usize> {
        let kept = self.0.iter().enumerate().filter(|(fold, _)| !folds.contains(fold));
        ascending(kept.flat_map(|(_, samples)| samples).copied())
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

    fn set(samples: usize) -> Dataset {
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(Stream::Training)).unwrap()
    }

    fn deal(set: &Dataset, folds: usize, by: SplitBy, seed: u64) -> Folds {
        Folds::by(set, folds, by, &mut Seed(seed).rng(Stream::Split)).unwrap()
    }

    #[test]
    fn every_sample_is_in_exactly_one_test_fold_and_never_in_its_own_training() {
        let set = set(130);
        for (folds, unit) in [
            (10, SplitBy::Random),
            (7, SplitBy::Random),
            (4, SplitBy::Group),
            (13, SplitBy::Group),
        ] {
            let assigned = deal(&set, folds, unit, 1);
            let mut tested = vec![0; set.samples()];
            for fold in 0..assigned.count() {
                let training = assigned.without(&[fold]);
                for &sample in assigned.test(fold) {
                    tested[sample] += 1;
                    assert!(!training.contains(&sample));
                }
                assert_eq!(training.len() + assigned.test(fold).len(), set.samples());
            }
            assert!(tested.iter().all(|&times| times == 1), "{folds} folds by {unit:?}");
            let sizes = (0..folds).map(|fold| assigned.test(fold).len());
            let unit_size = if unit == SplitBy::Random { 1 } else { 10 };
            assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= unit_size);
        }
    }

    #[test]
    fn folds_by_snapshot_never_split_one() {
        let set = set(130);
        let assigned = deal(&set, 5, SplitBy::Group, 2);
        for fold in 0..5 {
            for snapshot in assigned.test(fold).chunks(10) {
                assert_eq!(snapshot[0] % 10, 0);
                assert!(snapshot.windows(2).all(|pair| pair[0] + 1 == pair[1]));
            }
        }
        let by_sample = deal(&set, 5, SplitBy::Random, 2);
        let splits = |samples: &[usize]| {
            samples
                .iter()
                .any(|sample| sample % 10 != 0 && !samples.contains(&(sample - 1)))
        };
        assert!(splits(by_sample.test(0)), "folds by sample do split snapshots");
    }

    #[test]
    fn a_seed_gives_the_same_folds_and_another_gives_others() {
        let set = set(100);
        for unit in [SplitBy::Random, SplitBy::Group] {
            assert_eq!(deal(&set, 5, unit, 3), deal(&set, 5, unit, 3));
            assert_ne!(deal(&set, 5, unit, 3), deal(&set, 5, unit, 4));
        }
    }

    #[test]
    fn too_many_folds_are_refused() {
        let set = set(100);
        for (folds, unit) in [
            (0, SplitBy::Random),
            (1, SplitBy::Random),
            (101, SplitBy::Random),
            (11, SplitBy::Group),
        ] {
            let error = Folds::by(&set, folds, unit, &mut Seed(0).rng(Stream::Split)).unwrap_err();
            assert!(error.to_string().contains(&folds.to_string()), "{error}");
        }
        assert_eq!(deal(&set, 100, SplitBy::Random, 0).test(0).len(), 1);
    }

    #[test]
    fn folds_in_time_are_consecutive_blocks() {
        let set = set(130);
        let assigned = Folds::by(&set, 4, SplitBy::Time, &mut Seed(0).rng(Stream::Split)).unwrap();
        let mut next = 0;
        for fold in 0..4 {
            let block = assigned.test(fold);
            assert_eq!(block, Vec::from_iter(next..next + block.len()));
            assert!(
                block.len().is_multiple_of(10) && (30..=40).contains(&block.len()),
                "{}",
                block.len()
            );
            next += block.len();
        }
        assert_eq!(next, 130);
        // Blocks of very different lengths still leave one for every fold.
        let readings = ndarray::Array2::zeros((103, 1));
        let groups = (0..103usize).map(|sample| sample.saturating_sub(99)).collect();
        let uneven = Dataset::new(readings.clone(), readings, None, groups).unwrap();
        let assigned = Folds::by(&uneven, 4, SplitBy::Time, &mut Seed(0).rng(Stream::Split)).unwrap();
        assert_eq!(
            (0..4).map(|fold| assigned.test(fold).len()).collect::<Vec<_>>(),
            [100, 1, 1, 1]
        );
        let error = Folds::by(&uneven, 5, SplitBy::Time, &mut Seed(0).rng(Stream::Split)).unwrap_err();
        assert!(error.to_string().contains("5 folds of 4 groups"), "{error}");
    }
}
