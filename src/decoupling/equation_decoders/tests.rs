use ndarray::Array2;

use super::*;
use crate::{
    dataset::{Dataset, PerRow, Seed, Stream},
    decoupling::{Decoder, NewtonRules, Posterior, SolvedRows, TrainingMean, decode_set},
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
