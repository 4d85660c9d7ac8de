//! Code that runs for every frame does not allocate.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use decoupler_core::{
    dataset::Seed,
    live::{FaultyWire, WireCheck},
    scene::{Noise, Rows, Scene},
    sensor::SensorModel,
};
use decoupler_files::{
    import::{LineParser, ParsedLine},
    live::{Latencies, Simulated},
};
use glam::DVec3;

fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

#[test]
fn allocations_are_counted() {
    assert_eq!(allocations(|| drop(vec![0.0; 10])), 1);
}

#[test]
fn the_forward_model_does_not_allocate() {
    let model = SensorModel::new("10x10_5x30".parse().unwrap());
    let pressed = vec![DVec3::new(0.0, 0.0, 0.4); model.scale.nodes_per_row()];
    let mut resistances_ohm = vec![0.0; model.scale.columns()];
    let forward = || model.row_resistances_into(3, &pressed, &mut resistances_ohm).unwrap();
    assert_eq!(allocations(forward), 0);
}

#[test]
fn a_line_is_parsed_and_monitored_without_allocating() {
    let (model, scene) = (
        SensorModel::new("10x6_3x18".parse().unwrap()),
        Scene {
            noise: Noise::relative(1e-3),
            rows: Rows::Known,
            ..Scene::default()
        },
    );
    let mut source = Simulated::new(&model, &scene, Seed(0), 10.0).unwrap();
    let mut frame_ohm = vec![0.0; source.readings()];
    source.next_frame(&mut frame_ohm).unwrap();
    let mut parser = LineParser::of_array(model.scale, scene.rows, true).unwrap();
    let mut check = WireCheck::new(&model, &scene, source.rows()).unwrap();
    let mut faulty = WireCheck::new(&model, &scene, source.rows()).unwrap();
    for _ in 0..8 {
        let mut faulty_ohm = frame_ohm.clone();
        faulty_ohm.iter_mut().skip(3).step_by(18).for_each(|ohm| *ohm *= 1.1);
        faulty.check(&faulty_ohm);
    }
    assert_eq!(faulty.named(), Some(FaultyWire::Column(3)));
    let mut answer_mm = vec![0.0; model.scale.coordinates_per_row()];
    let mut latencies = Latencies::default();
    for frame in 0..3 {
        let line = frame_ohm.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let found = allocations(|| {
            let ParsedLine::Snapshot(readings_ohm) = parser.parse(frame + 1, line.as_bytes()).unwrap() else {
                panic!("a snapshot is parsed");
            };
            assert_eq!(check.check(readings_ohm), None);
            faulty.decode(readings_ohm, 4..5, &mut answer_mm).unwrap();
            latencies.add(std::time::Duration::from_micros(7));
        });
        // The first line determines the number of fields.
        assert!(frame == 0 || found == 0, "{frame}: {found}");
    }
}
