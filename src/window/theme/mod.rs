//! Appearance of the window: design tokens, colour maps, fonts and egui's visuals.
//!
//! Panels use colours, sizes and distances from here and define none of their own.

#[cfg(test)]
mod contrast;
mod style;
mod tokens;

pub use style::{apply, font_definitions, install, semibold};
pub use tokens::{Palette, SPACE, TypeSizes, radius, space, type_size};

use std::sync::OnceLock;

use eframe::egui::Color32;

use decoupler_files::figure::{ColourMap, Rgb};

/// Dark or light theme.
#[derive(Clone, Debug, PartialEq)]
pub struct Theme {
    /// True for light text on dark panels.
    pub is_dark: bool,
    /// Named colours.
    pub palette: Palette,
    /// Diverging colour map of errors; zero has the colour of the panel.
    pub errors: ColourMap,
}

impl Theme {
    /// Returns the dark or the light theme.
    pub fn get(is_dark: bool) -> &'static Self {
        static THEMES: OnceLock<[Theme; 2]> = OnceLock::new();
        &THEMES.get_or_init(|| [false, true].map(Theme::new))[usize::from(is_dark)]
    }

    /// Returns the theme of `ui`.
    pub fn of(ui: &eframe::egui::Ui) -> &'static Self {
        Self::get(ui.visuals().dark_mode)
    }

    fn new(is_dark: bool) -> Self {
        let palette = if is_dark { Palette::DARK } else { Palette::LIGHT };
        Self {
            is_dark,
            palette,
            errors: ColourMap::diverging(palette.error_stops.map(|stop| [stop.r(), stop.g(), stop.b()])),
        }
    }
}

/// Returns an opaque colour.
pub fn rgb([red, green, blue]: Rgb) -> Color32 {
    Color32::from_rgb(red, green, blue)
}
