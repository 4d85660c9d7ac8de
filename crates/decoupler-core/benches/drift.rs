//! False alarms and detections of the drift monitor: `cargo bench -p decoupler-core --bench drift`.
//!
//! Each of 20 sets of a kind has a training recording of five channels and later readings of the same kind, also with a
//! fault.
#![expect(clippy::print_stdout, reason = "a benchmark's result is what it prints")]
#![allow(missing_docs, clippy::unwrap_used)]

use std::f64::consts::TAU;

use decoupler_core::live::{DriftMonitor, DriftReference};
use ndarray::{Array1, Array2, Axis};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

const CHANNELS: usize = 5;
const SETS: u64 = 20;
/// Training readings in correlation times.
const LENGTHS: [f64; 3] = [60.0, 300.0, 2000.0];
/// Blocks of each set without a fault.
const BLOCKS: usize = 1000;
/// Maximum number of blocks with a fault.
const FAULTY_BLOCKS: usize = 60;

#[derive(Clone, Copy)]
enum Kind {
    /// First-order autoregression with this coefficient.
    Autoregression(f64),
    /// Presses of random place, depth and duration.
    Presses,
    /// Sines of one period and different phases.
    Sine,
    /// Staircases that wrap.
    Encoder,
}

/// Name, kind, and number of readings that carry as much information as one independent reading.
const KINDS: [(&str, Kind, f64); 7] = [
    ("white noise", Kind::Autoregression(0.0), 1.0),
    ("AR(1) 0.5", Kind::Autoregression(0.5), 3.0),
    ("AR(1) 0.9", Kind::Autoregression(0.9), 19.0),
    ("AR(1) 0.99", Kind::Autoregression(0.99), 199.0),
    ("random presses", Kind::Presses, 60.0),
    ("sine", Kind::Sine, 30.0),
    ("encoder", Kind::Encoder, 120.0),
];

const FAULTS: [&str; 5] = [
    "frozen at the mean",
    "frozen at the last reading",
    "halved spans",
    "dead channel",
    "swapped channels",
];

struct Source {
    kind: Kind,
    rng: ChaCha8Rng,
    time: f64,
    state: [f64; CHANNELS + 1],
    offsets: [f64; CHANNELS],
    gains: [f64; CHANNELS],
    /// Share of the common state in each channel.
    shares: [f64; CHANNELS],
    /// Place, depth, duration and remaining time of a press.
    press: [f64; 4],
}

impl Source {
    fn new(kind: Kind, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [offsets, gains, shares] =
            [10.0, 1.5, 1.0].map(|largest| std::array::from_fn(|_| rng.random_range(0.0..largest)));
        let mut source = Self {
            kind,
            state: [0.0; CHANNELS + 1],
            offsets,
            gains: gains.map(|gain: f64| 0.5 + gain),
            shares,
            press: [0.0; 4],
            time: 0.0,
            rng,
        };
        (0..1000).for_each(|_| drop(source.next()));
        source
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.rng.random::<f64>()).ln()).sqrt();
        radius * (TAU * self.rng.random::<f64>()).cos()
    }

    fn next(&mut self) -> Array1<f64> {
        self.time += 1.0;
        match self.kind {
            Kind::Autoregression(memory) => {
                for index in 0..=CHANNELS {
                    self.state[index] = memory * self.state[index] + (1.0 - memory * memory).sqrt() * self.normal();
                }
            }
            Kind::Presses if self.press[3] <= 0.0 => {
                let duration = self.rng.random_range(20.0..60.0);
                let (place, depth) = (self.rng.random_range(0.0..4.0), self.rng.random_range(0.2..1.0));
                self.press = [place, depth, duration, duration];
            }
            _ => self.press[3] -= 1.0,
        }
        let [place, depth, duration, remaining] = self.press;
        Array1::from_shape_fn(CHANNELS, |channel| {
            let at = channel as f64;
            let value = match self.kind {
                Kind::Autoregression(_) => self.state[channel] + self.shares[channel] * self.state[CHANNELS],
                Kind::Presses => {
                    // At rest for a fifth of the time; then pressed, held and released.
                    let phase = 1.0 - remaining / duration;
                    let pressed = (5.0 * phase - 1.0).min(5.0 - 5.0 * phase).clamp(0.0, 1.0);
                    pressed * depth * (-(at - place).powi(2)).exp() + 0.02 * self.normal()
                }
                Kind::Sine => (TAU * self.time / 73.3 + at).sin() + 0.02 * self.normal(),
                Kind::Encoder => {
                    let period = [64.0, 37.0, 50.0, 91.0, 120.0][channel];
                    (self.time / 4.0).floor().rem_euclid(period) / period
                }
            };
            self.offsets[channel] + self.gains[channel] * value
        })
    }
}

fn with_fault(fault: usize, mut reading: Array1<f64>, mean: &Array1<f64>, last: &Array1<f64>) -> Array1<f64> {
    match fault {
        0 => return mean.clone(),
        1 => return last.clone(),
        2 => return 0.5 * (reading + mean),
        3 => reading[2] = mean[2],
        _ => reading.swap(0, 4),
    }
    reading
}

fn main() {
    println!(
        "| readings | training readings | block | blocks in a row | false alarms | {} |",
        FAULTS.join(" | ")
    );
    for (name, kind, time) in KINDS {
        for length in LENGTHS {
            let samples = (length * time) as usize;
            let (mut alarms, mut blocks, mut sets) = (0, 0, 0);
            let mut sizes: [Vec<usize>; 2] = Default::default();
            let mut found: [Vec<usize>; FAULTS.len()] = Default::default();
            for seed in 0..SETS {
                let mut source = Source::new(kind, seed);
                let mut training = Array2::zeros((samples, CHANNELS));
                training
                    .rows_mut()
                    .into_iter()
                    .for_each(|mut row| row.assign(&source.next()));
                let Ok(reference) = DriftReference::of(training.view()) else {
                    continue;
                };
                sets += 1;
                let block = reference.readings_per_block();
                sizes[0].push(block);
                sizes[1].push(reference.blocks_in_a_row());
                let mut monitor = DriftMonitor::new(reference.clone());
                for _ in 0..BLOCKS * block {
                    let drift = monitor.take(0, &source.next().to_vec());
                    alarms += usize::from(drift.is_some_and(|drift| !drift.has_ended));
                }
                blocks += BLOCKS;
                let (mean, last) = (training.mean_axis(Axis(0)).unwrap(), source.next());
                for (fault, found) in found.iter_mut().enumerate() {
                    let mut monitor = DriftMonitor::new(reference.clone());
                    let alarm = (1..=FAULTY_BLOCKS * block).find(|_| {
                        let reading = with_fault(fault, source.next(), &mean, &last);
                        monitor.take(0, &reading.to_vec()).is_some()
                    });
                    found.extend(alarm.map(|readings| readings / block));
                }
            }
            let found = found.map(|blocks| format!("{} ({})", blocks.len(), median(blocks)));
            let [block, in_a_row] = sizes.map(median);
            println!(
                "| {name} | {samples} | {block} | {in_a_row} | {alarms} in {blocks} ({sets} sets) | {} |",
                found.join(" | ")
            );
        }
    }
}

fn median(mut values: Vec<usize>) -> String {
    values.sort_unstable();
    values.get(values.len() / 2).map_or("–".to_owned(), usize::to_string)
}
