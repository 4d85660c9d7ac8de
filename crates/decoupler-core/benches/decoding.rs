//! Decoding speed: `cargo bench -p decoupler-core --bench decoding`.
//!
//! One thread; medians of many frames, measured in turns within one run. Only ratios are comparable between machines:
//! the minimum arithmetic (divisions, square roots, hyperbolic tangents and multiplications, the same number in plain
//! loops) is measured alongside.
#![expect(clippy::print_stdout, reason = "a benchmark's result is what it prints")]
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "arithmetic/row.rs"]
mod row_arithmetic;
#[path = "arithmetic/untrained.rs"]
mod untrained;

use std::{hint::black_box, time::Instant};

use decoupler_core::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{Decoder, DecoderKind, Estimator, NewtonDecoder, Precision, ProgramDecoder},
    evaluation::{DecoderSet, RunSettings},
    network::{InputChoice, Quantity, ScalingChoice, tanh_in_place, tanh_in_place_single},
    scene::{Noise, RowModel, Rows, Scene},
    sensor::{ArrayScale, SensorModel},
};
use glam::DVec3;
use pulp::{Simd, WithSimd};
use row_arithmetic::RowArithmetic;
use untrained::untrained_networks;

/// A piece of work with its name.
type Work<'a> = (String, Box<dyn FnMut() + 'a>);

/// Nanoseconds of each piece of work: medians of blocks, measured in turns.
fn medians_ns(works: &mut [Work<'_>]) -> Vec<f64> {
    const TURNS: usize = 15;
    const BLOCK_NS: f64 = 2e6;
    let runs: Vec<usize> = works
        .iter_mut()
        .map(|(_, work)| {
            work();
            let begun = Instant::now();
            work();
            (BLOCK_NS / begun.elapsed().as_nanos().max(1) as f64).clamp(1.0, 20_000.0) as usize
        })
        .collect();
    let mut times = vec![Vec::new(); works.len()];
    for _ in 0..TURNS {
        for (((_, work), &runs), times) in works.iter_mut().zip(&runs).zip(&mut times) {
            let begun = Instant::now();
            for _ in 0..runs {
                work();
            }
            times.push(begun.elapsed().as_nanos() as f64 / runs as f64);
        }
    }
    let middle = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[TURNS / 2]
    };
    times.iter_mut().map(middle).collect()
}

/// Minimum arithmetic of decoding a frame by networks, in the precision of the array. A type rather than a closure,
/// which would be too long to be inlined into the SIMD-dispatched function.
macro_rules! arithmetic {
    ($real:ty, $tanh:path, $divisions:expr, $tangents:expr, $products:expr) => {{
        struct Arithmetic<'a>(&'a mut [$real], &'a [$real]);
        impl WithSimd for Arithmetic<'_> {
            type Output = $real;

            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) -> $real {
                const LANES: usize = 8;
                for value in self.0 {
                    *value = 1.0 / *value;
                }
                // Several sums to hide the latency of additions.
                let mut sums = [[0.0; LANES]; 4];
                for blocks in self.1.as_chunks::<LANES>().0.as_chunks::<4>().0 {
                    for (sums, block) in sums.iter_mut().zip(blocks) {
                        for lane in 0..LANES {
                            sums[lane] += 0.7 * block[lane];
                        }
                    }
                }
                sums.as_flattened().iter().sum()
            }
        }
        let (mut quotients, mut tangents) = (vec![1.5 as $real; $divisions], vec![0.3 as $real; $tangents]);
        let weights = vec![0.01 as $real; $products];
        move || {
            black_box(pulp::Arch::new().dispatch(Arithmetic(&mut quotients, &weights)));
            $tanh(&mut tangents);
            black_box((&quotients, &tangents));
        }
    }};
}

impl RowArithmetic {
    /// Arithmetic of Gaussians around `centres`, each with an exponential of about 16 products.
    fn of_radial_basis(scale: ArrayScale, centres: usize) -> Self {
        let (inputs, outputs) = (scale.columns(), scale.nodes_per_row());
        Self {
            roots: 0,
            divisions: inputs,
            products: inputs * inputs + centres * (inputs + outputs + 16),
        }
    }

    /// Arithmetic of `steps` steps with a prior: each evaluates Eq. (2) and decomposes the equations of readings and prior.
    fn of_estimator(scale: ArrayScale, steps: usize) -> Self {
        let (readings, nodes) = (scale.columns(), scale.nodes_per_row());
        let newton = Self::of_newton(scale, steps);
        Self {
            products: newton.products + steps * 2 * nodes * nodes * nodes,
            roots: newton.roots + steps * readings,
            ..newton
        }
    }
}

/// Number of evaluations by Newton's method from an affine estimate: its error of a hundredth of the stroke is
/// squared each time.
const NEWTON_EVALUATIONS: usize = 3;

fn print_scale(scale: ArrayScale) {
    let model = SensorModel::new(scale);
    let scene = Scene {
        rows: Rows::Known,
        ..Scene::default()
    };
    let noisy = Scene {
        noise: Noise::relative(1e-3),
        ..scene
    };
    let rows: Vec<usize> = (0..scale.rows()).collect();
    let mut rng = Seed(0).rng(Stream::Training);
    let training = Dataset::simulate(&model, &scene, 300 * scale.rows(), &mut rng).unwrap();
    let frame = training.frames().unwrap().swap_remove(0);
    let kinds = [
        ("mean", DecoderKind::Mean),
        ("ridge", DecoderKind::Ridge),
        ("fuzzy rules", DecoderKind::Fuzzy),
        ("radial basis, 100 centres", DecoderKind::RadialBasis),
    ];
    let settings = RunSettings {
        inputs: InputChoice::BEST,
        ..RunSettings::measured(RowModel::Each)
    };
    let set = DecoderSet::new(settings, training.clone(), None);
    let fitted = kinds.map(|(name, kind)| {
        let decoder = set.decoder(kind, Precision::Double).unwrap().unwrap();
        (name.to_owned(), decoder)
    });
    let mut decoders: Vec<(String, Box<dyn Decoder>)> = fitted.into();
    for hidden in [6, 12, 24, 48] {
        for quantity in Quantity::ALL {
            let choice = InputChoice {
                quantity,
                scaling: ScalingChoice::Whitening,
            };
            let networks = untrained_networks(&training, choice, hidden);
            let [double, single] = [Precision::Double, Precision::Single]
                .map(|precision| ProgramDecoder::new(networks.program(precision)));
            decoders.push((format!("network, {hidden} hidden, {quantity}, f64"), Box::new(double)));
            decoders.push((format!("network, {hidden} hidden, {quantity}, f32"), Box::new(single)));
        }
    }
    let first = untrained_networks(&training, InputChoice::BEST, 12).decoder();
    decoders.push((
        "polish, 1 step".into(),
        Box::new(
            NewtonDecoder::new(&model, &scene, &rows)
                .unwrap()
                .after(Box::new(first), 1),
        ),
    ));
    decoders.push((
        "newton".into(),
        Box::new(NewtonDecoder::new(&model, &scene, &rows).unwrap()),
    ));
    let mut estimator = Estimator::new(&model, &noisy, &rows).unwrap();
    let mut answer = vec![0.0; scale.coordinates_per_row()];
    let mut steps_of = |row: usize| {
        let readings = &frame[row * scale.columns()..(row + 1) * scale.columns()];
        estimator.solve(row, readings, &mut answer).unwrap().steps
    };
    let steps = rows.iter().map(|&row| steps_of(row)).sum::<usize>() / rows.len();
    decoders.push((
        "newton with prior, noise 1e-3".into(),
        Box::new(NewtonDecoder::new(&model, &noisy, &rows).unwrap()),
    ));
    let coordinates = scale.rows() * scale.coordinates_per_row();
    let (m1, m2, m4) = (scale.rows(), scale.nodes_per_row(), scale.columns());
    let pressed = vec![DVec3::new(0.0, 0.0, 0.4); m2];
    let mut resistances = vec![0.0; m4];
    let mut works: Vec<Work<'_>> = Vec::new();
    for (name, decoder) in &mut decoders {
        let mut answer = vec![0.0; coordinates];
        let frame = &frame;
        let work = move || {
            decoder.decode(black_box(frame), &mut answer).unwrap();
            black_box(&answer);
        };
        works.push((name.clone(), Box::new(work)));
    }
    let (divisions, tangents, products) = (m1 * m4, m1 * 12, m1 * 12 * (m4 + m2));
    works.push((
        "arithmetic of 12 hidden, f64".into(),
        Box::new(arithmetic!(f64, tanh_in_place, divisions, tangents, products)),
    ));
    works.push((
        "arithmetic of 12 hidden, f32".into(),
        Box::new(arithmetic!(f32, tanh_in_place_single, divisions, tangents, products)),
    ));
    works.push((
        "forward model".into(),
        Box::new(|| {
            for row in 0..m1 {
                model
                    .row_resistances_into(row, black_box(&pressed), &mut resistances)
                    .unwrap();
                black_box(&resistances);
            }
        }),
    ));
    works.push((
        "forward model and Jacobian".into(),
        Box::new(|| {
            for row in 0..m1 {
                black_box(model.row_jacobian(row, black_box(&pressed)).unwrap());
            }
        }),
    ));
    let mut distances = vec![30.0_f64; m1 * m2 * scale.nodes_per_column() * m4];
    works.push((
        "arithmetic of the forward model".into(),
        Box::new(move || {
            pulp::Arch::new().dispatch(|| {
                for value in &mut distances {
                    *value = 1.0 / (*value + 30.0).sqrt();
                }
            });
            black_box(&distances);
        }),
    ));
    let newton = |evaluations| RowArithmetic::of_newton(scale, evaluations);
    let per_row = [
        ("radial basis, 100 centres", RowArithmetic::of_radial_basis(scale, 100)),
        ("polish, 1 step", newton(2)),
        ("newton", newton(NEWTON_EVALUATIONS)),
        (
            "newton with prior, noise 1e-3",
            RowArithmetic::of_estimator(scale, steps),
        ),
    ];
    for (name, arithmetic) in per_row {
        works.push((format!("arithmetic of {name}"), Box::new(arithmetic.work(m1))));
    }
    let times = medians_ns(&mut works);
    println!("\n{scale}: {m1} rows per frame");
    println!("{:38} {:>12} {:>12}", "", "ns per row", "us per frame");
    for ((name, _), ns) in works.iter().zip(&times) {
        println!("{name:38} {:>12.0} {:>12.3}", ns / m1 as f64, ns * 1e-3);
    }
    let of = |name: &str| times[works.iter().position(|work| work.0 == name).unwrap()];
    for precision in ["f64", "f32"] {
        println!(
            "12 hidden, conductance, {precision}: {:.1} times its arithmetic",
            of(&format!("network, 12 hidden, conductance, {precision}"))
                / of(&format!("arithmetic of 12 hidden, {precision}"))
        );
    }
    for (name, _) in per_row {
        let times = of(name) / of(&format!("arithmetic of {name}"));
        println!("{name}: {times:.1} times its arithmetic");
    }
    println!(
        "forward model: {:.1} times its arithmetic",
        of("forward model") / of("arithmetic of the forward model")
    );
}

fn main() {
    for scale in ArrayScale::PRESETS {
        print_scale(scale);
    }
    print_scale("20x20_10x60".parse().unwrap());
}
