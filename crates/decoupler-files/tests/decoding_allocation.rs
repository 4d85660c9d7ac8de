//! Code that runs for every frame does not allocate.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use decoupler_core::{
    dataset::{Dataset, PerRow, Seed, Stream},
    decoupling::{
        AffineMap, CompiledNetworks, Decoder, NewtonDecoder, PolishedDecoder, RadialBasisNetwork, TakagiSugeno,
    },
    live::{Diagnosis, FaultCause, FaultyWire, LeftOutDecoder, WireCheck},
    network::{
        DecouplingNetwork, InputChoice, Inputs, MinMax, Quantity, ScalingChoice, ScalingError, Shape, nguyen_widrow,
    },
    scene::{Noise, NoiseSource, RowModel, Rows, Scene},
    sensor::{Axes, RowConductance, SensorModel},
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
fn a_frame_is_decoded_by_networks_without_allocating() {
    let model = SensorModel::new("10x10_5x30".parse().unwrap());
    let rows = model.scale.rows();
    let set = Dataset::simulate(&model, &Scene::default(), 1000, &mut Seed(0).rng(Stream::Training)).unwrap();
    let frame = set.frames().unwrap().frame(0).to_vec();
    let mut coordinates_mm = vec![0.0; rows * model.scale.coordinates_per_row()];
    let mut rng = Seed(0).rng(Stream::Start);
    for quantity in Quantity::ALL {
        // Without noise, single precision computes some sums in double precision; with noise it does not.
        for noise in [0.0, 1e-2] {
            let unseen = Noise::relative(noise).source(&model).unwrap();
            let scaling = ScalingChoice::Whitening;
            let network = |set: &Dataset| {
                let choice = InputChoice { quantity, scaling };
                let inputs = Inputs::fit(choice, set.readings(), unseen)?;
                let outputs = MinMax::fit(set.targets())?;
                let shape = Shape {
                    inputs: inputs.count(),
                    hidden: 12,
                    outputs: outputs.varying().len(),
                };
                let mlp = nguyen_widrow(shape, &mut rng);
                Ok::<_, ScalingError>(DecouplingNetwork::new(inputs, mlp, outputs))
            };
            let networks = PerRow::fit(&set, RowModel::Each, network).unwrap();
            let mut double = CompiledNetworks::<f64>::new(&networks, rows);
            let mut single = CompiledNetworks::<f32>::new(&networks, rows);
            let decoders: [&mut dyn Decoder; 2] = [&mut double, &mut single];
            for decoder in decoders {
                assert_eq!(allocations(|| decoder.decode(&frame, &mut coordinates_mm).unwrap()), 0);
            }
        }
    }
}

#[test]
fn a_frame_is_decoded_by_fuzzy_rules_without_allocating() {
    let model = SensorModel::new("10x6_3x18".parse().unwrap());
    let mut rng = Seed(0).rng(Stream::Training);
    let set = Dataset::simulate(&model, &Scene::default(), 600, &mut rng).unwrap();
    let fit = |set: &Dataset| TakagiSugeno::fit(set, Quantity::Conductance, NoiseSource::default(), &mut rng);
    let mut decoder = PerRow::fit(&set, RowModel::Shared, fit).unwrap();
    assert!(decoder.at(0).rules() > 1);
    let frame = set.frames().unwrap().frame(0).to_vec();
    let mut coordinates_mm = vec![0.0; 180];
    assert_eq!(allocations(|| decoder.decode(&frame, &mut coordinates_mm).unwrap()), 0);
}

#[test]
fn a_frame_is_decoded_by_radial_basis_and_newton_without_allocating() {
    let model = SensorModel::new("10x6_3x18".parse().unwrap());
    let scene = Scene {
        rows: Rows::Known,
        ..Scene::default()
    };
    let mut rng = Seed(0).rng(Stream::Training);
    let set = Dataset::simulate(&model, &scene, 600, &mut rng).unwrap();
    let no_noise = NoiseSource::default();
    let ridge = |set: &Dataset| AffineMap::ridge(set, Quantity::Conductance, no_noise);
    let first = Box::new(PerRow::fit(&set, RowModel::Each, ridge).unwrap());
    let rows: Vec<usize> = (0..10).collect();
    let mut polished = PolishedDecoder::new(first, &model, &scene, &rows, 1).unwrap();
    let mut newton = NewtonDecoder::new(&model, &scene, &rows).unwrap();
    let basis = |set: &Dataset| RadialBasisNetwork::fit(set, InputChoice::BEST, no_noise, &mut rng);
    let mut basis = PerRow::fit(&set, RowModel::Each, basis).unwrap();
    let mut coordinates_mm = vec![0.0; 180];
    let frames = set.frames().unwrap();
    let decoders: [&mut dyn Decoder; 3] = [&mut polished, &mut newton, &mut basis];
    for decoder in decoders {
        // The first frame determines the number of rows.
        decoder.decode(frames.frame(0), &mut coordinates_mm).unwrap();
        let allocated = allocations(|| decoder.decode(frames.frame(1), &mut coordinates_mm).unwrap());
        assert_eq!(allocated, 0);
    }
}

#[test]
fn the_forward_model_and_its_jacobian_do_not_allocate() {
    let model = SensorModel::new("10x10_5x30".parse().unwrap());
    let pressed = vec![DVec3::new(0.0, 0.0, 0.4); model.scale.nodes_per_row()];
    let mut resistances_ohm = vec![0.0; model.scale.columns()];
    let forward = || model.row_resistances_into(3, &pressed, &mut resistances_ohm).unwrap();
    assert_eq!(allocations(forward), 0);
    for axes in [Axes::Z, Axes::Xyz] {
        let mut conductance = RowConductance::new(&model, axes);
        assert_eq!(allocations(|| conductance.evaluate(&model, 3, &pressed)), 0);
    }
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
    let mut parser = LineParser::new(model.scale, scene.rows, true).unwrap();
    let mut check = WireCheck::new(&model, &scene, source.rows()).unwrap();
    let mut decoder = LeftOutDecoder::new(&model, &scene, source.rows()).unwrap();
    decoder.leave_out(Some(Diagnosis {
        wire: FaultyWire::Column(3),
        cause: FaultCause::Unknown,
        probability: 1.0,
    }));
    let mut answer_mm = vec![0.0; decoder.outputs()];
    let mut latencies = Latencies::default();
    for frame in 0..3 {
        let line = frame_ohm.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let found = allocations(|| {
            let ParsedLine::Snapshot(readings_ohm) = parser.parse(frame + 1, line.as_bytes()).unwrap() else {
                panic!("a snapshot is parsed");
            };
            assert_eq!(check.check(readings_ohm), None);
            decoder
                .decode_row(4, &readings_ohm[4 * 18..5 * 18], &mut answer_mm)
                .unwrap();
            latencies.add(std::time::Duration::from_micros(7));
        });
        // The first line determines the number of fields.
        assert!(frame == 0 || found == 0, "{frame}: {found}");
    }
}
