//! Colour maps, baked into tables.

use std::sync::LazyLock;

use colorgrad::{BlendMode, Color, Gradient, GradientBuilder, LinearGradient};
use serde::{Deserialize, Serialize};
use strum::EnumMessage as _;

/// Red, green, blue.
pub type Rgb = [u8; 3];

const ENTRIES: usize = 256;

/// Sequential colour maps from which the reader can choose. Their lightness increases evenly, which keeps them readable
/// in grey and for colour-blind readers.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, strum::EnumMessage, strum::IntoStaticStr,
)]
pub enum SequentialMap {
    /// Blue, green, yellow: matplotlib's default.
    #[default]
    #[strum(message = "From blue over green to yellow, even in lightness.")]
    Viridis,
    /// Blue, grey, yellow: looks the same with all kinds of colour vision (Nuñez, Anderton and Renslow 2018).
    #[strum(message = "From blue over grey to yellow: looks nearly the same to readers with any colour vision.")]
    Cividis,
    /// Black, purple, orange, pale yellow.
    #[strum(message = "From black over purple and orange to pale yellow, even in lightness.")]
    Inferno,
}

impl SequentialMap {
    /// All maps.
    pub const ALL: [Self; 3] = [Self::Viridis, Self::Cividis, Self::Inferno];

    /// Returns its usual name.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Description in a sentence.
    pub fn meaning(self) -> &'static str {
        self.get_message().expect("every map has a description")
    }

    /// Its colours.
    pub fn colours(self) -> &'static ColourMap {
        use colorgrad::preset::{cividis, inferno, viridis};
        static MAPS: LazyLock<[ColourMap; 3]> = LazyLock::new(|| {
            let (viridis, cividis, inferno) = (viridis(), cividis(), inferno());
            [
                ColourMap::bake(&viridis),
                ColourMap::bake(&cividis),
                ColourMap::bake(&inferno),
            ]
        });
        &MAPS[self as usize]
    }
}

/// 256 colours over 0..=1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColourMap(Vec<Rgb>);

impl ColourMap {
    /// From most negative to most positive, blended in Oklab so that equal values of either sign look equally strong.
    pub fn diverging(stops: [Rgb; 5]) -> Self {
        let colours = stops.map(|[red, green, blue]| Color::from_rgba8(red, green, blue, u8::MAX));
        let gradient = GradientBuilder::new().colors(&colours).mode(BlendMode::Oklab).build();
        let gradient: LinearGradient = gradient.expect("five stops make a gradient");
        let mut map = Self::bake(&gradient);
        // With 256 entries there is no middle one; both entries next to zero get its exact colour.
        map.0[ENTRIES / 2 - 1] = stops[2];
        map.0[ENTRIES / 2] = stops[2];
        map
    }

    fn bake(gradient: &impl Gradient) -> Self {
        let rgb = |colour: Color| {
            let [red, green, blue, _] = colour.to_rgba8();
            [red, green, blue]
        };
        Self(gradient.colors(ENTRIES).map(rgb).collect())
    }

    /// Returns the colour at `position` in 0..=1; beyond that, the colours of the ends.
    pub fn at(&self, position: f32) -> Rgb {
        // NaN becomes 0 in the conversion.
        self.0[((position.clamp(0.0, 1.0) * (ENTRIES - 1) as f32 + 0.5) as usize).min(ENTRIES - 1)]
    }
}

/// Returns `true` for a colour on which black is more readable than white.
pub fn is_light([red, green, blue]: Rgb) -> bool {
    0.299 * f32::from(red) + 0.587 * f32::from(green) + 0.114 * f32::from(blue) > 110.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_exactly_the_middle_colour() {
        let stops = [[10, 60, 140], [90, 155, 230], [255; 3], [240, 135, 90], [150, 40, 10]];
        let map = ColourMap::diverging(stops);
        assert_eq!([map.at(-3.0), map.at(0.5), map.at(3.0)], [stops[0], stops[2], stops[4]]);
    }

    #[test]
    fn a_missing_value_has_a_colour() {
        let map = SequentialMap::default().colours();
        assert_eq!(map.at(f32::NAN), map.at(0.0));
    }

    /// Linear red, green and blue.
    fn linear(colour: Rgb) -> [f64; 3] {
        colour.map(|part| {
            let part = f64::from(part) / 255.0;
            if part <= 0.040_45 {
                part / 12.92
            } else {
                ((part + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// CIE 1976 L*a*b* of linear sRGB under D65.
    fn lab(rgb: [f64; 3]) -> [f64; 3] {
        const TO_XYZ: [[f64; 3]; 3] = [
            [0.412_456_4, 0.357_576_1, 0.180_437_5],
            [0.212_672_9, 0.715_152_2, 0.072_175_0],
            [0.019_333_9, 0.119_192_0, 0.950_304_1],
        ];
        const WHITE: [f64; 3] = [0.950_47, 1.0, 1.088_83];
        let xyz = times(TO_XYZ, rgb);
        let f = |at: usize| {
            let share = xyz[at] / WHITE[at];
            if share > 216.0 / 24_389.0 {
                share.cbrt()
            } else {
                (24_389.0 / 27.0 * share + 16.0) / 116.0
            }
        };
        [116.0 * f(1) - 16.0, 500.0 * (f(0) - f(1)), 200.0 * (f(1) - f(2))]
    }

    fn times(matrix: [[f64; 3]; 3], vector: [f64; 3]) -> [f64; 3] {
        matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
    }

    /// Severe protanomaly and deuteranomaly in linear light (Machado, Oliveira and Fernandes 2009, severity 1).
    const VISIONS: [[[f64; 3]; 3]; 3] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ];

    #[test]
    fn equal_steps_of_value_look_equal_and_grow_lighter_for_every_colour_vision() {
        const STEPS: usize = 16;
        for map in SequentialMap::ALL {
            for (vision, matrix) in VISIONS.into_iter().enumerate() {
                let seen = |step: usize| {
                    let rgb = linear(map.colours().at(step as f32 / STEPS as f32));
                    lab(times(matrix, rgb).map(|part| part.clamp(0.0, 1.0)))
                };
                let steps: Vec<[f64; 3]> = (0..=STEPS).map(seen).collect();
                let lighter: Vec<f64> = steps.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
                let (least, most) = lighter.iter().fold((f64::MAX, f64::MIN), |(least, most), &step| {
                    (least.min(step), most.max(step))
                });
                assert!(
                    least > 1.5,
                    "{} grows darker for vision {vision}: {lighter:?}",
                    map.name()
                );
                assert!(most < 3.0 * least, "{} for vision {vision}: {lighter:?}", map.name());
            }
        }
    }

    #[test]
    fn the_maps_are_those_of_their_names() {
        // The end colours of matplotlib's tables; its cividis is approximated by polynomials.
        let ends = |map: SequentialMap| [0.0, 1.0].map(|end| map.colours().at(end));
        let expected = [
            [[68, 1, 84], [253, 231, 37]],
            [[0, 34, 78], [254, 232, 56]],
            [[0, 0, 4], [252, 255, 164]],
        ];
        for (map, expected) in SequentialMap::ALL.into_iter().zip(expected) {
            for (end, expected) in ends(map).iter().flatten().zip(expected.iter().flatten()) {
                let apart = i16::from(*end) - expected;
                assert!(apart.abs() <= 14, "{}: {:?} for {expected}", map.name(), ends(map));
            }
        }
    }
}
