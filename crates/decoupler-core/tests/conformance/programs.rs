//! Programs of every operation, by hand and against their definition.

use decoupler_core::{
    dataset::{Memory, PerRow, Seed, Span, Stream},
    decoupling::{
        Builder, DecodeError, Decoder, Domain, Function, NodeId, Operation, Precision, Program, ProgramDecoder,
    },
    network::{DecouplingNetwork, InputChoice, Inputs, MinMax, Mlp, Quantity, Shape},
    scene::NoiseSource,
};
use ndarray::{Array2, array};
use rand::{Rng, RngExt};

use crate::{
    cases::{bits, cases},
    reference::{States, answer},
};

/// Answer of the evaluator to one row.
fn decoded(program: &Program, readings: &[f64]) -> Vec<f64> {
    let mut targets = vec![f64::NAN; program.outputs()];
    let mut decoder = ProgramDecoder::new(program.clone());
    decoder.decode_row(0, readings, &mut targets).unwrap();
    targets
}

/// A program of one operation on the readings.
fn of_one(channels: usize, add: impl FnOnce(&mut Builder, NodeId) -> NodeId) -> Program {
    let mut builder = Builder::new(channels);
    let readings = builder.readings();
    let output = add(&mut builder, readings);
    builder.finish(output)
}

#[test]
fn every_operation_by_hand() {
    let double = Precision::Double;
    let constant = |builder: &mut Builder| builder.constants(&[1.0, 4.0], Precision::Double);
    let readings = [3.0, -2.0];
    type Add = Box<dyn FnOnce(&mut Builder, NodeId) -> NodeId>;
    let cases: Vec<(&str, Add, Vec<f64>)> = vec![
        ("readings", Box::new(|_, x| x), vec![3.0, -2.0]),
        ("constants", Box::new(move |b, _| constant(b)), vec![1.0, 4.0]),
        ("valid", Box::new(|b, x| b.valid(x, Domain::Finite)), vec![3.0, -2.0]),
        (
            "subtract",
            Box::new(move |b, x| {
                let c = constant(b);
                b.subtract(x, c, double)
            }),
            vec![2.0, -6.0],
        ),
        (
            "divide",
            Box::new(move |b, x| {
                let c = constant(b);
                b.divide(x, c, double)
            }),
            vec![3.0, -0.5],
        ),
        (
            "divide, single",
            Box::new(move |b, x| {
                let c = b.constants(&[7.0, 3.0], double);
                b.divide(x, c, Precision::Single)
            }),
            vec![f64::from(3.0_f32 / 7.0), f64::from(-2.0_f32 / 3.0)],
        ),
        (
            "affine",
            Box::new(move |b, x| b.affine(x, array![[1.0, 0.5, 2.0], [-1.0, 2.0, 1.0]], &[0.0, 1.0, -1.0], double)),
            vec![5.0, -1.5, 3.0],
        ),
        (
            "affine, placed",
            Box::new(move |b, x| b.affine(x, array![[0.0, 0.0, 2.0], [-1.0, 0.0, 0.0]], &[0.0, 1.0, -1.0], double)),
            vec![2.0, 1.0, 5.0],
        ),
        (
            "squared distances",
            Box::new(move |b, x| b.squared_distances(x, array![[3.0, 0.0, 1.0], [-2.0, 2.0, -1.0]], double)),
            vec![0.0, 25.0, 5.0],
        ),
        (
            "clip",
            Box::new(move |b, x| b.clip(x, [&[-1.0, -1.0], &[1.0, 1.0]], double)),
            vec![1.0, -1.0],
        ),
        (
            "concatenate",
            Box::new(move |b, x| {
                let c = constant(b);
                b.concatenate(&[x, c, x])
            }),
            vec![3.0, -2.0, 1.0, 4.0, 3.0, -2.0],
        ),
        (
            "blend",
            Box::new(move |b, x| {
                // Shares of 3/4 and 1/4.
                let logits = b.constants(&[3.0_f64.ln() + 800.0, 800.0], double);
                let c = constant(b);
                let vectors = b.concatenate(&[x, c]);
                b.blend(logits, vectors)
            }),
            vec![2.5, -0.5],
        ),
        (
            "count outside",
            Box::new(|b, x| b.count_outside(x, [vec![array![[3.0, -1.0]]], vec![array![[3.0, 1.0]]]])),
            vec![1.0],
        ),
    ];
    for (name, add, expected) in cases {
        let found = decoded(&of_one(2, add), &readings);
        let is_close = |(found, expected): (&f64, &f64)| (found - expected).abs() < 1e-12;
        assert!(
            found.iter().zip(&expected).all(is_close),
            "{name}: {found:?} {expected:?}"
        );
    }
    for (function, expected) in [
        (Function::Log1p, 1.25_f64.ln()),
        (Function::Tanh, 0.25_f64.tanh()),
        (Function::Gaussian, (-0.25_f64).exp()),
    ] {
        for (precision, tolerance) in [(double, 1e-15), (Precision::Single, 3e-7)] {
            let found = decoded(&of_one(1, |b, x| b.map(function, x, precision)), &[0.25])[0];
            assert!(
                (found / expected - 1.0).abs() < tolerance,
                "{function:?}: {found} {expected}"
            );
        }
    }
}

/// Random programs in which operations of both precisions follow one another, with row-wires of their own constants.
#[test]
fn programs_equal_their_definition_whatever_their_sizes() {
    let mut rng = Seed(0).rng(Stream::Training);
    for (inputs, hidden, outputs) in [
        (1, 1, 1),
        (3, 4, 2),
        (30, 12, 30),
        (18, 29, 7),
        (7, 61, 33),
        (5, 130, 16),
    ] {
        for precision in [Precision::Double, Precision::Single] {
            let mut one = || {
                let mut table = |rows: usize, columns: usize| random(&mut rng, rows, columns);
                let mut builder = Builder::new(inputs);
                let readings = builder.valid(builder.readings(), Domain::Finite);
                let centre = table(1, inputs).into_raw_vec_and_offset().0;
                let centre = builder.constants(&centre, Precision::Double);
                let changes = builder.subtract(readings, centre, Precision::Double);
                let biases = table(1, hidden).into_raw_vec_and_offset().0;
                let sums = builder.affine(changes, table(inputs, hidden), &biases, precision);
                let nodes = builder.map(Function::Tanh, sums, precision);
                let distances = builder.squared_distances(changes, table(inputs, hidden), precision);
                let gaussians = builder.map(Function::Gaussian, distances, precision);
                let features = builder.concatenate(&[nodes, gaussians]);
                let biases = table(1, outputs).into_raw_vec_and_offset().0;
                let targets = builder.affine(features, table(2 * hidden, outputs), &biases, precision);
                builder.finish(targets)
            };
            let rows = if inputs == 3 { 1 } else { 3 };
            let program = Program::each(&PerRow::each((0..rows).map(|_| one()).collect()));
            assert_eq!(program.rows(), rows);
            let readings = random(&mut rng, 40, inputs);
            let row_indices = Vec::from_iter((0..40).map(|sample| sample * 7 % rows));
            let found = ProgramDecoder::new(program.clone()).answers(&row_indices, readings.view());
            let tolerance = match precision {
                Precision::Double => 1e-13,
                Precision::Single => 1e-5,
            };
            for ((readings, &row), found) in readings.rows().into_iter().zip(&row_indices).zip(found.rows()) {
                let expected = answer(&program, row, &readings.to_vec(), &mut States::new()).unwrap();
                for (found, expected) in found.iter().zip(&expected) {
                    let off = (found - expected).abs();
                    assert!(
                        off < tolerance * (2 * hidden) as f64,
                        "{inputs} {hidden} {precision:?}: {off:e}"
                    );
                }
            }
        }
    }
}

fn random(rng: &mut impl Rng, rows: usize, columns: usize) -> Array2<f64> {
    Array2::from_shape_simple_fn((rows, columns), || rng.random_range(-1.0..1.0))
}

/// Every decoder that has a program, with the tolerance that its precision and the amplification by whitening allow.
#[test]
fn the_program_of_a_decoder_equals_its_answers() {
    let mut count = 0;
    for mut case in cases() {
        let Some(program) = case.decoder.program() else {
            continue;
        };
        let test = &case.test;
        let text = serde_json::to_string(&program).unwrap();
        assert_eq!(
            serde_json::from_str::<Program>(&text).unwrap(),
            program,
            "{}",
            case.name
        );
        let is_single = program.nodes().iter().any(|node| node.precision == Precision::Single);
        let mut targets = vec![0.0; program.outputs()];
        for sample in 0..test.samples() {
            let (row, readings) = (test.row_index(sample), test.sample_readings(sample));
            case.decoder.decode_row(row, readings, &mut targets).unwrap();
            let expected = answer(&program, row, readings, &mut States::new()).unwrap();
            for (found, expected) in targets.iter().zip(&expected) {
                let tolerance = if is_single { 1e-4 } else { 1e-7 };
                let off = (found - expected).abs() / expected.abs().max(1.0);
                assert!(off < tolerance, "{}: {found} {expected}", case.name);
            }
        }
        count += 1;
    }
    assert!(count > 30, "{count}");
}

/// Smaller networks of other row-wires are padded without effect.
#[test]
fn programs_of_row_wires_with_other_sizes_are_joined() {
    let network = |hidden: usize, seed: u64| {
        let mut rng = Seed(seed).rng(Stream::Start);
        let readings = random(&mut rng, 9, 4).mapv(|value| 20.0 + value);
        let inputs = Inputs::fit(InputChoice::PAPER, readings.view(), NoiseSource::default()).unwrap();
        let outputs = MinMax::fit(random(&mut rng, 9, 3).view()).unwrap();
        let shape = Shape {
            inputs: 4,
            hidden,
            outputs: 3,
        };
        let weights = random(&mut rng, 1, shape.weights()).into_raw_vec_and_offset().0;
        DecouplingNetwork::new(inputs, Mlp::from_weights(shape, weights), outputs)
    };
    let networks = [network(3, 1), network(9, 2), network(1, 3)];
    let joined = PerRow::each(networks.to_vec());
    for precision in [Precision::Double, Precision::Single] {
        let mut of_all = ProgramDecoder::new(joined.program(precision));
        let readings = [19.7, 20.3, 20.9, 20.0];
        for (row, network) in networks.iter().enumerate() {
            let (mut found, mut expected) = ([0.0; 3], [0.0; 3]);
            of_all.decode_row(row, &readings, &mut found).unwrap();
            ProgramDecoder::new(network.program(precision))
                .decode_row(0, &readings, &mut expected)
                .unwrap();
            assert_eq!(bits(&found), bits(&expected), "{row}");
        }
    }
}

/// Readings that hardly differ: R − R₀ is exact, and single precision loses nothing but its last digits.
#[test]
fn single_precision_keeps_the_digits_of_readings_that_hardly_differ() {
    for quantity in Quantity::ALL {
        let readings = Array2::from_shape_fn((20, 3), |(s, c)| 50.0 + 1e-4 * ((3 * s + 7 * c) as f64).sin());
        let choice = InputChoice {
            quantity,
            ..InputChoice::PAPER
        };
        let inputs = Inputs::fit(choice, readings.view(), NoiseSource::default()).unwrap();
        let outputs = MinMax::fit(array![[0.0], [1.0]].view()).unwrap();
        let shape = Shape {
            inputs: 3,
            hidden: 2,
            outputs: 1,
        };
        let mlp = Mlp::from_weights(shape, vec![0.3, -0.2, 0.5, 0.1, -0.4, 0.7, 0.2, -0.1, 0.6, -0.8, 0.1]);
        let expected = outputs.restore(mlp.forward(inputs.of(readings.view()).view()).view());
        let network = DecouplingNetwork::new(inputs, mlp, outputs);
        for (precision, tolerance) in [(Precision::Double, 1e-9), (Precision::Single, 1e-6)] {
            let found = ProgramDecoder::new(network.program(precision)).answers(&[0; 20], readings.view());
            let off = (found - &expected)
                .iter()
                .fold(0.0_f64, |most, off| most.max(off.abs()));
            assert!(off < tolerance, "{quantity}, {precision:?}: {off:e}");
        }
    }
}

#[test]
fn history_continues_in_its_group_and_row_wire_and_restarts_after_a_pause() {
    let memory = Memory {
        interval_s: Some(0.1),
        averages: vec![Span::Seconds(0.2)],
        ..Memory::default()
    };
    // The average of the reading.
    let of_features = of_one(2, |b, x| b.affine(x, array![[0.0], [1.0]], &[0.0], Precision::Double));
    let program = of_features.with_history(&memory, 1).unwrap();
    assert_eq!((program.channels(), program.outputs()), (1, 1));
    let weight = 1.0 - (-0.5_f64).exp();
    let mut decoder = ProgramDecoder::new(program.clone());
    let mut step = |group, time_s, row, reading: f64| {
        let mut target = [0.0];
        decoder.step((group, time_s), row, &[reading], &mut target).unwrap();
        target[0]
    };
    for (group, time_s, row, reading, expected, why) in [
        (0, Some(0.0), 0, 1.0, 1.0, "the first row"),
        (0, Some(0.1), 0, 2.0, 1.0 + weight, "0.1 s later"),
        (0, Some(0.1), 1, 9.0, 9.0, "another row-wire"),
        (1, Some(0.1), 0, 5.0, 5.0, "another group"),
        (0, Some(0.2), 0, 1.0 + weight, 1.0 + weight, "it continues"),
        (0, Some(6.0), 0, 3.0, 3.0, "a pause of more than 50 intervals"),
        (0, Some(5.0), 0, 7.0, 7.0, "a step back"),
    ] {
        let found = step(group, time_s, row, reading);
        assert!((found - expected).abs() < 1e-14, "{why}: {found} {expected}");
    }
    let mut decoder = ProgramDecoder::new(program.clone());
    let (mut found, mut states) = ([0.0], States::new());
    for reading in [1.0, 4.0, -2.0] {
        decoder.decode_row(0, &[reading], &mut found).unwrap();
        let expected = answer(&program, 0, &[reading], &mut states).unwrap();
        assert_eq!(found.to_vec(), expected, "usual intervals");
    }
    let error = decoder.decode_row(0, &[f64::NAN], &mut found).unwrap_err();
    assert_eq!((error.row_index, error.channel), (0, 0));
}

#[test]
fn samples_that_cannot_be_decoded_are_nan_and_the_others_are_not_affected() {
    let program = of_one(2, |b, x| {
        let valid = b.valid(x, Domain::Positive);
        b.affine(valid, array![[1.0], [1.0]], &[0.5], Precision::Double)
    });
    let mut readings = Array2::from_shape_fn((50, 2), |(s, c)| (s + c) as f64 + 1.0);
    let invalid = [0, 16, 17, 35, 49];
    invalid.iter().for_each(|&sample| readings[[sample, 1]] = -1.0);
    let mut decoder = ProgramDecoder::new(program);
    let answers = decoder.answers(&[0; 50], readings.view());
    for (sample, answer) in answers.iter().enumerate() {
        let expected = 2.0 * sample as f64 + 3.5;
        assert!(answer.is_nan() == invalid.contains(&sample) && (answer.is_nan() || *answer == expected));
    }
    let flat = readings.as_slice().unwrap();
    let found = decoder.decode_rows(&[0; 32], &flat[36..100], &mut [0.0; 32]);
    let expected = DecodeError {
        row_index: 17,
        channel: 1,
        value: -1.0,
    };
    assert_eq!(found, Err(expected), "beyond the rows that are evaluated together");
}

#[test]
fn overflow_in_one_value_spares_targets_that_do_not_depend_on_it() {
    let program = of_one(2, |b, x| {
        let sums = b.affine(x, array![[1e308, 1.0], [1e308, 1.0]], &[0.0, 0.0], Precision::Double);
        b.affine(sums, array![[2.0, 0.0], [0.0, 2.0]], &[0.0, 0.0], Precision::Double)
    });
    let found = decoded(&program, &[3.0, 4.0]);
    assert!(found[0].is_infinite() && found[1] == 14.0, "{found:?}");
    assert!(matches!(
        program.node(program.output()).operation,
        Operation::Affine { .. }
    ));
}
