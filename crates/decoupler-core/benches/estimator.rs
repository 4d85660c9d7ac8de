//! Accuracy of Newton's method with prior: `cargo bench -p decoupler-core --bench estimator`.
//!
//! Decodes 40 scenes: loading, noise, drift, and row-wires that are known or not, of a small array and the paper's.
#![expect(clippy::print_stdout, reason = "a benchmark's result is what it prints")]
#![allow(missing_docs, clippy::unwrap_used)]

use std::time::Instant;

use decoupler_core::{
    dataset::{Dataset, Seed, Simulation, Stream},
    decoupling::{DecoderKind, Precision, decode_set},
    evaluation::{DecoderSet, Errors, RunSettings},
    scene::{Noise, Rows, Scene},
    sensor::SensorModel,
};

/// Number of snapshots of a scene; 10 are enough for errors to within a few percent.
const SNAPSHOTS: usize = 15;
const SMALL: &str = "6x6_3x18";
const LARGE: &str = "10x10_5x30";
const LOADINGS: [&str; 3] = ["random", "smooth:4", "indenter"];

fn print_scene(array: &str, loading: &str, noise: Noise, rows: Rows) {
    let model = SensorModel::new(array.parse().unwrap());
    let scene = Scene {
        loading: loading.parse().unwrap(),
        noise,
        rows,
        ..Scene::default()
    };
    let samples = SNAPSHOTS * model.scale.rows();
    let mut test = Dataset::simulate(&model, &scene, samples, &mut Seed(2).rng(Stream::Test)).unwrap();
    test.disturb(&model, &noise, &mut Seed(2).rng(Stream::TestNoise))
        .unwrap();
    let errors = |kind: DecoderKind| {
        let settings = RunSettings::from(Simulation {
            sensor: model,
            scene,
            ..Simulation::default()
        });
        let decoders = DecoderSet::new(settings, test.clone(), None);
        let mut decoder = decoders.decoder(kind, Precision::Double).unwrap().unwrap();
        let begun = Instant::now();
        let answers_mm = decode_set(decoder.as_mut(), &test).unwrap();
        let micros = begun.elapsed().as_micros() as f64 / SNAPSHOTS as f64;
        let errors = Errors::measure(&test, &answers_mm, scene.stroke_mm(&model.geometry));
        (errors.z_mm, micros)
    };
    let (newton_mm, micros) = errors(DecoderKind::Newton);
    let (mean_mm, _) = errors(DecoderKind::Mean);
    let known = if rows == Rows::Known { "known" } else { "unknown" };
    println!(
        "| {array} | {loading} | {:e} | {} | {known} | {mean_mm:.4} | {newton_mm:.4} | {micros:.0} |",
        noise.relative, noise.drift
    );
}

fn main() {
    println!("| array | loading | noise | drift | rows | mean | newton | us per frame |");
    println!("|---|---|---|---|---|---|---|---|");
    let of = |relative: f64, drift: f64| Noise {
        drift,
        ..Noise::relative(relative)
    };
    for loading in LOADINGS {
        for relative in [1e-4, 1e-3, 1e-2] {
            print_scene(SMALL, loading, of(relative, 0.0), Rows::Known);
            print_scene(SMALL, loading, of(relative, 0.0), Rows::All);
            print_scene(SMALL, loading, of(relative, 0.05), Rows::Known);
            print_scene(LARGE, loading, of(relative, 0.0), Rows::Known);
        }
        print_scene(SMALL, loading, of(1e-3, 0.05), Rows::All);
    }
    print_scene(LARGE, "random", of(1e-3, 0.05), Rows::Known);
}
