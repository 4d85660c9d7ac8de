use std::marker::PhantomData;

use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::{
    ArrayScale, Geometry,
    conductance::ReciprocalRoot,
    fixed_point::{SplitLength, two_sum},
    geometry::Differences,
};

/// Columns per block, whose sums stay in registers. The padding of the last block is discarded.
const LANES: usize = 8;
/// Electrodes per chunk, whose sum is rounded as it comes.
const ELECTRODES: usize = 8;

/// Computes `s_k = Σ_i Σ_j 1/d` of Eq. (2), in 1/mm, for row-wire `row` whose nodes are displaced by `displacements_mm`
/// (M2), into `sums` (M4); and its derivatives by the displacements along no axis (`AXES` = 0), z (1) or x, y and z (3)
/// into `derivatives` (M2 × `AXES` × M4, in 1/mm²).
///
/// Where a wire is broken, the sum is over the nodes before the break: the first ones of the row-wire, if fewer
/// displacements are given, and the first `electrodes` of every column-wire.
///
/// With d² = dx² + dy² + z²: ∂(1/d)/∂ux = −dx/d³, ∂(1/d)/∂uy = −dy/d³ and, uz counting downwards, ∂(1/d)/∂uz = z/d³.
///
/// Differences of coordinates are right to the last place wherever the origin is, and the sum over nodes is compensated
/// (Ogita, Rump and Oishi, "Accurate sum and dot product", SIAM J. Sci. Comput. 26, 2005), so that s is right to a few
/// units in the last place for any number of nodes.
///
/// No fused operations, so every machine gives the same bits.
pub(super) fn sum_reciprocal_distances<const AXES: usize, R: ReciprocalRoot>(
    (scale, geometry): (ArrayScale, &Geometry),
    row: usize,
    displacements_mm: &[DVec3],
    electrodes: usize,
    sums: &mut [f64],
    derivatives: &mut [f64],
) {
    pulp::Arch::new().dispatch(Summation::<AXES, R> {
        scale,
        geometry,
        row,
        displacements_mm,
        electrodes,
        sums,
        derivatives,
        root: PhantomData,
    });
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Summation<'a, const AXES: usize, R> {
    scale: ArrayScale,
    geometry: &'a Geometry,
    row: usize,
    displacements_mm: &'a [DVec3],
    electrodes: usize,
    sums: &'a mut [f64],
    derivatives: &'a mut [f64],
    root: PhantomData<R>,
}

impl<const AXES: usize, R: ReciprocalRoot> WithSimd for Summation<'_, AXES, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let shift_mm = self.displacements_mm.iter().fold(0.0_f64, |largest, displacement| {
            largest.max(displacement.x.abs()).max(displacement.y.abs())
        });
        let differences = self.geometry.differences(self.scale, self.row, shift_mm);
        self.sums.fill(0.0);
        // The first chunk, nearly always the only one, has code of its own, which does not read derivatives.
        self.add_electrodes(&differences, 0, true);
        for first in (ELECTRODES..self.electrodes).step_by(ELECTRODES) {
            self.add_electrodes(&differences, first, false);
        }
    }
}

impl<const AXES: usize, R: ReciprocalRoot> Summation<'_, AXES, R> {
    /// Adds the terms of electrodes `first_electrode` and on of every column-wire.
    #[inline(always)]
    fn add_electrodes(&mut self, differences: &Differences, first_electrode: usize, are_first: bool) {
        let Self {
            geometry, electrodes, ..
        } = *self;
        let columns = self.sums.len();
        let electrodes_x: [SplitLength; ELECTRODES] =
            std::array::from_fn(|electrode| differences.electrode_x(first_electrode + electrode));
        let electrodes_x = &electrodes_x[..ELECTRODES.min(electrodes - first_electrode)];
        for (block, sums) in self.sums.chunks_mut(LANES).enumerate() {
            let first = block * LANES;
            let columns_y: [SplitLength; LANES] = std::array::from_fn(|lane| differences.column_y(first + lane));
            let mut totals = [0.0; LANES];
            let mut rests = [0.0; LANES];
            totals[..sums.len()].copy_from_slice(sums);
            for (node, displacement) in self.displacements_mm.iter().enumerate() {
                let x = differences.node_x(displacement.x);
                let y = differences.node_y(node, displacement.y);
                let z = geometry.height_mm - displacement.z;
                let dy = columns_y.map(|column_y| y.plus(column_y).rounded());
                let mut of_node = [0.0; LANES];
                let mut slopes = [[0.0; LANES]; AXES];
                for &electrode_x in electrodes_x {
                    let dx = x.plus(electrode_x).rounded();
                    add_electrode::<AXES, R>([dx, z], &dy, &mut of_node, &mut slopes);
                }
                for lane in 0..LANES {
                    let (total, rest) = two_sum(totals[lane], of_node[lane]);
                    totals[lane] = total;
                    rests[lane] += rest;
                }
                for (axis, slopes) in slopes.iter().enumerate() {
                    let begin = (node * AXES + axis) * columns + first;
                    let derivatives = &mut self.derivatives[begin..begin + sums.len()];
                    if are_first {
                        derivatives.copy_from_slice(&slopes[..sums.len()]);
                    } else {
                        derivatives
                            .iter_mut()
                            .zip(slopes)
                            .for_each(|(sum, slope)| *sum += slope);
                    }
                }
            }
            for (sum, (total, rest)) in sums.iter_mut().zip(totals.iter().zip(&rests)) {
                // The rest of an infinite sum, that of a node which touches a column-wire, is not a number.
                *sum = if rest.is_nan() { *total } else { total + rest };
            }
        }
    }
}

/// Adds 1/d and its derivatives for an electrode of each column-wire of a block.
#[inline(always)]
fn add_electrode<const AXES: usize, R: ReciprocalRoot>(
    [dx, z]: [f64; 2],
    dy: &[f64; LANES],
    sums: &mut [f64; LANES],
    slopes: &mut [[f64; LANES]; AXES],
) {
    let across2 = dx * dx + z * z;
    for lane in 0..LANES {
        let dy = dy[lane];
        let inverse = R::of(across2 + dy * dy);
        sums[lane] += inverse;
        if AXES > 0 {
            let cubed = inverse * inverse * inverse;
            slopes[AXES - 1][lane] += z * cubed;
            if AXES == 3 {
                slopes[0][lane] -= dx * cubed;
                slopes[1][lane] -= dy * cubed;
            }
        }
    }
}
