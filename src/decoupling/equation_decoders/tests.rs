use ndarray::Array2;

use super::*;
use crate::{
    dataset::{Dataset, PerRow, Seed, Stream},
    decoupling::{Decoder, Newton, NewtonRules, Posterior, Solution, SolvedRows, TrainingMean, decode_set},
    scene::{Noise, Rows, Scene},
    sensor::SensorModel,
};

fn solved(mut decoder: impl Decoder, set: &Dataset) -> SolvedRows {
    decode_set(&mut decoder, set).unwrap();
    let solved = decoder.take_solved_rows();
    assert_eq!(decoder.take_solved_rows(), SolvedRows::default());
    solved
}

fn polish(model: &SensorModel, scene: &Scene, set: &Dataset, steps: usize) -> PolishedDecoder {
    let first = Box::new(PerRow::shared(TrainingMean::fit(set)));
    let rows = Vec::from_iter(0..model.scale.rows());
    let mut rng = Seed(0).rng(Stream::Expectation);
    PolishedDecoder::new(first, model, scene, &rows, steps, &mut rng).unwrap()
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
        let newton = NewtonDecoder::new(&model, &scene, &[0, 1, 2], NewtonRules::default()).unwrap();
        let solved = solved(newton, &set);
        assert_eq!((solved.rows, solved.unsolved, solved.undetermined), (30, 0, expected));
    }
}

/// In a sensor so high that all rows look alike, which of them explain the readings depends on the last digits.
#[test]
fn the_standing_is_that_of_the_row_taken_and_of_no_other_that_was_tried() {
    let mut model = SensorModel::new("10x2_3x30".parse().unwrap());
    model.geometry.height_mm = 1e5;
    let scene = Scene::default();
    let rows = Vec::from_iter(0..10);
    let mut decoder = NewtonDecoder::new(&model, &scene, &rows, NewtonRules::default()).unwrap();
    let mut newton = Newton::new(&model, &scene, NewtonRules::default());
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
            let of_taken = newton.solve(taken, readings, &mut [0.0; 6]).unwrap();
            let unsolved = usize::from(of_taken.solution == Solution::None);
            assert_eq!(decoder.take_solved_rows().unsolved, unsolved, "{noise:e}, {sample}");
            counts[unsolved] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count > 20), "{counts:?}");
}

/// Four electrodes for six nodes leave every row open, and 18 none.
#[test]
fn rows_that_the_equations_leave_open_are_answered_by_the_posterior_and_no_others() {
    for (array, is_open) in [("2x6_3x4", true), ("2x6_3x18", false)] {
        let model = SensorModel::new(array.parse().unwrap());
        let scene = Scene {
            rows: Rows::Known,
            ..Scene::default()
        };
        let set = Dataset::simulate(&model, &scene, 20, &mut Seed(0).rng(Stream::Test)).unwrap();
        let posterior = || Posterior::new(&model, &scene, &[0, 1], &mut Seed(0).rng(Stream::Expectation)).unwrap();
        let mut both = NewtonDecoder::with_posterior(posterior(), &model, &scene, &[0, 1]).unwrap();
        let answers = decode_set(&mut both, &set).unwrap();
        let alike: Array2<f64> = if is_open {
            decode_set(
                &mut PosteriorDecoder::new(posterior(), &model, &scene, &[0, 1]).unwrap(),
                &set,
            )
        } else {
            decode_set(
                &mut NewtonDecoder::new(&model, &scene, &[0, 1], NewtonRules::default()).unwrap(),
                &set,
            )
        }
        .unwrap();
        assert_eq!(answers, alike, "{array}");
        let undetermined = if is_open { 20 } else { 0 };
        assert_eq!(both.take_solved_rows().undetermined, undetermined, "{array}");
    }
}
