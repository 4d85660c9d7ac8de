//! Colours by value, baked into a table.

use colorgrad::{BlendMode, Color, Gradient, GradientBuilder, LinearGradient};
use eframe::egui::Color32;

use super::tokens::Palette;

const ENTRIES: usize = 256;

/// 256 colours over 0..=1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColourMap {
    entries: Vec<Color32>,
}

impl ColourMap {
    pub(super) fn viridis() -> Self {
        Self::bake(&colorgrad::preset::viridis())
    }

    /// Blended in Oklab, so that equal errors of either sign look equally strong.
    pub(super) fn diverging(palette: &Palette) -> Self {
        let stops: Vec<Color> = palette
            .error_stops
            .iter()
            .map(|stop| Color::from_rgba8(stop.r(), stop.g(), stop.b(), u8::MAX))
            .collect();
        let gradient: LinearGradient = GradientBuilder::new()
            .colors(&stops)
            .mode(BlendMode::Oklab)
            .build()
            .expect("five stops make a gradient");
        let mut map = Self::bake(&gradient);
        // 256 entries have no middle one; give zero the panel's colour exactly, on both sides of it.
        map.entries[ENTRIES / 2 - 1] = palette.panel;
        map.entries[ENTRIES / 2] = palette.panel;
        map
    }

    fn bake(gradient: &impl Gradient) -> Self {
        let entry = |index: usize| {
            let [red, green, blue, _] = gradient.at(index as f32 / (ENTRIES - 1) as f32).to_rgba8();
            Color32::from_rgb(red, green, blue)
        };
        Self {
            entries: (0..ENTRIES).map(entry).collect(),
        }
    }

    /// The colour at `position` of 0..=1; beyond, the end colours.
    pub fn at(&self, position: f32) -> Color32 {
        // NaN becomes 0 in the conversion.
        self.entries[((position.clamp(0.0, 1.0) * (ENTRIES - 1) as f32 + 0.5) as usize).min(ENTRIES - 1)]
    }
}

#[cfg(test)]
mod tests {

    use crate::app::theme::Theme;

    #[test]
    fn zero_error_has_the_colour_of_the_panel() {
        for theme in [Theme::dark(), Theme::light()] {
            assert_eq!(theme.errors.at(0.5), theme.palette.panel);
            assert_eq!(theme.errors.at(-3.0), theme.palette.error_stops[0]);
            assert_eq!(theme.errors.at(3.0), theme.palette.error_stops[4]);
        }
    }

    #[test]
    fn a_missing_value_has_a_colour() {
        assert_eq!(Theme::dark().heights.at(f32::NAN), Theme::dark().heights.at(0.0));
    }
}
