//! One suite for every decoder: each kind, in each precision, shared or one for each row-wire, for a simulated array and
//! for a recording.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod cases;
mod programs;
mod reference;

use cases::{Case, bits, cases};
use decoupler_core::{
    decoupling::{DecodeError, DecoderKind, decode_set},
    network::Quantity,
};

#[test]
fn frames_equal_rows_bit_for_bit() {
    for Case {
        name,
        mut decoder,
        test,
        ..
    } in cases()
    {
        let frames = test.frames().unwrap();
        let (channels, outputs) = (decoder.channels(), decoder.outputs());
        let mut whole = vec![0.0; test.row_count() * outputs];
        let mut row_by_row = whole.clone();
        for (frame, readings) in frames.iter().enumerate() {
            decoder.decode(readings, &mut whole).unwrap();
            let solved = decoder.take_solved_rows();
            let rows = readings
                .chunks_exact(channels)
                .zip(row_by_row.chunks_exact_mut(outputs));
            for (row, (readings, targets)) in rows.enumerate() {
                decoder.decode_row(row, readings, targets).unwrap();
            }
            assert_eq!(bits(&whole), bits(&row_by_row), "{name}, frame {frame}");
            assert_eq!(decoder.take_solved_rows(), solved, "{name}, frame {frame}");
        }
    }
}

#[test]
fn sets_equal_frames_in_any_order_of_their_rows() {
    for Case {
        name,
        mut decoder,
        test,
        ..
    } in cases()
    {
        let frames = test.frames().unwrap();
        let outputs = decoder.outputs();
        let mut expected = vec![0.0; test.samples() * outputs];
        let mut frame_targets = vec![0.0; test.row_count() * outputs];
        for (frame, samples) in test.snapshots().iter().enumerate() {
            decoder.decode(&frames[frame], &mut frame_targets).unwrap();
            for (&sample, targets) in samples.iter().zip(frame_targets.chunks_exact(outputs)) {
                expected[sample * outputs..(sample + 1) * outputs].copy_from_slice(targets);
            }
        }
        let found = decode_set(&mut *decoder, &test).unwrap();
        assert_eq!(bits(found.as_slice().unwrap()), bits(&expected), "{name}");
        let backwards = Vec::from_iter((0..test.samples()).rev());
        let found = decode_set(&mut *decoder, &test.select(&backwards)).unwrap();
        for (&sample, found) in backwards.iter().zip(found.rows()) {
            let expected = &expected[sample * outputs..(sample + 1) * outputs];
            assert_eq!(
                bits(found.as_slice().unwrap()),
                bits(expected),
                "{name}, sample {sample}"
            );
        }
    }
}

#[test]
fn invalid_readings_are_named() {
    for Case {
        name,
        kind,
        quantity,
        mut decoder,
        test,
    } in cases()
    {
        let frames = test.frames().unwrap();
        let (channels, outputs) = (decoder.channels(), decoder.outputs());
        let mut targets = vec![0.0; test.row_count() * outputs];
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -3.0, 0.0] {
            // The mean of the training set answers whatever the readings are, if they are numbers.
            let quantity = if kind == DecoderKind::Mean {
                Quantity::Raw
            } else {
                quantity
            };
            let is_refused = !quantity.accepts(value);
            let check = |found: Result<(), DecodeError>, row_index: usize| match found.err() {
                Some(error) => {
                    assert!(is_refused, "{name}, {value}: {error}");
                    let found = (error.row_index, error.channel, error.value.to_bits());
                    assert_eq!(found, (row_index, 2, value.to_bits()), "{name}, {value}");
                    let text = format!("row {}, reading 3: {value:?}", row_index + 1);
                    assert!(error.to_string().starts_with(&text), "{error}");
                }
                None => assert!(!is_refused, "{name}, {value}"),
            };
            let mut readings = frames[0].clone();
            readings[channels + 2] = value;
            check(decoder.decode(&readings, &mut targets), 1);
            check(
                decoder.decode_row(1, &readings[channels..2 * channels], &mut targets[..outputs]),
                0,
            );
            let mut rows = frames[0][channels..2 * channels].repeat(3);
            rows[2 * channels + 2] = value;
            check(decoder.decode_rows(&[1, 1, 1], &rows, &mut targets[..3 * outputs]), 2);
        }
    }
}

#[test]
fn decoding_does_not_allocate() {
    for Case {
        name,
        kind,
        mut decoder,
        test,
        ..
    } in cases()
    {
        let frames = test.frames().unwrap();
        let outputs = decoder.outputs();
        let mut targets = vec![0.0; test.row_count() * outputs];
        let order = Vec::from_iter((0..test.row_count()).rev());
        let solves = kind.needs_sensor();
        if solves && (name.contains("Shared") || name.contains("noisy")) {
            // The search for an unknown row-wire allocates, and so does the posterior.
            continue;
        }
        let mut work = || {
            decoder.decode(&frames[1], &mut targets).unwrap();
            // Solvers have buffers for frames only.
            if !solves {
                decoder.decode_rows(&order, &frames[1], &mut targets).unwrap();
                let first_row = &frames[1][..decoder.channels()];
                decoder.decode_row(0, first_row, &mut targets[..outputs]).unwrap();
            }
        };
        // Buffers grow to the number of rows.
        work();
        assert_eq!(allocation_counter::measure(work).count_total, 0, "{name}");
    }
}

#[test]
fn answers_do_not_depend_on_the_number_of_threads() {
    let answers = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let answer = |case: Case| {
            let Case {
                name,
                mut decoder,
                test,
                ..
            } = case;
            (
                name,
                bits(decode_set(&mut *decoder, &test).unwrap().as_slice().unwrap()),
            )
        };
        pool.install(|| cases().into_iter().map(answer).collect::<Vec<_>>())
    };
    for (one, several) in answers(1).into_iter().zip(answers(3)) {
        assert_eq!(one, several);
    }
}

#[test]
fn every_kind_and_precision_is_covered() {
    let names = Vec::from_iter(cases().into_iter().map(|case| case.name));
    for kind in DecoderKind::ALL {
        for &precision in kind.precisions() {
            let covered = names
                .iter()
                .filter(|name| name.starts_with(&format!("{kind} {precision:?}")));
            let expected = if kind.needs_sensor() { 2 } else { 4 };
            assert!(covered.count() >= expected, "{kind}, {precision:?}");
        }
    }
}
