use eframe::egui::{
    Align, Button, CursorIcon, Layout, Mesh, Popup, Rect, RichText, Sense, Ui, UiBuilder, Vec2, WidgetInfo,
    accesskit::Role, pos2, vec2,
};

use super::{Effect, Look};
use crate::window::{
    surface_view::ColourBar,
    test_view::HeightScale,
    theme::{Theme, rgb, space, type_size},
    widgets::section_heading_ui,
};
use decoupler_files::{
    export::format_number,
    figure::{
        ColourMap, SequentialMap,
        surface::{ColourScale, Quantity},
    },
};

/// Width of the sample of a map, in points.
const SAMPLE: f32 = space(16);
/// Pieces of which it consists.
const PIECES: usize = 32;

/// The scale of colours in `slot`. A click opens what can be chosen of it: its colours, and whether it is locked. `note` is
/// shown under the pointer.
pub fn colour_scale_ui(
    ui: &mut Ui,
    slot: Rect,
    scale: &ColourScale,
    note: &str,
    look: Look,
    effects: &mut Vec<Effect>,
) {
    let mut slot_ui = ui.new_child(UiBuilder::new().max_rect(slot));
    let theme = Theme::of(ui);
    let bar = ColourBar { scale, theme }.show(&mut slot_ui, slot.height());
    let mut changed = look;
    Popup::menu(&bar).show(|ui| {
        // A menu justifies its lines.
        ui.with_layout(Layout::top_down(Align::Min), |ui| {
            ui.set_width(space(66));
            choices_ui(ui, scale, look, &mut changed);
        });
    });
    let state = match scale.quantity {
        Quantity::Height | Quantity::Target(_) if look.heights == HeightScale::Fitted => {
            " It spans the displayed heights."
        }
        Quantity::Error if look.error_limit_mm.is_some() => " It is locked.",
        _ => "",
    };
    let hint = format!("{note} Click to choose colours, or to lock or free the scale.{state}");
    bar.on_hover_cursor(CursorIcon::PointingHand).on_hover_text(hint);
    if changed != look {
        effects.push(Effect::Look(changed));
    }
}

/// The choices that a scale offers; changes `look`.
fn choices_ui(ui: &mut Ui, scale: &ColourScale, look: Look, changed: &mut Look) {
    let theme = Theme::of(ui);
    if scale.quantity.is_diverging() {
        let text = "Errors have the colour of the card at zero, blue below and orange above.";
        ui.label(RichText::new(text).size(type_size().note).color(theme.palette.dim));
    } else {
        section_heading_ui(ui, "Colours");
        for map in SequentialMap::ALL {
            if map_ui(ui, map, look.colours) {
                changed.colours = map;
            }
        }
    }
    match scale.quantity {
        Quantity::Height | Quantity::Target(_) => {
            let is_locked = look.heights == HeightScale::Stroke;
            let meanings = [
                "Spans the whole stroke, from full compression to rest: colours mean the same on every surface.",
                "Spans the displayed heights: small differences are visible, but colours are not comparable between plots.",
            ];
            let meanings = match scale.quantity {
                Quantity::Height => meanings,
                _ => [
                    "Spans the values of all test samples: colours mean the same for every sample.",
                    "Spans the displayed values: small differences are visible, but colours are not comparable between plots.",
                ],
            };
            if let Some(locked) = lock_ui(ui, is_locked, meanings) {
                changed.heights = if locked {
                    HeightScale::Stroke
                } else {
                    HeightScale::Fitted
                };
            }
        }
        Quantity::Error => {
            let limit_mm = *scale.range.end();
            let locked = format!("Keeps ± {} mm for whatever is shown next.", format_number(limit_mm));
            let meanings = [&*locked, "Spans ± the largest displayed error."];
            if let Some(locked) = lock_ui(ui, look.error_limit_mm.is_some(), meanings) {
                changed.error_limit_mm = locked.then_some(limit_mm);
            }
        }
        // The limit of errors is in millimetres, which these are not.
        Quantity::Pattern | Quantity::Sensitivity | Quantity::TargetError(_) => {}
    }
}

/// A map to choose, with a sample of it. Returns true if the user newly picked it.
fn map_ui(ui: &mut Ui, map: SequentialMap, chosen: SequentialMap) -> bool {
    let (picked, sample) = ui
        .horizontal(|ui| {
            let button = Button::selectable(map == chosen, map.name()).min_size(vec2(space(24), space(6)));
            let picked = ui.add(button).on_hover_text(map.meaning()).clicked();
            let (sample, _) = ui.allocate_exact_size(Vec2::new(SAMPLE, space(3)), Sense::hover());
            (picked, sample)
        })
        .inner;
    ui.painter().add(gradient(sample, map.colours()));
    picked && map != chosen
}

/// The choice between locked and free. Returns the one newly picked.
fn lock_ui(ui: &mut Ui, is_locked: bool, meanings: [&str; 2]) -> Option<bool> {
    section_heading_ui(ui, "Scale");
    let mut picked = None;
    for ((option, text), meaning) in [(true, "Locked"), (false, "Free")].into_iter().zip(meanings) {
        let button = Button::selectable(option == is_locked, text).min_size(vec2(space(24), space(6)));
        let button = ui.add(button);
        button.widget_info(|| WidgetInfo::selected(Role::RadioButton, true, option == is_locked, text));
        if button.clicked() && option != is_locked {
            picked = Some(option);
        }
        let dim = Theme::of(ui).palette.dim;
        ui.label(RichText::new(meaning).size(type_size().note).color(dim));
    }
    picked
}

fn gradient(rect: Rect, map: &ColourMap) -> Mesh {
    let mut mesh = Mesh::default();
    for piece in 0..=PIECES {
        let part = piece as f32 / PIECES as f32;
        let x = rect.left() + part * rect.width();
        mesh.colored_vertex(pos2(x, rect.top()), rgb(map.at(part)));
        mesh.colored_vertex(pos2(x, rect.bottom()), rgb(map.at(part)));
        if piece > 0 {
            let at = 2 * piece as u32;
            mesh.add_triangle(at - 2, at - 1, at);
            mesh.add_triangle(at - 1, at, at + 1);
        }
    }
    mesh
}
