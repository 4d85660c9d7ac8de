//! The colours of figures: dark enough for paper.

use crate::figure::Hue;
pub(super) use crate::figure::Rgb;

pub(super) const INK: Rgb = [0x1b, 0x24, 0x30];
pub(super) const DIM: Rgb = [0x5b, 0x64, 0x72];
pub(super) const GRID: Rgb = [0xe3, 0xe7, 0xee];
pub(super) const MISSING: Rgb = [0xf3, 0xf5, 0xf8];

/// A hue in print.
pub(super) fn rgb(hue: Hue) -> Rgb {
    match hue {
        Hue::Blue => [0x1f, 0x6f, 0xeb],
        Hue::Red => [0xc6, 0x2f, 0x2f],
        Hue::Green => [0x1a, 0x7f, 0x4b],
        Hue::Orange => [0xa8, 0x64, 0x00],
        Hue::Violet => [0x7a, 0x3e, 0xb1],
        Hue::Cyan => [0x0b, 0x76, 0x8c],
        Hue::Grey => DIM,
        Hue::Ink => INK,
    }
}

/// A colour this much paler, from 0 (itself) to 1 (white).
pub(super) fn pale(colour: Rgb, paler: f64) -> Rgb {
    colour.map(|part| (f64::from(part) + paler * (255.0 - f64::from(part))).round() as u8)
}

/// Ink on light colours, white on dark ones.
pub(super) fn contrast([red, green, blue]: Rgb) -> Rgb {
    let luma = 0.299 * f64::from(red) + 0.587 * f64::from(green) + 0.114 * f64::from(blue);
    if luma > 120.0 { INK } else { [255; 3] }
}
