use super::{TradePoint, pareto_front};

/// What is weighed against the error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TradeCost {
    /// Time to decode a frame on one thread.
    #[default]
    Decoding,
    /// Processor time of training and fitting.
    Training,
}

impl TradeCost {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Decoding, Self::Training];

    /// Cost and error of z in percent: microseconds of decoding, or seconds of training.
    pub fn of(self, point: &TradePoint) -> (f64, f64) {
        match self {
            Self::Decoding => point.decoding(),
            Self::Training => point.training(),
        }
    }

    /// The cost and its unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::Decoding => "time to decode a frame (µs)",
            Self::Training => "training time (s)",
        }
    }
}

/// The points at one level of noise.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeLevel {
    /// Relative error of a reading.
    pub noise: f64,
    /// In the order in which they were measured.
    pub points: Vec<TradePoint>,
}

impl TradeLevel {
    /// Which points no other beats at this cost.
    pub fn front(&self, cost: TradeCost) -> Vec<bool> {
        let points: Vec<_> = self.points.iter().map(|point| cost.of(point)).collect();
        pareto_front(&points)
    }
}
