use eframe::egui::{Align, Layout, Rect, RichText, Sense, Ui, UiBuilder, Vec2};

use super::{
    RunsAction,
    curves::{colours, curves_keys, curves_ui},
    figures_table::figures_ui,
};
use crate::{
    app::{
        plotting::{legend_ui, legend_width},
        shared::{Compared, PLACES, RightCard, RunsState, State},
        surface_view::{ColourBar, SurfaceView},
        theme::{Theme, semibold, space, type_size},
        widgets::{card_ui, placeholder_ui, scrolled_ui, section_heading_ui, segmented_ui},
        window::Action,
    },
    figure::surface::{OrbitCamera, Surface, SurfaceFigure, ViewMode},
};

/// The middle of the Compare view: the surfaces of both runs above, their curves and figures below.
pub fn compare_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    let whole = ui.available_rect_before_wrap();
    let gap = space(2);
    let lower_height = (0.42 * whole.height()).clamp(space(50), space(96));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    let upper = upper.with_max_y(upper.max.y - gap);
    let (cards, scale) = upper.split_left_right_at_x(upper.right() - ColourBar::WIDTH);
    let width = 0.5 * (cards.width() - gap);
    let figure = compare_figure(state);
    let mut surfaces = figure.surfaces.iter();
    for place in 0..2 {
        let surface = state.runs.compared[place].as_ref().and_then(|_| surfaces.next());
        let left = cards.left() + (width + gap) * place as f32;
        let card = Rect::from_min_size([left, cards.top()].into(), Vec2::new(width, cards.height()));
        card_ui(ui, card, |ui| side_ui(ui, state, place, surface, &mut actions));
    }
    if let [colours, ..] = &figure.scales()[..] {
        let slot = scale.shrink2(Vec2::new(0.0, space(4)));
        let theme = Theme::of(ui);
        let mut slot_ui = ui.new_child(UiBuilder::new().max_rect(slot));
        let bar = ColourBar { scale: colours, theme }.show(&mut slot_ui, slot.height());
        bar.on_hover_text(figure.note());
    }
    let figures_width = (0.42 * lower.width()).clamp(space(80), space(120));
    let (left, right) = lower.split_left_right_at_x(lower.right() - figures_width);
    card_ui(ui, left.with_max_x(left.max.x - gap), |ui| losses_ui(ui, &state.runs));
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "compared figures", |ui| {
            section_heading_ui(ui, "Errors on the test sets");
            figures_ui(ui, &state.runs);
        });
    });
    ui.allocate_rect(whole, Sense::hover());
    actions
}

/// The surfaces of the runs that are prepared, with one scale.
fn compare_figure(state: &State) -> SurfaceFigure {
    let (runs, mode) = (&state.runs, state.look.mode);
    let surface = |compared: &Compared| {
        let [_, decoupled, error] = &compared.frames;
        match runs.card {
            RightCard::Decoupled => compared.test.heights("Decoupled", decoupled, mode),
            RightCard::Error => compared.test.errors("Error", error, mode),
        }
    };
    SurfaceFigure {
        surfaces: runs.compared.iter().flatten().map(surface).collect(),
        camera: state.look.camera,
        marked_node: None,
    }
    .with_common_scales()
}

fn side_ui(ui: &mut Ui, state: &State, place: usize, surface: Option<&Surface>, actions: &mut Vec<Action>) {
    let theme = Theme::of(ui);
    let runs = &state.runs;
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        let colour = colours(&theme.palette)[place];
        ui.label(
            RichText::new(PLACES[place])
                .font(semibold(type_size().title))
                .color(colour),
        );
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            // What holds for both is asked for once.
            match place {
                0 => {
                    let modes = [(ViewMode::ThreeD, "3-D"), (ViewMode::Top, "Top view")];
                    let picked = segmented_ui(ui, "How surfaces are drawn", &modes, state.look.mode, false);
                    actions.extend(picked.map(Action::SetViewMode));
                }
                _ => {
                    let cards = [(RightCard::Decoupled, "Decoupled"), (RightCard::Error, "Error")];
                    let picked = segmented_ui(ui, "What the cards show", &cards, runs.card, false);
                    actions.extend(picked.map(RunsAction::ShowCard).map(Action::from));
                }
            }
            if let Some(run) = runs.pinned(place) {
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let name = RichText::new(&run.name).font(semibold(type_size().title));
                    ui.add(eframe::egui::Label::new(name).truncate());
                });
            }
        });
    });
    match surface {
        Some(surface) => surface_ui(ui, place, surface, state.look.camera, actions),
        None if runs.workspace.pinned[place].is_some() => placeholder_ui(ui, "Its surfaces are being prepared."),
        None => {
            let text = format!("Press {} at a run of the list to show it here.", PLACES[place]);
            placeholder_ui(ui, &text);
        }
    }
}

fn surface_ui(ui: &mut Ui, place: usize, surface: &Surface, camera: OrbitCamera, actions: &mut Vec<Action>) {
    let view = SurfaceView {
        label: ["Surface of A", "Surface of B"][place],
        surface,
        marked_node: None,
        theme: Theme::of(ui),
    };
    let shown = view.show(ui, camera);
    if shown.camera != camera {
        actions.push(Action::MoveCamera(shown.camera));
    }
}

fn losses_ui(ui: &mut Ui, runs: &RunsState) {
    let keys = curves_keys(&Theme::of(ui).palette, runs);
    ui.horizontal(|ui| {
        ui.label(RichText::new("Loss").font(semibold(type_size().title)));
        let spare = ui.available_width() - ui.spacing().item_spacing.x - legend_width(ui, &keys);
        ui.add_space(spare.max(space(3)));
        legend_ui(ui, &keys);
    });
    if keys.is_empty() {
        placeholder_ui(ui, "The errors of each epoch of both runs appear here, in one chart.");
    } else {
        curves_ui(ui, runs);
    }
}
