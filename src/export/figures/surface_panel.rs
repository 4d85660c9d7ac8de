use glam::DVec3;

/// One surface of a [`SurfaceFigure`](super::SurfaceFigure).
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePanel {
    /// Title above the surface, such as "Actual".
    pub title: String,
    /// Heights on the grid, `x points × y points`, in millimetres.
    pub values_mm: Vec<f64>,
    /// Positions of the nodes, in millimetres; drawn as dots on the map.
    pub nodes_mm: Vec<DVec3>,
}
