//! What runs for every frame allocates nothing.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use decoupler::{
    dataset::{Dataset, PerRow, Seed, Stream},
    decoupling::{CompiledNetworks, Decoder, TakagiSugeno},
    network::{
        DecouplingNetwork, InputChoice, Inputs, MinMax, Quantity, ScalingChoice, ScalingError, Shape, nguyen_widrow,
    },
    scene::{Noise, NoiseSource, RowModel, Scene},
    sensor::{Axes, RowConductance, SensorModel},
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
        // Without noise, single precision has sums in double precision; with noise it has not.
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
