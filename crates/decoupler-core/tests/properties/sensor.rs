//! Symmetries of the resistance model, and of its Jacobian.

use decoupler_core::sensor::SensorModel;
use glam::DVec3;
use proptest::prelude::*;

use crate::cases;

/// A sensor and one of its row-wires, pressed.
#[derive(Clone, Debug)]
struct Pressed {
    sensor: SensorModel,
    row: usize,
    displacements_mm: Vec<DVec3>,
}

impl Pressed {
    fn resistances_ohm(&self) -> Vec<f64> {
        self.sensor.row_resistances(self.row, &self.displacements_mm).unwrap()
    }

    /// M4 × M2 vectors.
    fn jacobian(&self) -> Vec<Vec<DVec3>> {
        let jacobian = self.sensor.row_jacobian(self.row, &self.displacements_mm).unwrap();
        let columns = jacobian.outer_iter();
        let nodes = columns.map(|column| {
            column
                .outer_iter()
                .map(|node| DVec3::new(node[0], node[1], node[2]))
                .collect()
        });
        nodes.collect()
    }
}

fn pressed() -> impl Strategy<Value = Pressed> {
    let scale = (1..6_usize, 1..6_usize, 1..5_usize, 1..10_usize);
    let lengths = (1.0..8.0_f64, 0.3..3.0_f64, 0.3..3.0_f64, 0.3..3.0_f64);
    (scale, lengths, 0..6_usize).prop_flat_map(|((rows, nodes, across, columns), lengths, row)| {
        let mut sensor = SensorModel::new(format!("{rows}x{nodes}_{across}x{columns}").parse().unwrap());
        let geometry = &mut sensor.geometry;
        (geometry.height_mm, geometry.row_pitch_mm) = (lengths.0, lengths.1);
        (geometry.node_pitch_mm, geometry.column_pitch_mm) = (lengths.2, lengths.3);
        let displacement = (-0.3..0.3_f64, -0.3..0.3_f64, 0.0..0.6_f64);
        let height_mm = lengths.0;
        let displacement = displacement.prop_map(move |(x, y, z)| DVec3::new(x, y, z * height_mm));
        prop::collection::vec(displacement, nodes).prop_map(move |displacements_mm| Pressed {
            sensor,
            row: row % rows,
            displacements_mm,
        })
    })
}

fn largest_relative(a: impl IntoIterator<Item = f64>, b: impl IntoIterator<Item = f64>) -> f64 {
    let pairs: Vec<(f64, f64)> = a.into_iter().zip(b).collect();
    let size = pairs.iter().fold(f64::MIN_POSITIVE, |size, (_, b)| size.max(b.abs()));
    pairs.iter().map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(cases(64))]

    /// A row is centred over the column-wires: its reflection along y is the row itself with its nodes and columns
    /// reversed.
    #[test]
    fn mirrored_rows_have_mirrored_resistances_and_derivatives(pressed in pressed()) {
        let reflected = |vector: DVec3| DVec3::new(vector.x, -vector.y, vector.z);
        let mut other = pressed.clone();
        other.displacements_mm = pressed.displacements_mm.iter().rev().map(|&displacement| reflected(displacement)).collect();
        let mirrored = other.resistances_ohm().into_iter().rev();
        let off = largest_relative(mirrored, pressed.resistances_ohm());
        prop_assert!(off < 1e-12, "{off:e}");
        let components = |jacobian: Vec<Vec<DVec3>>| jacobian.into_iter().flatten().flat_map(|node| node.to_array());
        let mirrored = other.jacobian().into_iter().rev();
        let mirrored = mirrored.map(|column| column.into_iter().rev().map(reflected).collect()).collect();
        let off = largest_relative(components(mirrored), components(pressed.jacobian()));
        prop_assert!(off < 1e-11, "{off:e}");
    }

    /// A path from a node to a column's nodes depends on the node's position, not on its index.
    #[test]
    fn swapping_two_nodes_swaps_their_derivatives(pressed in pressed(), (a, b) in (0..6_usize, 0..6_usize)) {
        let nodes = pressed.displacements_mm.len();
        let (a, b) = (a % nodes, b % nodes);
        let apart_mm = pressed.sensor.geometry.node_pitch_mm * (b as f64 - a as f64);
        let mut other = pressed.clone();
        other.displacements_mm[a] = pressed.displacements_mm[b] + DVec3::Y * apart_mm;
        other.displacements_mm[b] = pressed.displacements_mm[a] - DVec3::Y * apart_mm;
        let off = largest_relative(other.resistances_ohm(), pressed.resistances_ohm());
        prop_assert!(off < 1e-12, "{off:e}");
        for (ours, theirs) in other.jacobian().iter().zip(pressed.jacobian()) {
            let off = (ours[a] - theirs[b]).length() + (ours[b] - theirs[a]).length();
            let size = theirs.iter().fold(0.0_f64, |size, node| size.max(node.length()));
            prop_assert!(off < 1e-11 * size, "{off:e} of {size:e}");
        }
    }

    /// Pressing a node shortens its paths, and with them every resistance of its row.
    #[test]
    fn pressing_any_node_lowers_every_resistance(pressed in pressed()) {
        for column in pressed.jacobian() {
            prop_assert!(column.iter().all(|node| node.z < 0.0), "{column:?}");
        }
    }
}
