//! Faults of wires and electronics: their effect on readings, and whether the right wire is named.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;

use decoupler_core::{
    dataset::{Seed, Stream},
    live::{FaultCause, FaultEvent, FaultyWire, WireCheck},
    scene::{Deformation, Indenter, Loading, Noise, Scene},
    sensor::SensorModel,
};
use decoupler_files::live::{ConverterEnd, Fault, FaultEffect, FaultySensor, Simulated};
use glam::DVec3;
use rand::RngExt;

/// Currents of a resistor network by nodal analysis: every row-wire and column-wire consists of two pieces, before
/// and after a break, which are joined if the wire is intact.
struct Network {
    pieces: usize,
    /// Conductance between pieces, and of each piece to its driver or amplifier.
    between: Vec<Vec<f64>>,
    to_ground: Vec<f64>,
}

/// Resistance of a driver and an amplifier, in ohm, and that of a joint: small compared with the rubber.
const DRIVER_OHM: f64 = 1e-5;
const JOINT_OHM: f64 = 1e-9;

impl Network {
    fn new(model: &SensorModel, deformation: &Deformation, fault: Fault) -> Self {
        let scale = model.scale;
        let (rows, columns) = (scale.rows(), scale.columns());
        let mut network = Self {
            pieces: 2 * (rows + columns),
            between: vec![vec![0.0; 2 * (rows + columns)]; 2 * (rows + columns)],
            to_ground: vec![0.0; 2 * (rows + columns)],
        };
        let (near_row, near_column) = (|row: usize| 2 * row, |column: usize| 2 * (rows + column));
        for wire in 0..rows + columns {
            network.to_ground[2 * wire] = 1.0 / DRIVER_OHM;
            let is_open = match (fault.wire, fault.effect) {
                (FaultyWire::Row(row), FaultEffect::Open(_)) => wire == row,
                (FaultyWire::Column(column), FaultEffect::Open(_)) => wire == rows + column,
                _ => false,
            };
            if !is_open {
                network.join(2 * wire, 2 * wire + 1, JOINT_OHM);
            }
        }
        if let FaultyWire::Columns(column) = fault.wire {
            network.join(near_column(column), near_column(column + 1), JOINT_OHM);
        }
        let beyond = |node: usize, break_at: Option<usize>| usize::from(break_at.is_some_and(|at| node >= at));
        for row in 0..rows {
            for column in 0..columns {
                for node in 0..scale.nodes_per_row() {
                    for electrode in 0..scale.nodes_per_column() {
                        let at_mm = model.displaced_mm(row, node, deformation.row_mm(row)[node]);
                        let apart_mm = (at_mm - model.geometry.column_node_mm(column, electrode)).length();
                        let break_of = |wire| match fault.effect {
                            FaultEffect::Open(before_node) if fault.wire == wire => Some(before_node),
                            _ => None,
                        };
                        let (row_break, column_break) =
                            (break_of(FaultyWire::Row(row)), break_of(FaultyWire::Column(column)));
                        let one = near_row(row) + beyond(node, row_break);
                        let other = near_column(column) + beyond(electrode, column_break);
                        network.join(one, other, model.resistivity_ohm_per_mm * apart_mm);
                    }
                }
            }
        }
        network
    }

    fn join(&mut self, one: usize, other: usize, ohm: f64) {
        self.between[one][other] += 1.0 / ohm;
        self.between[other][one] += 1.0 / ohm;
    }

    /// Potential of every piece with 1 V behind the driver of piece `driven`, by Gaussian elimination.
    fn potentials(&self, driven: usize) -> Vec<f64> {
        let n = self.pieces;
        let mut system = vec![vec![0.0; n + 1]; n];
        for (i, equation) in system.iter_mut().enumerate() {
            equation[i] = self.to_ground[i] + self.between[i].iter().sum::<f64>();
            (0..n)
                .filter(|&j| j != i)
                .for_each(|j| equation[j] = -self.between[i][j]);
        }
        system[driven][n] = self.to_ground[driven];
        for pivot in 0..n {
            let best = (pivot..n)
                .max_by(|&a, &b| system[a][pivot].abs().total_cmp(&system[b][pivot].abs()))
                .unwrap();
            system.swap(pivot, best);
            let of_pivot = system[pivot].clone();
            for (_, equation) in system.iter_mut().enumerate().filter(|(row, _)| *row != pivot) {
                let factor = equation[pivot] / of_pivot[pivot];
                equation
                    .iter_mut()
                    .zip(&of_pivot)
                    .for_each(|(entry, other)| *entry -= factor * other);
            }
        }
        (0..n).map(|i| system[i][n] / system[i][i]).collect()
    }
}

#[test]
fn faulty_readings_match_the_resistor_network() {
    let model = SensorModel::new("3x2_2x4".parse().unwrap());
    let mut rng = Seed(0).rng(Stream::Test);
    let deformation = Deformation::from_fn(model.scale, |_, _| DVec3::Z * rng.random::<f64>());
    let faults = [
        "open-row:2@2",
        "open-row:1@1",
        "open-column:3@2",
        "open-column:4@1",
        "short-columns:2-3",
    ];
    for text in faults {
        let fault: Fault = text.parse().unwrap();
        let network = Network::new(&model, &deformation, fault);
        let faulty = FaultySensor::new(&model, Noise::default(), fault).unwrap();
        let intact = (0..3).flat_map(|row| model.row_resistances(row, deformation.row_mm(row)).unwrap());
        let mut readings_ohm: Vec<f64> = intact.collect();
        let full_scale_ohm = 2.0 * at_rest_ohm(&model);
        faulty.before_noise(&[0, 1, 2], &deformation, &mut readings_ohm);
        for row in 0..3 {
            let potentials = network.potentials(2 * row);
            for column in 0..4 {
                let current = potentials[2 * (3 + column)] / DRIVER_OHM;
                let found_ohm = readings_ohm[4 * row + column];
                let is_dead = current.abs() < 1e-9;
                let expected_ohm = if is_dead { full_scale_ohm } else { 1.0 / current };
                assert!(
                    (found_ohm / expected_ohm - 1.0).abs() < 1e-4,
                    "{text} {row} {column}: {found_ohm} {expected_ohm}"
                );
            }
        }
    }
}

/// Largest resistance of the unloaded array.
fn at_rest_ohm(model: &SensorModel) -> f64 {
    let at_rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
    let rows = (0..model.scale.rows()).flat_map(|row| model.row_resistances(row, &at_rest).unwrap());
    rows.fold(0.0, f64::max)
}

fn sensor_and_scene() -> (SensorModel, Scene) {
    let scene = Scene {
        noise: Noise::relative(1e-3),
        loading: Loading::Indenter(Indenter::default()),
        ..Scene::default()
    };
    (SensorModel::new("10x6_3x18".parse().unwrap()), scene)
}

#[test]
fn the_faulty_wire_is_named_once_with_its_cause_until_it_recovers() {
    let (sensor, scene) = sensor_and_scene();
    let row = FaultyWire::Row;
    let column = FaultyWire::Column;
    let cases = [
        ("open-row:4", row(3), FaultCause::Open),
        ("open-row:4@3", row(3), FaultCause::Open),
        ("open-column:7", column(6), FaultCause::Open),
        ("open-column:7@2", column(6), FaultCause::Open),
        ("short-columns:3-4", FaultyWire::Columns(2), FaultCause::Shorted),
        ("gain:11=0.05", column(10), FaultCause::Gain { relative: 0.05 }),
        ("gain:18=-0.19", column(17), FaultCause::Gain { relative: -0.19 }),
        ("stuck:2=low", column(1), FaultCause::Stuck),
        ("stuck:9=high", column(8), FaultCause::Open),
    ];
    for (text, wire, cause) in cases {
        let mut source = Simulated::new(&sensor, &scene, Seed(7), 20.0).unwrap();
        let mut check = WireCheck::new(&sensor, &scene, source.rows()).unwrap();
        let mut frame_ohm = vec![0.0; source.readings()];
        let mut events = |source: &mut Simulated, frames: usize| -> Vec<(usize, FaultEvent)> {
            let mut found = Vec::new();
            for frame in 0..frames {
                source.next_frame(&mut frame_ohm).unwrap();
                found.extend(check.check(&frame_ohm).map(|event| (frame, event)));
            }
            found
        };
        assert_eq!(events(&mut source, 10), [], "{text}");
        // The same fault, and once more after it went.
        for _ in 0..2 {
            source.set_fault(Some(text.parse().unwrap())).unwrap();
            let found = events(&mut source, 12);
            let [
                (
                    frame,
                    event @ FaultEvent::Named {
                        wire: named,
                        cause: found,
                        probability,
                    },
                ),
            ] = found[..]
            else {
                panic!("{text}: {found:?}");
            };
            assert!(frame + 1 >= WireCheck::PERSISTENCE, "{text}: {frame}");
            assert!(probability >= WireCheck::SURE);
            assert_eq!(named, wire, "{text}");
            match (found, cause) {
                (FaultCause::Gain { relative: found }, FaultCause::Gain { relative }) => {
                    assert!((found - relative).abs() < 2e-3, "{text}: {event}");
                }
                (found, cause) => assert_eq!(found, cause, "{text}"),
            }
            source.set_fault(None).unwrap();
            let found = events(&mut source, 5);
            assert_eq!(found, [(WireCheck::PERSISTENCE - 1, FaultEvent::Recovered)], "{text}");
        }
    }
}

/// Every wire of a small array, under presses of any kind.
#[test]
fn each_fault_of_each_wire_is_named_within_eight_frames() {
    let sensor = SensorModel::new("4x3_2x9".parse().unwrap());
    let mut faults: Vec<(String, FaultyWire)> = Vec::new();
    for row in 0..4 {
        faults.push((format!("open-row:{}", row + 1), FaultyWire::Row(row)));
        faults.push((format!("open-row:{}@2", row + 1), FaultyWire::Row(row)));
    }
    for column in 0..9 {
        for (kind, value) in [
            ("open-column", ""),
            ("open-column", "@2"),
            ("stuck", "=low"),
            ("stuck", "=high"),
            ("gain", "=0.05"),
            ("gain", "=-0.1"),
        ] {
            faults.push((format!("{kind}:{}{value}", column + 1), FaultyWire::Column(column)));
        }
    }
    for column in 0..8 {
        let text = format!("short-columns:{}-{}", column + 1, column + 2);
        faults.push((text, FaultyWire::Columns(column)));
    }
    let noises = [
        Noise::relative(1e-3),
        Noise {
            drift: 0.02,
            ..Noise::relative(1e-3)
        },
        Noise {
            additive_ohm: 1e-3,
            converter_bits: Some(14),
            ..Noise::relative(1e-4)
        },
    ];
    let mut late = Vec::new();
    for (noise, loading) in noises.into_iter().zip(["random", "smooth:4", "random"]) {
        let scene = Scene {
            noise,
            loading: loading.parse().unwrap(),
            ..Scene::default()
        };
        // All wires once, and some of them with other noise.
        let every = if noise.drift > 0.0 || noise.additive_ohm > 0.0 {
            5
        } else {
            1
        };
        for (text, wire) in faults.iter().step_by(every) {
            let mut check = WireCheck::new(&sensor, &scene, &[0, 1, 2, 3]).unwrap();
            let mut events = Vec::new();
            frames(&sensor, &scene, Some(text.parse().unwrap()), 8, |frame_ohm, _| {
                events.extend(check.check(frame_ohm));
            });
            match events[..] {
                [FaultEvent::Named { wire: named, .. }] if named == *wire => {}
                _ => late.push(format!("{loading}, {text}: {events:?}")),
            }
        }
    }
    assert!(late.is_empty(), "{} faults: {late:#?}", late.len());
}

/// A frame is suspicious with a probability of at most 10⁻³; four in a row are practically impossible, also if the presses are
/// not those of the scene.
#[test]
fn intact_frames_raise_no_alarm() {
    let (sphere, random) = ("indenter:sphere", "random");
    let coarse = Noise {
        drift: 0.05,
        additive_ohm: 0.01,
        converter_bits: Some(10),
        ..Noise::relative(1e-3)
    };
    for (array, noise, expected, pressed, count) in [
        ("10x6_3x18", Noise::relative(1e-3), sphere, sphere, 200),
        ("4x3_2x9", Noise::relative(1e-5), random, random, 1000),
        ("4x3_2x9", Noise::relative(0.2), "indenter:edge", "indenter:edge", 1000),
        ("4x3_2x9", coarse, "smooth:4", "smooth:4", 1000),
        ("4x3_2x9", Noise::relative(1e-3), sphere, random, 300),
    ] {
        let sensor = SensorModel::new(array.parse().unwrap());
        let scene = |loading: &str, largest_compression| Scene {
            noise,
            loading: loading.parse().unwrap(),
            largest_compression,
            ..Scene::default()
        };
        let rows = Vec::from_iter(0..sensor.scale.rows());
        let usual = Scene::default().largest_compression;
        let most = if expected == pressed { usual } else { 0.25 };
        let mut check = WireCheck::new(&sensor, &scene(expected, usual), &rows).unwrap();
        frames(&sensor, &scene(pressed, most), None, count, |frame_ohm, _| {
            assert_eq!(check.check(frame_ohm), None, "{array} {noise:?} {expected} {pressed}");
        });
    }
}

#[test]
fn two_faults_are_not_named_as_one() {
    let (sensor, scene) = sensor_and_scene();
    let mut source = Simulated::new(&sensor, &scene, Seed(5), 10.0).unwrap();
    let mut check = WireCheck::new(&sensor, &scene, source.rows()).unwrap();
    let mut frame_ohm = vec![0.0; source.readings()];
    source.set_fault(Some("gain:3=0.1".parse().unwrap())).unwrap();
    let mut events = Vec::new();
    for _ in 0..8 {
        source.next_frame(&mut frame_ohm).unwrap();
        frame_ohm.iter_mut().skip(11).step_by(18).for_each(|ohm| *ohm *= 0.9);
        events.extend(check.check(&frame_ohm));
    }
    assert_eq!(events, [FaultEvent::Unexplained]);
}

/// Independent frames of `scene`, row by row, with `fault` if there is one.
fn frames(
    sensor: &SensorModel,
    scene: &Scene,
    fault: Option<Fault>,
    count: usize,
    mut take: impl FnMut(&[f64], &Deformation),
) {
    let (mut rng, mut noise_rng) = (Seed(3).rng(Stream::Live), Seed(3).rng(Stream::LiveNoise));
    let rows: Vec<usize> = (0..sensor.scale.rows()).collect();
    let columns = sensor.scale.columns();
    let source = scene.noise.source(sensor).unwrap();
    let faulty = fault.map(|fault| FaultySensor::new(sensor, scene.noise, fault).unwrap());
    let mut frame_ohm = vec![0.0; rows.len() * columns];
    for _ in 0..count {
        let deformation = scene.draw(sensor, &mut rng);
        for (&row, ohm) in rows.iter().zip(frame_ohm.chunks_exact_mut(columns)) {
            sensor.row_resistances_into(row, deformation.row_mm(row), ohm).unwrap();
        }
        match &faulty {
            Some(faulty) => faulty.disturb_snapshot((&rows, &deformation), &mut frame_ohm, &source, &mut noise_rng),
            None => source.disturb(&mut frame_ohm, &mut noise_rng),
        }
        take(&frame_ohm, &deformation);
    }
}

/// Rows on both sides of the columns' middle have equal readings at rest, or wherever they are pressed alike.
#[test]
fn equal_readings_of_symmetric_rows_are_not_a_short() {
    let mut sensor = SensorModel::new("2x4_2x12".parse().unwrap());
    sensor.geometry.row_x0_mm = 16.0;
    let scene = Scene {
        noise: Noise::relative(1e-3),
        loading: Loading::Indenter(Indenter::default()),
        ..Scene::default()
    };
    let source = scene.noise.source(&sensor).unwrap();
    let mut check = WireCheck::new(&sensor, &scene, &[0, 1]).unwrap();
    let mut rng = Seed(1).rng(Stream::LiveNoise);
    for depth_mm in [0.0, 0.7] {
        let pressed = vec![DVec3::Z * depth_mm; 4];
        let rows = [0, 1].map(|row| sensor.row_resistances(row, &pressed).unwrap());
        assert!(
            rows[0]
                .iter()
                .zip(&rows[1])
                .all(|(one, other)| (one / other - 1.0).abs() < 1e-12)
        );
        for frame in 0..500 {
            let mut frame_ohm = rows.concat();
            source.disturb(&mut frame_ohm, &mut rng);
            assert_eq!(check.check(&frame_ohm), None, "{depth_mm} {frame}");
        }
    }
}

/// Check of all rows that has named the wire of this fault.
fn named(sensor: &SensorModel, scene: &Scene, fault: &str, wire: FaultyWire) -> WireCheck {
    let rows = Vec::from_iter(0..sensor.scale.rows());
    let mut check = WireCheck::new(sensor, scene, &rows).unwrap();
    frames(sensor, scene, Some(fault.parse().unwrap()), 12, |frame_ohm, _| {
        check.check(frame_ohm);
    });
    assert_eq!(check.named(), Some(wire), "{fault}");
    check
}

/// Without one of its columns, a row is decoded like a row of an array that does not have it.
#[test]
fn a_left_out_column_has_no_influence() {
    let (sensor, scene) = sensor_and_scene();
    let mut whole = WireCheck::new(&sensor, &scene, &Vec::from_iter(0..10)).unwrap();
    for (fault, wire) in [
        ("gain:18=-0.19", FaultyWire::Column(17)),
        ("short-columns:1-2", FaultyWire::Columns(0)),
        ("stuck:9=high", FaultyWire::Column(8)),
    ] {
        let mut without = named(&sensor, &scene, fault, wire);
        frames(&sensor, &scene, None, 10, |frame_ohm, _| {
            let mut spoiled = frame_ohm.to_vec();
            let [mut one, mut other] = [vec![0.0; 18], vec![0.0; 18]];
            without.decode(&spoiled, 0..1, &mut one).unwrap();
            let columns = wire.columns();
            columns.clone().for_each(|column| spoiled[column] *= 7.0);
            without.decode(&spoiled, 0..1, &mut other).unwrap();
            assert_eq!(one, other, "{wire}");
            // Readings in place of the missing ones that agree with the answer leave it unchanged.
            let at: Vec<DVec3> = (0..6)
                .map(|node| sensor.displacement_mm(0, node, DVec3::from_slice(&one[3 * node..])))
                .collect();
            let predicted_ohm = sensor.row_resistances(0, &at).unwrap();
            columns.for_each(|column| spoiled[column] = predicted_ohm[column]);
            whole.decode(&spoiled, 0..1, &mut other).unwrap();
            let apart = one.iter().zip(&other).map(|(one, other)| (one - other).abs());
            assert!(
                apart.clone().fold(0.0, f64::max) < 1e-4,
                "{wire}: {:?}",
                apart.collect::<Vec<_>>()
            );
        });
    }
}

#[test]
fn an_answer_without_a_wire_does_not_depend_on_earlier_frames() {
    let (sensor, scene) = sensor_and_scene();
    let outputs = sensor.scale.coordinates_per_row();
    let mut all_ohm = Vec::new();
    frames(&sensor, &scene, None, 6, |frame_ohm, _| {
        all_ohm.push(frame_ohm.to_vec());
    });
    for (fault, wire) in [
        ("open-row:5", FaultyWire::Row(4)),
        ("open-row:1", FaultyWire::Row(0)),
        ("short-columns:4-5", FaultyWire::Columns(3)),
        ("open-column:3", FaultyWire::Column(2)),
    ] {
        let mut check = named(&sensor, &scene, fault, wire);
        let mut decode = |frame_ohm: &[f64]| {
            let mut answer_mm = vec![0.0; 10 * outputs];
            check.decode(frame_ohm, 0..10, &mut answer_mm).unwrap();
            for row in 0..10 {
                let mut of_row = vec![0.0; outputs];
                check.decode(frame_ohm, row..row + 1, &mut of_row).unwrap();
                assert_eq!(of_row, answer_mm[row * outputs..][..outputs], "{wire} {row}");
            }
            answer_mm
        };
        let forwards: Vec<_> = all_ohm.iter().map(|frame_ohm| decode(frame_ohm)).collect();
        let mut backwards: Vec<_> = all_ohm.iter().rev().map(|frame_ohm| decode(frame_ohm)).collect();
        backwards.reverse();
        assert_eq!(forwards, backwards, "{wire}");
    }
    // A row without signal is interpolated from its neighbours.
    let mut check = named(&sensor, &scene, "open-row:5", FaultyWire::Row(4));
    let mut answer_mm = vec![0.0; 10 * outputs];
    check.decode(&all_ohm[0], 0..10, &mut answer_mm).unwrap();
    let z_mm = |row: usize| answer_mm[row * outputs + 2];
    assert!((z_mm(4) - 0.5 * (z_mm(3) + z_mm(5))).abs() < 1e-12);
}

/// Mean errors of z: with all wires, without the faulty one, and of the intact array.
#[test]
fn leaving_the_wire_out_restores_the_answer() {
    let (sensor, scene) = sensor_and_scene();
    for (text, gain) in [("open-column:7", 1.5), ("gain:11=0.05", 1.5), ("stuck:2=low", 0.9)] {
        let mut intact = Simulated::new(&sensor, &scene, Seed(7), 10.0).unwrap();
        let mut source = Simulated::new(&sensor, &scene, Seed(7), 10.0).unwrap();
        source.set_fault(Some(text.parse().unwrap())).unwrap();
        let mut check = WireCheck::new(&sensor, &scene, source.rows()).unwrap();
        let mut whole = WireCheck::new(&sensor, &scene, source.rows()).unwrap();
        let (mut intact_ohm, mut frame_ohm) = (vec![0.0; source.readings()], vec![0.0; source.readings()]);
        let mut answer_mm = vec![0.0; 10 * sensor.scale.coordinates_per_row()];
        let mut errors_mm = [0.0; 3];
        for _ in 0..20 {
            intact.next_frame(&mut intact_ohm).unwrap();
            source.next_frame(&mut frame_ohm).unwrap();
            check.check(&frame_ohm);
            if check.named().is_none() {
                continue;
            }
            let decoded = [(&frame_ohm, true), (&frame_ohm, false), (&intact_ohm, true)];
            for (error_mm, (frame_ohm, is_whole)) in errors_mm.iter_mut().zip(decoded) {
                let decoder = if is_whole { &mut whole } else { &mut check };
                decoder.decode(frame_ohm, 0..10, &mut answer_mm).unwrap();
                let truth = (0..10).flat_map(|row| source.deformation().row_positions_mm(&sensor, row));
                let pairs = answer_mm.chunks_exact(3).zip(truth);
                *error_mm += pairs.map(|(node, truth)| (node[2] - truth.z).abs()).sum::<f64>();
            }
        }
        let [with, without, intact] = errors_mm;
        assert!(intact > 0.0 && without < 1.2 * intact, "{text}: {without} {intact}");
        assert!(with > gain * without, "{text}: {with} {without}");
    }
}

#[test]
fn faults_are_parsed_and_invalid_ones_are_refused() {
    for (text, wire, effect) in [
        ("open-row:3@1", FaultyWire::Row(2), FaultEffect::Open(0)),
        ("open-column:30@5", FaultyWire::Column(29), FaultEffect::Open(4)),
        ("short-columns:1-2", FaultyWire::Columns(0), FaultEffect::Shorted),
        ("gain:7=-0.05", FaultyWire::Column(6), FaultEffect::Gain(-0.05)),
        (
            "stuck:1=low",
            FaultyWire::Column(0),
            FaultEffect::Stuck(ConverterEnd::Low),
        ),
        (
            "stuck:1=high",
            FaultyWire::Column(0),
            FaultEffect::Stuck(ConverterEnd::High),
        ),
    ] {
        assert_eq!(text.parse(), Ok(Fault { wire, effect }));
    }
    assert_eq!("open-row:3".parse::<Fault>(), "open-row:3@1".parse());
    for text in [
        "",
        "open-row:0",
        "short-columns:1-3",
        "short-rows:1-2",
        "gain:7",
        "stuck:1=up",
        "broken:1",
        "gain:1=nan",
    ] {
        assert!(text.parse::<Fault>().is_err(), "{text}");
    }
    let refusal = "broken:1".parse::<Fault>().unwrap_err().to_string();
    let (_, offered) = refusal.split_once("give ").unwrap();
    let offered: BTreeSet<&str> = offered
        .split(' ')
        .filter_map(|word| word.split_once(':'))
        .map(|(kind, _)| kind)
        .collect();
    let accepted = ["open-row", "open-column", "short-columns", "gain", "stuck"];
    assert_eq!(offered, BTreeSet::from(accepted), "{refusal}");
    let scale = "10x6_3x18".parse().unwrap();
    for (text, words) in [
        ("open-row:11", "no row-wire 11; give 1 to 10"),
        ("open-row:10@7", "no node on a row-wire 7; give 1 to 6"),
        ("short-columns:18-19", "no column-wire 19; give 1 to 18"),
        ("open-row:3", "row 3 is not read"),
    ] {
        let read: Vec<usize> = if text == "open-row:3" {
            vec![1]
        } else {
            (0..10).collect()
        };
        let message = text
            .parse::<Fault>()
            .unwrap()
            .check(scale, &read)
            .unwrap_err()
            .to_string();
        assert!(message.contains(words), "{message}");
    }
}
