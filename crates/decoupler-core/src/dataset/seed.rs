use std::fmt;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use serde::{Deserialize, Serialize};

/// Seed of all random numbers of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Seed(pub u64);

/// Purpose of random numbers. Each purpose has its own stream: more training samples, for example, change neither the
/// test set nor the initial weights of the network.
///
/// The number of a stream is part of every data set drawn from it: never change one, and give new purposes new numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Deformations of the training (and validation) set.
    Training = 0,
    /// Deformations of the test set.
    Test = 1,
    /// Initial weights of the network.
    Start = 2,
    /// Selection of held-out samples, and division into folds.
    Split = 3,
    /// Seeds of the repeats and folds of a cross-validation.
    Folds = 4,
    /// Noise of the training (and validation) set.
    TrainingNoise = 5,
    /// Noise of the test set.
    TestNoise = 6,
    /// Draws that estimate an expectation, such as the mean and covariance of a scene.
    Expectation = 7,
    /// Path of the simulated live source.
    Live = 8,
    /// Noise of the simulated live source.
    LiveNoise = 9,
}

/// Offset of the streams of all random initialisations after the first: initialisation k uses this number plus k.
const FURTHER_STARTS: u64 = 1 << 32;

impl Seed {
    /// Random number generator for one purpose.
    pub fn rng(self, stream: Stream) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.0);
        rng.set_stream(stream as u64);
        rng
    }

    /// Random number generator for the initial weights of restart `start`, counted from 0. Restart 0 uses
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

#[cfg(test)]
mod tests {
    use rand::Rng;

    use super::*;

    /// Literal values, to detect a renumbered stream, which would draw other data sets.
    #[test]
    fn every_stream_keeps_its_numbers() {
        let streams = [
            Stream::Training,
            Stream::Test,
            Stream::Start,
            Stream::Split,
            Stream::Folds,
            Stream::TrainingNoise,
            Stream::TestNoise,
            Stream::Expectation,
        ];
        let first = streams.map(|stream| Seed(0).rng(stream).next_u64());
        let expected: [u64; 8] = [
            13_080_132_717_333_068_652,
            13_937_087_304_575_520_531,
            6_128_383_831_660_698_443,
            722_560_577_158_678_697,
            15_789_455_820_715_750_791,
            3_283_172_953_191_924_410,
            2_864_297_967_017_666_925,
            10_210_632_076_967_111_328,
        ];
        assert_eq!(first, expected);
        let starts = [0, 1, 2].map(|start| Seed(0).start_rng(start).next_u64());
        let expected: [u64; 3] = [
            6_128_383_831_660_698_443,
            17_511_776_552_961_250_555,
            13_920_962_125_768_239_384,
        ];
        assert_eq!(starts, expected);
    }
}
