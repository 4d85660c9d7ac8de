//! Design tokens: the only file with raw colours, sizes and distances.

use eframe::egui::Color32;

/// Named colours of a theme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Palette {
    /// Background of the window, behind the cards.
    pub background: Color32,
    /// Panels and cards.
    pub panel: Color32,
    /// Controls on a panel.
    pub raised: Color32,
    /// Controls under the pointer.
    pub hovered: Color32,
    /// Hairlines, axes, outlines.
    pub line: Color32,
    /// Text.
    pub text: Color32,
    /// Secondary text: units, ticks, hints.
    pub dim: Color32,
    /// Accent colour: the selection, the result of the network and the primary button.
    pub accent: Color32,
    /// The primary button under the pointer.
    pub accent_hovered: Color32,
    /// Text on the accent colour.
    pub on_accent: Color32,
    /// Background of a selected option: the accent mixed into the raised colour.
    pub selected: Color32,
    /// Success.
    pub good: Color32,
    /// Warning.
    pub warning: Color32,
    /// Background of a warning.
    pub warning_tint: Color32,
    /// Failure.
    pub bad: Color32,
    /// Colour of an additional series.
    pub violet: Color32,
    /// Colour of another additional series.
    pub cyan: Color32,
    /// Diverging colour map from the most negative to the most positive value; its middle is the colour of the panel.
    pub error_stops: [Color32; 5],
}

impl Palette {
    /// Dark theme.
    pub const DARK: Self = Self {
        background: Color32::from_rgb(0x12, 0x14, 0x19),
        panel: Color32::from_rgb(0x1b, 0x1e, 0x24),
        raised: Color32::from_rgb(0x24, 0x29, 0x32),
        hovered: Color32::from_rgb(0x2e, 0x35, 0x41),
        line: Color32::from_rgb(0x2c, 0x32, 0x3c),
        text: Color32::from_rgb(0xe7, 0xea, 0xf0),
        dim: Color32::from_rgb(0x98, 0xa2, 0xb3),
        accent: Color32::from_rgb(0x5b, 0x9d, 0xff),
        accent_hovered: Color32::from_rgb(0x85, 0xb6, 0xff),
        on_accent: Color32::from_rgb(0x0b, 0x12, 0x20),
        selected: Color32::from_rgb(0x22, 0x32, 0x4c),
        good: Color32::from_rgb(0x4c, 0xc3, 0x8a),
        warning: Color32::from_rgb(0xf0, 0xa8, 0x3c),
        warning_tint: Color32::from_rgb(0x33, 0x2b, 0x22),
        bad: Color32::from_rgb(0xf5, 0x7f, 0x7f),
        violet: Color32::from_rgb(0xb9, 0x8c, 0xf0),
        cyan: Color32::from_rgb(0x4f, 0xc4, 0xd9),
        error_stops: [
            Color32::from_rgb(0x9a, 0xd8, 0xff),
            Color32::from_rgb(0x2f, 0x7f, 0xd0),
            Color32::from_rgb(0x1b, 0x1e, 0x24),
            Color32::from_rgb(0xd0, 0x58, 0x2a),
            Color32::from_rgb(0xff, 0xc0, 0x94),
        ],
    };

    /// Light theme.
    pub const LIGHT: Self = Self {
        background: Color32::from_rgb(0xee, 0xf1, 0xf5),
        panel: Color32::from_rgb(0xff, 0xff, 0xff),
        raised: Color32::from_rgb(0xf3, 0xf5, 0xf8),
        hovered: Color32::from_rgb(0xe6, 0xea, 0xf0),
        line: Color32::from_rgb(0xdd, 0xe2, 0xea),
        text: Color32::from_rgb(0x1b, 0x24, 0x30),
        dim: Color32::from_rgb(0x5b, 0x64, 0x72),
        accent: Color32::from_rgb(0x1a, 0x5f, 0xc9),
        accent_hovered: Color32::from_rgb(0x16, 0x4f, 0xa8),
        on_accent: Color32::from_rgb(0xff, 0xff, 0xff),
        selected: Color32::from_rgb(0xdb, 0xe8, 0xfb),
        good: Color32::from_rgb(0x17, 0x6d, 0x41),
        warning: Color32::from_rgb(0x8f, 0x55, 0x00),
        warning_tint: Color32::from_rgb(0xf7, 0xef, 0xe2),
        bad: Color32::from_rgb(0xb9, 0x2b, 0x2b),
        violet: Color32::from_rgb(0x7a, 0x3e, 0xb1),
        cyan: Color32::from_rgb(0x0a, 0x66, 0x78),
        error_stops: [
            Color32::from_rgb(0x0b, 0x3d, 0x91),
            Color32::from_rgb(0x5b, 0x9b, 0xe6),
            Color32::from_rgb(0xff, 0xff, 0xff),
            Color32::from_rgb(0xf0, 0x87, 0x5a),
            Color32::from_rgb(0x9a, 0x2c, 0x06),
        ],
    };
}

/// Type sizes in points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TypeSizes {
    /// Section headings in capitals, ticks.
    pub small: f32,
    /// Hints, table headings.
    pub note: f32,
    /// Everything else.
    pub body: f32,
    /// Titles of cards and windows.
    pub title: f32,
}

/// Returns the four type sizes of the window.
pub const fn type_size() -> TypeSizes {
    TypeSizes {
        small: 11.0,
        note: 12.0,
        body: 13.0,
        title: 14.0,
    }
}

/// Unit of all distances, in points.
pub const SPACE: f32 = 4.0;

/// Returns `steps` units of distance, in points.
pub const fn space(steps: u8) -> f32 {
    SPACE * steps as f32
}

/// Returns the corner radius of cards and controls, in points.
pub const fn radius() -> u8 {
    6
}
