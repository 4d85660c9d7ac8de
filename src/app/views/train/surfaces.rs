use eframe::egui::{Align, Layout, Rect, RichText, Ui, UiBuilder, Vec2};

use super::{drawn::Frames, export_kind::file_name, state::TrainView};
use crate::{
    app::{
        shared::{Effect, FileTask, Look, RightCard, SURFACES, Shared},
        surface_view::{ColourBar, SurfaceView},
        test_view::TestView,
        theme::{Theme, semibold, space, type_size},
        widgets::{card_ui, placeholder_ui, segmented_ui},
    },
    export::format_number,
    figure::surface::{Surface, SurfaceFigure, ViewMode},
};

/// Both surfaces side by side, and the scale of their colours.
pub fn surfaces_ui(ui: &mut Ui, rect: Rect, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    let gap = space(2);
    let (cards, scales) = rect.split_left_right_at_x(rect.right() - ColourBar::WIDTH);
    let width = 0.5 * (cards.width() - gap);
    let left = Rect::from_min_size(cards.min, Vec2::new(width, cards.height()));
    let right = Rect::from_min_max(left.right_top() + Vec2::new(gap, 0.0), cards.max);
    let figure = surface_figure(view, shared);
    card_ui(ui, left, |ui| actual_card_ui(ui, &figure, view, shared, effects));
    card_ui(ui, right, |ui| right_card_ui(ui, &figure, view, shared, effects));
    colour_scales_ui(ui, scales, &figure);
}

/// The surfaces of the snapshot on show: the actual one, and once there is a network what its card shows.
pub fn surface_figure(view: &TrainView, shared: &Shared) -> SurfaceFigure {
    let (frames, mode) = (&view.drawn.frames, shared.look.mode);
    let surfaces = shared.test().into_iter().flat_map(|test| {
        let actual = test.heights("Actual", &frames.actual, mode);
        let beside = frames.decoupled.as_ref().map(|(decoupled, error)| match view.right {
            RightCard::Decoupled => test.heights("Decoupled", decoupled, mode),
            RightCard::Error => test.errors("Error", error, mode),
        });
        std::iter::once(actual).chain(beside)
    });
    SurfaceFigure {
        surfaces: surfaces.collect(),
        camera: shared.look.camera,
        marked_node: view.node,
    }
}

/// The file of the surfaces as they are in view; `None` before a training.
pub fn surfaces_task(view: &TrainView, shared: &Shared) -> Option<FileTask> {
    let run = shared.shown_run().filter(|run| run.result.is_some())?;
    let what = match shared.look.mode {
        ViewMode::ThreeD => "surfaces",
        ViewMode::Top => "surfaces-top",
    };
    let name = file_name(what, SURFACES, &run.settings);
    Some(FileTask::picture(SURFACES, name, surface_figure(view, shared)))
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

fn actual_card_ui(
    ui: &mut Ui,
    figure: &SurfaceFigure,
    view: &mut TrainView,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        title_ui(ui, "Actual", space(29));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let modes = [(ViewMode::ThreeD, "3-D"), (ViewMode::Top, "Top view")];
            let look = shared.look;
            let picked = segmented_ui(ui, "Surface view", &modes, look.mode, false);
            effects.extend(picked.map(|mode| Effect::Look(Look { mode, ..look })));
        });
    });
    if let Some(surface) = figure.surfaces.first() {
        surface_ui(ui, surface, view, shared, effects);
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
        title_ui(ui, "Network", space(36));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let options = [(RightCard::Decoupled, "Decoupled"), (RightCard::Error, "Error")];
            let picked = segmented_ui(ui, "Network card", &options, view.right, false);
            view.right = picked.unwrap_or(view.right);
        });
    });
    match figure.surfaces.get(1) {
        Some(surface) => surface_ui(ui, surface, view, shared, effects),
        None => placeholder_ui(
            ui,
            "Press Train: the decoupled surface takes shape here while the network learns.",
        ),
    }
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

fn surface_ui(ui: &mut Ui, surface: &Surface, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    let (Some(test), look) = (shared.test(), shared.look) else {
        return;
    };
    let shown = SurfaceView {
        label: &format!("{} surface", surface.title),
        surface,
        marked_node: view.node,
        theme: Theme::of(ui),
    }
    .show(ui, look.camera);
    if shown.camera != look.camera {
        let camera = shown.camera;
        effects.push(Effect::Look(Look { camera, ..look }));
    }
    // Each card speaks for the pointer only while it is over it, so that the other card's mark stays.
    if shown.response.contains_pointer() && shown.hovered_node != view.node {
        view.node = shown.hovered_node;
        ui.ctx().request_repaint();
    }
    shown.node_tooltip_ui(|ui, node| node_values_ui(ui, &view.drawn.frames, test, node));
}

/// The node under the pointer and its values, in two lines that hide little.
fn node_values_ui(ui: &mut Ui, frames: &Frames, test: &TestView, node: usize) {
    let Some(actual) = frames.actual.nodes_mm.get(node) else {
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
    if let Some((decoupled, error)) = &frames.decoupled
        && let (Some(decoupled), Some(error)) = (decoupled.nodes_mm.get(node), error.nodes_mm.get(node))
    {
        let [decoupled, error] = [decoupled.z, error.z].map(format_number);
        text += &format!(", decoupled {decoupled} mm, error {error} mm");
    }
    ui.label(RichText::new(text).size(type_size().note));
}
