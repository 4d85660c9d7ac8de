//! Writes `assets/samples/soft_skin.csv`: a simulated recording of a soft skin with seven magnetometer-like channels over a
//! 20 mm × 20 mm pad, pressed by a finger at sixty places: `cargo run --example soft_skin > assets/samples/soft_skin.csv`.
//!
//! The pad is viscoelastic. With the force f(t) of the finger, its compression u follows the standard linear solid
//! u = f/k + w, τ dw/dt = f/k₂ − w, so that loading and unloading differ (hysteresis). Channel i at (xᵢ, yᵢ) reads
//! bᵢ + sᵢ u exp(−d²/(2 r²)), d the distance to the finger and r growing with u, with noise and slow drift.
#![expect(clippy::print_stdout, reason = "an example's result is what it prints")]

use std::f64::consts::PI;

/// Positions pressed, samples of each press, and the time between samples in seconds.
const PRESSES: usize = 60;
const SAMPLES: usize = 15;
const INTERVAL_S: f64 = 0.02;
/// Channels: position in millimetres, offset in millitesla, sensitivity in millitesla per millimetre.
const CHANNELS: [(f64, f64, f64, f64); 7] = [
    (10.0, 10.0, 0.42, 1.31),
    (3.0, 6.0, -0.18, 1.12),
    (10.0, 2.5, 0.07, 1.25),
    (17.0, 6.0, 0.31, 0.96),
    (17.0, 14.0, -0.25, 1.18),
    (10.0, 17.5, 0.15, 1.05),
    (3.0, 14.0, -0.06, 1.22),
];
/// Stiffness of the two springs in N/mm, and the time constant of the damper in seconds.
const STIFFNESS: (f64, f64) = (4.0, 14.0);
const TIME_CONSTANT_S: f64 = 0.12;
/// Standard deviation of the noise, and of the drift from press to press, in millitesla.
const NOISE_MT: f64 = 0.006;
const DRIFT_MT: f64 = 0.004;

/// SplitMix64 (Steele, Lea and Flood 2014), enough for numbers that look random.
struct Random(u64);

impl Random {
    /// Returns a number between 0 and 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a normally distributed number by the Box-Muller transform.
    fn normal(&mut self) -> f64 {
        let (radius, angle) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * radius.ln()).sqrt() * (2.0 * PI * angle).cos()
    }
}

fn main() {
    let mut random = Random(2026);
    let mut drift_mt = [0.0; CHANNELS.len()];
    let channels: Vec<String> = (1..=CHANNELS.len()).map(|channel| format!("b{channel} (mT)")).collect();
    println!("time (s),press,{},force (N),x (mm),y (mm)", channels.join(","));
    let mut time_s = 0.0;
    for press in 1..=PRESSES {
        let (x_mm, y_mm) = (3.0 + 14.0 * random.uniform(), 3.0 + 14.0 * random.uniform());
        let peak_n = 1.0 + 5.0 * random.uniform();
        drift_mt
            .iter_mut()
            .for_each(|drift| *drift += DRIFT_MT * random.normal());
        let mut creep_mm = 0.0;
        for sample in 0..SAMPLES {
            let phase = (sample as f64 + 1.0) / (SAMPLES as f64 + 1.0);
            let force_n = peak_n * (PI * phase).sin();
            creep_mm += INTERVAL_S / TIME_CONSTANT_S * (force_n / STIFFNESS.1 - creep_mm);
            let compression_mm = force_n / STIFFNESS.0 + creep_mm;
            let radius_mm = 4.5 + compression_mm;
            let mut line = format!("{time_s:.2},{press}");
            for ((x, y, offset_mt, sensitivity), drift) in CHANNELS.iter().zip(drift_mt) {
                let distance_squared = (x - x_mm).powi(2) + (y - y_mm).powi(2);
                let field_mt = sensitivity * compression_mm * (-0.5 * distance_squared / radius_mm.powi(2)).exp();
                line += &format!(",{:.4}", offset_mt + drift + field_mt + NOISE_MT * random.normal());
            }
            println!("{line},{force_n:.3},{x_mm:.2},{y_mm:.2}");
            time_s += INTERVAL_S;
        }
        time_s += 0.5;
    }
}
