//! egui's visuals, built from the design tokens.
//!
//! The font is Inter with tabular digits, in two weights; egui's own fonts are the fallback for rare characters.

use std::sync::Arc;

use eframe::egui::{
    self, Color32, Context, CornerRadius, FontData, FontDefinitions, FontFamily, FontId, Margin, Shadow, Stroke, Style,
    TextStyle, Visuals,
    style::{HandleShape, ScrollStyle, Selection, WidgetVisuals},
    vec2,
};

use super::tokens::{Palette, radius, space, type_size};

/// Installs the fonts and both styles; called once, before the first frame.
pub fn install(ctx: &Context, is_dark: bool) {
    ctx.set_fonts(font_definitions());
    ctx.set_style_of(egui::Theme::Dark, style(true));
    ctx.set_style_of(egui::Theme::Light, style(false));
    apply(ctx, is_dark);
}

/// Switches between dark and light.
pub fn apply(ctx: &Context, is_dark: bool) {
    ctx.set_theme(if is_dark { egui::Theme::Dark } else { egui::Theme::Light });
}

fn style(is_dark: bool) -> Style {
    let mut style = Style {
        visuals: visuals(is_dark),
        // No animations.
        animation_time: 0.0,
        ..Style::default()
    };
    let sizes = type_size();
    let regular = |size| FontId::new(size, FontFamily::Proportional);
    style.text_styles = [
        (TextStyle::Small, regular(sizes.small)),
        (TextStyle::Body, regular(sizes.body)),
        (TextStyle::Button, regular(sizes.body)),
        (TextStyle::Heading, semibold(sizes.title)),
        (TextStyle::Monospace, FontId::new(sizes.note, FontFamily::Monospace)),
    ]
    .into();
    style.drag_value_text_style = TextStyle::Body;

    let spacing = &mut style.spacing;
    spacing.item_spacing = vec2(space(2), space(1));
    spacing.button_padding = vec2(space(2), space(1));
    spacing.interact_size = vec2(space(10), space(6));
    spacing.window_margin = Margin::same(16);
    spacing.menu_margin = Margin::same(4);
    spacing.slider_rail_height = space(1);
    spacing.icon_width = space(4);
    spacing.icon_width_inner = space(2);
    spacing.icon_spacing = space(2);
    spacing.indent = space(4);
    spacing.tooltip_width = 320.0;
    spacing.scroll = ScrollStyle {
        bar_width: space(2),
        floating_width: 3.0,
        // One sees that there is more, also before the pointer is there.
        dormant_handle_opacity: 0.3,
        ..ScrollStyle::floating()
    };
    style.interaction.tooltip_delay = 0.3;
    style
}

fn visuals(is_dark: bool) -> Visuals {
    let palette = if is_dark { Palette::DARK } else { Palette::LIGHT };
    let mut visuals = if is_dark { Visuals::dark() } else { Visuals::light() };
    let corner = CornerRadius::same(radius());
    let widget = |fill: Color32, outline: Stroke, text: Color32| WidgetVisuals {
        bg_fill: fill,
        weak_bg_fill: fill,
        bg_stroke: outline,
        corner_radius: corner,
        fg_stroke: Stroke::new(1.0, text),
        expansion: 0.0,
    };
    let hairline = Stroke::new(1.0, palette.line);

    visuals.widgets.noninteractive = widget(palette.panel, hairline, palette.text);
    visuals.widgets.inactive = widget(palette.raised, Stroke::NONE, palette.text);
    visuals.widgets.hovered = widget(palette.hovered, Stroke::NONE, palette.text);
    // egui shows keyboard focus with the active style: the outline is the focus ring.
    visuals.widgets.active = widget(palette.hovered, Stroke::new(1.0, palette.accent), palette.text);
    visuals.widgets.open = widget(palette.hovered, Stroke::NONE, palette.text);

    visuals.selection = Selection {
        bg_fill: palette.selected,
        stroke: Stroke::new(1.0, palette.accent),
    };
    visuals.weak_text_color = Some(palette.dim);
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.warning;
    visuals.error_fg_color = palette.bad;
    visuals.faint_bg_color = palette.raised;
    visuals.extreme_bg_color = palette.background;
    visuals.text_edit_bg_color = Some(palette.raised);
    visuals.code_bg_color = palette.raised;
    visuals.panel_fill = palette.panel;
    visuals.window_fill = palette.panel;
    visuals.window_stroke = hairline;
    visuals.window_corner_radius = corner;
    visuals.menu_corner_radius = corner;
    visuals.window_shadow = shadow(24, is_dark);
    visuals.popup_shadow = shadow(12, is_dark);
    visuals.text_cursor.stroke = Stroke::new(1.5, palette.accent);
    visuals.slider_trailing_fill = true;
    visuals.handle_shape = HandleShape::Circle;
    visuals.indent_has_left_vline = false;
    visuals.disabled_alpha = 0.4;
    visuals
}

fn shadow(blur: u8, is_dark: bool) -> Shadow {
    let alpha = if is_dark { 120 } else { 40 };
    Shadow {
        offset: [0, 4],
        blur,
        spread: 0,
        color: Color32::from_black_alpha(alpha),
    }
}

const REGULAR: &str = "Inter Tabular Regular";
const SEMIBOLD: &str = "Inter Tabular SemiBold";

/// Returns the semi-bold font at a size in points.
pub fn semibold(size: f32) -> FontId {
    FontId::new(size, FontFamily::Name(SEMIBOLD.into()))
}

/// Returns the fonts of the window.
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
