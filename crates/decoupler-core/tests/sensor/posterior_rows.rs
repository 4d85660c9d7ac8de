//! Rows with noise that are solved side by side have the same answers as alone.

use decoupler_core::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{Decoder, PolishedDecoder, Posterior, PosteriorDecoder, Program, ProgramDecoder, decode_set},
    scene::{Movement, Noise, Rows, Scene},
    sensor::SensorModel,
};

fn posterior(model: &SensorModel, scene: &Scene) -> PosteriorDecoder {
    let rows: Vec<usize> = (0..model.scale.rows()).collect();
    let posterior = Posterior::new(model, scene, &rows, &mut Seed(1).rng(Stream::Expectation)).unwrap();
    PosteriorDecoder::new(posterior, model, scene, &rows).unwrap()
}

fn polished(model: &SensorModel, scene: &Scene, set: &Dataset, steps: usize) -> PolishedDecoder {
    let first = Box::new(ProgramDecoder::new(Program::mean(set)));
    let rows: Vec<usize> = (0..model.scale.rows()).collect();
    let mut rng = Seed(1).rng(Stream::Expectation);
    PolishedDecoder::new(first, model, scene, &rows, steps, &mut rng).unwrap()
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

/// Medians of one frame recorded when rows were solved one by one, with vector registers along the columns of one
/// matrix. Each moves by less than 1e-11 mm if readings change by a unit in the last place.
#[derive(serde::Deserialize)]
struct Past {
    array: String,
    relative: f64,
    additive_ohm: f64,
    drift: f64,
    converter_bits: Option<u8>,
    loading: String,
    sideways: bool,
    known: bool,
    readings_ohm: Vec<f64>,
    z_mm: Vec<f64>,
}

#[test]
fn medians_match_rows_solved_one_by_one() {
    let past: Vec<Past> = serde_json::from_str(include_str!("../fixtures/posterior_medians.json")).unwrap();
    for case in past {
        let model = SensorModel::new(case.array.parse().unwrap());
        let scene = Scene {
            rows: if case.known { Rows::Known } else { Rows::All },
            movement: if case.sideways { Movement::SIDEWAYS } else { Movement::Z },
            loading: case.loading.parse().unwrap(),
            noise: Noise {
                relative: case.relative,
                additive_ohm: case.additive_ohm,
                drift: case.drift,
                converter_bits: case.converter_bits,
                ..Noise::default()
            },
            ..Scene::default()
        };
        let mut answer_mm = vec![0.0; 3 * case.z_mm.len()];
        posterior(&model, &scene)
            .decode(&case.readings_ohm, &mut answer_mm)
            .unwrap();
        for (place, (ours, past)) in answer_mm.iter().skip(2).step_by(3).zip(&case.z_mm).enumerate() {
            let apart = (ours - past).abs();
            assert!(
                apart < 1e-10,
                "{}, {:?}, node {place}: {apart:e}",
                case.array,
                scene.noise
            );
        }
    }
}

/// Also next to rows whose readings no deformation explains, which take ten times as many linearisations, and in a
/// decoder that has recorded which rows are slow.
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
            let mut readings = set.frames().unwrap().frame(0).to_vec();
            wild_rows
                .iter()
                .for_each(|row| readings[row * channels + channels - 1] *= 40.0);
            let decoders: [[Box<dyn Decoder>; 2]; 3] = [
                [posterior(&model, &scene), posterior(&model, &scene)].map(|decoder| Box::new(decoder) as _),
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

#[test]
fn sets_are_bit_identical_to_their_frames() {
    let model = SensorModel::new("3x2_2x6".parse().unwrap());
    let scene = Scene {
        rows: Rows::Known,
        noise: Noise::relative(1e-2),
        ..Scene::default()
    };
    let set = noisy_set(&model, &scene, 400);
    let answers = decode_set(&mut posterior(&model, &scene), &set).unwrap();
    let frames = set.frames().unwrap();
    let mut decoder = posterior(&model, &scene);
    let mut frame_mm = vec![0.0; 3 * 6];
    for snapshot in 0..frames.count() {
        decoder.decode(frames.frame(snapshot), &mut frame_mm).unwrap();
        for (&sample, row_mm) in frames.samples(snapshot).iter().zip(frame_mm.chunks_exact(6)) {
            assert_eq!(bits(answers.row(sample).as_slice().unwrap()), bits(row_mm), "{sample}");
        }
    }
}

#[test]
fn invalid_readings_are_named() {
    let model = SensorModel::new("7x2_2x6".parse().unwrap());
    for rows in [Rows::Known, Rows::All] {
        let scene = Scene {
            rows,
            noise: Noise::relative(1e-3),
            ..Scene::default()
        };
        let set = noisy_set(&model, &scene, 200);
        for (row, channel, value) in [(6, 4, f64::NAN), (0, 0, 0.0), (3, 5, f64::INFINITY)] {
            let mut readings = set.frames().unwrap().frame(0).to_vec();
            readings[row * 6 + channel] = value;
            let decoders: [Box<dyn Decoder>; 2] = [
                Box::new(posterior(&model, &scene)),
                Box::new(polished(&model, &scene, &set, 2)),
            ];
            for mut decoder in decoders {
                let error = decoder.decode(&readings, &mut [0.0; 7 * 6]).unwrap_err();
                assert_eq!((error.row_index, error.channel), (row, channel));
                assert_eq!(error.value.to_bits(), value.to_bits());
            }
        }
        // For a set, the error names the sample, also beyond the first block.
        let mut readings = set.readings().to_owned();
        readings[[1300, 2]] = -1.0;
        let row_wires: Vec<usize> = (0..set.samples()).map(|sample| set.row_wire(sample).unwrap()).collect();
        let groups = set.groups().to_vec();
        let bad = Dataset::new(readings, set.targets().to_owned(), Some(&row_wires), groups).unwrap();
        let error = decode_set(&mut posterior(&model, &scene), &bad).unwrap_err();
        assert_eq!((error.row_index, error.channel, error.value), (1300, 2, -1.0));
    }
}
