use glam::{DVec3, Vec2, Vec3};

use super::{field::Field, light::Shade, stage::Stage};
use crate::figure::colour_map::{ColourMap, Rgb};

/// Opacity of the extrapolated margin where it begins; it fades to nothing at its rim.
const MARGIN_OPACITY: f32 = 0.6;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position on the screen.
    pub at: Vec2,
    /// Its colour under the light.
    pub colour: Rgb,
    /// 1 within the nodes' rectangle; fades towards the rim of the extrapolated margin.
    pub opacity: f32,
}

/// One vertex for every grid point, in their order.
pub(super) fn vertices(field: &Field<'_>, stage: &Stage<'_>, map: &ColourMap) -> Vec<Vertex> {
    let (x_mm, y_mm) = (field.grid.x_mm(), field.grid.y_mm());
    let across = y_mm.len();
    let places = field.values.iter().enumerate().map(|(index, &value)| {
        let (ix, iy) = (index / across, index % across);
        (ix, iy, DVec3::new(x_mm[ix], y_mm[iy], value))
    });
    let vertex = |ix: usize, iy: usize, at: Vec2, value: f64, light: f32| {
        let beyond = field.beyond(ix, iy);
        Vertex {
            at,
            colour: map.at(field.share(value)).map(|part| (f32::from(part) * light) as u8),
            opacity: if beyond > 0.0 {
                MARGIN_OPACITY * (1.0 - beyond).max(0.0).powf(1.3)
            } else {
                1.0
            },
        }
    };
    match stage {
        Stage::Plan(plan) => places
            .map(|(ix, iy, place)| vertex(ix, iy, plan.point(place.truncate()), place.z, 1.0))
            .collect(),
        Stage::Space(projection) => {
            let plot_box = projection.plot_box;
            let (low, high) = (plot_box.min_mm.z, plot_box.max_mm.z);
            let in_box = |place: DVec3| plot_box.unit(place.with_z(place.z.clamp(low, high)));
            let units: Vec<Vec3> = places.clone().map(|(_, _, place)| in_box(place)).collect();
            let shade = Shade::new(&units, across, projection.eye);
            let lit = places.zip(&units).map(|((ix, iy, place), unit)| {
                vertex(ix, iy, projection.point_of_unit(*unit), place.z, shade.at(ix, iy))
            });
            lit.collect()
        }
    }
}

/// A vertex between others, by its share of each.
pub(super) fn mixed(vertices: &[Vertex; 4], shares: [f64; 4]) -> Vertex {
    let mix = |of: &dyn Fn(&Vertex) -> f32| -> f32 {
        vertices
            .iter()
            .zip(shares)
            .map(|(vertex, share)| of(vertex) * share as f32)
            .sum()
    };
    Vertex {
        at: Vec2::ZERO,
        colour: [0, 1, 2].map(|part| mix(&|vertex| f32::from(vertex.colour[part])).round() as u8),
        opacity: mix(&|vertex| vertex.opacity),
    }
}
