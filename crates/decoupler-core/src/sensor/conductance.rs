use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::{
    Axes, SensorModel,
    geometry::{Differences, SplitLength, two_sum},
};

/// The sums `s_k = Σ_i Σ_j 1/d` of Eq. (2) for one row-wire, with `R_k = g / s_k`, and their derivatives by the unknowns.
/// Storage is reused between evaluations, which do not allocate.
///
/// Conductance is suited to solvers: it is a plain sum over nodes, hence much closer to linear than resistance.
#[derive(Clone, Debug, PartialEq)]
pub struct RowConductance {
    axes: Axes,
    /// See [`Self::refined`].
    is_refined: bool,
    /// s_k in 1/mm: M4.
    sums: Vec<f64>,
    /// ∂s_k/∂u in 1/mm²: unknown by unknown (node by node, each node's axes together), each M4 long.
    derivatives: Vec<f64>,
}

impl RowConductance {
    /// Allocates storage for the row-wires of `model` whose nodes move along `axes`.
    pub fn new(model: &SensorModel, axes: Axes) -> Self {
        let columns = model.scale.columns();
        Self {
            axes,
            is_refined: false,
            sums: vec![0.0; columns],
            derivatives: vec![0.0; columns * model.scale.nodes_per_row() * axes.count()],
        }
    }

    /// Evaluates with [refined](reciprocal_root) reciprocal roots: in half the time, with errors of a few more units in the
    /// last place. Distances must be [within reach](Self::is_within_reach).
    pub(crate) fn refined(self) -> Self {
        Self {
            is_refined: true,
            ..self
        }
    }

    /// Returns the sums s_k in 1/mm: M4.
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }

    /// Returns the derivatives of every s_k by one unknown in 1/mm²: M4.
    pub fn derivatives(&self, unknown: usize) -> &[f64] {
        &self.derivatives[unknown * self.sums.len()..][..self.sums.len()]
    }

    /// Evaluates sums and derivatives of row-wire `row` whose nodes are displaced by `displacements_mm` (M2 of them).
    ///
    /// # Panics
    /// If there are not M2 displacements.
    pub fn evaluate(&mut self, model: &SensorModel, row: usize, displacements_mm: &[DVec3]) {
        match self.axes {
            Axes::Z => self.sum::<1>(model, row, displacements_mm),
            Axes::Xyz => self.sum::<3>(model, row, displacements_mm),
        }
    }

    /// Evaluates only the sums, bit-identical to [`Self::evaluate`]; derivatives remain those of the last evaluation.
    pub(crate) fn evaluate_sums(&mut self, model: &SensorModel, row: usize, displacements_mm: &[DVec3]) {
        self.sum::<0>(model, row, displacements_mm);
    }

    fn sum<const AXES: usize>(&mut self, model: &SensorModel, row: usize, displacements_mm: &[DVec3]) {
        assert_eq!(displacements_mm.len(), model.scale.nodes_per_row());
        let (at, derivatives) = ((model, row, displacements_mm), &mut self.derivatives[..]);
        match self.is_refined {
            false => sum_reciprocal_distances::<AXES, false>(at, &mut self.sums, derivatives),
            true => sum_reciprocal_distances::<AXES, true>(at, &mut self.sums, derivatives),
        }
    }

    /// Returns `true` if refined reciprocal roots are valid for nodes displaced by up to `largest_mm` and at least
    /// `nearest_mm` away from the column-wires.
    pub(crate) fn is_within_reach(model: &SensorModel, nearest_mm: f64, largest_mm: f64) -> bool {
        let (geometry, scale) = (&model.geometry, model.scale);
        let farthest_mm = geometry.height_mm
            + (geometry.row_x0_mm - geometry.column_node_x0_mm).abs()
            + geometry.row_pitch_mm * scale.rows() as f64
            + geometry.column_node_pitch_mm * scale.nodes_per_column() as f64
            + geometry.node_pitch_mm * scale.nodes_per_row() as f64
            + geometry.column_pitch_mm * scale.columns() as f64
            + 3.0 * largest_mm;
        nearest_mm > 0.0
            && SQUARES.contains(&(nearest_mm * nearest_mm))
            && SQUARES.contains(&(farthest_mm * farthest_mm))
    }
}

/// Squares whose refined reciprocal root stays within the range of single precision.
const SQUARES: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

/// Returns 1/√x: by a square root and a division or, if refined, by a single-precision estimate, whose square root and
/// division take a quarter of the time, and one third-order step (Householder 1970): with e = 1 − x y²,
/// `y (1 + e/2 + 3e²/8)` leaves an error of 5e³/16, below 1e-19. Accurate to 2 units in the last place for squares in
/// [`SQUARES`].
#[inline(always)]
fn reciprocal_root<const IS_REFINED: bool>(square: f64) -> f64 {
    if !IS_REFINED {
        return 1.0 / square.sqrt();
    }
    let first = f64::from(1.0 / (square as f32).sqrt());
    let error = 1.0 - square * first * first;
    first + first * (error * (0.5 + 0.375 * error))
}

/// Number of columns per block, whose sums stay in registers. The padding of the last block is discarded.
const LANES: usize = 8;
/// Number of electrodes per chunk, which is summed without compensation.
const ELECTRODES: usize = 8;

/// Computes `s_k = Σ_i Σ_j 1/d` of Eq. (2), in 1/mm, for row-wire `row` whose nodes are displaced by `displacements_mm`
/// (M2), into `sums` (M4); and its derivatives by the displacements along no axis (`AXES` = 0), z (1) or x, y and z (3)
/// into `derivatives` (M2 × `AXES` × M4, in 1/mm²).
///
/// With d² = dx² + dy² + z²: ∂(1/d)/∂ux = −dx/d³, ∂(1/d)/∂uy = −dy/d³ and, with uz positive downwards, ∂(1/d)/∂uz = z/d³.
///
/// Differences of coordinates are accurate to the last place for any origin, and the sum over nodes is compensated
/// (Ogita, Rump and Oishi, "Accurate sum and dot product", SIAM J. Sci. Comput. 26, 2005), so that s is accurate to a few
/// units in the last place for any number of nodes.
///
/// There are no fused operations, so results are bit-identical on all machines.
pub(super) fn sum_reciprocal_distances<const AXES: usize, const IS_REFINED: bool>(
    (model, row, displacements_mm): (&SensorModel, usize, &[DVec3]),
    sums: &mut [f64],
    derivatives: &mut [f64],
) {
    pulp::Arch::new().dispatch(Summation::<AXES, IS_REFINED> {
        model,
        row,
        displacements_mm,
        sums,
        derivatives,
    });
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Summation<'a, const AXES: usize, const IS_REFINED: bool> {
    model: &'a SensorModel,
    row: usize,
    displacements_mm: &'a [DVec3],
    sums: &'a mut [f64],
    derivatives: &'a mut [f64],
}

impl<const AXES: usize, const IS_REFINED: bool> WithSimd for Summation<'_, AXES, IS_REFINED> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let shift_mm = self.displacements_mm.iter().fold(0.0_f64, |largest, displacement| {
            largest.max(displacement.x.abs()).max(displacement.y.abs())
        });
        let differences = self.model.geometry.differences(self.model.scale, self.row, shift_mm);
        self.sums.fill(0.0);
        // The first chunk, usually the only one, has separate code, which does not read derivatives.
        self.add_electrodes(&differences, 0, true);
        for first in (ELECTRODES..self.model.scale.nodes_per_column()).step_by(ELECTRODES) {
            self.add_electrodes(&differences, first, false);
        }
    }
}

impl<const AXES: usize, const IS_REFINED: bool> Summation<'_, AXES, IS_REFINED> {
    /// Adds the terms of one chunk of electrodes, from `first_electrode` on, of every column-wire.
    #[inline(always)]
    fn add_electrodes(&mut self, differences: &Differences, first_electrode: usize, are_first: bool) {
        let model = self.model;
        let columns = self.sums.len();
        let Differences {
            grid,
            row_x,
            electrode_pitch,
            half_node_pitch,
            half_column_pitch,
        } = *differences;
        // x of the first node on the column-wires minus that of each electrode.
        let electrodes_x: [SplitLength; ELECTRODES] =
            std::array::from_fn(|electrode| electrode_pitch.times(-((first_electrode + electrode) as f64)));
        let electrodes_x = &electrodes_x[..ELECTRODES.min(model.scale.nodes_per_column() - first_electrode)];
        for (block, sums) in self.sums.chunks_mut(LANES).enumerate() {
            let first = block * LANES;
            // y of the middle of the array minus that of each column-wire.
            let columns_y: [SplitLength; LANES] =
                std::array::from_fn(|lane| half_column_pitch.times((columns - 1) as f64 - (2 * (first + lane)) as f64));
            let mut totals = [0.0; LANES];
            let mut rests = [0.0; LANES];
            totals[..sums.len()].copy_from_slice(sums);
            for (node, displacement) in self.displacements_mm.iter().enumerate() {
                // x of the node minus that of the first node on the column-wires, and y minus that of the middle.
                let x = row_x.plus(grid.split(displacement.x));
                let twice_from_middle = (2 * node) as f64 - (model.scale.nodes_per_row() - 1) as f64;
                let y = (half_node_pitch.times(twice_from_middle)).plus(grid.split(displacement.y));
                let z = model.geometry.height_mm - displacement.z;
                let dy = columns_y.map(|column_y| y.plus(column_y).rounded());
                let mut of_node = [0.0; LANES];
                let mut slopes = [[0.0; LANES]; AXES];
                for &electrode_x in electrodes_x {
                    let dx = x.plus(electrode_x).rounded();
                    add_electrode::<AXES, IS_REFINED>([dx, z], &dy, &mut of_node, &mut slopes);
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
                // The compensation of an infinite sum (a node touches a column-wire) is NaN.
                *sum = if rest.is_nan() { *total } else { total + rest };
            }
        }
    }
}

/// Adds 1/d and its derivatives for an electrode of each column-wire of a block.
#[inline(always)]
fn add_electrode<const AXES: usize, const IS_REFINED: bool>(
    [dx, z]: [f64; 2],
    dy: &[f64; LANES],
    sums: &mut [f64; LANES],
    slopes: &mut [[f64; LANES]; AXES],
) {
    let across2 = dx * dx + z * z;
    for lane in 0..LANES {
        let dy = dy[lane];
        let inverse = reciprocal_root::<IS_REFINED>(across2 + dy * dy);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Compared with the evaluation by square roots and divisions, whose rounding is tested in high precision elsewhere.
    #[test]
    fn refined_sums_and_derivatives_are_within_four_units_in_the_last_place() {
        for scale in ["10x10_5x30", "3x2_1x7", "2x9_17x5"] {
            let model = SensorModel::new(scale.parse().unwrap());
            let nodes = model.scale.nodes_per_row();
            let at: Vec<DVec3> = (0..nodes)
                .map(|i| DVec3::new(0.07 * i as f64, -0.05 * i as f64, 0.09 * i as f64))
                .collect();
            for axes in [Axes::Z, Axes::Xyz] {
                let mut exact = RowConductance::new(&model, axes);
                let mut refined = exact.clone().refined();
                exact.evaluate(&model, 1, &at);
                refined.evaluate(&model, 1, &at);
                let mut alone = refined.clone();
                alone.evaluate_sums(&model, 2.min(model.scale.rows() - 1), &at);
                alone.evaluate_sums(&model, 1, &at);
                assert_eq!(alone, refined);
                let mut alone = exact.clone();
                alone.evaluate_sums(&model, 2.min(model.scale.rows() - 1), &at);
                alone.evaluate_sums(&model, 1, &at);
                assert_eq!(alone, exact);
                for (exact, refined) in exact.sums().iter().zip(refined.sums()) {
                    assert!(
                        (refined / exact - 1.0).abs() <= 4.0 * f64::EPSILON,
                        "{scale}: {refined} {exact}"
                    );
                }
                for unknown in 0..nodes * axes.count() {
                    let largest = exact
                        .derivatives(unknown)
                        .iter()
                        .fold(0.0, |most: f64, slope| most.max(slope.abs()));
                    for (exact, refined) in exact.derivatives(unknown).iter().zip(refined.derivatives(unknown)) {
                        assert!(
                            (refined - exact).abs() <= 8.0 * f64::EPSILON * largest,
                            "{scale}: {refined} {exact}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn lengths_beyond_single_precision_are_excluded() {
        let mut model = SensorModel::new("2x4_3x12".parse().unwrap());
        assert!(RowConductance::is_within_reach(&model, 0.5, 2.0));
        assert!(!RowConductance::is_within_reach(&model, 0.0, 2.0));
        assert!(!RowConductance::is_within_reach(&model, 1e-20, 2.0));
        assert!(
            !RowConductance::is_within_reach(&model, -0.5, 5.5),
            "beyond the column-wires"
        );
        model.geometry.column_pitch_mm = 1e20;
        assert!(!RowConductance::is_within_reach(&model, 0.5, 2.0));
    }

    #[test]
    fn a_node_on_a_column_wire_conducts_without_limit_there_alone() {
        let model = SensorModel::new("2x4_3x12".parse().unwrap());
        let mut at = [DVec3::ZERO; 4];
        at[1] = model.displacement_mm(1, 1, model.geometry.column_node_mm(5, 2));
        let mut row = RowConductance::new(&model, Axes::Z);
        row.evaluate_sums(&model, 1, &at);
        assert!(row.sums()[5] > 1e10, "{}", row.sums()[5]);
        assert!(row.sums().iter().all(|sum| *sum > 0.0));
        assert_eq!(row.sums().iter().filter(|sum| **sum > 1e10).count(), 1);
    }

    /// The Jacobian of [`SensorModel`] is tested against central differences; R = g/s relates the two.
    #[test]
    fn sums_and_derivatives_match_the_resistances() {
        for scale in ["10x6_3x18", "3x2_1x7"] {
            let model = SensorModel::new(scale.parse().unwrap());
            let nodes = model.scale.nodes_per_row();
            let at: Vec<DVec3> = (0..nodes)
                .map(|i| DVec3::new(0.1 * i as f64, -0.05, 0.13 * i as f64))
                .collect();
            let resistances = model.row_resistances(2, &at).unwrap();
            let jacobian = model.row_jacobian(2, &at).unwrap();
            for axes in [Axes::Z, Axes::Xyz] {
                let mut row = RowConductance::new(&model, axes);
                row.evaluate(&model, 2, &at);
                for (column, (&sum, &ohm)) in row.sums().iter().zip(&resistances).enumerate() {
                    assert!((model.resistivity_ohm_per_mm / sum / ohm - 1.0).abs() < 1e-14);
                    for node in 0..nodes {
                        for (place, &axis) in axes.indices().iter().enumerate() {
                            let slope = row.derivatives(node * axes.count() + place)[column];
                            let of_resistance = -model.resistivity_ohm_per_mm / (sum * sum) * slope;
                            let expected = jacobian[[column, node, axis]];
                            // ∂R/∂u = −g/s² ∂s/∂u.
                            assert!(
                                (of_resistance - expected).abs() < 1e-12 * ohm,
                                "{of_resistance} {expected}"
                            );
                        }
                    }
                }
            }
        }
    }

    /// y is accurate to 2 units in the last place if x y² is accurate to twice as many: y (1 + δ) gives 1 + 2δ.
    #[test]
    fn refined_roots_are_accurate_to_two_units_in_the_last_place() {
        let (mut square, mut worst) = (*SQUARES.start(), 0.0_f64);
        while square < *SQUARES.end() {
            let root = reciprocal_root::<true>(square);
            // x y² with the rounding error of y²: fused operations round once.
            let upper = root * root;
            let lower = root.mul_add(root, -upper);
            let error = square.mul_add(upper, -1.0) + square * lower;
            worst = worst.max(0.5 * error.abs());
            square *= 1.000_73;
        }
        assert!(worst < 2.0 * 0.5 * f64::EPSILON * 2.0, "{worst:e}");
    }
}
