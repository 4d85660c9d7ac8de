use std::fmt;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use serde::{Deserialize, Serialize};

/// Seed of a run, from which all its randomness follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Seed(pub u64);

/// Purpose of a random stream. Each purpose has its own stream, so that, for example, more training samples change
/// neither the test set nor the initial weights of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Deformations of the training (and validation) set.
    Training,
    /// Deformations of the test set.
    Test,
    /// Initial weights of the network.
    Start,
    /// Selection of held-out samples, and division into folds.
    Split,
    /// Seeds of the repeats and folds of a cross-validation.
    Folds,
    /// Noise in the readings of the training (and validation) set.
    TrainingNoise,
    /// Noise in the readings of the test set.
    TestNoise,
    /// Monte Carlo estimates of expectations, such as the spread of a scene.
    Expectation,
}

/// First stream of the restarts after the first.
const FURTHER_STARTS: u64 = 1 << 32;

impl Seed {
    /// Returns the random generator for one purpose.
    pub fn rng(self, stream: Stream) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.0);
        rng.set_stream(stream as u64);
        rng
    }

    /// Returns the random generator for the initial weights of restart `start`, from 0. Restart 0 uses
    /// [`Stream::Start`].
    pub fn start_rng(self, start: usize) -> ChaCha8Rng {
        let mut rng = self.rng(Stream::Start);
        if start > 0 {
            rng.set_stream(FURTHER_STARTS + start as u64);
        }
        rng
    }
}

impl fmt::Display for Seed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
