//! Rounding of the resistance model and of its derivatives, in units in the last place, against sums in 200 bits.

#![expect(clippy::print_stdout, reason = "the table is shown with --nocapture")]

use dashu_float::{FBig, round::mode::HalfEven};
use glam::DVec3;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::sensor::{Axes, Geometry, RowConductance, SensorModel};

type Exact = FBig<HalfEven, 2>;

const BITS: usize = 200;

fn exact(value: f64) -> Exact {
    Exact::try_from(value).unwrap().with_precision(BITS).value()
}

/// Difference of `computed` from `truth` in units in the last place of `scale`.
fn ulps(computed: f64, truth: &Exact, scale: f64) -> f64 {
    let apart = exact(computed) - truth;
    apart.to_f64().value().abs() / (scale.next_up() - scale)
}

/// Distances (dx, dy, z) of a displaced node from an electrode of a column-wire, from the eight lengths themselves.
fn distances(model: &SensorModel, row: usize, node: usize, u_mm: DVec3, column: usize, j: usize) -> [Exact; 3] {
    let Geometry {
        height_mm,
        row_x0_mm,
        row_pitch_mm,
        node_pitch_mm,
        column_y0_mm: _,
        column_pitch_mm,
        column_node_x0_mm,
        column_node_pitch_mm,
    } = model.geometry;
    let scale = model.scale;
    let half = |twice: f64| exact(0.5 * twice);
    let from_centre = |index: usize, count: usize| half(2.0 * index as f64 - (count - 1) as f64);
    let dx = exact(row_x0_mm) + exact(row_pitch_mm) * exact(row as f64) + exact(u_mm.x)
        - exact(column_node_x0_mm)
        - exact(column_node_pitch_mm) * exact(j as f64);
    let dy = exact(node_pitch_mm) * from_centre(node, scale.nodes_per_row()) + exact(u_mm.y)
        - exact(column_pitch_mm) * from_centre(column, scale.columns());
    [dx, dy, exact(height_mm) - exact(u_mm.z)]
}

/// Maximum rounding error in ulps of the resistances, and of the derivatives of conductance in ulps of their largest
/// possible size Σ|term|.
fn worst_ulps(model: &SensorModel, row: usize, columns: &[usize], at: &[DVec3]) -> (f64, f64) {
    let mut conductance = RowConductance::new(model, Axes::Xyz);
    conductance.evaluate(model, row, at);
    let resistances = model.row_resistances(row, at).unwrap();
    let mut worst = (0.0_f64, 0.0_f64);
    for &column in columns {
        let mut sum = exact(0.0);
        for (node, &u_mm) in at.iter().enumerate() {
            let mut slopes = [exact(0.0), exact(0.0), exact(0.0)];
            let mut sizes = [0.0; 3];
            for j in 0..model.scale.nodes_per_column() {
                let [dx, dy, z] = distances(model, row, node, u_mm, column, j);
                let square = dx.clone() * &dx + dy.clone() * &dy + z.clone() * &z;
                let inverse = exact(1.0) / square.sqrt();
                let cubed = inverse.clone() * &inverse * &inverse;
                sum += inverse;
                for (axis, apart) in [-dx, -dy, z].into_iter().enumerate() {
                    let term = apart * &cubed;
                    sizes[axis] += term.to_f64().value().abs();
                    slopes[axis] += term;
                }
            }
            for axis in 0..3 {
                let computed = conductance.derivatives(3 * node + axis)[column];
                if sizes[axis] > f64::MIN_POSITIVE {
                    worst.1 = worst.1.max(ulps(computed, &slopes[axis], sizes[axis]));
                }
            }
        }
        let truth = exact(model.resistivity_ohm_per_mm) / sum;
        worst.0 = worst.0.max(ulps(resistances[column], &truth, resistances[column]));
    }
    worst
}

/// Maximum rounding error over compressions from none to nearly touching and a few row-wires, for random nodes.
fn worst_of(array: &str, change: impl FnOnce(&mut Geometry), shift: f64) -> (f64, f64) {
    let mut model = SensorModel::new(array.parse().unwrap());
    model.resistivity_ohm_per_mm = 470.0 / 3.0;
    change(&mut model.geometry);
    let scale = model.scale;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let columns = [0, scale.columns() / 2];
    let mut worst = (0.0_f64, 0.0_f64);
    for compression in [0.0, 0.2, 0.5, 0.9, 0.99999] {
        for row in [6 % scale.rows(), scale.rows() - 1] {
            let nodes = 0..scale.nodes_per_row();
            let mut shifted = || shift * rng.random_range(-1.0..=1.0);
            let sideways: Vec<[f64; 2]> = nodes.map(|_| [shifted(), shifted()]).collect();
            let stroke_mm = compression * model.geometry.height_mm;
            let at: Vec<DVec3> = sideways
                .iter()
                .enumerate()
                .map(|(node, &[x, y])| {
                    let down = if node % 2 == 0 {
                        1.0
                    } else {
                        rng.random_range(0.0..=1.0)
                    };
                    DVec3::new(x, y, down * stroke_mm)
                })
                .collect();
            let (resistance, derivative) = worst_ulps(&model, row, &columns, &at);
            worst = (worst.0.max(resistance), worst.1.max(derivative));
        }
    }
    worst
}

fn origin(geometry: &mut Geometry, origin_mm: f64) {
    geometry.row_x0_mm += origin_mm;
    geometry.column_node_x0_mm += origin_mm;
    geometry.column_y0_mm += origin_mm;
}

fn all_lengths(geometry: &mut Geometry, factor: f64) {
    for length in [
        &mut geometry.height_mm,
        &mut geometry.row_x0_mm,
        &mut geometry.row_pitch_mm,
        &mut geometry.node_pitch_mm,
        &mut geometry.column_y0_mm,
        &mut geometry.column_pitch_mm,
        &mut geometry.column_node_x0_mm,
        &mut geometry.column_node_pitch_mm,
    ] {
        *length *= factor;
    }
}

fn pitches(geometry: &mut Geometry, factor: f64) {
    for pitch in [
        &mut geometry.row_pitch_mm,
        &mut geometry.node_pitch_mm,
        &mut geometry.column_pitch_mm,
        &mut geometry.column_node_pitch_mm,
    ] {
        *pitch *= factor;
    }
}

#[test]
fn resistances_and_derivatives_are_accurate_to_a_few_units_in_the_last_place() {
    type Change = fn(&mut Geometry);
    let changes: [(&str, Change, f64); 11] = [
        ("default", |_| (), 0.0),
        ("shifts of 0.2 mm", |_| (), 0.2),
        ("pitches of a tenth", |g| pitches(g, 0.1), 0.02),
        ("pitches of 0.37", |g| pitches(g, 0.37), 0.2),
        ("height 1e-6 mm", |g| g.height_mm = 1e-6, 1e-6),
        ("height 1e6 mm", |g| g.height_mm = 1e6, 0.2),
        ("all lengths 1e-6", |g| all_lengths(g, 1e-6), 2e-7),
        ("all lengths 1e6", |g| all_lengths(g, 1e6), 2e5),
        ("origin at 1e9 mm", |g| origin(g, 1e9), 0.2),
        ("origin at -1e15 mm", |g| origin(g, -1e15), 0.2),
        (
            "origin at 1e9 mm, pitches of a tenth",
            |g| {
                pitches(g, 0.1);
                origin(g, 1e9);
            },
            0.02,
        ),
    ];
    println!("{:40} {:>16} {:>10} {:>10}", "", "array", "R, ulp", "dR, ulp");
    let mut worst = (0.0_f64, 0.0_f64);
    for (name, change, shift) in changes {
        for array in ["1x1_1x1", "10x6_3x18", "10x10_5x30", "3x64_10x192"] {
            let (resistance, derivative) = worst_of(array, change, shift);
            println!("{name:40} {array:>16} {resistance:>10.2} {derivative:>10.2}");
            worst = (worst.0.max(resistance), worst.1.max(derivative));
        }
    }
    assert!(worst.0 <= 4.0, "resistances: {} ulp", worst.0);
    assert!(worst.1 <= 8.0, "derivatives: {} ulp", worst.1);
}
