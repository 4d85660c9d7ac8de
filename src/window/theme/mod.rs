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
    /// Returns the dark theme.
    pub fn dark() -> &'static Self {
        static DARK: OnceLock<Theme> = OnceLock::new();
        DARK.get_or_init(|| Self::new(true))
    }

    /// Returns the light theme.
    pub fn light() -> &'static Self {
        static LIGHT: OnceLock<Theme> = OnceLock::new();
        LIGHT.get_or_init(|| Self::new(false))
    }

    /// Returns the theme of `ui`.
    pub fn of(ui: &eframe::egui::Ui) -> &'static Self {
        if ui.visuals().dark_mode {
            Self::dark()
        } else {
            Self::light()
        }
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
