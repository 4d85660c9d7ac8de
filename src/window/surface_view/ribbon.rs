//! Thin, soft lines inside a mesh, so that what is drawn later hides them.

use eframe::egui::{Color32, Mesh, Pos2};

/// Half the width over which a line fades out, in points.
const REACH: f32 = 1.0;

/// Vertices and triangles of one line.
pub(super) const VERTICES: usize = 6;
pub(super) const TRIANGLES: usize = 4;

/// Appends a line about one point wide whose colour fades out on both sides.
pub(super) fn line(mesh: &mut Mesh, from: Pos2, to: Pos2, colour: Color32) {
    let along = to - from;
    let length = along.length();
    if length < 1e-3 || !length.is_finite() {
        return;
    }
    let across = along.rot90() * (REACH / length);
    let first = mesh.vertices.len() as u32;
    for (side, colour) in [(-1.0, Color32::TRANSPARENT), (0.0, colour), (1.0, Color32::TRANSPARENT)] {
        mesh.colored_vertex(from + across * side, colour);
        mesh.colored_vertex(to + across * side, colour);
    }
    for strip in [first, first + 2] {
        mesh.add_triangle(strip, strip + 1, strip + 2);
        mesh.add_triangle(strip + 2, strip + 1, strip + 3);
    }
}
