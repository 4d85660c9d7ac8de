//! Fuzzy rules decode a frame without allocating.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use decoupler::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{FrameDecoder, TakagiSugeno, fit_rows},
    network::Quantity,
    scene::Scene,
    sensor::SensorModel,
};

#[test]
fn a_frame_is_decoded_by_fuzzy_rules_without_allocating() {
    let model = SensorModel::new("10x6_3x18".parse().unwrap());
    let mut rng = Seed(0).rng(Stream::Training);
    let set = Dataset::simulate(&model, &Scene::default(), 600, &mut rng).unwrap();
    let fit = |set: &Dataset| TakagiSugeno::fit(set, Quantity::Conductance, 0.0, &mut rng);
    let mut decoder = fit_rows(&set, false, fit).unwrap();
    assert!(decoder.maps()[0].rules() > 1);
    let frame: Vec<f64> = set.resistances_ohm.iter().take(180).copied().collect();
    let mut coordinates_mm = vec![0.0; 180];
    let counted = allocation_counter::measure(|| decoder.decode(&frame, &mut coordinates_mm).unwrap());
    assert_eq!(counted.count_total, 0);
}
