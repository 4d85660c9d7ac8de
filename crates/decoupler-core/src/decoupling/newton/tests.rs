use super::*;
use crate::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{Decoder, Estimator, Program, ProgramDecoder, Solution, SolvedRows, decode_set},
    scene::{Movement, Noise, Rows, Scene},
    sensor::SensorModel,
};

fn solved(mut decoder: impl Decoder, set: &Dataset) -> SolvedRows {
    decode_set(&mut decoder, set).unwrap();
    let solved = decoder.take_solved_rows();
    assert_eq!(decoder.take_solved_rows(), SolvedRows::default());
    solved
}

fn polish(model: &SensorModel, scene: &Scene, set: &Dataset, steps: usize) -> NewtonDecoder {
    let first = Box::new(ProgramDecoder::new(Program::mean(set)));
    let rows = Vec::from_iter(0..model.scale.rows());
    NewtonDecoder::new(model, scene, &rows).unwrap().after(first, steps)
}

#[test]
fn too_few_steps_are_flagged_and_enough_are_not() {
    let model = SensorModel::new("3x4_2x12".parse().unwrap());
    for noise in [0.0, 1e-3] {
        let scene = Scene {
            rows: Rows::Known,
            noise: Noise::relative(noise),
            ..Scene::default()
        };
        let mut set = Dataset::simulate(&model, &scene, 30, &mut Seed(0).rng(Stream::Test)).unwrap();
        set.disturb(&model, &scene.noise, &mut Seed(0).rng(Stream::TestNoise))
            .unwrap();
        let enough = solved(polish(&model, &scene, &set, 9), &set);
        assert!(enough.are_reliable() && enough.rows == 30, "{noise}: {enough}");
    }
    let scene = Scene {
        rows: Rows::Known,
        ..Scene::default()
    };
    let set = Dataset::simulate(&model, &scene, 30, &mut Seed(0).rng(Stream::Test)).unwrap();
    let one = solved(polish(&model, &scene, &set, 1), &set);
    assert!(one.unsolved > 20, "{one}");
    assert!(one.to_string().contains("of 30 rows were not solved"), "{one}");
}

/// Rows at x = 8, 10 and 12, with electrodes at x = 7.5 and 12.5, or one.
#[test]
fn rows_that_mirror_each_other_are_flagged_unless_they_are_known() {
    for (array, rows, expected) in [
        ("3x2_2x6", Rows::All, 20),
        ("3x2_2x6", Rows::Known, 0),
        ("3x2_1x6", Rows::All, 30),
        ("3x2_1x6", Rows::Known, 0),
    ] {
        let mut model = SensorModel::new(array.parse().unwrap());
        model.geometry.row_pitch_mm = 2.0;
        model.geometry.column_node_x0_mm = 7.5;
        let scene = Scene {
            rows,
            ..Scene::default()
        };
        let set = Dataset::simulate(&model, &scene, 30, &mut Seed(0).rng(Stream::Test)).unwrap();
        let newton = NewtonDecoder::new(&model, &scene, &[0, 1, 2]).unwrap();
        let solved = solved(newton, &set);
        assert_eq!((solved.rows, solved.unsolved, solved.undetermined), (30, 0, expected));
    }
}

/// As above with nodes that move sideways: at rest only the rows at the ends mirror each other, row 2 mirrors itself,
/// and rows of pitch 0.3 are within reach of each other's mirror images.
#[test]
fn rows_that_mirror_each_other_are_flagged_when_they_move_sideways_too() {
    for (row_pitch_mm, middle_mm, rows, expected) in [
        (2.0, 10.0, Rows::All, 30),
        (2.0, 10.0, Rows::Known, 10),
        (2.0, 12.5, Rows::All, 0),
        // Counted below.
        (0.3, 9.0, Rows::All, 0),
    ] {
        let mut model = SensorModel::new("3x1_3x9".parse().unwrap());
        model.geometry.row_pitch_mm = row_pitch_mm;
        model.geometry.column_node_x0_mm = middle_mm - 5.0;
        let scene = Scene {
            rows,
            movement: Movement::SIDEWAYS,
            ..Scene::default()
        };
        let set = Dataset::simulate(&model, &scene, 30, &mut Seed(0).rng(Stream::Test)).unwrap();
        let newton = NewtonDecoder::new(&model, &scene, &[0, 1, 2]).unwrap();
        let twinned = || {
            let mirrored = |x_mm: f64| 2.0 * middle_mm - x_mm;
            let is_reached =
                |&&x_mm: &&f64| (0..3).any(|row| (mirrored(x_mm) - 8.0 - row_pitch_mm * f64::from(row)).abs() <= 0.2);
            set.targets().column(0).iter().filter(is_reached).count()
        };
        let solved = solved(newton, &set);
        assert_eq!((solved.rows, solved.unsolved), (30, 0), "{row_pitch_mm} {middle_mm}");
        let expected = if row_pitch_mm < 1.0 { twinned() } else { expected };
        assert!(expected < 30 || row_pitch_mm > 1.0);
        assert_eq!(solved.undetermined, expected, "{row_pitch_mm} {middle_mm} {rows:?}");
    }
}

#[test]
fn polishing_flags_rows_that_mirror_each_other() {
    let mut model = SensorModel::new("3x2_2x6".parse().unwrap());
    model.geometry.row_pitch_mm = 2.0;
    model.geometry.column_node_x0_mm = 7.5;
    let scene = Scene::default();
    let set = Dataset::simulate(&model, &scene, 30, &mut Seed(0).rng(Stream::Test)).unwrap();
    // The first answer identifies the right row-wire.
    let known = Scene {
        rows: Rows::Known,
        ..scene
    };
    let first = NewtonDecoder::new(&model, &known, &[0, 1, 2]).unwrap();
    let nearly = NewtonDecoder::new(&model, &scene, &[0, 1, 2]).unwrap();
    let solved = solved(nearly.after(Box::new(first), 9), &set);
    assert_eq!((solved.rows, solved.unsolved, solved.undetermined), (30, 0, 20));
}

/// The gain of the snapshot is unknown. With it, exact evidence (importance sampling of the uniform prior, 60 rows)
/// finds 8 of 10 rows; the residual alone is lowest for the row that suits the gain.
#[test]
fn rows_are_found_with_drift_as_without() {
    let model = SensorModel::new("10x6_3x18".parse().unwrap());
    let found = |noise: Noise| {
        let scene = Scene {
            noise,
            ..Scene::default()
        };
        let rows = Vec::from_iter(0..10);
        let mut set = Dataset::simulate(&model, &scene, 100, &mut Seed(0).rng(Stream::Test)).unwrap();
        set.disturb(&model, &scene.noise, &mut Seed(0).rng(Stream::TestNoise))
            .unwrap();
        let mut decoder = NewtonDecoder::new(&model, &scene, &rows).unwrap();
        let answers = decode_set(&mut decoder, &set).unwrap();
        let is_right = |sample: &usize| answers[[*sample, 0]] == set.targets()[[*sample, 0]];
        (0..100).filter(is_right).count()
    };
    let without = found(Noise::relative(1e-3));
    let with = found(Noise {
        drift: 0.1,
        ..Noise::relative(1e-3)
    });
    assert!(without >= 99 && with >= 70, "{without} without drift, {with} with");
    let alone = found(Noise {
        drift: 0.1,
        ..Noise::default()
    });
    let digitised = found(Noise {
        drift: 0.1,
        converter_bits: Some(16),
        ..Noise::default()
    });
    assert!(alone == 100 && digitised >= 70, "{alone} exact, {digitised} of 16 bits");
}

/// In a sensor so high that all rows look alike, rounding decides which of them explain the readings.
#[test]
fn the_status_is_that_of_the_chosen_row() {
    let mut model = SensorModel::new("10x2_3x30".parse().unwrap());
    model.geometry.height_mm = 1e5;
    let scene = Scene::default();
    let rows = Vec::from_iter(0..10);
    let mut decoder = NewtonDecoder::new(&model, &scene, &rows).unwrap();
    let mut estimator = Estimator::new(&model, &scene, &rows).unwrap();
    let mut counts = [0; 2];
    for noise in [1e-15, 1.2e-15] {
        let mut set = Dataset::simulate(&model, &scene, 200, &mut Seed(0).rng(Stream::Test)).unwrap();
        set.disturb(&model, &Noise::relative(noise), &mut Seed(0).rng(Stream::TestNoise))
            .unwrap();
        for sample in 0..set.samples() {
            let readings = set.sample_readings(sample);
            let mut coordinates_mm = [0.0; 6];
            decoder.decode_row(0, readings, &mut coordinates_mm).unwrap();
            let is_taken = |&&row: &&usize| model.geometry.row_x_mm(row) == coordinates_mm[0];
            let taken = *rows.iter().find(is_taken).unwrap();
            let of_taken = estimator.solve(taken, readings, &mut [0.0; 6]).unwrap();
            let unsolved = usize::from(of_taken.solution == Solution::None);
            assert_eq!(decoder.take_solved_rows().unsolved, unsolved, "{noise:e}, {sample}");
            counts[unsolved] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count > 20), "{counts:?}");
}

/// Four electrodes for six nodes leave every row undetermined, and the answer is the one with the least squares from the
/// mean of the loading; 18 leave none undetermined, and the answer is the truth.
#[test]
fn only_undetermined_rows_use_the_prior() {
    for (array, is_open) in [("2x6_3x4", true), ("2x6_3x18", false)] {
        let model = SensorModel::new(array.parse().unwrap());
        let scene = Scene {
            rows: Rows::Known,
            ..Scene::default()
        };
        let set = Dataset::simulate(&model, &scene, 20, &mut Seed(0).rng(Stream::Test)).unwrap();
        let mut decoder = NewtonDecoder::new(&model, &scene, &[0, 1]).unwrap();
        let answers = decode_set(&mut decoder, &set).unwrap();
        let from_mean = |z_mm: &f64| (z_mm - 4.5).powi(2);
        for (ours, truth) in answers.rows().into_iter().zip(set.targets().rows()) {
            let [ours, truth] = [ours, truth].map(|row| Vec::from_iter(row.iter().skip(2).step_by(3).copied()));
            let [squares, of_truth] = [&ours, &truth].map(|row| row.iter().map(from_mean).sum::<f64>());
            let farthest = ours.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if is_open {
                assert!(squares <= of_truth + 1e-9 && farthest > 1e-3, "{ours:?} {truth:?}");
            } else {
                assert!(farthest < 1e-9, "{ours:?} {truth:?}");
            }
        }
        let undetermined = if is_open { 20 } else { 0 };
        assert_eq!(decoder.take_solved_rows().undetermined, undetermined, "{array}");
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Rows side by side do not influence each other: neither rows that noise leaves unsolved, nor rows that are given up
/// among solved ones.
#[test]
fn frames_are_bit_identical_to_rows_with_the_same_status() {
    for (array, noisy_rows) in [
        ("9x6_3x18", 0..0),
        ("11x4_2x12", 3..5),
        ("3x2_2x6", 0..3),
        ("3x6_3x4", 0..0),
    ] {
        let model = SensorModel::new(array.parse().unwrap());
        let (rows, channels) = (model.scale.rows(), model.scale.columns());
        for known in [Rows::Known, Rows::All] {
            let scene = Scene {
                rows: known,
                ..Scene::default()
            };
            let set = Dataset::simulate(&model, &scene, 2 * rows, &mut Seed(3).rng(Stream::Test)).unwrap();
            let all: Vec<usize> = (0..rows).collect();
            let newton = || NewtonDecoder::new(&model, &scene, &all).unwrap();
            let decoders: [(Box<dyn Decoder>, Box<dyn Decoder>); 3] = [
                (Box::new(newton()), Box::new(newton())),
                (
                    Box::new(polish(&model, &scene, &set, 1)),
                    Box::new(polish(&model, &scene, &set, 1)),
                ),
                (
                    Box::new(polish(&model, &scene, &set, 20)),
                    Box::new(polish(&model, &scene, &set, 20)),
                ),
            ];
            let mut readings = set.frames().unwrap().swap_remove(1);
            for row in noisy_rows.clone() {
                readings[row * channels] *= 1.2;
            }
            for (mut whole, mut by_rows) in decoders {
                let mut frame = vec![0.0; rows * whole.outputs()];
                whole.decode(&readings, &mut frame).unwrap();
                for (row, answer) in frame.chunks_exact(whole.outputs()).enumerate() {
                    let mut alone = vec![0.0; answer.len()];
                    let readings = &readings[row * channels..(row + 1) * channels];
                    by_rows.decode_row(row, readings, &mut alone).unwrap();
                    assert_eq!(bits(&alone), bits(answer), "{array}, row {row}");
                }
                assert_eq!(whole.take_solved_rows(), by_rows.take_solved_rows(), "{array}");
            }
        }
    }
}
