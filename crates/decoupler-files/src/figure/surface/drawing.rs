//! A surface laid out in a card, ready to be painted.

use decoupler_core::text::counted;
use glam::Vec2;

use super::{
    Surface, ViewMode,
    axes::Axes,
    camera::{OrbitCamera, PlotBox, Sight},
    field::Field,
    mesh::Mesh,
    nodes::Dots,
};
use crate::figure::{
    colour_map::ColourMap,
    drawing::{Bounds, Measure, Shape},
};

/// Usual size of the labels of a box, in points.
const LABELS: Vec2 = Vec2::new(72.0, 56.0);
/// Free edge of a card, in points.
const EDGE: f32 = 8.0;

/// A laid-out surface, in the order of painting.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The frame with its ticks, numbers and names.
    pub frame: Vec<Shape>,
    /// The surface.
    pub mesh: Mesh,
    /// The nodes.
    pub dots: Dots,
    /// From points on the screen back to millimetres.
    pub sight: Sight,
    /// Note on parts beyond the axes and how they are drawn.
    pub note: Option<String>,
}

impl Surface {
    /// Lays the surface out in `card`, as `camera` sees it, with its values in these colours.
    pub fn lay_out(&self, camera: OrbitCamera, card: Bounds, measure: Measure<'_>, colours: &ColourMap) -> Drawing {
        let field = Field::new(self);
        let (plot_box, camera) = match self.mode {
            ViewMode::ThreeD => {
                let room = (card.size() - LABELS).max(Vec2::ONE);
                (PlotBox::new(field.box_mm(), room.y / room.x), Some(camera))
            }
            ViewMode::Top => (PlotBox::flat(field.box_mm()), None),
        };
        let names = ["x (mm)", "y (mm)", &self.quantity.axis_name()];
        let axes = Axes::new(measure, card.grown(-EDGE), plot_box, camera, &field.range, names);
        let sight = axes.sight;
        let (mesh, dots) = match self.values.len() == field.grid.len() {
            true => (Mesh::new(&field, &sight, colours), Dots::new(&field, &sight)),
            false => Default::default(),
        };
        let mut frame = axes.lines();
        frame.extend(axes.labels.shapes());
        let note = match (mesh.has_plateau, dots.beyond()) {
            (false, 0) => None,
            (true, 0) => Some("Beyond the axes: hatched".to_owned()),
            (true, nodes) => Some(format!("Beyond the axes: hatched, {}", counted(nodes, "node"))),
            (false, 1) => Some("1 node beyond the axes is drawn at their edge".to_owned()),
            (false, nodes) => Some(format!("{nodes} nodes beyond the axes are drawn at their edge")),
        };
        Drawing {
            frame,
            mesh,
            dots,
            sight,
            note,
        }
    }
}
