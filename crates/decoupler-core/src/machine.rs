//! Memory and speed of the machine. A program passes the memory in as a [`MemoryBudget`]; the speed is measured, to estimate the
//! time of a run before it starts.

use std::{fmt, hint::black_box, sync::OnceLock, time::Instant};

use faer::{Accum, Mat, Par, linalg::matmul::matmul};
use glam::DVec3;

use crate::sensor::{ArrayScale, SensorModel};

/// Memory in bytes that trainings may use, by its source for messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryBudget {
    /// Reported by the system.
    System(u64),
    /// Set by the user, by the option `--memory-limit` or [`MemoryBudget::VARIABLE`].
    User(u64),
    /// Assumed, since neither is known.
    Assumed(u64),
}

impl MemoryBudget {
    /// Memory that is assumed if the system does not report it: that of an ordinary machine.
    pub const ASSUMED_BYTES: u64 = 8_000_000_000;
    /// No limit, for work that is known to be small.
    pub const UNLIMITED: Self = Self::Assumed(u64::MAX);
    /// Environment variable with the memory that the program may use, in GB (10⁹ bytes).
    pub const VARIABLE: &str = "DECOUPLER_MEMORY_GB";

    /// Size in bytes.
    pub fn bytes(self) -> u64 {
        match self {
            Self::System(bytes) | Self::User(bytes) | Self::Assumed(bytes) => bytes,
        }
    }
}

impl fmt::Display for MemoryBudget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (gigabytes, variable) = (self.bytes() as f64 * 1e-9, Self::VARIABLE);
        match self {
            Self::System(_) => write!(f, "the machine has {gigabytes:.1} GB"),
            Self::User(_) => write!(f, "the memory limit ({variable}) is {gigabytes:.1} GB"),
            Self::Assumed(_) => write!(
                f,
                "{gigabytes:.1} GB are assumed, since the system does not report its memory (set the environment variable \
                 {variable} to the GB that the machine has)"
            ),
        }
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

/// Returns the number of multiplications in large matrix products per second on one thread, which is measured on the first
/// call in about 10 ms.
pub(crate) fn multiplications_per_second() -> f64 {
    const SIZE: usize = 256;
    static SPEED: OnceLock<f64> = OnceLock::new();
    *SPEED.get_or_init(|| {
        let factor = Mat::from_fn(SIZE, SIZE, |row, column| (row * 7 + column * 3) as f64 * 1e-3);
        let mut product = Mat::zeros(SIZE, SIZE);
        rate(SIZE.pow(3) as f64, || {
            matmul(product.as_mut(), Accum::Replace, &factor, &factor, 1.0, Par::Seq);
            black_box(&product);
        })
    })
}

/// Returns the number of pairs of a row-wire node and a column-wire node in resistances per second on one thread, which is
/// measured on the first call in about 10 ms.
pub(crate) fn node_pairs_per_second() -> f64 {
    const ROWS: usize = 200;
    static SPEED: OnceLock<f64> = OnceLock::new();
    *SPEED.get_or_init(|| {
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
    })
}

/// Number of node pairs in the resistances of a row-wire.
pub fn node_pairs_per_row(sensor: &SensorModel) -> f64 {
    let scale = sensor.scale;
    scale.nodes_per_row() as f64 * scale.nodes_per_column() as f64 * scale.columns() as f64
}
