//! What a surface view looks like, kept from frame to frame: a pointer that moves changes none of it.

use std::{
    hash::{DefaultHasher, Hash, Hasher},
    ops::RangeInclusive,
    sync::Arc,
};

use eframe::egui::{Mesh, Painter, Rect, Shape, Ui, Vec2};

use super::axes::SpaceAxes;
use super::camera::OrbitCamera;
use super::mesh::{Stage, Surface};
use super::nodes::{self, Dot};
use super::plan::PlanAxes;
use super::projection::PlotBox;
use super::view::{SurfaceView, SurfaceViewResponse, ViewMode};
use crate::app::theme::Theme;

/// Room for overshoots of the surface above and below the range, as a part of it.
const HEADROOM: f64 = 0.08;

/// Room that the labels of a box usually take, in points.
const LABELS: Vec2 = Vec2::new(72.0, 56.0);

/// A laid-out and projected view.
pub(super) struct Drawing {
    key: u64,
    frame: DrawnFrame,
    mesh: Arc<Mesh>,
    pub(super) dots: Vec<Option<Dot>>,
}

enum DrawnFrame {
    Space(Box<SpaceAxes>),
    Plan(PlanAxes),
}

impl Drawing {
    /// The frame with its labels, and the surface; not the dots, for which one is marked may change.
    pub(super) fn paint(&self, painter: &Painter, theme: &Theme) {
        match &self.frame {
            DrawnFrame::Space(axes) => axes.paint(painter, theme),
            DrawnFrame::Plan(plan) => plan.paint(painter, theme),
        }
        painter.add(Shape::Mesh(Arc::clone(&self.mesh)));
    }
}

impl SurfaceView<'_> {
    /// The drawing of the last frame if nothing in it has changed, or a new one.
    pub(super) fn drawing(&self, ui: &Ui, painter: &Painter, rect: Rect, shown: &SurfaceViewResponse) -> Arc<Drawing> {
        let (id, camera) = (shown.response.id, shown.camera);
        let key = self.key(ui, rect, camera);
        let kept: Option<Arc<Drawing>> = ui.data(|data| data.get_temp(id));
        kept.filter(|drawing| drawing.key == key).unwrap_or_else(|| {
            let drawing = Arc::new(self.draw(painter, rect, camera, key));
            ui.data_mut(|data| data.insert_temp(id, Arc::clone(&drawing)));
            drawing
        })
    }

    /// Lays out and projects everything that depends on no pointer.
    fn draw(&self, painter: &Painter, rect: Rect, camera: OrbitCamera, key: u64) -> Drawing {
        let range_mm = usable_range(&self.range_mm);
        let names = ["x (mm)", "y (mm)", self.colours.title()];
        let headroom = HEADROOM * (range_mm.end() - range_mm.start());
        let surface = Surface {
            grid: self.grid,
            values: self.values_mm,
            range: &range_mm,
            shown: range_mm.start() - headroom..=range_mm.end() + headroom,
            colours: self.colours.map(self.theme),
        };
        let (min_mm, max_mm) = surface.box_mm();
        let frame = match self.mode {
            ViewMode::ThreeD => {
                let tall_per_wide = (rect.height() - LABELS.y).max(1.0) / (rect.width() - LABELS.x).max(1.0);
                let plot_box = PlotBox::new(min_mm, max_mm, tall_per_wide);
                let card = rect.shrink(8.0);
                let axes = SpaceAxes::new(painter, card, plot_box, camera, &range_mm, names, self.theme);
                DrawnFrame::Space(Box::new(axes))
            }
            ViewMode::Top => {
                let (min_mm, max_mm) = (min_mm.truncate(), max_mm.truncate());
                let names = [names[0], names[1]];
                DrawnFrame::Plan(PlanAxes::new(
                    painter,
                    rect.shrink(8.0),
                    min_mm,
                    max_mm,
                    names,
                    self.theme,
                ))
            }
        };
        let stage = match &frame {
            DrawnFrame::Space(axes) => Stage::Space(&axes.projection),
            DrawnFrame::Plan(plan) => Stage::Plan(plan),
        };
        let is_usable = self.values_mm.len() == self.grid.len();
        let (mesh, dots) = if is_usable {
            (surface.mesh(&stage), nodes::dots(self.nodes_mm, &surface, &stage))
        } else {
            (Mesh::default(), Vec::new())
        };
        Drawing {
            key,
            frame,
            mesh: Arc::new(mesh),
            dots,
        }
    }

    /// Differs where a drawing differs.
    fn key(&self, ui: &Ui, rect: Rect, camera: OrbitCamera) -> u64 {
        let mut hasher = DefaultHasher::new();
        let OrbitCamera { yaw, pitch, zoom, pan } = camera;
        let look = [yaw, pitch, zoom, pan[0], pan[1], ui.pixels_per_point()];
        let place = [rect.min.x, rect.min.y, rect.max.x, rect.max.y];
        look.iter()
            .chain(&place)
            .for_each(|part| part.to_bits().hash(&mut hasher));
        (self.mode as u8, self.colours as u8, self.theme.is_dark).hash(&mut hasher);
        let nodes = self.nodes_mm.iter().flat_map(|node| node.to_array());
        let ends = [*self.range_mm.start(), *self.range_mm.end()];
        let grid = self.grid.x_mm().iter().chain(self.grid.y_mm()).chain(self.values_mm);
        for part in grid.copied().chain(nodes).chain(ends) {
            part.to_bits().hash(&mut hasher);
        }
        hasher.finish()
    }
}

/// A range that can be divided by, whatever was given.
fn usable_range(range: &RangeInclusive<f64>) -> RangeInclusive<f64> {
    let (low, high) = (*range.start(), *range.end());
    if !(low.is_finite() && high.is_finite()) {
        0.0..=1.0
    } else if high - low > 1e-9 * low.abs().max(1e-3) {
        low..=high
    } else {
        low - 0.5..=low + 0.5
    }
}
