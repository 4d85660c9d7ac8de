use std::fmt;

/// See [`FaultMonitor::PERSISTENCE`](super::FaultMonitor::PERSISTENCE).
pub(super) const PERSISTENCE: usize = 4;
/// See [`FaultMonitor::SURE`](super::FaultMonitor::SURE).
pub(super) const SURE: f64 = 0.99;

/// Faulty wires, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaultyWire {
    /// A row-wire.
    Row(usize),
    /// A column-wire, its amplifier or its converter.
    Column(usize),
    /// This row-wire and the next.
    Rows(usize),
    /// This column-wire and the next.
    Columns(usize),
}

/// Cause of a fault, as far as the readings determine it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultCause {
    /// The readings do not depend on the deformation: the wire is broken at its connector or grounded, or a converter is
    /// stuck.
    NoSignal,
    /// The wire is broken before this node, counted from 0.
    Broken {
        /// First node that is cut off.
        before_node: usize,
    },
    /// The two wires touch.
    Shorted,
    /// Readings are 1 + `relative` times the resistances.
    Gain {
        /// Relative error of the readings.
        relative: f64,
    },
    /// The wire's readings contradict all others in a way that no other cause explains.
    Unknown,
}

/// Fault identified from the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diagnosis {
    /// Faulty wires.
    pub wire: FaultyWire,
    /// Most probable cause.
    pub cause: FaultCause,
    /// Probability of these wires, summed over all causes, given that exactly one fault explains the readings.
    pub probability: f64,
}

impl FaultyWire {
    /// Returns `true` if only the readings of this row-wire are affected.
    pub fn is_row(self, row: usize) -> bool {
        match self {
            Self::Row(faulty) => faulty == row,
            Self::Rows(first) => (first..=first + 1).contains(&row),
            Self::Column(_) | Self::Columns(_) => false,
        }
    }

    /// Returns the faulty column-wires.
    pub fn columns(self) -> [Option<usize>; 2] {
        match self {
            Self::Row(_) | Self::Rows(_) => [None; 2],
            Self::Column(column) => [Some(column), None],
            Self::Columns(first) => [Some(first), Some(first + 1)],
        }
    }
}

impl fmt::Display for FaultyWire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Row(row) => write!(f, "row-wire {}", row + 1),
            Self::Column(column) => write!(f, "column-wire {}", column + 1),
            Self::Rows(first) => write!(f, "row-wires {} and {}", first + 1, first + 2),
            Self::Columns(first) => write!(f, "column-wires {} and {}", first + 1, first + 2),
        }
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.wire)?;
        match (self.cause, self.wire) {
            (FaultCause::NoSignal, FaultyWire::Row(_) | FaultyWire::Rows(_)) => {
                write!(f, "no signal, as if broken at its connector or grounded")
            }
            (FaultCause::NoSignal, _) => {
                write!(f, "no signal, as if broken at its connector or its converter stuck")
            }
            (FaultCause::Broken { before_node }, _) => write!(f, "broken before node {}", before_node + 1),
            (FaultCause::Shorted, _) => write!(f, "the wires touch"),
            (FaultCause::Gain { relative }, _) => {
                write!(
                    f,
                    "gain error of its amplifier, readings off by {:+.2} %",
                    100.0 * relative
                )
            }
            (FaultCause::Unknown, _) => write!(f, "its readings contradict all others"),
        }?;
        write!(f, " (probability {:.4})", self.probability)
    }
}
