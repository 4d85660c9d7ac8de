//! The surfaces of the Train view, or all displayed targets of the sample if a recording has no surfaces.

use std::ops::RangeInclusive;

use decoupler_files::{
    export::format_number,
    figure::surface::{Section, Surface, SurfaceFigure},
};
use eframe::egui::{Align, Layout, Rect, RichText, Ui, Vec2};
use glam::DVec2;

use super::{
    charts_card::{BottomTab, all_targets_figure, has_target_surface},
    drawn::Frames,
    inspect::{lit_nodes, take_pointed_target, target_of_node, with_lit_targets},
    press::{Hand, Shown},
    view::TrainView,
};
use crate::window::{
    plotting::{Pointer, plots_ui},
    shared::{Effect, Look, Phase, RightCard, Shared, SourceKind, colour_scale_ui, follow_surface, view_mode_ui},
    surface_view::{ColourBar, SurfaceView},
    test_view::{HeightScale, Positions, TestView},
    theme::{Theme, semibold, space, type_size},
    widgets::{card_ui, dim_ui, explained_options_ui, ghost_button, placeholder_ui, segmented_ui},
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
    if shared.source == SourceKind::Recording && !has_target_surface(shared) {
        card_ui(ui, rect, |ui| sample_card_ui(ui, view, shared));
        return;
    }
    let gap = space(2);
    let (cards, scales) = rect.split_left_right_at_x(rect.right() - ColourBar::WIDTH);
    let width = 0.5 * (cards.width() - gap);
    let left = Rect::from_min_size(cards.min, Vec2::new(width, cards.height()));
    let right = Rect::from_min_max(left.right_top() + Vec2::new(gap, 0.0), cards.max);
    let figure = surface_figure(view, shared);
    card_ui(ui, left, |ui| actual_card_ui(ui, &figure, view, shared, effects));
    card_ui(ui, right, |ui| right_card_ui(ui, &figure, view, shared, effects));
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
    let (frames, style) = (view.frames(), shared.look.style());
    let of_array = |test: &TestView| {
        let right = frames.decoupled.as_ref().map(|(decoupled, error)| match view.right {
            RightCard::Decoupled => test.heights("Decoupled", decoupled, style),
            RightCard::Error => test.errors("Error", error, style),
        });
        let actual = test.heights("Actual", &frames.actual, style);
        std::iter::once(actual).chain(right).collect()
    };
    SurfaceFigure {
        surfaces: shared
            .test()
            .map_or_else(|| target_surfaces(view, shared.look), of_array),
        camera: shared.look.camera,
        marked_node: view.lights.node,
        lit_nodes: lit_nodes(view, shared),
        section: section(view, shared),
    }
    .with_common_scales()
}

/// Returns the surfaces through the targets of a recording.
fn target_surfaces(view: &TrainView, look: Look) -> Vec<Surface> {
    let Some([actual, decoded, error]) = &view.drawn.target_surfaces else {
        return Vec::new();
    };
    let right = match view.right {
        RightCard::Decoupled => decoded,
        RightCard::Error => error,
    };
    let has_result = view.drawn.frames.decoupled.is_some();
    let shown = std::iter::once(actual).chain(has_result.then_some(right));
    let looking = |surface: &Surface| Surface {
        mode: look.mode,
        colours: look.colours,
        range: match look.heights {
            HeightScale::Fitted if !surface.quantity.is_diverging() => {
                range_of_nodes(surface).unwrap_or_else(|| surface.range.clone())
            }
            _ => surface.range.clone(),
        },
        ..surface.clone()
    };
    shown.map(looking).collect()
}

/// Returns the smallest and largest value at the nodes.
fn range_of_nodes(surface: &Surface) -> Option<RangeInclusive<f64>> {
    let values = || {
        surface
            .nodes
            .iter()
            .map(|node| node.z)
            .filter(|value| value.is_finite())
    };
    Some(values().reduce(f64::min)?..=values().reduce(f64::max)?)
}

/// Returns the line of the section while it is displayed.
fn section(view: &TrainView, shared: &Shared) -> Option<Section> {
    let test = shared.test().filter(|_| view.tab == BottomTab::Section)?;
    Some(view.section.section(test))
}

/// The invitation on a card without a network: to press, which a small network answers, or to train.
fn invitation_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let text = if view.press.is_pressing() {
        view.press.waiting_text(shared)
    } else if shared.phase.is_busy() {
        "The decoded surface appears here with the first epoch. Meanwhile, press the surface on the left."
    } else {
        "Press the surface on the left: a network decodes its readings here. Or train your own and watch \
         its surface take shape here."
    };
    placeholder_ui(ui, text);
    if view.press.is_pressing() {
        return;
    }
    if let Some(test) = shared.test() {
        ui.vertical_centered(|ui| {
            ui.add_space(space(3));
            let hint = "Presses a ball onto the middle of the surface.";
            if ui.add(ghost_button("Press it")).on_hover_text(hint).clicked() {
                view.press.press_middle(test);
                ui.request_repaint();
            }
        });
    }
}

/// The title of the card, if the options next to it, `options_width` wide, leave room for it.
fn title_ui(ui: &mut Ui, title: &str, note: &str, options_width: f32) {
    let font = semibold(type_size().title);
    let galley = ui
        .painter()
        .layout_no_wrap(title.to_owned(), font, eframe::egui::Color32::WHITE);
    if galley.size().x + options_width > ui.available_width() {
        return;
    }
    ui.label(RichText::new(title).font(semibold(type_size().title)));
    if galley.size().x + options_width + space(14) <= ui.available_width() + galley.size().x && !note.is_empty() {
        dim_ui(ui, note);
    }
}

fn actual_card_ui(
    ui: &mut Ui,
    figure: &SurfaceFigure,
    view: &mut TrainView,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        title_ui(
            ui,
            "Actual",
            if view.press.is_pressing() { "pressed" } else { "" },
            space(56),
        );
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            view_mode_ui(ui, shared.look, effects);
            // Only sources with a sensor model can be pressed.
            if shared.source == SourceKind::Array {
                let picked = explained_options_ui(ui, "Pointer on the surface", &HANDS, view.press.hand, false);
                view.press.hand = picked.unwrap_or(view.press.hand);
            }
        });
    });
    if let Some(surface) = figure.surfaces.first() {
        surface_ui(ui, (surface, figure), Role::Actual, view, shared, effects);
    }
}

fn right_card_ui(
    ui: &mut Ui,
    figure: &SurfaceFigure,
    view: &mut TrainView,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        let time = view.press.shown().and_then(Shown::network_time);
        title_ui(ui, "Network", time.as_deref().unwrap_or_default(), space(36));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let decoded = match shared.source {
                SourceKind::Array => "Decoupled",
                SourceKind::Recording => "Decoded",
            };
            let options = [(RightCard::Decoupled, decoded), (RightCard::Error, "Error")];
            let picked = segmented_ui(ui, "Network card", &options, view.right, false);
            view.right = picked.unwrap_or(view.right);
        });
    });
    match figure.surfaces.get(1) {
        Some(surface) => surface_ui(ui, (surface, figure), Role::Network, view, shared, effects),
        None => invitation_ui(ui, view, shared),
    }
}

/// Role of one of the two surfaces.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    Actual,
    Network,
}

fn surface_ui(
    ui: &mut Ui,
    (surface, figure): (&Surface, &SurfaceFigure),
    role: Role,
    view: &mut TrainView,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let (array, look, theme) = (shared.test(), shared.look, Theme::of(ui));
    let surface_view = SurfaceView {
        label: &format!("{} surface", surface.title),
        surface,
        marked_node: view.lights.node,
        lit_nodes: &figure.lit_nodes,
        section: figure.section.as_ref(),
        theme,
    };
    let is_touched = role == Role::Actual && view.press.hand == Hand::Press && array.is_some();
    let shown = if is_touched {
        surface_view.show_touched(ui, look.camera)
    } else {
        surface_view.show(ui, look.camera)
    };
    if role == Role::Actual {}
    if let (Role::Actual, Some(test)) = (role, array) {
        view.press.take_target(&shown, surface);
        let painter = ui.painter();
        view.press
            .outline_ui(painter, &theme.palette, shown.response.hover_pos(), test.stroke_mm);
    }
    follow_surface(&shown, look, &mut view.lights.node, effects);
    // A pressed surface is cut too.
    let is_chosen = shown.response.clicked() || (is_touched && shown.response.is_pointer_button_down_on());
    if let (true, true, Some(test), Some(at), Some(sight)) = (
        view.tab == BottomTab::Section,
        is_chosen,
        array,
        shown.response.interact_pointer_pos(),
        shown.sight,
    ) && let Some(place) = surface.pick(&sight.ray(DVec2::new(f64::from(at.x), f64::from(at.y))))
    {
        view.section.choose_at(place.truncate(), test);
        ui.ctx().request_repaint();
    }
    shown.node_tooltip_ui(|ui, node| {
        if let Some(words) = NodeWords::of(shared, node) {
            node_values_ui(ui, view.frames(), &words, node);
        }
    });
}

/// Description of a node and its values.
struct NodeWords {
    name: String,
    /// Names of the actual and of the decoded value.
    values: [&'static str; 2],
    /// With a space before it; empty for none.
    unit: String,
}

impl NodeWords {
    fn of(shared: &Shared, node: usize) -> Option<Self> {
        if let Some(test) = shared.test() {
            let per_row = test.sensor.scale.nodes_per_row();
            let row = test.rows.get(node / per_row).map_or(0, |row| row + 1);
            return Some(Self {
                name: format!("Row {row}, node {}", node % per_row + 1),
                values: ["z", "decoupled"],
                unit: " mm".to_owned(),
            });
        }
        let test = shared.recorded_test()?;
        let target = test.problem.targets.get(target_of_node(test, node)?)?;
        Some(Self {
            name: target.name.clone(),
            values: ["actual", "decoded"],
            unit: target.unit.as_ref().map_or_else(String::new, |unit| format!(" {unit}")),
        })
    }
}

/// The node under the pointer and its values, in two lines that hide little.
fn node_values_ui(ui: &mut Ui, frames: &Frames, words: &NodeWords, node: usize) {
    let Some(actual) = frames.actual.nodes_mm.get(node) else {
        return;
    };
    ui.spacing_mut().item_spacing.y = 0.0;
    ui.horizontal(|ui| {
        ui.label(RichText::new(&words.name).font(semibold(type_size().note)));
        let [x, y] = [actual.x, actual.y].map(format_number);
        let place = RichText::new(format!("x {x}, y {y} mm")).size(type_size().note);
        ui.label(place.color(Theme::of(ui).palette.dim));
    });
    let ([name, found], unit) = (words.values, &words.unit);
    let mut text = format!("{name} {}{unit}", format_number(actual.z));
    if let Some((decoupled, error)) = &frames.decoupled
        && let (Some(decoupled), Some(error)) = (decoupled.nodes_mm.get(node), error.nodes_mm.get(node))
    {
        let [decoupled, error] = [decoupled.z, error.z].map(format_number);
        text += &format!(", {found} {decoupled}{unit}, error {error}{unit}");
    }
    ui.label(RichText::new(text).size(type_size().note));
}

/// All displayed targets of the sample, actual next to decoded.
pub fn sample_card_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let Some(figure) = all_targets_figure(view, shared) else {
        let text = match shared.phase {
            Phase::Preparing => "The recording is being read; the first epoch follows.",
            _ => "Press Train: the targets of each test sample appear here, actual next to decoded.",
        };
        placeholder_ui(ui, text);
        return;
    };
    let figure = with_lit_targets(figure, view, shared);
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        let title = format!("Test sample {}", view.snapshot + 1);
        ui.label(RichText::new(title).font(semibold(type_size().title)));
    });
    if let Some(Positions::NoSurface(reason)) = shared.recorded_test().map(|test| &test.positions) {
        dim_ui(
            ui,
            &format!("No surface goes through the positions of the targets: {reason}."),
        );
    }
    let lit = view.lights.node;
    let drawn = plots_ui(ui, "all targets", &figure, Pointer::Moves);
    take_pointed_target(view, &drawn, shared);
    if view.lights.node != lit {
        ui.request_repaint();
    }
}
