//! The surfaces of the Train view, or all displayed targets of the sample if a recording has no surfaces.

use decoupler_files::{
    export::format_number,
    figure::{
        Figure, TargetSurface,
        surface::{Surface, SurfaceFigure},
    },
};
use eframe::egui::{Align, Color32, Layout, Rect, RichText, Ui, Vec2};
use glam::DVec2;

use super::{
    charts::{SAMPLE, SECTION, lit_nodes},
    press::{Hand, Shown},
    view::TrainView,
};
use crate::window::{
    shared::{Effect, Phase, RightCard, Shared, SourceKind, colour_scale_ui, follow_surface, view_mode_ui},
    surface_view::{ColourBar, SurfaceView},
    test_view::Drawing,
    theme::{Theme, semibold, space, type_size},
    widgets::{card_ui, dim_ui, explained_options_ui, placeholder_ui, segmented_ui},
};

/// Work of the pointer on the actual surface.
const HANDS: [(Hand, &str, &str); 2] = [
    (
        Hand::Press,
        "Press",
        "Drag on the surface to press it; the wheel sets the depth. Drag with Shift or another button to move the picture, \
         and the surface next to it to turn it.",
    ),
    (Hand::Turn, "Turn", "Drag to turn the surface; the wheel zooms."),
];

/// Both surfaces side by side with their colour scale; all targets of the sample if a recording has no surfaces.
pub fn surfaces_ui(ui: &mut Ui, rect: Rect, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    if shared.source == SourceKind::Recording && through(shared).is_none() {
        card_ui(ui, rect, |ui| sample_card_ui(ui, view, shared));
        return;
    }
    let gap = space(2);
    let (cards, scales) = rect.split_left_right_at_x(rect.right() - ColourBar::WIDTH);
    let width = 0.5 * (cards.width() - gap);
    let left = cards.with_max_x(cards.left() + width);
    let right = cards.with_min_x(left.right() + gap);
    let figure = surface_figure(view, shared);
    for (card, place) in [left, right].into_iter().zip([Place::Actual, Place::Network]) {
        card_ui(ui, card, |ui| {
            head_ui(ui, place, view, shared, effects);
            match figure.surfaces.get(place as usize) {
                Some(surface) => surface_ui(ui, (surface, &figure), place, view, shared, effects),
                None if place == Place::Network => invitation_ui(ui, view, shared),
                None => {}
            }
        });
    }
    let (parts, note) = (figure.scales(), figure.note());
    let part = scales.height() / parts.len().max(1) as f32;
    for (index, scale) in parts.iter().enumerate() {
        let top = scales.top() + part * index as f32;
        let slot = Rect::from_x_y_ranges(scales.x_range(), top..=top + part).shrink2(Vec2::new(0.0, space(4)));
        colour_scale_ui(ui, slot, scale, &note, shared.look, effects);
    }
}

/// Returns the displayed surfaces of the snapshot: the actual one, and the one of the network if there is one.
pub fn surface_figure(view: &TrainView, shared: &Shared) -> SurfaceFigure {
    let drawn = view.drawing().into_iter().flat_map(|drawing| {
        let decoded = drawing.decoded.as_ref().map(|[decoded, error]| match view.right {
            RightCard::Decoupled => decoded,
            RightCard::Error => error,
        });
        std::iter::once(&drawing.actual).chain(decoded)
    });
    let dressed = drawn.map(|surface| shared.look.dressed(surface, surface.title.clone()));
    let is_cut = view.tab == SECTION.name;
    SurfaceFigure {
        surfaces: dressed.collect(),
        camera: shared.look.camera,
        marked_node: view.lights.node.and_then(|item| match through(shared) {
            Some(through) => through.nodes().iter().position(|node| node.target == item),
            None => Some(item),
        }),
        lit_nodes: lit_nodes(view, shared),
        section: shared.skin().filter(|_| is_cut).map(|skin| view.section.section(skin)),
    }
    .with_common_scales()
}

/// The surface through the targets of a recording.
pub(super) fn through(shared: &Shared) -> Option<&TargetSurface> {
    shared.test()?.through()
}

/// Returns the item at a node of a surface: the node itself, or the target there.
fn item_at(shared: &Shared, node: usize) -> Option<usize> {
    match through(shared) {
        Some(through) => Some(through.nodes().get(node)?.target),
        None => Some(node),
    }
}

/// Place of one of the two surfaces in the figure.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Actual,
    Network,
}

/// The title of a card, if the options next to it leave room for it, and the options.
fn head_ui(ui: &mut Ui, place: Place, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    let (title, note, options_width) = match place {
        Place::Actual if view.press.is_pressing() => ("Actual", Some("pressed".to_owned()), space(56)),
        Place::Actual => ("Actual", None, space(56)),
        Place::Network => ("Network", view.press.shown().and_then(Shown::network_time), space(36)),
    };
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        let font = semibold(type_size().title);
        let galley = ui
            .painter()
            .layout_no_wrap(title.to_owned(), font.clone(), Color32::WHITE);
        if galley.size().x + options_width <= ui.available_width() {
            ui.label(RichText::new(title).font(font));
            if let Some(note) = note.filter(|_| options_width + space(14) <= ui.available_width()) {
                dim_ui(ui, &note);
            }
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| match place {
            Place::Actual => {
                view_mode_ui(ui, shared.look, effects);
                // Only sources with a sensor model can be pressed.
                if shared.source == SourceKind::Array {
                    let picked = explained_options_ui(ui, "Pointer on the surface", &HANDS, view.press.hand, false);
                    view.press.hand = picked.unwrap_or(view.press.hand);
                }
            }
            Place::Network => {
                let options = [(RightCard::Decoupled, "Decoded"), (RightCard::Error, "Error")];
                let picked = segmented_ui(ui, "Network card", &options, view.right, false);
                view.right = picked.unwrap_or(view.right);
            }
        });
    });
}

/// The invitation on a card without a network: to press, which a small network answers, or to train.
fn invitation_ui(ui: &mut Ui, view: &TrainView, shared: &Shared) {
    let text = if view.press.is_pressing() {
        view.press.waiting_text(shared)
    } else if shared.phase.is_busy() {
        "The decoded surface appears here with the first epoch. Meanwhile, press the surface on the left."
    } else {
        "Press the surface on the left: a network decodes its readings here. Or train your own and watch \
         its surface take shape here."
    };
    placeholder_ui(ui, text);
}

fn surface_ui(
    ui: &mut Ui,
    (surface, figure): (&Surface, &SurfaceFigure),
    place: Place,
    view: &mut TrainView,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let (array, look, theme) = (shared.skin(), shared.look, Theme::of(ui));
    let surface_view = SurfaceView {
        label: &format!("{} surface", surface.title),
        surface,
        marked_node: figure.marked_node,
        lit_nodes: &figure.lit_nodes,
        section: figure.section.as_ref(),
        theme,
    };
    let is_touched = place == Place::Actual && view.press.hand == Hand::Press && array.is_some();
    let shown = match is_touched {
        true => surface_view.show_touched(ui, look.camera),
        false => surface_view.show(ui, look.camera),
    };
    let response = &shown.response;
    if let (Place::Actual, Some(skin)) = (place, array) {
        view.press.take_target(&shown, surface);
        let (painter, pointer) = (ui.painter(), response.hover_pos());
        view.press.outline_ui(painter, &theme.palette, pointer, skin.stroke_mm);
    }
    let mut marked = figure.marked_node;
    follow_surface(&shown, look, &mut marked, effects);
    if marked != figure.marked_node {
        view.lights.node = marked.and_then(|node| item_at(shared, node));
    }
    // A pressed surface is cut too.
    let is_chosen = response.clicked() || (is_touched && response.is_pointer_button_down_on());
    if let (true, Some(skin)) = (is_chosen && figure.section.is_some(), array)
        && let (Some(at), Some(sight)) = (response.interact_pointer_pos(), shown.sight)
        && let Some(place) = surface.pick(&sight.ray(DVec2::new(f64::from(at.x), f64::from(at.y))))
    {
        view.section.choose_at(place.truncate(), skin);
    }
    shown.node_tooltip_ui(|ui, node| {
        if let Some(drawing) = view.drawing() {
            node_values_ui(ui, drawing, shared, node);
        }
    });
}

/// The node under the pointer and its values, in two lines that hide little.
fn node_values_ui(ui: &mut Ui, drawing: &Drawing, shared: &Shared, node: usize) {
    let target = || shared.test()?.problem.targets.get(item_at(shared, node)?);
    let (title, [name, found], unit) = if let Some(skin) = shared.skin() {
        let per_row = skin.sensor.scale.nodes_per_row();
        let row = skin.rows.get(node / per_row).map_or(0, |row| row + 1);
        let title = format!("Row {row}, node {}", node % per_row + 1);
        (title, ["z", "decoded"], " mm".to_owned())
    } else if let Some(target) = target() {
        let unit = target.unit.as_ref().map_or_else(String::new, |unit| format!(" {unit}"));
        (target.name.clone(), ["actual", "decoded"], unit)
    } else {
        return;
    };
    let Some(actual) = drawing.actual.nodes.get(node) else {
        return;
    };
    ui.spacing_mut().item_spacing.y = 0.0;
    ui.horizontal(|ui| {
        ui.label(RichText::new(title).font(semibold(type_size().note)));
        let [x, y] = [actual.x, actual.y].map(format_number);
        dim_ui(ui, &format!("x {x}, y {y} mm"));
    });
    let mut text = format!("{name} {}{unit}", format_number(actual.z));
    if let Some(decoded) = &drawing.decoded {
        let [decoded, error] = decoded.each_ref().map(|surface| format_number(surface.nodes[node].z));
        text += &format!(", {found} {decoded}{unit}, error {error}{unit}");
    }
    ui.label(RichText::new(text).size(type_size().note));
}

/// All displayed targets of the sample, actual next to decoded.
fn sample_card_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let Some(figure) = SAMPLE.figure(view, shared) else {
        let text = match shared.phase {
            Phase::Preparing => "The recording is being read; the first epoch follows.",
            _ => "Press Train: the targets of each test sample appear here, actual next to decoded.",
        };
        return placeholder_ui(ui, text);
    };
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        let title = format!("Test sample {}", view.snapshot + 1);
        ui.label(RichText::new(title).font(semibold(type_size().title)));
    });
    if let Some(Err(reason)) = shared.test().and_then(|test| test.through.as_ref()) {
        let text = format!("No surface goes through the positions of the targets: {reason}.");
        dim_ui(ui, &text);
    }
    SAMPLE.figure_ui(ui, &figure, view, shared);
}

/// Returns the figure above the charts: the surfaces, or all targets of a sample.
pub(super) fn upper_figure(view: &TrainView, shared: &Shared) -> Figure {
    let surfaces = surface_figure(view, shared);
    match SAMPLE.figure(view, shared) {
        Some(targets) if surfaces.surfaces.is_empty() => targets,
        _ => surfaces.into(),
    }
}
