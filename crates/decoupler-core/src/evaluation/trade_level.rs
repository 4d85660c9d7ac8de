use super::{
    TradeOffPoint,
    trade::{fastest_under, most_accurate_under, pareto_front},
};

/// Cost weighed against the error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TradeOffCost {
    /// Time to decode a frame on one thread.
    #[default]
    Decoding,
    /// Processor time of training and fitting.
    Training,
}

impl TradeOffCost {
    /// Both costs, in the order offered to the user.
    pub const ALL: [Self; 2] = [Self::Decoding, Self::Training];

    /// Returns the cost (microseconds of decoding, or seconds of training) and the error in percent.
    pub fn of(self, point: &TradeOffPoint) -> (f64, f64) {
        match self {
            Self::Decoding => point.decoding(),
            Self::Training => point.training(),
        }
    }

    /// Returns the name of the cost with its unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::Decoding => "time to decode a frame (µs)",
            Self::Training => "training time (s)",
        }
    }
}

/// Limits of the questions "fastest under" and "most accurate under".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TradeOffLimits {
    /// Largest error, in percent.
    pub percent: f64,
    /// Longest time of a frame, in microseconds.
    pub microseconds: f64,
}

impl Default for TradeOffLimits {
    fn default() -> Self {
        Self {
            percent: 1.0,
            microseconds: 10.0,
        }
    }
}

/// Points of the trade-off at one noise level, or on a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffLevel {
    /// Relative error of a reading, if it is simulated.
    pub noise: Option<f64>,
    /// Points in the order in which they were measured.
    pub points: Vec<TradeOffPoint>,
}

impl TradeOffLevel {
    /// Marks the points on the Pareto front for this cost.
    pub fn front(&self, cost: TradeOffCost) -> Vec<bool> {
        let points: Vec<_> = self.points.iter().map(|point| cost.of(point)).collect();
        pareto_front(&points)
    }

    /// Returns the indices of the points that answer "fastest under" and "most accurate under".
    pub fn answers(&self, limits: &TradeOffLimits) -> [Option<usize>; 2] {
        let index = |chosen: Option<&TradeOffPoint>| {
            let chosen = chosen?;
            self.points.iter().position(|point| std::ptr::eq(point, chosen))
        };
        [
            index(fastest_under(&self.points, limits.percent)),
            index(most_accurate_under(&self.points, limits.microseconds)),
        ]
    }
}
