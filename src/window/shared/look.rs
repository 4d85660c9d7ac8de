//! The look of surfaces, common to all views: camera, mode, colours and scales, with the controls that change it.

use decoupler_core::problem::Channel;
use decoupler_files::{
    export::format_number,
    figure::{
        SequentialMap,
        surface::{OrbitCamera, Quantity, Surface, SurfaceFigure, ViewMode},
    },
};
use eframe::egui::{
    Align, Button, ComboBox, CursorIcon, Label, Layout, Popup, Rect, RichText, ScrollArea, Sense, Ui, UiBuilder, vec2,
};

use super::Effect;
use crate::window::{
    surface_view::{SurfaceView, SurfaceViewResponse, colour_bar_ui},
    test_view::HeightScale,
    theme::{rgb, semibold, space, type_size},
    widgets::{card_ui, dim_ui, section_heading_ui, segmented_ui},
};

/// Camera, mode and colours in which all views draw surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Shared by all surfaces.
    pub camera: OrbitCamera,
    /// In space or from above.
    pub mode: ViewMode,
    /// Dark or light.
    pub is_dark: bool,
    /// Colours of values that do not diverge.
    pub colours: SequentialMap,
    /// Range of heights that colours and axes span.
    pub heights: HeightScale,
    /// Error at the ends of the colour scale, in millimetres, while it is locked.
    pub error_limit_mm: Option<f64>,
}

impl Look {
    /// Returns a surface in this look. Its own range is that of a locked scale of values, or of a free one of errors.
    pub fn dressed(&self, surface: &Surface, title: String) -> Surface {
        let values = || {
            surface
                .nodes
                .iter()
                .map(|node| node.z)
                .filter(|value| value.is_finite())
        };
        let extremes = values().reduce(f64::min).zip(values().reduce(f64::max));
        let range = match (&surface.quantity, self.heights, self.error_limit_mm, extremes) {
            (Quantity::Error, _, Some(limit_mm), _) => -limit_mm..=limit_mm,
            // The resolution of heights is a nanometre.
            (Quantity::Height, HeightScale::Fitted, _, Some((low, high))) => low..=high.max(low + 1e-6),
            (Quantity::Target(_), HeightScale::Fitted, _, Some((low, high))) => low..=high,
            _ => surface.range.clone(),
        };
        Surface {
            title,
            range,
            mode: self.mode,
            colours: self.colours,
            ..surface.clone()
        }
    }
}

/// Surface shown for a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RightCard {
    /// The decoded surface.
    #[default]
    Decoupled,
    /// Its difference from the actual one.
    Error,
}

/// The choice between surfaces in space and from above.
pub fn view_mode_ui(ui: &mut Ui, look: Look, effects: &mut Vec<Effect>) {
    let modes = [(ViewMode::ThreeD, "3-D"), (ViewMode::Top, "Top view")];
    let picked = segmented_ui(ui, "Surface view", &modes, look.mode, false);
    effects.extend(picked.map(|mode| Effect::Look(Look { mode, ..look })));
}

/// Divides the middle of a view: surfaces above, a chart below at the left, and figures at its right. In a low window it
/// scrolls.
pub fn surfaces_above_ui(ui: &mut Ui, contents_ui: impl FnOnce(&mut Ui, [Rect; 3])) {
    /// Height below which it scrolls.
    const MIN_HEIGHT: f32 = space(120);
    let gap = space(2);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let height = ui.available_height().max(MIN_HEIGHT);
        // The scroll bar covers nothing.
        let strip = if height > ui.available_height() { gap } else { 0.0 };
        let size = vec2(ui.available_width() - strip, height);
        let (whole, _) = ui.allocate_exact_size(size, Sense::hover());
        let lower_height = (0.43 * whole.height()).clamp(space(56), space(100));
        let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
        let figures_width = (0.42 * whole.width()).clamp(space(64), space(120));
        let (left, right) = lower.split_left_right_at_x(lower.right() - figures_width);
        let places = [
            upper.with_max_y(upper.max.y - gap),
            left.with_max_x(left.max.x - gap),
            right,
        ];
        contents_ui(ui, places);
    });
}

/// Cards of the same width side by side in `rect`, with the colour scales of `figure` at the right of the last one;
/// `contents_ui` receives the number of the card.
pub fn surface_cards_ui(
    ui: &mut Ui,
    (rect, cards): (Rect, usize),
    figure: &SurfaceFigure,
    look: Look,
    effects: &mut Vec<Effect>,
    mut contents_ui: impl FnMut(&mut Ui, usize, &mut Vec<Effect>),
) {
    let gap = space(2);
    let (parts, note) = (figure.scales(), figure.note());
    // Without surfaces the cards take the room of the scale too.
    let scale_width = if parts.is_empty() { 0.0 } else { Surface::SCALE_WIDTH };
    let (whole, scales) = rect.split_left_right_at_x(rect.right() - scale_width);
    let width = (whole.width() - gap * (cards as f32 - 1.0)) / cards as f32;
    for place in 0..cards {
        let left = whole.left() + (width + gap) * place as f32;
        let card = Rect::from_x_y_ranges(left..=left + width, whole.y_range());
        card_ui(ui, card, |ui| contents_ui(ui, place, effects));
    }
    let part = scales.height() / parts.len().max(1) as f32;
    for (index, scale) in parts.iter().enumerate() {
        let top = scales.top() + part * index as f32;
        let slot = Rect::from_x_y_ranges(scales.x_range(), top..=top + part).shrink2(vec2(0.0, space(4)));
        colour_scale_ui(ui, slot, scale, &note, look, effects);
    }
}

/// The title of a card, as far as the options at its right leave room for it.
pub fn card_head_ui(ui: &mut Ui, title: &str, options_ui: impl FnOnce(&mut Ui)) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            options_ui(ui);
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let title = RichText::new(title).font(semibold(type_size().title));
                ui.add(Label::new(title).truncate());
            });
        });
    });
}

/// Shows a surface, turns all surfaces as it is turned, and marks the node under the pointer on its neighbours too.
pub fn surface_ui(
    ui: &mut Ui,
    view: SurfaceView<'_>,
    look: Look,
    marked: &mut Option<usize>,
    effects: &mut Vec<Effect>,
) -> SurfaceViewResponse {
    let shown = view.show(ui);
    if shown.camera != look.camera {
        let camera = shown.camera;
        effects.push(Effect::Look(Look { camera, ..look }));
    }
    // Each card sets the mark only while the pointer is over it, so that it keeps the mark of the other card.
    if shown.response.contains_pointer() && shown.hovered_node != *marked {
        *marked = shown.hovered_node;
        shown.response.ctx.request_repaint();
    }
    shown
}

/// The list of targets behind `name`, where there are several.
pub fn target_choice_ui(ui: &mut Ui, name: &str, id: &str, targets: &[Channel], target: &mut usize) {
    *target = (*target).min(targets.len().saturating_sub(1));
    if targets.len() < 2 {
        return;
    }
    ui.horizontal(|ui| {
        let label = ui.label(name);
        let combo = ComboBox::from_id_salt(id).selected_text(targets[*target].title());
        let picked = combo.show_ui(ui, |ui| {
            for (index, of) in targets.iter().enumerate() {
                ui.selectable_value(target, index, of.title());
            }
        });
        picked.response.labelled_by(label.id);
    });
}

/// The colour scale in `slot`. A click opens its options: the colour map, and whether the scale is locked. `note` is shown
/// under the pointer.
fn colour_scale_ui(ui: &mut Ui, slot: Rect, scale: &Surface, note: &str, look: Look, effects: &mut Vec<Effect>) {
    let mut slot_ui = ui.new_child(UiBuilder::new().max_rect(slot));
    let bar = colour_bar_ui(&mut slot_ui, scale, slot.height());
    let mut changed = look;
    Popup::menu(&bar).show(|ui| {
        // A menu justifies its lines.
        ui.with_layout(Layout::top_down(Align::Min), |ui| {
            ui.set_width(space(66));
            colours_ui(ui, scale, &mut changed);
            lock_ui(ui, scale, &mut changed);
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

/// The colour maps, each with a sample; changes `look`.
fn colours_ui(ui: &mut Ui, scale: &Surface, look: &mut Look) {
    /// Pieces of the sample of a colour map.
    const PIECES: usize = 32;
    if scale.quantity.is_diverging() {
        dim_ui(
            ui,
            "Errors have the colour of the card at zero, blue below and orange above.",
        );
        return;
    }
    section_heading_ui(ui, "Colours");
    for map in SequentialMap::ALL {
        ui.horizontal(|ui| {
            let button = Button::selectable(map == look.colours, map.name()).min_size(vec2(space(24), space(6)));
            if ui.add(button).on_hover_text(map.meaning()).clicked() {
                look.colours = map;
            }
            let (sample, _) = ui.allocate_exact_size(vec2(space(16), space(3)), Sense::hover());
            let width = sample.width() / PIECES as f32;
            for piece in 0..PIECES {
                let left = sample.left() + width * piece as f32;
                let part = Rect::from_x_y_ranges(left..=left + width, sample.y_range());
                let colour = map.colours().at(piece as f32 / (PIECES - 1) as f32);
                ui.painter().rect_filled(part, 0.0, rgb(colour));
            }
        });
    }
}

/// The check box that locks the scale, where there is one; changes `look`.
fn lock_ui(ui: &mut Ui, scale: &Surface, look: &mut Look) {
    let limit_mm = *scale.range.end();
    let hint = match scale.quantity {
        Quantity::Height => {
            "Locked, it spans the whole stroke, from full compression to rest: colours mean the same on every surface. \
             Free, it spans the displayed heights."
        }
        Quantity::Target(_) => {
            "Locked, it spans the values of all test samples: colours mean the same for every sample. Free, it spans the \
             displayed values."
        }
        Quantity::Error => &format!(
            "Locked, it keeps ± {} mm for whatever is shown next. Free, it spans ± the largest displayed error.",
            format_number(limit_mm)
        ),
        // The limit of errors is in millimetres, which these are not.
        Quantity::Pattern | Quantity::Sensitivity | Quantity::TargetError(_) => return,
    };
    let is_error = scale.quantity == Quantity::Error;
    let mut is_locked = match is_error {
        true => look.error_limit_mm.is_some(),
        false => look.heights == HeightScale::Stroke,
    };
    section_heading_ui(ui, "Scale");
    if ui.checkbox(&mut is_locked, "Locked").changed() {
        match (is_error, is_locked) {
            (true, _) => look.error_limit_mm = is_locked.then_some(limit_mm),
            (false, true) => look.heights = HeightScale::Stroke,
            (false, false) => look.heights = HeightScale::Fitted,
        }
    }
    dim_ui(ui, hint);
}
