//! Surfaces in space or from above.
//!
//! A [`SurfaceFigure`] describes a picture of surfaces. Each [`Surface`] of it lays itself out in a card as a
//! [`Drawing`]: shapes and a mesh in the order of painting. A renderer only has to paint them.
//!
//! `camera` maps millimetres to points on the screen and back; `axes` lays out the axes with their ticks and labels.
//! `field` is the surface on its grid and `mesh` the same with contour lines, from far to near; `section` cuts it along a
//! wire. `nodes` are the dots on it, and `pick` finds the place on the surface under a point of the screen.

mod axes;
mod camera;
mod drawing;
mod field;
mod mesh;
mod nodes;
mod pick;
mod quantity;
mod section;

pub use camera::{OrbitCamera, Ray, Sight};
pub use drawing::Drawing;
pub use mesh::{Mesh, Piece, Vertex};
pub use nodes::Dots;
pub use quantity::{ColourScale, Quantity};
pub use section::{Section, SectionLine};

use std::{ops::RangeInclusive, sync::Arc};

use decoupler_core::surface::SurfaceMap;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::figure::{colour_map::SequentialMap, unique_by};

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

    /// Colours of the values.
    pub fn scale(&self) -> ColourScale {
        ColourScale {
            quantity: self.quantity.clone(),
            range: self.range.clone(),
            colours: self.colours,
        }
    }

    /// Returns `true` if both look the same. Values are compared by their address in memory, which is fast.
    pub fn looks_like(&self, other: &Self) -> bool {
        let bits = |surface: &Self| [*surface.range.start(), *surface.range.end()].map(f64::to_bits);
        Arc::ptr_eq(&self.map, &other.map)
            && Arc::ptr_eq(&self.values, &other.values)
            && Arc::ptr_eq(&self.nodes, &other.nodes)
            && self.quantity == other.quantity
            && (self.mode, self.colours, bits(self)) == (other.mode, other.colours, bits(other))
    }
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
        let scales = self.scales();
        for surface in &mut self.surfaces {
            let alike = scales.iter().filter(|scale| scale.quantity == surface.quantity);
            for ColourScale { range, .. } in alike {
                let low = surface.range.start().min(*range.start());
                surface.range = low..=surface.range.end().max(*range.end());
            }
        }
        self
    }

    /// Returns the different colour scales, from left to right.
    pub fn scales(&self) -> Vec<ColourScale> {
        unique_by(self.surfaces.iter().map(Surface::scale), Clone::clone)
    }

    /// Returns the note common to all surfaces: "Between the nodes: bilinear."
    pub fn note(&self) -> String {
        let kinds = self.surfaces.iter().map(|surface| surface.map.interpolation());
        format!("Between the nodes: {}.", unique_by(kinds, |kind| *kind).join("; "))
    }
}
