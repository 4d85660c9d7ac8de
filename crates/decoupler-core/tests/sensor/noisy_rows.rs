//! Rows with noise that are solved side by side have the same answers as alone.

use decoupler_core::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{Decoder, NewtonDecoder, Program, ProgramDecoder, decode_set},
    scene::{Noise, Rows, Scene},
    sensor::SensorModel,
};

fn newton(model: &SensorModel, scene: &Scene) -> NewtonDecoder {
    let rows: Vec<usize> = (0..model.scale.rows()).collect();
    NewtonDecoder::new(model, scene, &rows).unwrap()
}

fn polished(model: &SensorModel, scene: &Scene, set: &Dataset, steps: usize) -> NewtonDecoder {
    let first = Box::new(ProgramDecoder::new(Program::mean(set)));
    let rows: Vec<usize> = (0..model.scale.rows()).collect();
    NewtonDecoder::new(model, scene, &rows).unwrap().after(first, steps)
}

fn noisy_set(model: &SensorModel, scene: &Scene, snapshots: usize) -> Dataset {
    let samples = snapshots * model.scale.rows();
    let mut set = Dataset::simulate(model, scene, samples, &mut Seed(3).rng(Stream::Test)).unwrap();
    set.disturb(model, &scene.noise, &mut Seed(3).rng(Stream::TestNoise))
        .unwrap();
    set
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Also next to rows whose readings no deformation explains, which take ten times as many linearisations.
#[test]
fn frames_are_bit_identical_to_rows_with_the_same_status() {
    let relative = Noise::relative(1e-3);
    let noises = [
        relative,
        Noise::default(),
        Noise {
            drift: 0.05,
            ..relative
        },
        Noise {
            converter_bits: Some(8),
            additive_ohm: 1.0,
            ..relative
        },
    ];
    for (array, wild_rows) in [
        ("9x3_2x9", [0, 4]),
        ("5x1_1x3", [4, 4]),
        ("3x5_2x7", [1, 2]),
        ("1x4_2x12", [0, 0]),
    ] {
        let model = SensorModel::new(array.parse().unwrap());
        let (rows, channels) = (model.scale.rows(), model.scale.columns());
        for (noise, known) in noises
            .into_iter()
            .flat_map(|noise| [(noise, Rows::Known), (noise, Rows::All)])
        {
            let scene = Scene {
                rows: known,
                noise,
                ..Scene::default()
            };
            let set = noisy_set(&model, &scene, 1);
            let mut readings = set.frames().unwrap().swap_remove(0);
            wild_rows
                .iter()
                .for_each(|row| readings[row * channels + channels - 1] *= 40.0);
            let decoders: [[Box<dyn Decoder>; 2]; 3] = [
                [newton(&model, &scene), newton(&model, &scene)].map(|decoder| Box::new(decoder) as _),
                [1, 1].map(|steps| Box::new(polished(&model, &scene, &set, steps)) as _),
                [4, 4].map(|steps| Box::new(polished(&model, &scene, &set, steps)) as _),
            ];
            for [mut whole, mut by_rows] in decoders {
                let mut frame = vec![0.0; rows * whole.outputs()];
                whole.decode(&readings, &mut frame).unwrap();
                for (row, answer) in frame.chunks_exact(whole.outputs()).enumerate() {
                    let mut alone = vec![0.0; answer.len()];
                    let readings = &readings[row * channels..(row + 1) * channels];
                    by_rows.decode_row(row, readings, &mut alone).unwrap();
                    assert_eq!(bits(&alone), bits(answer), "{array}, {noise:?}, row {row}");
                }
                assert_eq!(whole.take_solved_rows(), by_rows.take_solved_rows(), "{array}");
                let mut again = vec![0.0; frame.len()];
                whole.decode(&readings, &mut again).unwrap();
                assert_eq!(bits(&again), bits(&frame), "{array}, {noise:?}");
            }
        }
    }
}

/// Sets are solved in parallel.
#[test]
fn sets_are_bit_identical_to_their_frames_and_name_an_invalid_sample() {
    let model = SensorModel::new("3x2_2x6".parse().unwrap());
    for (rows, noise) in [
        (Rows::Known, 1e-2),
        (Rows::Known, 0.0),
        (Rows::All, 1e-3),
        (Rows::All, 0.0),
    ] {
        let scene = Scene {
            rows,
            noise: Noise::relative(noise),
            ..Scene::default()
        };
        let set = noisy_set(&model, &scene, 450);
        let answers = decode_set(&mut newton(&model, &scene), &set).unwrap();
        let frames = set.frames().unwrap();
        let mut decoder = newton(&model, &scene);
        let mut frame_mm = vec![0.0; 3 * 6];
        for (snapshot, samples) in set.snapshots().iter().enumerate() {
            decoder.decode(&frames[snapshot], &mut frame_mm).unwrap();
            for (&sample, row_mm) in samples.iter().zip(frame_mm.chunks_exact(6)) {
                assert_eq!(bits(answers.row(sample).as_slice().unwrap()), bits(row_mm), "{sample}");
            }
        }
        // Also beyond the first block.
        let mut readings = set.readings().to_owned();
        readings[[1300, 2]] = -1.0;
        let row_wires = Vec::from_iter((0..set.samples()).map(|sample| set.row_wire(sample).unwrap()));
        let groups = set.groups().to_vec();
        let bad = Dataset::new(readings, set.targets().to_owned(), Some(&row_wires), groups).unwrap();
        let error = decode_set(&mut newton(&model, &scene), &bad).unwrap_err();
        assert_eq!((error.row_index, error.channel, error.value), (1300, 2, -1.0));
    }
}
