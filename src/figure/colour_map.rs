//! Colours by value, baked into a table.

use std::sync::OnceLock;

use colorgrad::{BlendMode, Color, Gradient, GradientBuilder, LinearGradient};

/// Red, green, blue.
pub type Rgb = [u8; 3];

const ENTRIES: usize = 256;

/// 256 colours over 0..=1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColourMap {
    entries: Vec<Rgb>,
}

impl ColourMap {
    /// Viridis: perceptually even, told apart also in grey and by colour-blind readers.
    pub fn viridis() -> &'static Self {
        static VIRIDIS: OnceLock<ColourMap> = OnceLock::new();
        VIRIDIS.get_or_init(|| Self::bake(&colorgrad::preset::viridis()))
    }

    /// From most negative to most positive, blended in Oklab so that equal values of either sign look equally strong.
    pub fn diverging(stops: [Rgb; 5]) -> Self {
        let colours = stops.map(|[red, green, blue]| Color::from_rgba8(red, green, blue, u8::MAX));
        let gradient: LinearGradient = GradientBuilder::new()
            .colors(&colours)
            .mode(BlendMode::Oklab)
            .build()
            .expect("five stops make a gradient");
        let mut map = Self::bake(&gradient);
        // 256 entries have no middle one; give zero its colour exactly, on both sides of it.
        map.entries[ENTRIES / 2 - 1] = stops[2];
        map.entries[ENTRIES / 2] = stops[2];
        map
    }

    fn bake(gradient: &impl Gradient) -> Self {
        let entry = |index: usize| {
            let [red, green, blue, _] = gradient.at(index as f32 / (ENTRIES - 1) as f32).to_rgba8();
            [red, green, blue]
        };
        Self {
            entries: (0..ENTRIES).map(entry).collect(),
        }
    }

    /// The colour at `position` of 0..=1; beyond, the end colours.
    pub fn at(&self, position: f32) -> Rgb {
        // NaN becomes 0 in the conversion.
        self.entries[((position.clamp(0.0, 1.0) * (ENTRIES - 1) as f32 + 0.5) as usize).min(ENTRIES - 1)]
    }
}

/// Returns `true` for a colour on which black is read better than white.
pub fn is_light([red, green, blue]: Rgb) -> bool {
    0.299 * f32::from(red) + 0.587 * f32::from(green) + 0.114 * f32::from(blue) > 110.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_the_middle_colour_exactly() {
        let stops = [[10, 60, 140], [90, 155, 230], [255; 3], [240, 135, 90], [150, 40, 10]];
        let map = ColourMap::diverging(stops);
        assert_eq!([map.at(-3.0), map.at(0.5), map.at(3.0)], [stops[0], stops[2], stops[4]]);
    }

    #[test]
    fn a_missing_value_has_a_colour() {
        assert_eq!(ColourMap::viridis().at(f32::NAN), ColourMap::viridis().at(0.0));
    }
}
