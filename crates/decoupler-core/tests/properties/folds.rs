//! Folds and held-out samples of sets with snapshots of arbitrary size and order.

use std::collections::BTreeSet;

use decoupler_core::dataset::{Dataset, Folds, Seed, SplitBy, Stream};
use ndarray::Array2;
use proptest::prelude::*;

use crate::cases;

/// A set whose only reading is the index of the sample.
fn sets() -> impl Strategy<Value = Dataset> {
    prop::collection::vec(0..8_usize, 2..60).prop_map(|groups| {
        let column = |first: f64| Array2::from_shape_fn((groups.len(), 1), |(sample, _)| first + sample as f64);
        Dataset::new(column(1.0), column(0.0), None, groups.clone()).unwrap()
    })
}

fn units() -> impl Strategy<Value = SplitBy> {
    prop_oneof![Just(SplitBy::Random), Just(SplitBy::Group)]
}

fn groups_of(set: &Dataset, samples: &[usize]) -> BTreeSet<usize> {
    samples.iter().map(|&sample| set.groups()[sample]).collect()
}

proptest! {
    #![proptest_config(cases(128))]

    #[test]
    fn folds_partition_the_samples_and_keep_snapshots_whole(
        set in sets(), unit in units(), folds in 0..12_usize, seed in any::<u64>()
    ) {
        let every = Vec::from_iter(0..set.samples());
        let of_unit = match unit {
            SplitBy::Random => set.samples(),
            SplitBy::Group | SplitBy::Time => groups_of(&set, &every).len(),
        };
        match Folds::by(&set, folds, unit, &mut Seed(seed).rng(Stream::Split)) {
            Ok(assigned) => {
                prop_assert_eq!(assigned.count(), folds);
                let mut tested: Vec<usize> = (0..folds).flat_map(|fold| assigned.test(fold).to_vec()).collect();
                tested.sort_unstable();
                prop_assert_eq!(&tested, &every, "every sample is tested once");
                let mut sizes = Vec::new();
                for fold in 0..folds {
                    let (test, training) = (assigned.test(fold), assigned.without(&[fold]));
                    prop_assert_eq!(test.len() + training.len(), set.samples());
                    prop_assert!(training.iter().all(|sample| !test.contains(sample)));
                    let groups = groups_of(&set, test);
                    if unit == SplitBy::Group {
                        prop_assert!(groups.is_disjoint(&groups_of(&set, &training)), "a snapshot is divided");
                    }
                    sizes.push(if unit == SplitBy::Group { groups.len() } else { test.len() });
                }
                prop_assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1, "{sizes:?}");
            }
            Err(error) => {
                prop_assert!(folds < 2 || folds > of_unit, "{error}");
                prop_assert!(error.to_string().starts_with(&format!("{folds} folds of {of_unit} ")), "{error}");
            }
        }
    }

    #[test]
    fn held_out_snapshots_are_whole_and_no_sample_is_lost(set in sets(), held_out in 0..10_usize, seed in any::<u64>()) {
        let split = SplitBy::Group.hold_out(&set, held_out, &mut Seed(seed).rng(Stream::Split));
        let groups = |set: &Dataset| BTreeSet::from_iter(set.groups().iter().copied());
        let numbers = |set: &Dataset| set.readings().iter().map(|&number| number as usize).collect::<Vec<_>>();
        let mut all = numbers(&split.training);
        let snapshots = groups(&set).len();
        let expected = held_out.min(snapshots - 1);
        match &split.validation {
            Some(validation) => {
                prop_assert!(groups(validation).is_disjoint(&groups(&split.training)));
                prop_assert_eq!(groups(validation).len(), expected);
                all.extend(numbers(validation));
            }
            None => prop_assert_eq!(expected, 0),
        }
        all.sort_unstable();
        prop_assert_eq!(all, numbers(&set));
    }
}
