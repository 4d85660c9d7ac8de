//! Peak memory of a training, measured in a separate process.

use std::{fs, process::Command};

use decoupler_core::{network::Shape, training::Method};
use rayon::ThreadPoolBuilder;

use crate::problem::Sizes;

/// Argument that starts this program as the measured process.
const FLAG: &str = "--peak-of";

/// Returns the peak memory in megabytes of a process that trains a few epochs of Levenberg-Marquardt on one thread;
/// `None` if the system does not report it.
pub(crate) fn peak_mb(sizes: Sizes) -> Option<f64> {
    let Sizes { shape, samples } = sizes;
    let numbers = [shape.inputs, shape.hidden, shape.outputs, samples].map(|number| number.to_string());
    let program = std::env::current_exe().ok()?;
    let output = Command::new(program).arg(FLAG).args(numbers).output().ok()?;
    let kilobytes: f64 = String::from_utf8(output.stdout).ok()?.trim().parse().ok()?;
    Some(kilobytes * 1024.0 / 1e6)
}

/// Returns the sizes to train if this is the measured process.
pub(crate) fn asked(arguments: &[String]) -> Option<Sizes> {
    let (flag, numbers) = arguments.split_first()?;
    let numbers: Vec<usize> = numbers.iter().filter_map(|number| number.parse().ok()).collect();
    match *numbers {
        [inputs, hidden, outputs, samples] if flag == FLAG => Some(Sizes {
            shape: Shape {
                inputs,
                hidden,
                outputs,
            },
            samples,
        }),
        _ => None,
    }
}

/// Trains and prints the peak memory in kilobytes, as Linux reports it.
pub(crate) fn print_peak(sizes: Sizes) {
    let pool = ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("the thread pool can be built").install(|| {
        let mut trainer = sizes.trainer(Method::default());
        (0..3).for_each(|_| {
            trainer.step();
        });
    });
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    println!("{}", line.unwrap_or_default().trim().trim_end_matches(" kB"));
}
