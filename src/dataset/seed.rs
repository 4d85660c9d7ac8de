use std::fmt;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use serde::{Deserialize, Serialize};

/// The one number from which everything random in a run follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Seed(pub u64);

/// What randomness is for. Each use has a stream of its own, so that, say, more training samples change neither the
/// test set nor the start of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Deformations of the training (and validation) set.
    Training,
    /// Deformations of the test set.
    Test,
    /// Initial weights of the network.
    Start,
    /// Which samples are held out for validation.
    Split,
    /// Which samples are in which fold of a cross-validation.
    Folds,
    /// What disturbs the readings of the training (and validation) set.
    TrainingNoise,
    /// What disturbs the readings of the test set.
    TestNoise,
    /// Draws that estimate an expectation, such as the spread of a scene.
    Expectation,
}

/// Streams from here on are those of the starts after the first.
const FURTHER_STARTS: u64 = 1 << 32;

impl Seed {
    /// The generator of one use.
    pub fn rng(self, stream: Stream) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.0);
        rng.set_stream(stream as u64);
        rng
    }

    /// The generator of the initial weights of start number `start`, from 0. Start 0 has that of [`Stream::Start`].
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
