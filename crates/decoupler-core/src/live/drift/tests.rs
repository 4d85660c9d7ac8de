use ndarray::{Array1, Array2, Axis};
use rand::{SeedableRng, rngs::ChaCha8Rng};

use super::*;
use crate::scene::standard_normal;

/// Readings of five correlated channels, with the correlation `memory` of neighbouring readings.
fn readings(samples: usize, memory: f64, rng: &mut ChaCha8Rng) -> Array2<f64> {
    let mut state: Vec<f64> = (0..6).map(|_| standard_normal(rng)).collect();
    let mut readings = Array2::zeros((samples, 5));
    for mut row in readings.rows_mut() {
        for value in &mut state {
            *value = memory * *value + (1.0 - memory * memory).sqrt() * standard_normal(rng);
        }
        for (channel, reading) in row.iter_mut().enumerate() {
            *reading = 100.0 * (channel + 1) as f64 + state[channel] + state[5];
        }
    }
    readings
}

/// Events of the monitor, with rows as positions.
fn events(reference: &DriftReference, readings: &Array2<f64>) -> Vec<Drift> {
    let mut monitor = DriftMonitor::new(reference.clone());
    let rows = readings.rows().into_iter().zip(0..);
    rows.filter_map(|(row, position)| monitor.take(position, &row.to_vec()))
        .collect()
}

/// First drift, if there is one.
fn first_drift(reference: &DriftReference, readings: &Array2<f64>) -> Option<Drift> {
    events(reference, readings).into_iter().find(|drift| !drift.has_ended)
}

type Fault = fn(&mut Array2<f64>, &Array1<f64>);

fn frozen_at_the_mean(readings: &mut Array2<f64>, mean: &Array1<f64>) {
    readings.rows_mut().into_iter().for_each(|mut row| row.assign(mean));
}

fn frozen_at_the_last_reading(readings: &mut Array2<f64>, _: &Array1<f64>) {
    let last = readings.row(0).to_owned();
    frozen_at_the_mean(readings, &last);
}

fn halved_spans(readings: &mut Array2<f64>, mean: &Array1<f64>) {
    *readings = 0.5 * (&*readings + mean);
}

fn dead_channel(readings: &mut Array2<f64>, mean: &Array1<f64>) {
    readings.column_mut(2).fill(mean[2]);
}

fn shifted_channel(readings: &mut Array2<f64>, _: &Array1<f64>) {
    // The standard deviation of a channel is √2.
    readings
        .column_mut(2)
        .mapv_inplace(|reading| reading + 3.0 * 2_f64.sqrt());
}

/// Each swapped channel keeps its mean and its variance.
fn swapped_channels(readings: &mut Array2<f64>, _: &Array1<f64>) {
    for mut row in readings.rows_mut() {
        (row[1], row[3]) = (row[3] - 200.0, row[1] + 200.0);
    }
}

#[test]
fn readings_that_differ_from_the_training_are_found_and_others_raise_no_alarm() {
    let faults: [(&str, Fault, &str); 6] = [
        (
            "frozen at the mean",
            frozen_at_the_mean,
            "the inputs vary less than in training",
        ),
        (
            "frozen at the last",
            frozen_at_the_last_reading,
            "the inputs vary less than in training",
        ),
        ("halved spans", halved_spans, " less than in training"),
        ("dead channel", dead_channel, "c varies less than in training"),
        (
            "shifted channel",
            shifted_channel,
            "c is higher on average than in training",
        ),
        ("swapped channels", swapped_channels, " related to "),
    ];
    let inputs = ["a", "b", "c", "d", "e"].map(|name| Channel {
        name: name.to_owned(),
        ..Channel::default()
    });
    for (memory, samples) in [(0.0, 1000), (0.9, 10_000)] {
        let mut alarms = 0;
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            // The fourth channel repeats the third, so that a swap breaks a relation.
            let mut drawn = |samples| {
                let mut drawn = readings(samples, memory, &mut rng);
                let repeated = &drawn.column(2) + 100.0;
                drawn.column_mut(3).assign(&repeated);
                drawn
            };
            let training = drawn(samples);
            let reference = DriftReference::of(training.view()).unwrap();
            assert!(reference.is_valid());
            assert_eq!(first_drift(&reference, &training), None);
            let (block, blocks) = (reference.readings_per_block(), reference.blocks_in_a_row());
            alarms += events(&reference, &drawn(100 * block)).len();
            let mean = training.mean_axis(Axis(0)).unwrap();
            for (name, fault, description) in &faults {
                let mut later = drawn(3 * blocks * block);
                fault(&mut later, &mean);
                let found = first_drift(&reference, &later);
                let found = found.unwrap_or_else(|| panic!("memory {memory}, seed {seed}: {name} is not found"));
                assert_eq!(found.last + 1 - found.first, (blocks * block) as u64);
                let described = found.describe(&inputs);
                assert!(described.contains(description), "{name}: {described}");
            }
        }
        assert_eq!(alarms, 0, "memory {memory}");
    }
}

#[test]
fn a_drift_ends_when_the_readings_are_back_to_normal() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let training = readings(400, 0.0, &mut rng);
    let reference = DriftReference::of(training.view()).unwrap();
    let (block, blocks) = (reference.readings_per_block(), reference.blocks_in_a_row());
    let mut later = readings(40 * block, 0.0, &mut rng);
    // Positions are rows of which blocks 10 to 19 are frozen.
    let frozen = 10 * block..20 * block;
    for row in frozen.clone() {
        later.row_mut(row).assign(&training.row(0));
    }
    let events = events(&reference, &later);
    let [began, ended] = events[..] else {
        panic!("{events:?}");
    };
    assert!(!began.has_ended && ended.has_ended);
    assert_eq!(
        (began.first, began.last),
        (frozen.start as u64, ((10 + blocks) * block - 1) as u64)
    );
    assert_eq!((ended.first, ended.last), (frozen.start as u64, frozen.end as u64 - 1));
}

#[test]
fn the_probability_of_a_false_alarm_in_a_block_is_bounded() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for samples in [100, 150, 400, 3000] {
        let reference = DriftReference::of(readings(samples, 0.0, &mut rng).view()).unwrap();
        // Ways to choose which of the training and later blocks are the later ones.
        let ways = |later: usize| {
            let chosen = (1..=later as u128).map(|k| (reference.blocks as u128 + k, k));
            chosen.fold(1, |ways, (numerator, denominator)| ways * numerator / denominator)
        };
        // Two sides of the variances and means, one of the squares.
        let comparisons = 2 * 6 + 2 * 5 + 6;
        let blocks = reference.blocks_in_a_row();
        assert!(ways(blocks) >= comparisons * 10_000 && ways(blocks - 1) < comparisons * 10_000);
    }
}

#[test]
fn the_monitor_does_not_depend_on_the_scale() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (training, mut later) = (readings(400, 0.0, &mut rng), readings(400, 0.0, &mut rng));
    later.row_mut(200).fill(0.0);
    shifted_channel(&mut later, &Array1::zeros(5));
    let expected = first_drift(&DriftReference::of(training.view()).unwrap(), &later);
    assert!(expected.is_some());
    for (scale, offset) in [(1e-200, 0.0), (1e-290, 0.0), (1e300, 0.0), (1e-3, 1e9), (1.0, 1e12)] {
        let of_scale = |readings: &Array2<f64>| readings * scale + offset;
        let reference = DriftReference::of(of_scale(&training).view()).unwrap();
        assert_eq!(
            first_drift(&reference, &of_scale(&later)),
            expected,
            "scale {scale:e}, offset {offset:e}"
        );
    }
}

#[test]
fn unusable_readings_have_no_monitor_for_a_reason() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut reason = |change: fn(f64) -> f64, samples, memory| {
        DriftReference::of(readings(samples, memory, &mut rng).mapv(change).view()).err()
    };
    let constant = Some(LiveError::Constant);
    assert_eq!(reason(|_| 0.0, 400, 0.0), constant);
    assert_eq!(reason(|_| 0.1, 400, 0.0), constant);
    assert_eq!(reason(|reading| 1e14 + 1e-9 * reading, 400, 0.0), constant);
    assert_eq!(reason(|reading| 1e-320 * reading.signum(), 400, 0.0), constant);
    assert_eq!(reason(|reading| reading, 1, 0.0), constant);
    assert_eq!(reason(|reading| 3e305 * (reading - 300.0), 400, 0.0), None);
    assert_eq!(
        reason(|reading| 1e308 * (reading - 300.0), 400, 0.0),
        Some(LiveError::NotFinite)
    );
    assert_eq!(reason(|_| f64::NAN, 400, 0.0), Some(LiveError::NotFinite));
    let few = Some(LiveError::TooFewReadings { blocks: 4, block: 5 });
    assert_eq!(reason(|reading| reading, 20, 0.0), few);
    let few = reason(|reading| reading, 400, 0.99);
    assert!(
        matches!(few, Some(LiveError::TooFewReadings { blocks: 0..10, .. })),
        "{few:?}"
    );
    assert_eq!(
        DriftReference::of(Array2::zeros((400, 600)).view()),
        Err(LiveError::TooManyInputs { found: 600 })
    );
}

#[test]
fn a_constant_channel_is_ignored() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut training = readings(400, 0.0, &mut rng);
    training.column_mut(0).fill(5.0);
    let reference = DriftReference::of(training.view()).unwrap();
    let mut later = readings(400, 0.0, &mut rng);
    later.column_mut(0).fill(6.0);
    assert_eq!(first_drift(&reference, &later), None);
}
