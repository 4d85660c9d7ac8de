//! A surface laid out in a card, ready to be painted.

use glam::Vec2;

use super::{
    box_axes::BoxAxes,
    camera::OrbitCamera,
    field::Field,
    mesh::Mesh,
    nodes::Dots,
    plan_axes::PlanAxes,
    projection::PlotBox,
    shapes::{Bounds, Line, Text},
    sight::Sight,
    stage::Stage,
    surface_figure::{Surface, ViewMode},
};
use crate::figure::colour_map::ColourMap;
use decoupler_core::text::counted;

/// Room that the labels of a box usually take, in points.
const LABELS: Vec2 = Vec2::new(72.0, 56.0);
/// Free edge of a card, in points.
const EDGE: f32 = 8.0;

/// Space, text metrics and colours with which a surface is laid out.
pub struct Card<'a> {
    /// The space to fill.
    pub bounds: Bounds,
    /// Tells the size of a text.
    pub measure: &'a dyn Fn(&str) -> Vec2,
    /// The colours of the values.
    pub colours: &'a ColourMap,
}

/// A laid-out surface, in the order of painting.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The frame with its ticks.
    pub lines: Vec<Line>,
    /// Numbers and names of the axes.
    pub texts: Vec<Text>,
    /// The surface.
    pub mesh: Mesh,
    /// The nodes.
    pub dots: Dots,
    /// From points on the screen back to millimetres.
    pub sight: Sight,
    /// Says what lies beyond the axes and how it is drawn.
    pub note: Option<String>,
}

impl Surface {
    /// Lays the surface out as `camera` sees it.
    pub fn lay_out(&self, camera: OrbitCamera, card: &Card<'_>) -> Drawing {
        let field = Field::new(self);
        let value_name = self.quantity.axis_name();
        let names = ["x (mm)", "y (mm)", &*value_name];
        let (min_mm, max_mm) = field.box_mm();
        let inner = card.bounds.grown(-EDGE);
        let (lines, labels, (mesh, dots), sight) = match self.mode {
            ViewMode::ThreeD => {
                let [width, height] = (card.bounds.size() - LABELS).max(Vec2::ONE).into();
                let plot_box = PlotBox::new(min_mm, max_mm, height / width);
                let axes = BoxAxes::new(card.measure, inner, plot_box, camera, &field.range, names);
                let painted = self.paint(&field, &Stage::Space(&axes.projection), card);
                let sight = Sight::of_projection(&axes.projection);
                (axes.lines(), axes.labels, painted, sight)
            }
            ViewMode::Top => {
                let names = [names[0], names[1]];
                let axes = PlanAxes::new(card.measure, inner, min_mm.truncate(), max_mm.truncate(), names);
                let painted = self.paint(&field, &Stage::Plan(&axes), card);
                let sight = Sight::of_plan(&axes);
                (axes.lines(), axes.labels, painted, sight)
            }
        };
        Drawing {
            note: note(mesh.has_plateau, dots.beyond()),
            lines,
            texts: labels.into_texts(),
            mesh,
            dots,
            sight,
        }
    }

    fn paint(&self, field: &Field<'_>, stage: &Stage<'_>, card: &Card<'_>) -> (Mesh, Dots) {
        if field.values.is_empty() {
            return <(Mesh, Dots)>::default();
        }
        (
            Mesh::new(field, stage, card.colours),
            Dots::new(&self.nodes, field, stage),
        )
    }
}

/// Says that a part of the surface is drawn at the end of the axis because it lies beyond it, and how many nodes are.
fn note(has_plateau: bool, nodes: usize) -> Option<String> {
    match (has_plateau, nodes) {
        (false, 0) => None,
        (true, 0) => Some("Beyond the axes: hatched".to_owned()),
        (true, _) => Some(format!("Beyond the axes: hatched, {}", counted(nodes, "node"))),
        (false, 1) => Some("1 node beyond the axes is drawn at their edge".to_owned()),
        (false, _) => Some(format!("{nodes} nodes beyond the axes are drawn at their edge")),
    }
}
