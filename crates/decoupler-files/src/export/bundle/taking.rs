use super::{fixed_point::FixedNetworks, weights::Digits};

/// Form in which a bundle takes readings, and to which its callers round what they have.
#[derive(Clone, Copy, Debug)]
pub(super) enum Taking<'a> {
    /// Double precision.
    Double,
    /// Single precision.
    Single,
    /// Whole numbers of units.
    Whole(&'a FixedNetworks),
}

/// Changes of the outputs by rounding the readings to the form that a bundle takes, relative to their scales.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingRounding {
    /// Largest change found.
    pub largest: f64,
    /// Largest change possible, to first order, at the readings that were tried.
    pub bound: f64,
}

impl Taking<'_> {
    /// The number that a bundle is given for a reading of a channel.
    pub(super) fn rounded(self, channel: usize, reading: f64) -> f64 {
        match self {
            Self::Double => reading,
            Self::Single => Digits::Single.round(reading),
            Self::Whole(networks) => networks.representable(channel, reading),
        }
    }

    /// Largest rounding error of a reading of a channel.
    pub(super) fn error(self, channel: usize, reading: f64) -> f64 {
        match self {
            Self::Double => 0.0,
            Self::Single => {
                let of_digits = reading.abs() * Digits::Single.unit_roundoff();
                // Below the smallest normal number there are fewer digits.
                of_digits.max(0.5 * f64::from(f32::from_bits(1)))
            }
            Self::Whole(networks) => 0.5 * networks.readings.unit(channel),
        }
    }
}

impl ReadingRounding {
    /// Largest change with which a bundle is still written.
    pub(super) const LARGEST: f64 = 0.01;

    /// The larger of both figures.
    pub fn worst(self) -> f64 {
        if self.largest.is_nan() {
            f64::NAN
        } else {
            self.largest.max(self.bound)
        }
    }
}
