//! The medians of the posterior against sequential Monte Carlo on Eq. (2) itself: no linearisation, no expectation
//! propagation.
//!
//! `cargo test --release --test posterior_sampling -- --ignored --nocapture` prints the table over ten decades of noise.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "the table is shown with --nocapture")]

mod sampler;

use decoupler_core::{
    dataset::{Seed, Stream},
    decoupling::Posterior,
    glam::DVec3,
    rand::{SeedableRng, rngs::ChaCha8Rng},
    scene::Movement,
};
use sampler::{ROW, Sampler, Truth};

/// Mean errors of z in mm of the reference, of the decoder, of sampling, and of the middle of the stroke.
#[derive(Clone, Copy, Debug)]
struct Errors {
    reference: f64,
    decoder: f64,
    sampled: f64,
    middle: f64,
}

fn errors(array: &str, truth: Truth, movement: Movement, samples: usize, particles: usize) -> Errors {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let sampler = Sampler::new(array, truth, movement);
    let model = &sampler.model;
    let scene = truth.scene(movement);
    let mut posterior = Posterior::new(model, &scene, &[ROW], &mut Seed(1).rng(Stream::Expectation)).unwrap();
    let nodes = model.scale.nodes_per_row();
    let per_node = sampler.lowest.len() / nodes;
    let mut sums = [0.0; 4];
    for _ in 0..samples {
        let x = sampler.draw(&mut rng);
        let readings = sampler.read(&x, &mut rng);
        let mut coordinates = Vec::new();
        for node in 0..nodes {
            let displacement = match x[node * per_node..(node + 1) * per_node] {
                [z] => DVec3::new(0.0, 0.0, z),
                ref xyz => DVec3::from_slice(xyz),
            };
            coordinates.extend(model.displaced_mm(ROW, node, displacement).to_array());
        }
        let (mut limit, mut decoded) = (coordinates.clone(), coordinates.clone());
        assert!(posterior.limit(ROW, &readings, &coordinates, &mut limit), "{truth:?}");
        posterior.solve(ROW, &readings, &mut decoded).unwrap();
        let sampled = sampler.medians(&readings, particles, &mut rng);
        for node in 0..nodes {
            let z = node * per_node + per_node - 1;
            let at = model.displaced_mm(ROW, node, DVec3::ZERO).z;
            sums[0] += (limit[3 * node + 2] - coordinates[3 * node + 2]).abs();
            sums[1] += (decoded[3 * node + 2] - coordinates[3 * node + 2]).abs();
            sums[2] += (at - sampled[z] - coordinates[3 * node + 2]).abs();
            sums[3] += (x[z] - 0.5 * (sampler.lowest[z] + sampler.highest[z])).abs();
        }
    }
    let [reference, decoder, sampled, middle] = sums.map(|sum: f64| sum / (samples * nodes) as f64);
    Errors {
        reference,
        decoder,
        sampled,
        middle,
    }
}

#[test]
fn medians_are_as_accurate_as_sampling() {
    let cases = [
        Truth {
            relative: 1e-2,
            ..Truth::NONE
        },
        Truth {
            relative: 1e-7,
            ..Truth::NONE
        },
        Truth {
            additive_ohm: 0.1,
            ..Truth::NONE
        },
        Truth {
            additive_ohm: 300.0,
            ..Truth::NONE
        },
        Truth {
            relative: 1e-3,
            drift: 0.3,
            ..Truth::NONE
        },
        Truth {
            bits: Some(6),
            ..Truth::NONE
        },
        Truth {
            bits: Some(12),
            relative: 1e-4,
            ..Truth::NONE
        },
    ];
    for truth in cases {
        let found = errors("1x2_2x6", truth, Movement::Z, 10, 250);
        for ours in [found.reference, found.decoder] {
            assert!((0.9..1.1).contains(&(ours / found.sampled)), "{truth:?}: {found:?}");
        }
        assert!(found.reference < 1.1 * found.middle, "{truth:?}: {found:?}");
    }
}

/// The table, optionally restricted to the environment variables ARRAYS and NOISE, from SAMPLES rows with PARTICLES
/// particles each.
#[test]
#[ignore = "prints the whole table in minutes"]
fn table() {
    let given = |name, usual: &str| std::env::var(name).unwrap_or_else(|_| usual.to_owned());
    let arrays = given("ARRAYS", "1x2_2x6 2x6_3x18 2x6_3x4");
    let only = given("NOISE", "");
    let [samples, particles] =
        [("SAMPLES", "25"), ("PARTICLES", "500")].map(|(name, usual)| given(name, usual).parse().unwrap());
    for array in arrays.split(' ') {
        let decades = (0..=10).rev().map(|decade| 10.0_f64.powi(-decade));
        let mut cases: Vec<(String, Truth)> = Vec::new();
        for level in decades {
            cases.push((
                format!("relative {level:.0e}"),
                Truth {
                    relative: level,
                    ..Truth::NONE
                },
            ));
            let additive_ohm = 1e4 * level;
            cases.push((
                format!("additive {additive_ohm:.0e} ohm"),
                Truth {
                    additive_ohm,
                    ..Truth::NONE
                },
            ));
            let drift = Truth {
                drift: level,
                relative: 1e-3,
                ..Truth::NONE
            };
            cases.push((format!("drift {level:.0e} with 1e-3"), drift));
        }
        for bits in [1, 2, 3, 4, 6, 8, 12, 16, 24, 32] {
            let truth = Truth {
                bits: Some(bits),
                ..Truth::NONE
            };
            cases.push((format!("{bits} bits"), truth));
            let relative = 1e-3;
            cases.push((format!("{bits} bits with 1e-3"), Truth { relative, ..truth }));
        }
        for (name, truth) in cases.into_iter().filter(|(name, _)| only.is_empty() || *name == only) {
            let e = errors(array, truth, Movement::Z, samples, particles);
            println!(
                "{array:10} {name:22} sampled {:9.3e} reference {:6.3} decoder {:6.3} middle {:6.3}",
                e.sampled,
                e.reference / e.sampled,
                e.decoder / e.sampled,
                e.middle / e.sampled
            );
        }
    }
}
