//! Inter with tabular digits, in two weights; egui's own fonts stand behind it for rare signs.

use std::sync::Arc;

use eframe::egui::{FontData, FontDefinitions, FontFamily, FontId};

const REGULAR: &str = "Inter Tabular Regular";
const SEMIBOLD: &str = "Inter Tabular SemiBold";

/// The semi-bold face at a size in points.
pub fn semibold(size: f32) -> FontId {
    FontId::new(size, FontFamily::Name(SEMIBOLD.into()))
}

/// The fonts of the window.
pub fn font_definitions() -> FontDefinitions {
    let mut fonts = FontDefinitions::default();
    let faces: [(&str, &'static [u8]); 2] = [
        (
            REGULAR,
            include_bytes!("../../../assets/fonts/InterTabular-Regular.ttf"),
        ),
        (
            SEMIBOLD,
            include_bytes!("../../../assets/fonts/InterTabular-SemiBold.ttf"),
        ),
    ];
    for (name, bytes) in faces {
        fonts
            .font_data
            .insert(name.to_owned(), Arc::new(FontData::from_static(bytes)));
    }
    let fallback: Vec<String> = [FontFamily::Proportional, FontFamily::Monospace]
        .iter()
        .flat_map(|family| fonts.families.get(family).cloned().unwrap_or_default())
        .collect();
    let with_fallback = |first: &str| {
        std::iter::once(first.to_owned())
            .chain(fallback.iter().cloned())
            .collect()
    };
    fonts.families.insert(FontFamily::Proportional, with_fallback(REGULAR));
    fonts
        .families
        .insert(FontFamily::Name(SEMIBOLD.into()), with_fallback(SEMIBOLD));
    fonts
}
