//! Files written and read back.

use std::sync::{Arc, LazyLock};

use decoupler_core::{
    dataset::Dataset,
    evaluation::Run,
    network::{DecouplingNetwork, Mlp, Networks},
    scene::Rows,
    training::Method,
};
use decoupler_files::{
    export::{CheckpointFile, NetworkFile, RunFolder, write_samples, write_samples_header},
    import::{LineParser, ReadingsFile},
};
use ndarray::Array2;
use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed},
};

use crate::trained::{network, place, resumed, settings, stepped};

/// Readings of every magnitude, row-wires and snapshots of an array of three row-wires, two nodes and six columns.
fn sets() -> impl Strategy<Value = Dataset> {
    let sample = (prop::collection::vec(-30.0..30.0_f64, 6), 0..3_usize, 0..5_usize);
    prop::collection::vec(sample, 1..20).prop_map(|samples| {
        let readings = |(sample, column): (usize, usize)| 10_f64.powf(samples[sample].0[column]);
        let row_wires: Vec<usize> = samples.iter().map(|sample| sample.1).collect();
        let groups = samples.iter().map(|sample| sample.2).collect();
        let targets = Array2::zeros((samples.len(), 6));
        Dataset::new(
            Array2::from_shape_fn((samples.len(), 6), readings),
            targets,
            Some(&row_wires),
            groups,
        )
        .unwrap()
    })
}

/// The file of a network of the smallest array with 2 hidden nodes.
static TRAINED: LazyLock<NetworkFile> = LazyLock::new(|| network("1x1_1x3", 2, 1));

/// Number of cases of a property. They are the same in every run, so failures need no record.
fn cases(count: u32) -> Config {
    Config {
        cases: count,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(2),
        ..Config::default()
    }
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn samples_round_trip(set in sets(), most in 1..25_usize) {
        let mut file = Vec::new();
        write_samples_header("3x2_2x6".parse().unwrap(), false, &mut file).unwrap();
        write_samples(&set, None, 1, &mut file).unwrap();
        let parser = LineParser::of_array("3x2_2x6".parse().unwrap(), Rows::Known, true).unwrap();
        let mut reader = ReadingsFile::new(file.as_slice(), parser);
        let mut sample = 0;
        while let Some(reading) = reader.read(most).unwrap() {
            for (index, readings_ohm) in reading.values_ohm.outer_iter().enumerate() {
                prop_assert_eq!(readings_ohm.to_vec(), set.sample_readings(sample));
                prop_assert_eq!(Some(reading.row_indices[index]), set.row_wire(sample));
                sample += 1;
            }
        }
        prop_assert_eq!(sample, set.samples());
    }

    #[test]
    fn networks_round_trip_bit_for_bit(
        weights in prop::collection::vec(
            prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
            TRAINED.network.at(0).mlp().weights().len(),
        )
    ) {
        let mut file = TRAINED.clone();
        let network = TRAINED.network.at(0);
        let mlp = Mlp::from_weights(network.mlp().shape(), weights.clone());
        let network = DecouplingNetwork::new(network.inputs().clone(), mlp, network.outputs().clone());
        file.network = Networks::shared(network);
        let (_folder, path) = place();
        file.save(&path).unwrap();
        let read = NetworkFile::load(&path).unwrap();
        prop_assert_eq!(&read, &file);
        let bits = |weights: &[f64]| weights.iter().map(|weight| weight.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(read.network.at(0).mlp().weights()), bits(&weights));
    }

    /// A training that is written at any epoch and read back continues as if it had not been interrupted.
    #[test]
    fn trainings_round_trip_bit_for_bit(
        method in prop::sample::select(Method::all().to_vec()),
        before in 0..6_usize,
        after in 0..6_usize,
        starts in 1..3_usize,
    ) {
        let mut settings = settings("1x1_1x3", 2, 12);
        (settings.training.method, settings.starts) = (method, starts);
        let mut whole = stepped(settings, before);
        let (_folder, path) = place();
        CheckpointFile::from_run(&whole, None).unwrap().save(&path).unwrap();
        let mut read = resumed(CheckpointFile::load(&path).unwrap());
        prop_assert_eq!(read.states(), whole.states());
        for _ in 0..after {
            whole.step();
            read.step();
        }
        let bits = |run: &Run| run.network().at(0).mlp().weights().iter().map(|weight| weight.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&read), bits(&whole));
    }

    #[test]
    fn run_lists_round_trip(
        names in prop::collection::vec("\\PC{0,20}", 0..4),
        pinned in prop::sample::select(vec![None, Some(0_usize), Some(1)]),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let open = || RunFolder::open(folder.path()).unwrap();
        let (mut kept, _) = open();
        let file = Arc::new(TRAINED.clone());
        for name in &names {
            kept.keep(Arc::clone(&file)).unwrap();
            let id = kept.runs().runs.last().map(|run| run.id).unwrap();
            kept.rename(id, name).unwrap();
        }
        let pinned = pinned.and_then(|index| kept.runs().runs.get(index)).map(|run| run.id);
        kept.pin([pinned, None]).unwrap();
        let found = Vec::from_iter(kept.runs().runs.iter().map(|run| &run.name));
        prop_assert_eq!(found, Vec::from_iter(&names));
        let (mut again, mut problems) = open();
        problems.extend([again.load_used(), kept.load_used()].concat());
        prop_assert_eq!((again.runs(), problems), (kept.runs(), Vec::new()));
    }
}
