use eframe::egui::{Align, Layout, Rect, RichText, Ui, UiBuilder, Vec2};

use crate::{
    app::{
        shared::{RightCard, State},
        surface_view::{ColourBar, SurfaceView, SurfaceViewResponse},
        test_view::TestView,
        theme::{Theme, semibold, space, type_size},
        widgets::{card_ui, placeholder_ui, segmented_ui},
        window::Action,
    },
    export::format_number,
    figure::surface::{SurfaceFigure, ViewMode},
};

/// Both surfaces side by side, and the scale of their colours.
pub fn surfaces_ui(ui: &mut Ui, rect: Rect, state: &State, actions: &mut Vec<Action>) {
    let gap = space(2);
    let (cards, scales) = rect.split_left_right_at_x(rect.right() - ColourBar::WIDTH);
    let width = 0.5 * (cards.width() - gap);
    let left = Rect::from_min_size(cards.min, Vec2::new(width, cards.height()));
    let right = Rect::from_min_max(left.right_top() + Vec2::new(gap, 0.0), cards.max);
    let figure = surface_figure(state);
    card_ui(ui, left, |ui| actual_card_ui(ui, state, &figure, actions));
    card_ui(ui, right, |ui| right_card_ui(ui, state, &figure, actions));
    colour_scales_ui(ui, scales, &figure);
}

/// The surfaces of the snapshot on show: the actual one, and once there is a network what its card shows.
pub fn surface_figure(state: &State) -> SurfaceFigure {
    let (frames, look) = (&state.frames, &state.look);
    let surfaces = state.test().into_iter().flat_map(|test| {
        let actual = test.heights("Actual", &frames.actual, look.mode);
        let beside = frames.decoupled.as_ref().map(|(decoupled, error)| match look.right {
            RightCard::Decoupled => test.heights("Decoupled", decoupled, look.mode),
            RightCard::Error => test.errors("Error", error, look.mode),
        });
        std::iter::once(actual).chain(beside)
    });
    SurfaceFigure {
        surfaces: surfaces.collect(),
        camera: look.camera,
        marked_node: look.node,
    }
}

/// The card's title, where the options beside it, `options_width` wide, leave room for it.
fn title_ui(ui: &mut Ui, title: &str, options_width: f32) {
    let font = semibold(type_size().title);
    let galley = ui
        .painter()
        .layout_no_wrap(title.to_owned(), font, eframe::egui::Color32::WHITE);
    if galley.size().x + options_width > ui.available_width() {
        return;
    }
    ui.label(RichText::new(title).font(semibold(type_size().title)));
}

fn actual_card_ui(ui: &mut Ui, state: &State, figure: &SurfaceFigure, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        title_ui(ui, "Actual", space(29));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let modes = [(ViewMode::ThreeD, "3-D"), (ViewMode::Top, "Top view")];
            if let Some(mode) = segmented_ui(ui, "How surfaces are drawn", &modes, state.look.mode, false) {
                actions.push(Action::SetViewMode(mode));
            }
        });
    });
    surface_ui(ui, state, figure, 0, actions);
}

fn right_card_ui(ui: &mut Ui, state: &State, figure: &SurfaceFigure, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        title_ui(ui, "Network", space(36));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let options = [(RightCard::Decoupled, "Decoupled"), (RightCard::Error, "Error")];
            if let Some(right) = segmented_ui(ui, "What the network's card shows", &options, state.look.right, false) {
                actions.push(Action::SetRightCard(right));
            }
        });
    });
    if figure.surfaces.len() < 2 {
        placeholder_ui(
            ui,
            "Press Train: the surface that the network decouples takes shape here while it learns.",
        );
        return;
    }
    surface_ui(ui, state, figure, 1, actions);
}

/// The scale that both surfaces share; beside it that of the errors while they are shown.
fn colour_scales_ui(ui: &mut Ui, rect: Rect, figure: &SurfaceFigure) {
    let scales = figure.scales();
    let part = rect.height() / scales.len() as f32;
    for (index, scale) in scales.iter().enumerate() {
        let top = rect.top() + part * index as f32;
        let slot = Rect::from_x_y_ranges(rect.x_range(), top..=top + part).shrink2(Vec2::new(0.0, space(4)));
        let mut slot_ui = ui.new_child(UiBuilder::new().max_rect(slot));
        let theme = Theme::of(ui);
        let bar = ColourBar { scale, theme }.show(&mut slot_ui, slot.height());
        bar.on_hover_text(figure.note());
    }
}

fn surface_ui(ui: &mut Ui, state: &State, figure: &SurfaceFigure, card: usize, actions: &mut Vec<Action>) {
    let (Some(test), Some(surface)) = (state.test(), figure.surfaces.get(card)) else {
        return;
    };
    let view = SurfaceView {
        label: &format!("{} surface", surface.title),
        surface,
        marked_node: figure.marked_node,
        theme: Theme::of(ui),
    };
    let shown = view.show(ui, figure.camera);
    answer(&shown, state, actions);
    shown.node_tooltip_ui(|ui, node| node_values_ui(ui, state, test, node));
}

fn answer(shown: &SurfaceViewResponse, state: &State, actions: &mut Vec<Action>) {
    if shown.camera != state.look.camera {
        actions.push(Action::MoveCamera(shown.camera));
    }
    // Each card speaks for the pointer only while it is over it, so that the other card's mark stays.
    if shown.response.contains_pointer() && shown.hovered_node != state.look.node {
        actions.push(Action::HoverNode(shown.hovered_node));
    }
}

/// The node under the pointer and its values, in two lines that hide little.
fn node_values_ui(ui: &mut Ui, state: &State, test: &TestView, node: usize) {
    let Some(actual) = state.frames.actual.nodes_mm.get(node) else {
        return;
    };
    ui.spacing_mut().item_spacing.y = 0.0;
    let per_row = test.sensor.scale.nodes_per_row();
    ui.horizontal(|ui| {
        let row = test.rows.get(node / per_row).map_or(0, |row| row + 1);
        let name = format!("Row {row}, node {}", node % per_row + 1);
        ui.label(RichText::new(name).font(semibold(type_size().note)));
        let [x, y] = [actual.x, actual.y].map(format_number);
        let place = RichText::new(format!("x {x}, y {y} mm")).size(type_size().note);
        ui.label(place.color(Theme::of(ui).palette.dim));
    });
    let mut text = format!("z {} mm", format_number(actual.z));
    if let Some((decoupled, error)) = &state.frames.decoupled
        && let (Some(decoupled), Some(error)) = (decoupled.nodes_mm.get(node), error.nodes_mm.get(node))
    {
        let [decoupled, error] = [decoupled.z, error.z].map(format_number);
        text += &format!(", decoupled {decoupled} mm, error {error} mm");
    }
    ui.label(RichText::new(text).size(type_size().note));
}
