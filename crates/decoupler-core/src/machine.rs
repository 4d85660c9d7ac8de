//! The machine that the program runs on: its memory and speed, from which the memory and time of a run are estimated
//! before it starts.

mod budget;

use std::{env, fmt, fs, hint::black_box, sync::OnceLock, time::Instant};

pub use budget::{OverBudget, ReadingBudget};

use faer::{Accum, Mat, Par, linalg::matmul::matmul};
use glam::DVec3;

use crate::sensor::{ArrayScale, SensorModel};

/// Memory available to trainings: that of the machine, or the limit of its container, or the limit given by the user.
/// [`Self::ASSUMED_BYTES`] if none is known.
///
/// Only Linux reports its memory in a file. Other systems would need `unsafe` calls, or a crate of thousands of lines
/// for one number; use the variable there, or to use less than the memory of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MachineMemory {
    /// Size in bytes.
    pub bytes: u64,
    /// Source of the size.
    pub source: MemorySource,
}

/// Source of the size of the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemorySource {
    /// The system.
    System,
    /// The user, by [`MachineMemory::limit`] or [`MachineMemory::VARIABLE`].
    User,
    /// Assumed, since neither is known.
    Assumed,
}

static MEMORY: OnceLock<MachineMemory> = OnceLock::new();

impl MachineMemory {
    /// Memory that is assumed if the system does not report it: that of an ordinary machine.
    pub const ASSUMED_BYTES: u64 = 8_000_000_000;
    /// Environment variable with the memory that the program may use, in GB (10⁹ bytes).
    pub const VARIABLE: &str = "DECOUPLER_MEMORY_GB";

    /// Limits the memory that the program may use, instead of [`Self::VARIABLE`]. Without effect after the first call of
    /// [`Self::of_this_machine`].
    pub fn limit(gigabytes: f64) {
        MEMORY.get_or_init(|| Self::from_texts(Some(&gigabytes.to_string()), None, None));
    }

    /// Returns the memory of this machine, which is read on the first call.
    pub fn of_this_machine() -> Self {
        *MEMORY.get_or_init(|| {
            let given = env::var(Self::VARIABLE).ok();
            let meminfo = fs::read_to_string("/proc/meminfo").ok();
            let limit = fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
            Self::from_texts(given.as_deref(), meminfo.as_deref(), limit.as_deref())
        })
    }

    /// Evaluates the texts of the variable, of `/proc/meminfo` and of the container's limit. A variable that is not a
    /// number above 0 is ignored; the error message of a run that needs too much memory names the variable again.
    fn from_texts(given: Option<&str>, meminfo: Option<&str>, limit: Option<&str>) -> Self {
        let gigabytes = given.and_then(|text| text.trim().parse().ok());
        if let Some(gigabytes) = gigabytes.filter(|gigabytes: &f64| *gigabytes > 0.0) {
            return Self {
                // Saturates, also at infinity.
                bytes: (gigabytes * 1e9) as u64,
                source: MemorySource::User,
            };
        }
        let limit = limit.and_then(|text| text.trim().parse().ok());
        let least = [meminfo.and_then(total_bytes), limit].into_iter().flatten().min();
        let of_system = least.map(|bytes| Self {
            bytes,
            source: MemorySource::System,
        });
        of_system.unwrap_or(Self {
            bytes: Self::ASSUMED_BYTES,
            source: MemorySource::Assumed,
        })
    }
}

impl fmt::Display for MachineMemory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (gigabytes, variable) = (self.bytes as f64 * 1e-9, Self::VARIABLE);
        match self.source {
            MemorySource::System => write!(f, "the machine has {gigabytes:.1} GB"),
            MemorySource::User => write!(f, "--memory-limit or {variable} allows {gigabytes:.1} GB"),
            MemorySource::Assumed => write!(
                f,
                "{gigabytes:.1} GB are assumed, since the system does not report its memory (set the environment variable \
                 {variable} to the GB that the machine has)"
            ),
        }
    }
}

fn total_bytes(meminfo: &str) -> Option<u64> {
    let total = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = total.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Work per second on one thread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Speed {
    /// Multiplications in large matrix products.
    pub(crate) multiplications: f64,
    /// Pairs of a row-wire node and a column-wire node, in resistances.
    pub(crate) node_pairs: f64,
}

impl Speed {
    /// Returns the speed, which is measured on the first call in about 20 ms.
    pub(crate) fn measured() -> Self {
        static SPEED: OnceLock<Speed> = OnceLock::new();
        *SPEED.get_or_init(|| Self {
            multiplications: multiplications_per_second(),
            node_pairs: node_pairs_per_second(),
        })
    }
}

/// Returns the best rate of a few repetitions, the first of which warms the caches.
fn rate(work: f64, mut run: impl FnMut()) -> f64 {
    const REPETITIONS: usize = 4;
    let seconds = (0..REPETITIONS).map(|_| {
        let begun = Instant::now();
        run();
        begun.elapsed().as_secs_f64()
    });
    work / seconds.fold(f64::INFINITY, f64::min).max(1e-9)
}

fn multiplications_per_second() -> f64 {
    const SIZE: usize = 256;
    let factor = Mat::from_fn(SIZE, SIZE, |row, column| (row * 7 + column * 3) as f64 * 1e-3);
    let mut product = Mat::zeros(SIZE, SIZE);
    rate(SIZE.pow(3) as f64, || {
        matmul(product.as_mut(), Accum::Replace, &factor, &factor, 1.0, Par::Seq);
        black_box(&product);
    })
}

fn node_pairs_per_second() -> f64 {
    const ROWS: usize = 200;
    let sensor = SensorModel::new(ArrayScale::default());
    let scale = sensor.scale;
    let at_rest = vec![DVec3::ZERO; scale.nodes_per_row()];
    let mut resistances_ohm = vec![0.0; scale.columns()];
    rate(ROWS as f64 * node_pairs_per_row(&sensor), || {
        for row in 0..ROWS {
            // The default sensor has resistances at rest.
            let _ = sensor.row_resistances_into(row % scale.rows(), &at_rest, &mut resistances_ohm);
            black_box(&resistances_ohm);
        }
    })
}

/// Number of node pairs in the resistances of a row-wire.
pub(crate) fn node_pairs_per_row(sensor: &SensorModel) -> f64 {
    let scale = sensor.scale;
    scale.nodes_per_row() as f64 * scale.nodes_per_column() as f64 * scale.columns() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMINFO: &str = "MemTotal:       24683956 kB\nMemFree:        24097000 kB\n";

    #[test]
    fn the_memory_is_the_smaller_of_machine_and_container() {
        let memory = |meminfo, limit| MachineMemory::from_texts(None, meminfo, limit);
        let known = |bytes| MachineMemory {
            bytes,
            source: MemorySource::System,
        };
        assert_eq!(memory(Some(MEMINFO), None), known(24_683_956 * 1024));
        assert_eq!(memory(Some(MEMINFO), Some("max\n")), known(24_683_956 * 1024));
        assert_eq!(memory(Some(MEMINFO), Some("1000000\n")), known(1_000_000));
        assert_eq!(memory(Some(MEMINFO), None).to_string(), "the machine has 25.3 GB");
    }

    #[test]
    fn without_a_reported_size_the_message_names_the_assumption_and_the_variable() {
        let memory = MachineMemory::from_texts(None, Some("MemFree: 5 kB\n"), None);
        let assumed = (MachineMemory::ASSUMED_BYTES, MemorySource::Assumed);
        assert_eq!((memory.bytes, memory.source), assumed);
        let text = memory.to_string();
        assert!(
            text.contains("8.0 GB are assumed") && text.contains("DECOUPLER_MEMORY_GB"),
            "{text}"
        );
    }

    #[test]
    fn the_variable_overrides_the_memory() {
        let memory = |given| MachineMemory::from_texts(Some(given), Some(MEMINFO), Some("1000000"));
        assert_eq!(memory("64").bytes, 64_000_000_000);
        assert_eq!(
            memory(" 0.5\n").to_string(),
            "--memory-limit or DECOUPLER_MEMORY_GB allows 0.5 GB"
        );
        assert_eq!(memory("inf").bytes, u64::MAX);
        for refused in ["", "much", "0", "-3", "NaN"] {
            assert_eq!(memory(refused).bytes, 1_000_000, "{refused}");
        }
    }
}
