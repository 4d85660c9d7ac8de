//! Surfaces in space or from above.
//!
//! A [`SurfaceFigure`] describes a picture of surfaces. Each [`Surface`] of it lays itself out in a card as a
//! [`Drawing`]: shapes and a mesh in the order of painting. A renderer only has to paint them.
//!
//! `camera` maps millimetres to points on the screen and back; `axes` lays out the axes with their ticks and labels.
//! `mesh` is the surface with contour lines, from far to near; `section` cuts it along a wire. `nodes` are the dots on it,
//! and find the place on the surface under a point of the screen.

mod axes;
mod camera;
mod mesh;
mod nodes;
mod section;

pub use camera::{OrbitCamera, Ray, Sight};
pub use mesh::{Mesh, Piece, Vertex};
pub use nodes::Dots;
pub use section::{Section, SectionLine, section_figure};

use std::{ops::RangeInclusive, sync::Arc};

use decoupler_core::{
    surface::SurfaceMap,
    text::{counted, format_number},
};
use glam::{DVec3, Vec2};
use serde::{Deserialize, Serialize};

use super::{
    axis::PlotAxis,
    colour_map::{ColourMap, SequentialMap},
    drawing::{Bounds, Measure, Shape, lay_out_scale},
    extremes, titled, unique_by, with_unit,
};
use axes::Axes;
use camera::PlotBox;
use mesh::corners;

/// View of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ViewMode {
    /// In space.
    #[default]
    ThreeD,
    /// From above, as a map.
    Top,
}

/// One surface with its nodes.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Title of its card: "Actual".
    pub title: String,
    /// The lattice of the nodes, and the interpolation between them.
    pub map: Arc<SurfaceMap>,
    /// Values on the grid of the map, `x points × y points`. NaN leaves a gap.
    pub values: Arc<[f64]>,
    /// The nodes: x and y in millimetres, and the value. NaN hides one.
    pub nodes: Arc<[DVec3]>,
    /// Meaning of the values.
    pub quantity: Quantity,
    /// Values at the ends of the colours and of the value axis.
    pub range: RangeInclusive<f64>,
    /// In space or from above.
    pub mode: ViewMode,
    /// Colours of values that do not diverge.
    pub colours: SequentialMap,
}

impl Surface {
    /// The surface in space through `nodes`, which are those of `map` with their values.
    pub fn through(
        title: &str,
        map: &Arc<SurfaceMap>,
        nodes: impl Into<Arc<[DVec3]>>,
        quantity: Quantity,
        range: RangeInclusive<f64>,
    ) -> Self {
        let nodes = nodes.into();
        let values: Vec<f64> = nodes.iter().map(|node| node.z).collect();
        Self {
            title: title.to_owned(),
            map: Arc::clone(map),
            values: map.evaluate(&values).into(),
            nodes,
            quantity,
            range,
            mode: ViewMode::default(),
            colours: SequentialMap::default(),
        }
    }

    /// The surfaces through actual and decoded nodes of `map`, over `range`, and through decoded minus actual ones, whose
    /// range is symmetric about zero and at least ± `least`. The quantities are those of values and of errors.
    pub fn compared(
        decoded: &str,
        map: &Arc<SurfaceMap>,
        nodes: [Vec<DVec3>; 2],
        [value, error]: [Quantity; 2],
        range: RangeInclusive<f64>,
        least: f64,
    ) -> [Self; 3] {
        let pairs = nodes[0].iter().zip(&nodes[1]);
        let errors = Vec::from_iter(pairs.map(|(actual, decoded)| actual.with_z(decoded.z - actual.z)));
        let sizes = errors.iter().map(|node| node.z.abs());
        let largest = sizes.filter(|size| size.is_finite()).fold(least, f64::max);
        let [actual_nodes, decoded_nodes] = nodes;
        [
            Self::through("Actual", map, actual_nodes, value.clone(), range.clone()),
            Self::through(decoded, map, decoded_nodes, value, range),
            Self::through("Error", map, errors, error, -largest..=largest),
        ]
    }

    /// Width of a colour scale with its numbers, in points.
    pub const SCALE_WIDTH: f32 = 72.0;

    /// Returns the colours of its values: `errors` if they diverge from zero.
    fn colour_map<'a>(&self, errors: &'a ColourMap) -> &'a ColourMap {
        match self.quantity.is_diverging() {
            true => errors,
            false => self.colours.colours(),
        }
    }

    /// Lays the colour scale out in `area`, that of `errors` if values diverge from zero; empty if the area or the range is
    /// too small.
    pub fn lay_out_scale(&self, area: Bounds, measure: Measure<'_>, errors: &ColourMap) -> Vec<Shape> {
        let margin = Vec2::new(0.0, 14.0);
        let area = Bounds::of([area.min + margin, area.max - margin]);
        let axis = PlotAxis::linear(self.quantity.axis_name());
        lay_out_scale(area, &axis, &self.range, self.colour_map(errors), measure)
    }

    /// Returns what determines the colour of a value.
    pub fn scale(&self) -> (&Quantity, &RangeInclusive<f64>, SequentialMap) {
        (&self.quantity, &self.range, self.colours)
    }

    /// Returns `true` if both look the same. Values are compared by their address in memory, which is fast.
    pub fn looks_like(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.map, &other.map)
            && Arc::ptr_eq(&self.values, &other.values)
            && Arc::ptr_eq(&self.nodes, &other.nodes)
            && (self.mode, self.usable_range()) == (other.mode, other.usable_range())
            && (self.colours, &self.quantity) == (other.colours, &other.quantity)
    }

    /// Returns the range of its nodes: "z 4.00 to 5.00 mm".
    pub fn range_text(&self) -> String {
        match self.extremes() {
            Some((low, high)) => self.quantity.range_text(low.z, high.z),
            None => "no values".to_owned(),
        }
    }

    /// Returns the lowest and the highest node.
    fn extremes(&self) -> Option<(&DVec3, &DVec3)> {
        let finite = self.nodes.iter().filter(|node| node.is_finite());
        extremes(finite, |node| node.z)
    }

    /// Describes the surface: the range of its nodes, and the place furthest from rest.
    pub fn summary(&self) -> String {
        let (range, nodes) = (self.range_text(), counted(self.nodes.len(), "node"));
        let Some((lowest, highest)) = self.extremes() else {
            return range;
        };
        if lowest.z == highest.z {
            return format!("{range}, the same at {nodes}");
        }
        let (what, furthest) = match &self.quantity {
            Quantity::Height => ("lowest", lowest),
            quantity if !quantity.is_diverging() => ("largest", highest),
            _ if -lowest.z > highest.z => ("furthest from zero", lowest),
            _ => ("furthest from zero", highest),
        };
        let [x, y] = [furthest.x, furthest.y].map(|place_mm| format_number(place_mm).replace('-', "−"));
        format!("{range} over {nodes}, {what} at x {x}, y {y} mm")
    }

    /// Lays the surface out in `card`, as `camera` sees it; `errors` are the colours of values that diverge from zero.
    pub fn lay_out(&self, camera: OrbitCamera, card: Bounds, measure: Measure<'_>, errors: &ColourMap) -> Drawing {
        let (plot_box, camera) = match self.mode {
            ViewMode::ThreeD => {
                let room = (card.size() - LABELS).max(Vec2::ONE);
                (PlotBox::new(self.box_mm(), room.y / room.x), Some(camera))
            }
            ViewMode::Top => (PlotBox::flat(self.box_mm()), None),
        };
        let names = ["x (mm)", "y (mm)", &self.quantity.axis_name()];
        let (inner, range) = (card.grown(-EDGE), self.usable_range());
        let axes = Axes::new(measure, inner, plot_box, camera, &range, names);
        let sight = axes.sight;
        let (mut mesh, mut dots) = (Mesh::default(), Dots::default());
        if self.values.len() == self.map.grid().len() {
            mesh = Mesh::new(self, &sight, self.colour_map(errors));
            dots = Dots::new(self, &sight);
        }
        let mut frame = axes.lines;
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

    /// Returns the values at the ends of the colours and of the value axis: a range of non-zero width for any input.
    fn usable_range(&self) -> RangeInclusive<f64> {
        match (*self.range.start(), *self.range.end()) {
            (low, high) if !(low.is_finite() && high.is_finite()) => 0.0..=1.0,
            (low, high) if high - low > 1e-9 * low.abs().max(1e-3) => low..=high,
            (low, _) => low - 0.5..=low + 0.5,
        }
    }

    /// Returns the lowest and the highest value in the box, which has room for overshoots.
    fn shown(&self) -> [f64; 2] {
        let range = self.usable_range();
        let headroom = 0.08 * (range.end() - range.start());
        [range.start() - headroom, range.end() + headroom]
    }

    /// Returns two corners of the box: the extent of the grid, and the range of values.
    pub(super) fn box_mm(&self) -> [DVec3; 2] {
        let (x_mm, y_mm) = (self.map.grid().x_mm(), self.map.grid().y_mm());
        let (last_x, last_y) = (x_mm[x_mm.len() - 1], y_mm[y_mm.len() - 1]);
        let [low, high] = self.shown();
        [DVec3::new(x_mm[0], y_mm[0], low), DVec3::new(last_x, last_y, high)]
    }

    /// Position of a value on the scale of colours.
    pub(super) fn share(&self, value: f64) -> f32 {
        let range = self.usable_range();
        ((value - range.start()) / (range.end() - range.start())) as f32
    }

    /// Returns the position at which a place of the surface is drawn: in space, beyond the box, at its edge.
    pub(super) fn drawn(&self, place_mm: DVec3) -> DVec3 {
        let [low, high] = self.shown();
        match self.mode {
            ViewMode::ThreeD => place_mm.with_z(place_mm.z.clamp(low, high)),
            ViewMode::Top => place_mm,
        }
    }

    /// Returns the place of a grid point; its value is NaN in a gap.
    pub(super) fn place_mm(&self, [ix, iy]: [usize; 2]) -> DVec3 {
        let grid = self.map.grid();
        let value = self.values.get(grid.index(ix, iy)).copied();
        DVec3::new(grid.x_mm()[ix], grid.y_mm()[iy], value.unwrap_or(f64::NAN))
    }

    /// Returns the places of the corners of a cell, going round it; `None` in a gap.
    pub(super) fn cell_mm(&self, ix: usize, iy: usize) -> Option<[DVec3; 4]> {
        let corners = corners(ix, iy).map(|corner| self.place_mm(corner));
        corners.iter().all(|corner| corner.z.is_finite()).then_some(corners)
    }
}

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

/// Surfaces side by side, seen by one camera.
#[derive(Clone, Debug, Default)]
pub struct SurfaceFigure {
    /// From left to right.
    pub surfaces: Vec<Surface>,
    /// The camera of those in space.
    pub camera: OrbitCamera,
    /// Index of the node that is marked on each.
    pub marked_node: Option<usize>,
    /// Indices of nodes that are highlighted on each.
    pub lit_nodes: Vec<usize>,
    /// Line along which the surfaces are cut in a figure of their section.
    pub section: Option<Section>,
}

impl SurfaceFigure {
    /// Gives surfaces of the same quantity a common scale, which makes colours and heights comparable.
    #[must_use]
    pub fn with_common_scales(mut self) -> Self {
        let surfaces = self.surfaces.clone();
        for surface in &mut self.surfaces {
            let alike = surfaces.iter().filter(|other| other.quantity == surface.quantity);
            for Surface { range, .. } in alike {
                let low = surface.range.start().min(*range.start());
                surface.range = low..=surface.range.end().max(*range.end());
            }
        }
        self
    }

    /// Returns the first surface with each colour scale, from left to right.
    pub fn scales(&self) -> Vec<&Surface> {
        unique_by(self.surfaces.iter(), |surface| surface.scale())
    }

    /// Returns the note common to all surfaces: "Between the nodes: bilinear."
    pub fn note(&self) -> String {
        let kinds = self.surfaces.iter().map(|surface| surface.map.interpolation());
        format!("Between the nodes: {}.", unique_by(kinds, |kind| *kind).join("; "))
    }
}

/// Quantity that a surface shows, which determines its colours.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Heights.
    Height,
    /// Errors, diverging about zero.
    Error,
    /// A deformation pattern of arbitrary scale, diverging about zero.
    Pattern,
    /// Change of the readings with each node.
    Sensitivity,
    /// Values of measured targets in their unit, if that is known.
    Target(Option<Arc<str>>),
    /// Errors of measured targets in their unit, diverging about zero.
    TargetError(Option<Arc<str>>),
}

impl Quantity {
    /// Returns the name and the unit.
    fn name_and_unit(&self) -> (&'static str, Option<&str>) {
        match self {
            Self::Height => ("z", Some("mm")),
            Self::Error => ("error", Some("mm")),
            Self::Pattern => ("pattern", None),
            Self::Sensitivity => ("sensitivity", Some("per mm")),
            Self::Target(unit) => ("value", unit.as_deref()),
            Self::TargetError(unit) => ("error", unit.as_deref()),
        }
    }

    /// Name of the value axis, with its unit.
    pub fn axis_name(&self) -> String {
        match (self, self.name_and_unit()) {
            (Self::Sensitivity, _) => "1/mm".to_owned(),
            (_, (name, unit)) => titled(name, unit),
        }
    }

    /// Returns the range from `low` to `high` as text, with the unit: "z 4.00 to 5.00 mm".
    fn range_text(&self, low: f64, high: f64) -> String {
        let (name, unit) = self.name_and_unit();
        let text = |value: f64| match self {
            Self::Height | Self::Error => format!("{value:.2}"),
            _ => format_number(value),
        };
        let [low, high] = [low, high].map(|end| text(end).replace('-', "−"));
        with_unit(format!("{name} {low} to {high}"), unit)
    }

    /// Returns `true` if the colours diverge from zero.
    pub fn is_diverging(&self) -> bool {
        matches!(self, Self::Error | Self::Pattern | Self::TargetError(_))
    }
}
