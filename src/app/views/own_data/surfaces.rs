//! Surfaces of a test sample through the targets that have positions: the actual one, and beside it what the network makes of
//! the readings.

use std::sync::Arc;

use eframe::egui::{Align, Layout, Rect, RichText, Ui, UiBuilder, Vec2};

use super::{
    model::{Positions, Tested, Trained},
    state::OwnDataView,
};
use crate::{
    app::{
        shared::{Effect, Look, RightCard, colour_scale_ui, follow_surface, view_mode_ui},
        surface_view::{ColourBar, SurfaceView},
        test_view::HeightScale,
        theme::{Theme, semibold, space, type_size},
        widgets::{dim_ui, placeholder_ui, segmented_ui},
    },
    evaluation::Channel,
    export::format_number,
    figure::{
        TargetSurface,
        surface::{Surface, SurfaceFigure},
    },
};

/// Choices for the surfaces, and those drawn last.
#[derive(Debug, Default)]
pub(super) struct SurfacesChoice {
    beside: RightCard,
    /// The node under the pointer, marked on both.
    node: Option<usize>,
    drawn: Option<Drawn>,
}

/// The surfaces of a sample, which stay the same from frame to frame.
#[derive(Clone, Debug)]
struct Drawn {
    tested: Arc<Tested>,
    sample: usize,
    heights: HeightScale,
    /// Actual, decoded, and their difference.
    surfaces: [Surface; 3],
}

impl Drawn {
    fn new(tested: &Arc<Tested>, through: &TargetSurface, sample: usize, heights: HeightScale) -> Self {
        let actual = tested.set().targets().row(sample).to_vec();
        let decoded = tested.answers.row(sample).to_vec();
        let of_all = through.range_of(&tested.ranges);
        let range = match heights {
            HeightScale::Stroke => of_all,
            HeightScale::Fitted => {
                let ends = actual
                    .iter()
                    .zip(&decoded)
                    .map(|(&one, &other)| (one.min(other), one.max(other)));
                through.range_of(&Vec::from_iter(ends))
            }
        };
        Self {
            tested: Arc::clone(tested),
            sample,
            heights,
            surfaces: through.surfaces(&actual, &decoded, range),
        }
    }

    fn is_of(&self, tested: &Arc<Tested>, sample: usize, heights: HeightScale) -> bool {
        Arc::ptr_eq(&self.tested, tested) && (self.sample, self.heights) == (sample, heights)
    }
}

impl SurfacesChoice {
    /// The surfaces of a sample: those drawn last, or new ones.
    fn drawn(&self, tested: &Arc<Tested>, through: &TargetSurface, sample: usize, heights: HeightScale) -> Drawn {
        let kept = self.drawn.as_ref().filter(|drawn| drawn.is_of(tested, sample, heights));
        kept.cloned()
            .unwrap_or_else(|| Drawn::new(tested, through, sample, heights))
    }

    fn figure(&self, drawn: &Drawn, look: Look) -> SurfaceFigure {
        let [actual, decoded, error] = &drawn.surfaces;
        let beside = match self.beside {
            RightCard::Decoupled => decoded,
            RightCard::Error => error,
        };
        let looking = |surface: &Surface| Surface {
            mode: look.mode,
            colours: look.colours,
            ..surface.clone()
        };
        SurfaceFigure {
            surfaces: vec![looking(actual), looking(beside)],
            camera: look.camera,
            marked_node: self.node,
            ..SurfaceFigure::default()
        }
    }
}

/// The surfaces of this sample on show; `None` without test samples or where no surface goes through the positions.
pub(super) fn shown_surfaces(view: &OwnDataView, look: Look) -> Option<SurfaceFigure> {
    let tested = view.shown.as_ref()?.tested.as_ref()?;
    let Positions::Surface(through) = &tested.positions else {
        return None;
    };
    let choice = &view.surfaces;
    let drawn = choice.drawn(tested, through, view.chart.sample_of(tested), look.heights);
    Some(choice.figure(&drawn, look))
}

/// Both surfaces side by side and the scales of their colours, or why there are none.
pub(super) fn surfaces_ui(ui: &mut Ui, view: &mut OwnDataView, look: Look, effects: &mut Vec<Effect>) {
    let Some((shown, tested)) = view
        .shown
        .as_ref()
        .and_then(|shown| Some((shown, shown.tested.as_ref()?)))
    else {
        return;
    };
    let through = match &tested.positions {
        Positions::Surface(through) => Arc::clone(through),
        Positions::NoSurface(reason) => {
            let text = format!(
                "No surface goes through the positions of the targets: {reason}. The chart “Sample” shows all targets."
            );
            placeholder_ui(ui, &text);
            return;
        }
        Positions::None => return,
    };
    let sample = view.chart.sample_of(tested);
    let choice = &mut view.surfaces;
    let drawn = choice.drawn(tested, &through, sample, look.heights);
    let figure = choice.figure(&drawn, look);
    let gap = space(3);
    let area = ui.available_rect_before_wrap();
    let (cards, scales) = area.split_left_right_at_x(area.right() - ColourBar::WIDTH);
    let width = 0.5 * (cards.width() - gap);
    for (index, surface) in figure.surfaces.iter().enumerate() {
        let left = cards.left() + (width + gap) * index as f32;
        let slot = Rect::from_min_size([left, cards.top()].into(), Vec2::new(width, cards.height()));
        ui.scope_builder(UiBuilder::new().max_rect(slot), |ui| {
            ui.horizontal(|ui| {
                ui.set_min_height(space(7));
                ui.label(RichText::new(["Actual", "Network"][index]).font(semibold(type_size().body)));
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| match index {
                    0 => view_mode_ui(ui, look, effects),
                    _ => {
                        let options = [(RightCard::Decoupled, "Decoded"), (RightCard::Error, "Error")];
                        let picked = segmented_ui(ui, "Network surface", &options, choice.beside, false);
                        choice.beside = picked.unwrap_or(choice.beside);
                    }
                });
            });
            surface_ui(
                ui,
                (surface, &figure),
                &drawn,
                (&through, shown),
                look,
                &mut choice.node,
                effects,
            );
        });
    }
    // Below the line of the choices.
    let scales = scales.with_min_y(scales.top() + space(7));
    let (parts, note) = (figure.scales(), figure.note());
    let height = scales.height() / parts.len().max(1) as f32;
    for (index, scale) in parts.iter().enumerate() {
        let top = scales.top() + height * index as f32;
        let slot = Rect::from_x_y_ranges(scales.x_range(), top..=top + height);
        colour_scale_ui(ui, slot.shrink2(Vec2::new(0.0, space(1))), scale, &note, look, effects);
    }
    choice.drawn = Some(drawn);
}

fn surface_ui(
    ui: &mut Ui,
    (surface, figure): (&Surface, &SurfaceFigure),
    drawn: &Drawn,
    (through, trained): (&TargetSurface, &Trained),
    look: Look,
    marked: &mut Option<usize>,
    effects: &mut Vec<Effect>,
) {
    let shown = SurfaceView {
        label: &format!("{} surface of the sample", surface.title),
        surface,
        marked_node: figure.marked_node,
        lit_nodes: &[],
        section: None,
        theme: Theme::of(ui),
    }
    .show(ui, look.camera);
    follow_surface(&shown, look, marked, effects);
    shown.node_tooltip_ui(|ui, node| {
        if let Some(target) = through.nodes().get(node).map(|at| &trained.file.targets[at.target]) {
            node_ui(ui, target, drawn, node);
        }
    });
}

/// The target under the pointer and its values.
fn node_ui(ui: &mut Ui, target: &Channel, drawn: &Drawn, node: usize) {
    let [actual, decoded, error] = drawn.surfaces.each_ref().map(|surface| surface.nodes[node]);
    ui.spacing_mut().item_spacing.y = 0.0;
    ui.horizontal(|ui| {
        ui.label(RichText::new(&target.name).font(semibold(type_size().note)));
        dim_ui(
            ui,
            &format!("x {}, y {} mm", format_number(actual.x), format_number(actual.y)),
        );
    });
    let unit = target.unit.as_ref().map_or_else(String::new, |unit| format!(" {unit}"));
    let [actual, decoded, error] = [actual, decoded, error].map(|node| format_number(node.z).replace('-', "−"));
    let text = format!("actual {actual}, decoded {decoded}, error {error}{unit}");
    ui.label(RichText::new(text).size(type_size().note));
}
