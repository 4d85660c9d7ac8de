//! Scaling of the time and memory of an epoch with the samples of a whole run.

use std::{fs, process::Command};

use decoupler_core::evaluation::{Run, RunSettings, TrainingSize, Workload};
use rayon::ThreadPoolBuilder;

use crate::{
    exponent::exponent,
    timing::{median, time_ms},
};

/// Argument that starts this program as the measured process.
const FLAG: &str = "--peak-of-run";
const SAMPLES: [usize; 5] = [1000, 10_000, 100_000, 300_000, 999_000];

pub(crate) fn print() {
    println!("\n## A run of 10×10_5×30 with 12 hidden nodes, Levenberg-Marquardt, one thread\n");
    println!("Memory is the peak of a process, minus that of one with 100 samples.\n");
    println!("| samples | ms per epoch | peak, MB | estimated, MB |\n|---:|---:|---:|---:|");
    let min_mb = peak_mb(100);
    let mut times = Vec::new();
    for samples in SAMPLES {
        let ms = epoch_ms(samples);
        times.push(ms);
        let peak = match (peak_mb(samples), min_mb) {
            (Some(peak), Some(min)) => format!("{:.0}", peak - min),
            _ => "not available".to_owned(),
        };
        let estimated =
            Workload::of(&settings(samples), TrainingSize::drawn(&settings(samples)).unwrap()).bytes as f64 * 1e-6;
        println!("| {samples} | {ms:.1} | {peak} | {estimated:.0} |");
    }
    println!("\nExponent {:.2}.", exponent(&SAMPLES, &times));
}

fn settings(samples: usize) -> RunSettings {
    let mut settings = RunSettings::default();
    settings.simulation_mut().unwrap().samples = samples;
    settings
}

/// Runs `work` on one thread.
fn on_one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let pool = ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("the thread pool can be built").install(work)
}

fn epoch_ms(samples: usize) -> f64 {
    on_one_thread(|| {
        let mut run = Run::prepare(settings(samples)).unwrap();
        let epochs = if samples > 100_000 { 3 } else { 7 };
        median(&mut Vec::from_iter((0..epochs).map(|_| time_ms(|| run.step()))))
    })
}

fn peak_mb(samples: usize) -> Option<f64> {
    let program = std::env::current_exe().ok()?;
    let output = Command::new(program).arg(FLAG).arg(samples.to_string()).output().ok()?;
    let kilobytes: f64 = String::from_utf8(output.stdout).ok()?.trim().parse().ok()?;
    Some(kilobytes * 1024.0 / 1e6)
}

/// Returns the number of samples to train on if this is the measured process.
pub(crate) fn asked(arguments: &[String]) -> Option<usize> {
    match arguments {
        [flag, samples] if flag == FLAG => samples.parse().ok(),
        _ => None,
    }
}

/// Trains and prints the peak memory in kilobytes, as Linux reports it.
pub(crate) fn print_peak(samples: usize) {
    on_one_thread(|| {
        let mut run = Run::prepare(settings(samples)).unwrap();
        (0..2).for_each(|_| {
            run.step();
        });
    });
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    println!("{}", line.unwrap_or_default().trim().trim_end_matches(" kB"));
}
