use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{ArrayScale, SensorError};

/// Positions of the electrode nodes of the undeformed sensor, in millimetres.
///
/// The paper gives the height (5), the gap between wires (1) and row-wires at x = 8..17. The other values are assumed: of
/// 330 layouts tested, they are those for which the model is closest to the paper's Tables 1 and 3.
/// Row-wires run along y, column-wires along x, z points up from the column-wires.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Geometry {
    /// Distance of the undeformed row-wires above the column-wires.
    pub height_mm: f64,
    /// x of the first row-wire.
    pub row_x0_mm: f64,
    /// Distance between row-wires.
    pub row_pitch_mm: f64,
    /// Distance between the nodes on a row-wire; the row is centred over the column-wires.
    pub node_pitch_mm: f64,
    /// y of the first column-wire.
    pub column_y0_mm: f64,
    /// Distance between column-wires.
    pub column_pitch_mm: f64,
    /// x of the first node on each column-wire.
    pub column_node_x0_mm: f64,
    /// Distance between the nodes on a column-wire.
    pub column_node_pitch_mm: f64,
}

impl Default for Geometry {
    fn default() -> Self {
        Self {
            height_mm: 5.0,
            row_x0_mm: 8.0,
            row_pitch_mm: 1.0,
            node_pitch_mm: 2.0,
            column_y0_mm: 1.0,
            column_pitch_mm: 1.0,
            column_node_x0_mm: 14.0,
            column_node_pitch_mm: 5.0,
        }
    }
}

impl Geometry {
    /// Note for the user on the default values.
    pub const ASSUMPTION: &'static str = "The paper gives height, wire gap and row positions (x = 8 to 17 mm). Node \
         pitch and column-node positions are assumed: the layout, of 330 scanned, that comes closest to its tables.";

    /// Checks that every length is finite and that height and pitches are positive.
    ///
    /// # Errors
    /// If a length is not.
    pub fn check(&self) -> Result<(), SensorError> {
        let offsets = [
            ("the first row-wire's x", self.row_x0_mm),
            ("the first column-wire's y", self.column_y0_mm),
            ("the first column node's x", self.column_node_x0_mm),
        ];
        let lengths = [
            ("the height", self.height_mm),
            ("the row pitch", self.row_pitch_mm),
            ("the node pitch", self.node_pitch_mm),
            ("the column pitch", self.column_pitch_mm),
            ("the column node pitch", self.column_node_pitch_mm),
        ];
        let mut all = offsets.into_iter().chain(lengths);
        if let Some((what, value)) = all.find(|(_, value)| !value.is_finite()) {
            return Err(SensorError::NotFinite { what, value });
        }
        match lengths.into_iter().find(|(_, value)| *value <= 0.0) {
            Some((what, value)) => Err(SensorError::NotPositive { what, value }),
            None => Ok(()),
        }
    }

    /// Returns x of row-wire `row`.
    pub fn row_x_mm(&self, row: usize) -> f64 {
        self.row_x0_mm + self.row_pitch_mm * row as f64
    }

    /// Returns y of node `node` on every row-wire.
    pub fn node_y_mm(&self, scale: ArrayScale, node: usize) -> f64 {
        let columns_centre = self.column_y0_mm + self.column_pitch_mm * (scale.columns() - 1) as f64 / 2.0;
        columns_centre + self.node_pitch_mm * (node as f64 - (scale.nodes_per_row() - 1) as f64 / 2.0)
    }

    /// Returns x of each of these row-wires, and y of the nodes on each: the lattice of the nodes at rest.
    pub fn lattice_mm(&self, scale: ArrayScale, rows: &[usize]) -> (Vec<f64>, Vec<f64>) {
        let nodes = 0..scale.nodes_per_row();
        (
            rows.iter().map(|&row| self.row_x_mm(row)).collect(),
            nodes.map(|node| self.node_y_mm(scale, node)).collect(),
        )
    }

    /// Returns the undeformed position of node `node` on row-wire `row`.
    pub fn row_node_mm(&self, scale: ArrayScale, row: usize, node: usize) -> DVec3 {
        DVec3::new(self.row_x_mm(row), self.node_y_mm(scale, node), self.height_mm)
    }

    /// Returns the position of node `node` on column-wire `column`; the bottom layer does not move.
    pub fn column_node_mm(&self, column: usize, node: usize) -> DVec3 {
        DVec3::new(
            self.column_node_x0_mm + self.column_node_pitch_mm * node as f64,
            self.column_y0_mm + self.column_pitch_mm * column as f64,
            0.0,
        )
    }

    /// Prepares differences of coordinates for nodes shifted sideways by at most `shift_mm`.
    pub(super) fn differences(&self, scale: ArrayScale, row: usize, shift_mm: f64) -> Differences {
        let x_mm = (self.row_x0_mm - self.column_node_x0_mm).abs()
            + self.row_pitch_mm * scale.rows() as f64
            + self.column_node_pitch_mm * scale.nodes_per_column() as f64;
        let y_mm = self.node_pitch_mm * scale.nodes_per_row() as f64 + self.column_pitch_mm * scale.columns() as f64;
        let grid = FixedPoint::new(x_mm + y_mm + shift_mm);
        let first_row_x = grid.sum(self.row_x0_mm, -self.column_node_x0_mm);
        Differences {
            grid,
            row_x: first_row_x.plus(grid.split(self.row_pitch_mm).times(row as f64)),
            electrode_pitch: grid.split(self.column_node_pitch_mm),
            half_node_pitch: grid.split(0.5 * self.node_pitch_mm),
            half_column_pitch: grid.split(0.5 * self.column_pitch_mm),
        }
    }
}

/// Differences of coordinates between a row-wire's nodes and the electrodes of column-wires, in which the origin
/// cancels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Differences {
    pub(super) grid: FixedPoint,
    /// x of the row-wire minus that of the first node on the column-wires.
    pub(super) row_x: SplitLength,
    pub(super) electrode_pitch: SplitLength,
    pub(super) half_node_pitch: SplitLength,
    pub(super) half_column_pitch: SplitLength,
}

/// Axes along which the nodes of the row-wires move, which determine the number of unknowns per node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axes {
    /// Vertical only: one unknown per node.
    #[default]
    Z,
    /// Also sideways: three unknowns per node, in the order x, y, z.
    Xyz,
}

impl Axes {
    /// Returns the number of unknowns per node.
    pub fn count(self) -> usize {
        self.indices().len()
    }

    /// Returns the indices of the unknown coordinates among x, y, z (0, 1, 2).
    pub fn indices(self) -> &'static [usize] {
        match self {
            Self::Z => &[2],
            Self::Xyz => &[0, 1, 2],
        }
    }
}

/// Fixed-point grid fine enough for every coordinate of a row-wire, on which sums are exact.
///
/// A length is split exactly into a multiple of the grid and a remainder (Rump, Ogita and Oishi, "Accurate floating-point
/// summation", SIAM J. Sci. Comput. 31, 2008). Multiples are added without rounding, and the rounding of the small
/// remainders is negligible: differences of coordinates are accurate to the last place, even if they nearly cancel.
#[derive(Clone, Copy, Debug)]
pub(super) struct FixedPoint {
    /// 1.5 times a power of two above any length: adding it rounds to the grid.
    shift: f64,
}

/// Length as a multiple of a grid and a remainder.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SplitLength {
    pub(super) upper: f64,
    pub(super) lower: f64,
}

impl FixedPoint {
    /// Returns the grid for lengths whose sums never exceed `bound`.
    pub(super) fn new(bound: f64) -> Self {
        let exponent = bound.to_bits() & f64::INFINITY.to_bits();
        // The power of two below `bound`, times four.
        Self {
            shift: 6.0 * f64::from_bits(exponent),
        }
    }

    #[inline(always)]
    pub(super) fn split(self, length: f64) -> SplitLength {
        let upper = (length + self.shift) - self.shift;
        SplitLength {
            upper,
            lower: length - upper,
        }
    }

    /// Returns a + b.
    #[inline(always)]
    pub(super) fn sum(self, a: f64, b: f64) -> SplitLength {
        let (sum, rest) = two_sum(a, b);
        let SplitLength { upper, lower } = self.split(sum);
        SplitLength {
            upper,
            lower: lower + rest,
        }
    }
}

impl SplitLength {
    #[inline(always)]
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            upper: self.upper + other.upper,
            lower: self.lower + other.lower,
        }
    }

    /// Returns the length times an integer.
    #[inline(always)]
    pub(super) fn times(self, count: f64) -> Self {
        Self {
            upper: self.upper * count,
            lower: self.lower * count,
        }
    }

    /// Returns the length, rounded once.
    #[inline(always)]
    pub(super) fn rounded(self) -> f64 {
        self.upper + self.lower
    }
}

/// Returns a + b, rounded, and the rounding error, which is exactly representable (Knuth, The Art of Computer
/// Programming, vol. 2, section 4.2.2).
#[inline(always)]
pub(super) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_layout_is_as_documented() {
        let scale = ArrayScale::default();
        let geometry = Geometry::default();
        assert_eq!(geometry.row_node_mm(scale, 9, 0), DVec3::new(17.0, 6.5, 5.0));
        assert_eq!(geometry.column_node_mm(29, 4), DVec3::new(34.0, 30.0, 0.0));
    }

    #[test]
    fn invalid_lengths_are_reported() {
        let flat = Geometry {
            height_mm: 0.0,
            ..Geometry::default()
        };
        assert!(flat.check().unwrap_err().to_string().contains("height"));
        let nan = Geometry {
            node_pitch_mm: f64::NAN,
            ..Geometry::default()
        };
        assert!(nan.check().unwrap_err().to_string().contains("node pitch"));
        assert_eq!(Geometry::default().check(), Ok(()));
    }

    /// As a double, 0.1 is 3602879701896397 / 2⁵⁵.
    #[test]
    fn multiples_keep_their_digits_where_sums_cancel() {
        let unit = 2.0_f64.powi(-55);
        for bound in [2.0, 1e3, 1e9] {
            let grid = FixedPoint::new(bound);
            let product = grid.split(0.1).times(11.0);
            let rest = product.plus(grid.split(-1.1)).rounded();
            let of_decimal = (1.1 / unit) as i64;
            assert_eq!(
                rest / unit,
                (11 * 3_602_879_701_896_397_i64 - of_decimal) as f64,
                "{bound}"
            );
        }
    }

    #[test]
    fn the_remainder_of_a_sum_is_kept() {
        let grid = FixedPoint::new(10.0);
        assert_eq!(grid.sum(1.0, 1e-20).plus(grid.split(-1.0)).rounded(), 1e-20);
        assert_eq!(two_sum(1e17, 3.0), (1e17, 3.0));
    }
}
