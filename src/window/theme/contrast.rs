//! Contrast of text and marks in both themes, after WCAG 2.2.

use eframe::egui::Color32;

use super::Palette;

/// Minimum contrast of text (WCAG 2.2, 1.4.3).
const TEXT: f64 = 4.5;
/// Minimum contrast of marks that carry meaning (WCAG 2.2, 1.4.11).
const MARKS: f64 = 3.0;

#[test]
fn contrast_of_black_and_white_is_21_and_of_equal_colours_1() {
    assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-12);
    assert!((contrast(Color32::RED, Color32::RED) - 1.0).abs() < 1e-12);
    // According to WebAIM, the lightest grey that passes on white and the darkest that fails.
    assert!(contrast(Color32::from_gray(0x76), Color32::WHITE) > TEXT);
    assert!(contrast(Color32::from_gray(0x77), Color32::WHITE) < TEXT);
}

#[test]
fn text_has_enough_contrast_on_every_background() {
    for (theme, palette) in themes() {
        for (ink, colour) in inks(&palette) {
            for (ground, behind) in grounds(&palette) {
                let found = contrast(colour, behind);
                assert!(found >= TEXT, "{theme}: {ink} on {ground} has a contrast of {found:.2}");
            }
        }
        for (ground, behind) in [("accent", palette.accent), ("accent hovered", palette.accent_hovered)] {
            let found = contrast(palette.on_accent, behind);
            assert!(found >= TEXT, "{theme}: text on {ground} has a contrast of {found:.2}");
        }
    }
}

#[test]
fn marks_have_enough_contrast_on_cards() {
    for (theme, palette) in themes() {
        let ends = [
            ("smallest error", palette.error_stops[0]),
            ("largest error", palette.error_stops[4]),
        ];
        for (mark, colour) in inks(&palette).into_iter().chain(ends) {
            let found = contrast(colour, palette.panel);
            assert!(found >= MARKS, "{theme}: {mark} has a contrast of {found:.2}");
        }
    }
}

fn themes() -> [(&'static str, Palette); 2] {
    [("dark", Palette::DARK), ("light", Palette::LIGHT)]
}

/// Colours of text, also used for curves and symbols.
fn inks(palette: &Palette) -> [(&'static str, Color32); 8] {
    [
        ("text", palette.text),
        ("dim", palette.dim),
        ("accent", palette.accent),
        ("good", palette.good),
        ("warning", palette.warning),
        ("bad", palette.bad),
        ("violet", palette.violet),
        ("cyan", palette.cyan),
    ]
}

fn grounds(palette: &Palette) -> [(&'static str, Color32); 6] {
    [
        ("background", palette.background),
        ("panel", palette.panel),
        ("raised", palette.raised),
        ("hovered", palette.hovered),
        ("selected", palette.selected),
        ("warning tint", palette.warning_tint),
    ]
}

/// Returns the contrast of two opaque colours, from 1 to 21.
fn contrast(a: Color32, b: Color32) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// Returns the relative luminance of an sRGB colour.
fn luminance(colour: Color32) -> f64 {
    let linear = |channel: u8| {
        let value = f64::from(channel) / 255.0;
        if value <= 0.04045 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        }
    };
    0.2126 * linear(colour.r()) + 0.7152 * linear(colour.g()) + 0.0722 * linear(colour.b())
}
