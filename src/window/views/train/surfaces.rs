//! The surfaces of the Train view.

use decoupler_files::{
    export::format_number,
    figure::{
        TargetSurface,
        surface::{Surface, SurfaceFigure},
    },
};
use eframe::egui::{Align, Color32, Layout, Rect, RichText, Ui};
use glam::DVec2;

use super::{
    charts::{SECTION, lit_nodes},
    press::Shown,
    view::TrainView,
};
use crate::window::{
    shared::{Effect, RightCard, Shared, surface_cards_ui, surface_ui, view_mode_ui},
    surface_view::SurfaceView,
    test_view::Drawing,
    theme::{Theme, semibold, space, type_size},
    widgets::{dim_ui, placeholder_ui, segmented_ui},
};

/// Both surfaces side by side with their colour scale.
pub fn surfaces_ui(ui: &mut Ui, rect: Rect, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    let figure = surface_figure(view, shared);
    surface_cards_ui(ui, (rect, 2), &figure, shared.look, effects, |ui, index, effects| {
        let place = [Place::Actual, Place::Network][index];
        head_ui(ui, place, view, shared, effects);
        match figure.surfaces.get(index) {
            Some(surface) => side_ui(ui, (surface, &figure), place, view, shared, effects),
            None if place == Place::Network => invitation_ui(ui, view, shared),
            None => {}
        }
    });
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
fn through(shared: &Shared) -> Option<&TargetSurface> {
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
        Place::Actual if view.press.is_pressing() => ("Actual", Some("pressed".to_owned()), space(36)),
        Place::Actual => ("Actual", None, space(36)),
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
            Place::Actual => view_mode_ui(ui, shared.look, effects),
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

fn side_ui(
    ui: &mut Ui,
    (surface, figure): (&Surface, &SurfaceFigure),
    place: Place,
    view: &mut TrainView,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let (array, look) = (shared.skin(), shared.look);
    // Only sources with a sensor model can be pressed.
    let is_touched = place == Place::Actual && array.is_some();
    let surface_view = SurfaceView {
        label: &format!("{} surface", surface.title),
        surface,
        figure,
        is_touched,
    };
    let mut marked = figure.marked_node;
    let shown = surface_ui(ui, surface_view, look, &mut marked, effects);
    let response = &shown.response;
    if let (Place::Actual, Some(skin)) = (place, array) {
        view.press.take_target(&shown, surface);
        let (painter, pointer) = (ui.painter(), response.hover_pos());
        view.press
            .outline_ui(painter, &Theme::of(ui).palette, pointer, skin.stroke_mm);
    }
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
