//! The colours of figures: dark enough for paper.

use crate::figure::ColourMap;
pub(super) use crate::figure::Rgb;

pub(super) const INK: Rgb = [0x1b, 0x24, 0x30];
pub(super) const DIM: Rgb = [0x5b, 0x64, 0x72];
pub(super) const GRID: Rgb = [0xe3, 0xe7, 0xee];
pub(super) const BAND: Rgb = [0xee, 0xf1, 0xf5];
pub(super) const MISSING: Rgb = [0xf3, 0xf5, 0xf8];

/// The colour of a series, told apart also in grey and by most colour-blind readers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hue {
    /// The network's own result.
    Blue,
    /// The results that it is compared with.
    Red,
    /// A second comparison.
    Green,
    /// A third.
    Orange,
    /// A fourth.
    Violet,
    /// A fifth.
    Cyan,
    /// References and bounds.
    Grey,
}

impl Hue {
    pub(super) fn rgb(self) -> Rgb {
        match self {
            Self::Blue => [0x1f, 0x6f, 0xeb],
            Self::Red => [0xc6, 0x2f, 0x2f],
            Self::Green => [0x1a, 0x7f, 0x4b],
            Self::Orange => [0xa8, 0x64, 0x00],
            Self::Violet => [0x7a, 0x3e, 0xb1],
            Self::Cyan => [0x0b, 0x76, 0x8c],
            Self::Grey => DIM,
        }
    }
}

/// Viridis over 0..=1; beyond, its ends.
pub(super) fn viridis(position: f64) -> Rgb {
    ColourMap::viridis().at(position as f32)
}

/// Ink on light colours, white on dark ones.
pub(super) fn contrast([red, green, blue]: Rgb) -> Rgb {
    let luma = 0.299 * f64::from(red) + 0.587 * f64::from(green) + 0.114 * f64::from(blue);
    if luma > 120.0 { INK } else { [255; 3] }
}
