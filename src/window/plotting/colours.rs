use eframe::egui::Color32;

use crate::window::theme::Palette;
use decoupler_files::figure::Hue;

/// A hue in the theme.
pub fn hue_colour(hue: Hue, palette: &Palette) -> Color32 {
    match hue {
        Hue::Blue => palette.accent,
        Hue::Red => palette.bad,
        Hue::Green => palette.good,
        Hue::Orange => palette.warning,
        Hue::Violet => palette.violet,
        Hue::Cyan => palette.cyan,
        Hue::Grey => palette.dim,
        Hue::Ink => palette.text,
    }
}
