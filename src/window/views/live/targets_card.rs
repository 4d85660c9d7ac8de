use eframe::egui::{Align, Layout, Rect, RichText, Ui};

use super::{
    LiveView,
    engine::LiveTargets,
    figures_card::{outside_ui, stream_ui},
};
use crate::window::{
    plotting::titled_plots_ui,
    shared::{Effect, Look, Shared, colour_scale_ui, follow_surface, view_mode_ui},
    surface_view::{ColourBar, SurfaceView},
    test_view::HeightScale,
    theme::{Theme, semibold, space, type_size},
    widgets::{card_ui, coloured_fact_ui, fact_ui, scrolled_ui, section_heading_ui},
};
use decoupler_core::text::capitalised;
use decoupler_files::{
    export::format_number,
    figure::{
        PlotFigure,
        surface::{Surface, SurfaceFigure},
        targets_over_time_figure,
    },
};

/// Shows the targets of a recording as they are decoded: their surface if they have positions, their values over time,
/// the latest values, and the stream.
pub fn targets_ui(ui: &mut Ui, whole: Rect, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let Some(targets) = view.shown.targets.clone() else {
        return;
    };
    let gap = space(2);
    let lower_height = (0.4 * whole.height()).clamp(space(50), space(90));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    let mut upper = upper.with_max_y(upper.bottom() - gap);
    if let Some(figure) = surface_figure(&targets, view.node, shared.look) {
        let (left, right) = upper.split_left_right_at_x(upper.center().x);
        card_ui(ui, left.with_max_x(left.right() - gap), |ui| {
            surface_ui(ui, &figure, &targets, shared.look, &mut view.node, effects);
        });
        upper = right;
    }
    let intervals = targets.network.intervals.as_ref();
    let title = match intervals {
        Some(_) => "Decoded values with their 90 % intervals",
        None => "Decoded values",
    };
    card_ui(ui, upper, |ui| titled_plots_ui(ui, title, &chart(&targets)));
    let (left, right) = lower.split_left_right_at_x(lower.center().x);
    card_ui(ui, left.with_max_x(left.right() - gap), |ui| {
        scrolled_ui(ui, "live targets", |ui| {
            section_heading_ui(ui, "Targets");
            for (index, (target, value)) in targets.network.problem.targets.iter().zip(targets.values()).enumerate() {
                match intervals.and_then(|intervals| intervals.half_width(index, *value)) {
                    Some(half_width) => fact_ui(
                        ui,
                        &target.title(),
                        "Latest decoded value ± half-width of its 90 % prediction interval.",
                        &format!("{} ± {}", format_number(*value), format_number(half_width)),
                    ),
                    None => fact_ui(ui, &target.title(), "Latest decoded value.", &format_number(*value)),
                }
            }
        });
    });
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "live stream", |ui| {
            section_heading_ui(ui, "Confidence");
            let hint = "Readings beyond the range seen in training by more than a tenth of it, and targets beyond by more than \
                        all of it. There the network extrapolates: check these readings, or train on a recording that covers \
                        them.";
            let features = targets.network.problem.feature_count();
            outside_ui(ui, view.shown.outside, features, "target", hint);
            drift_ui(ui, &targets);
            section_heading_ui(ui, "Stream");
            stream_ui(ui, view);
        });
    });
}

/// Returns the chart of the values of all targets over time.
pub fn chart(targets: &LiveTargets) -> PlotFigure {
    let intervals = targets.network.intervals.as_ref();
    targets_over_time_figure(&targets.network.problem.targets, &targets.history, intervals)
}

/// Returns the surface through the latest values; `None` if the targets have no positions.
pub fn surface_figure(targets: &LiveTargets, marked_node: Option<usize>, look: Look) -> Option<SurfaceFigure> {
    let through = targets.surface.as_ref()?;
    let values = targets.values();
    let range = match look.heights {
        HeightScale::Stroke => through.range_of(&targets.ranges),
        HeightScale::Fitted => through.range_of(&Vec::from_iter(values.iter().map(|&value| (value, value)))),
    };
    let [_, decoded, _] = through.surfaces(values, values, range);
    let surface = Surface {
        mode: look.mode,
        colours: look.colours,
        ..decoded
    };
    Some(SurfaceFigure {
        surfaces: vec![surface],
        camera: look.camera,
        marked_node,
        ..SurfaceFigure::default()
    })
}

fn surface_ui(
    ui: &mut Ui,
    figure: &SurfaceFigure,
    targets: &LiveTargets,
    look: Look,
    node: &mut Option<usize>,
    effects: &mut Vec<Effect>,
) {
    let [surface] = &figure.surfaces[..] else { return };
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new(&surface.title).font(semibold(type_size().title)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            view_mode_ui(ui, look, effects);
        });
    });
    let place = ui.available_rect_before_wrap();
    let (picture, scale) = place.split_left_right_at_x(place.right() - ColourBar::WIDTH);
    let mut slot = ui.new_child(eframe::egui::UiBuilder::new().max_rect(picture));
    let shown = SurfaceView {
        label: "Live decoded surface",
        surface,
        marked_node: *node,
        lit_nodes: &[],
        section: None,
        theme: Theme::of(ui),
    }
    .show(&mut slot, look.camera);
    follow_surface(&shown, look, node, effects);
    shown.node_tooltip_ui(|ui, node| {
        let at = targets.surface.as_ref().and_then(|through| through.nodes().get(node));
        let target = at.and_then(|at| {
            Some((
                targets.network.problem.targets.get(at.target)?,
                targets.values().get(at.target)?,
            ))
        });
        if let Some((target, value)) = target {
            ui.label(RichText::new(target.title()).font(semibold(type_size().note)));
            ui.label(RichText::new(format_number(*value)).size(type_size().note));
        }
    });
    colour_scale_ui(ui, scale, surface, &figure.note(), look, effects);
}

fn drift_ui(ui: &mut Ui, targets: &LiveTargets) {
    const NAME: &str = "Drift of the readings";
    let palette = Theme::of(ui).palette;
    let drift = match &targets.drift {
        Ok(drift) => drift,
        Err(reason) => {
            let hint = format!("Drift is not monitored: {reason}.");
            coloured_fact_ui(ui, NAME, &hint, "not monitored", palette.dim);
            return;
        }
    };
    let hint = "Readings that do not look like those of the training: prediction intervals do not hold. Check the sensor and \
                its connection, re-zero it, or train with recent samples. The warning ends when the readings are back to \
                normal. In readings like those of the training, a false alarm occurs on average at most once in 10 000 \
                blocks of readings, each at least five times as long as neighbouring readings are correlated.";
    let (value, colour) = match drift {
        Some(drift) => (
            capitalised(&drift.describe(&targets.network.problem.inputs)),
            palette.warning,
        ),
        None => ("none".to_owned(), palette.text),
    };
    coloured_fact_ui(ui, NAME, hint, &value, colour);
}
