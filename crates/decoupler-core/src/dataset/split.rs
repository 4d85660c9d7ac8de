use rand::{Rng, seq::SliceRandom};

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
