//! Sequential Monte Carlo on Eq. (2), independent of the decoders.

use decoupler_core::{
    glam::DVec3,
    rand::{Rng, RngExt},
    scene::{Movement, Noise, Rows, Scene},
    sensor::SensorModel,
};

pub(crate) const ROW: usize = 0;

/// Effect of noise on the readings of one row, implemented independently.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Truth {
    pub(crate) relative: f64,
    pub(crate) additive_ohm: f64,
    pub(crate) drift: f64,
    pub(crate) bits: Option<u8>,
}

impl Truth {
    pub(crate) const NONE: Self = Self {
        relative: 0.0,
        additive_ohm: 0.0,
        drift: 0.0,
        bits: None,
    };

    pub(crate) fn scene(self, movement: Movement) -> Scene {
        Scene {
            rows: Rows::Known,
            movement,
            noise: Noise {
                relative: self.relative,
                additive_ohm: self.additive_ohm,
                drift: self.drift,
                converter_bits: self.bits,
                ..Noise::default()
            },
            ..Scene::default()
        }
    }
}

pub(crate) struct Sampler {
    pub(crate) model: SensorModel,
    truth: Truth,
    pub(crate) lowest: Vec<f64>,
    pub(crate) highest: Vec<f64>,
    step_ohm: f64,
    steps: f64,
}

struct Particle {
    /// Unknowns, and the gain's η.
    x: Vec<f64>,
    /// Logarithm of the likelihood, or minus half the squared distance from the converter's steps.
    log_likelihood: f64,
}

fn normal(rng: &mut impl Rng) -> f64 {
    let length = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    length * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x / 2.0_f64.sqrt())
}

impl Sampler {
    pub(crate) fn new(array: &str, truth: Truth, movement: Movement) -> Self {
        let model = SensorModel::new(array.parse().unwrap());
        let stroke_mm = truth.scene(movement).stroke_mm(&model.geometry);
        let shift_mm = movement.largest_shift_mm();
        let nodes = model.scale.nodes_per_row();
        let (lowest, highest) = match movement {
            Movement::Z => (vec![0.0; nodes], vec![stroke_mm; nodes]),
            Movement::Xyz { .. } => (
                [-shift_mm, -shift_mm, 0.0].repeat(nodes),
                [shift_mm, shift_mm, stroke_mm].repeat(nodes),
            ),
        };
        let rest = vec![DVec3::ZERO; nodes];
        let largest = (0..model.scale.rows()).flat_map(|row| model.row_resistances(row, &rest).unwrap());
        let steps = 2.0_f64.powi(i32::from(truth.bits.unwrap_or(1)));
        Self {
            step_ohm: 2.0 * largest.fold(0.0, f64::max) / steps,
            steps,
            model,
            truth,
            lowest,
            highest,
        }
    }

    fn resistances(&self, x: &[f64]) -> Vec<f64> {
        let axes = self.lowest.len() / self.model.scale.nodes_per_row();
        let displacements: Vec<DVec3> = x[..self.lowest.len()]
            .chunks_exact(axes)
            .map(|node| match *node {
                [z] => DVec3::new(0.0, 0.0, z),
                _ => DVec3::from_slice(node),
            })
            .collect();
        self.model.row_resistances(ROW, &displacements).unwrap()
    }

    pub(crate) fn draw(&self, rng: &mut impl Rng) -> Vec<f64> {
        let ranges = self.lowest.iter().zip(&self.highest);
        let mut x: Vec<f64> = ranges
            .map(|(low, high)| low + (high - low) * rng.random::<f64>())
            .collect();
        if self.truth.drift > 0.0 {
            x.push(
                std::iter::repeat_with(|| normal(rng))
                    .find(|eta| 1.0 + self.truth.drift * eta > 0.0)
                    .unwrap(),
            );
        }
        x
    }

    fn gain(&self, x: &[f64]) -> f64 {
        x.get(self.lowest.len()).map_or(1.0, |eta| 1.0 + self.truth.drift * eta)
    }

    pub(crate) fn read(&self, x: &[f64], rng: &mut impl Rng) -> Vec<f64> {
        let Truth {
            relative,
            additive_ohm,
            bits,
            ..
        } = self.truth;
        let gain = self.gain(x);
        let ohms = self.resistances(x).into_iter().map(|ohm| {
            let mut draws =
                std::iter::repeat_with(|| gain * ohm * (1.0 + relative * normal(rng)) + additive_ohm * normal(rng));
            let noisy = draws.find(|ohm| *ohm > 0.0).unwrap();
            match bits {
                Some(_) => (noisy / self.step_ohm).round().clamp(1.0, self.steps) * self.step_ohm,
                None => noisy,
            }
        });
        ohms.collect()
    }

    fn log_prior(&self, x: &[f64]) -> f64 {
        let inside = x
            .iter()
            .zip(&self.lowest)
            .zip(&self.highest)
            .all(|((x, low), high)| (low..=high).contains(&x));
        if !inside || self.gain(x) <= 0.0 {
            return f64::NEG_INFINITY;
        }
        x.get(self.lowest.len()).map_or(0.0, |eta| -0.5 * eta * eta)
    }

    fn log_likelihood(&self, x: &[f64], readings: &[f64]) -> f64 {
        let gain = self.gain(x);
        let pairs = self.resistances(x).into_iter().zip(readings);
        let terms = pairs.map(|(ohm, &reading)| {
            let ohm = gain * ohm;
            let deviation = (self.truth.relative * ohm).hypot(self.truth.additive_ohm);
            if self.truth.bits.is_some() {
                let step = (reading / self.step_ohm).round();
                let low = if step > 1.0 { (step - 0.5) * self.step_ohm } else { 0.0 };
                let high = if step < self.steps {
                    (step + 0.5) * self.step_ohm
                } else {
                    f64::INFINITY
                };
                if deviation == 0.0 {
                    let outside = (low - ohm).max(ohm - high).max(0.0) / self.step_ohm;
                    return -0.5 * outside * outside;
                }
                let (low, high) = ((low - ohm) / deviation, (high - ohm) / deviation);
                // In the tail, where differences keep their digits.
                let mass = if low > 0.0 {
                    normal_cdf(-low) - normal_cdf(-high)
                } else {
                    normal_cdf(high) - normal_cdf(low)
                };
                return mass.max(1e-300).ln() - normal_cdf(ohm / deviation).ln();
            }
            let deviation = deviation.max(1e-15 * ohm);
            let apart = (reading - ohm) / deviation;
            -0.5 * apart * apart - deviation.ln() - normal_cdf(ohm / deviation).ln()
        });
        terms.sum()
    }

    /// Medians of the posterior by sequential Monte Carlo from the prior, with moves along differences of particles
    /// (differential evolution; ter Braak 2006).
    pub(crate) fn medians(&self, readings: &[f64], count: usize, rng: &mut impl Rng) -> Vec<f64> {
        let is_hard = self.truth.bits.is_some() && self.truth.relative == 0.0 && self.truth.additive_ohm == 0.0;
        let particle = |x: Vec<f64>| Particle {
            log_likelihood: self.log_likelihood(&x, readings),
            x,
        };
        let mut particles: Vec<Particle> = (0..count).map(|_| particle(self.draw(rng))).collect();
        let mut power = 0.0;
        loop {
            let top = particles
                .iter()
                .map(|p| p.log_likelihood)
                .fold(f64::NEG_INFINITY, f64::max);
            let weights = |next: f64| -> Vec<f64> {
                let weight = |p: &Particle| {
                    if is_hard && next.is_infinite() {
                        f64::from(u8::from(p.log_likelihood == 0.0))
                    } else {
                        ((next - power) * (p.log_likelihood - top)).exp()
                    }
                };
                particles.iter().map(weight).collect()
            };
            let effective = |next: f64| {
                let weights = weights(next);
                let (sum, squares) = weights.iter().fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
                sum * sum / squares / count as f64
            };
            let last = if is_hard { f64::INFINITY } else { 1.0 };
            let next = if effective(last) >= 0.5 {
                last
            } else {
                let (mut low, mut high) = (power, if is_hard { power.max(1e-6) * 1e6 } else { 1.0 });
                for _ in 0..80 {
                    // Step sizes over many decades.
                    let middle = if low > 0.0 { (low * high).sqrt() } else { high * 1e-3 };
                    if effective(middle) > 0.5 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                low.max(power * (1.0 + 1e-9))
            };
            let weights = weights(next);
            let total: f64 = weights.iter().sum();
            let mut chosen = Vec::with_capacity(count);
            let (mut sum, mut mark) = (0.0, rng.random::<f64>() * total / count as f64);
            for (weight, p) in weights.iter().zip(&particles) {
                sum += weight;
                while mark < sum && chosen.len() < count {
                    chosen.push(Particle {
                        x: p.x.clone(),
                        log_likelihood: p.log_likelihood,
                    });
                    mark += total / count as f64;
                }
            }
            while chosen.len() < count {
                let p = &particles[count - 1];
                chosen.push(Particle {
                    x: p.x.clone(),
                    log_likelihood: p.log_likelihood,
                });
            }
            particles = chosen;
            power = next;
            let moves = if power == last { 60 } else { 12 };
            for turn in 0..moves {
                for i in 0..count {
                    let (a, b) = (rng.random_range(0..count), rng.random_range(0..count));
                    let unknowns = particles[i].x.len() as f64;
                    let gamma = if turn % 6 == 5 {
                        1.0
                    } else {
                        2.38 / (2.0 * unknowns).sqrt() * (0.4 + rng.random::<f64>())
                    };
                    let x: Vec<f64> = (0..particles[i].x.len())
                        .map(|k| particles[i].x[k] + gamma * (particles[a].x[k] - particles[b].x[k]))
                        .collect();
                    let prior = self.log_prior(&x) - self.log_prior(&particles[i].x);
                    if prior == f64::NEG_INFINITY {
                        continue;
                    }
                    let next = particle(x);
                    let gained = if is_hard && power.is_infinite() {
                        if next.log_likelihood == 0.0 {
                            0.0
                        } else {
                            f64::NEG_INFINITY
                        }
                    } else {
                        power * (next.log_likelihood - particles[i].log_likelihood)
                    };
                    if rng.random::<f64>().ln() < prior + gained {
                        particles[i] = next;
                    }
                }
            }
            if power == last {
                break;
            }
        }
        let median = |k: usize| {
            let mut values: Vec<f64> = particles.iter().map(|p| p.x[k]).collect();
            values.sort_by(f64::total_cmp);
            0.5 * (values[(count - 1) / 2] + values[count / 2])
        };
        (0..self.lowest.len()).map(median).collect()
    }
}
