use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::{ArrayScale, Geometry};

/// Columns per block, whose sums stay in registers. The padding of the last block is discarded.
const LANES: usize = 8;

/// Computes `s_k = Σ_i Σ_j 1/d` of Eq. (2), in 1/mm, for row-wire `row` whose nodes are displaced by `displacements_mm`
/// (M2), into `sums` (M4); and its derivatives by the displacements along no axis (`AXES` = 0), z (1) or x, y and z (3)
/// into `derivatives` (M2 × `AXES` × M4, in 1/mm²).
///
/// With d² = dx² + dy² + z²: ∂(1/d)/∂ux = −dx/d³, ∂(1/d)/∂uy = −dy/d³ and, uz counting downwards, ∂(1/d)/∂uz = z/d³.
///
/// No fused operations, so every machine gives the same bits.
pub(super) fn sum_reciprocal_distances<const AXES: usize>(
    (scale, geometry): (ArrayScale, &Geometry),
    row: usize,
    displacements_mm: &[DVec3],
    sums: &mut [f64],
    derivatives: &mut [f64],
) {
    pulp::Arch::new().dispatch(Summation::<AXES> {
        scale,
        geometry,
        row,
        displacements_mm,
        sums,
        derivatives,
    });
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Summation<'a, const AXES: usize> {
    scale: ArrayScale,
    geometry: &'a Geometry,
    row: usize,
    displacements_mm: &'a [DVec3],
    sums: &'a mut [f64],
    derivatives: &'a mut [f64],
}

impl<const AXES: usize> WithSimd for Summation<'_, AXES> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let geometry = self.geometry;
        let columns = self.sums.len();
        for (block, sums) in self.sums.chunks_mut(LANES).enumerate() {
            let first = block * LANES;
            let mut y_mm = [0.0; LANES];
            for (lane, y_mm) in y_mm.iter_mut().enumerate() {
                *y_mm = geometry.column_y0_mm + geometry.column_pitch_mm * (first + lane) as f64;
            }
            let mut totals = [0.0; LANES];
            for (node, &displacement) in self.displacements_mm.iter().enumerate() {
                let position = geometry.displaced_mm(self.scale, self.row, node, displacement);
                let mut slopes = [[0.0; LANES]; AXES];
                add_node(self.scale, geometry, position, &y_mm, &mut totals, &mut slopes);
                for (axis, slopes) in slopes.iter().enumerate() {
                    let begin = (node * AXES + axis) * columns + first;
                    self.derivatives[begin..begin + sums.len()].copy_from_slice(&slopes[..sums.len()]);
                }
            }
            sums.copy_from_slice(&totals[..sums.len()]);
        }
    }
}

#[inline(always)]
fn add_node<const AXES: usize>(
    scale: ArrayScale,
    geometry: &Geometry,
    position: DVec3,
    y_mm: &[f64; LANES],
    sums: &mut [f64; LANES],
    slopes: &mut [[f64; LANES]; AXES],
) {
    for j in 0..scale.nodes_per_column() {
        let dx = position.x - geometry.column_node_mm(0, j).x;
        let across2 = dx * dx + position.z * position.z;
        for lane in 0..LANES {
            let dy = position.y - y_mm[lane];
            let inverse = 1.0 / (across2 + dy * dy).sqrt();
            sums[lane] += inverse;
            if AXES > 0 {
                let cubed = inverse * inverse * inverse;
                slopes[AXES - 1][lane] += position.z * cubed;
                if AXES == 3 {
                    slopes[0][lane] -= dx * cubed;
                    slopes[1][lane] -= dy * cubed;
                }
            }
        }
    }
}
