use super::{
    super::{DVec3, SensorModel},
    PressedRow, SensorParameter,
};

/// Number of parameters.
pub(super) const COUNT: usize = SensorParameter::COUNT;

/// Derivatives of one reading by every parameter, in the order of [`SensorParameter::ALL`].
pub(super) type Slopes = [f64; COUNT];

/// Writes ln R of Eq. (2) for every column-wire (M4) and its derivatives by the parameters.
///
/// With s = Σ 1/d and R = g/s, ∂ ln R/∂θ = −(1/s) ∂s/∂θ for a length θ, where ∂(1/d)/∂θ = −(d · ∂d/∂θ)/d³ for the vector
/// d between a node and an electrode; and ∂ ln R/∂g = 1/g.
pub(super) fn log_resistances(model: &SensorModel, pressed: &PressedRow, mut write: impl FnMut(usize, f64, &Slopes)) {
    let SensorModel {
        scale,
        geometry,
        resistivity_ohm_per_mm: g,
    } = model;
    let middle = |count: usize| (count - 1) as f64 / 2.0;
    let row = pressed.row as f64;
    let first_x = geometry.row_x0_mm - geometry.column_node_x0_mm + geometry.row_pitch_mm * row;
    for column in 0..scale.columns() {
        let columns_off = middle(scale.columns()) - column as f64;
        let (mut sum, mut slopes) = (0.0, [0.0; COUNT]);
        for (node, displacement) in pressed.displacements_mm.iter().enumerate() {
            let nodes_off = node as f64 - middle(scale.nodes_per_row());
            let y = geometry.node_pitch_mm * nodes_off + geometry.column_pitch_mm * columns_off + displacement.y;
            let z = geometry.height_mm - displacement.z;
            for electrode in 0..scale.nodes_per_column() {
                let electrode = electrode as f64;
                let x = first_x - geometry.column_node_pitch_mm * electrode + displacement.x;
                let inverse = DVec3::new(x, y, z).length_recip();
                let cubed = inverse * inverse * inverse;
                sum += inverse;
                let [by_x, by_y, by_z] = [-x * cubed, -y * cubed, -z * cubed];
                let by = [
                    by_z,
                    row * by_x,
                    nodes_off * by_y,
                    columns_off * by_y,
                    -by_x,
                    -electrode * by_x,
                ];
                for (slope, by) in slopes.iter_mut().zip(by) {
                    *slope += by;
                }
            }
        }
        slopes.iter_mut().for_each(|slope| *slope /= -sum);
        slopes[COUNT - 1] = 1.0 / g;
        write(column, (g / sum).ln(), &slopes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::ArrayScale;

    fn pressed(scale: ArrayScale, row: usize) -> PressedRow {
        let displacement = |node: usize| DVec3::new(0.03 * node as f64, -0.02, 0.17 * (node % 5) as f64);
        PressedRow {
            frame: 0,
            row,
            displacements_mm: (0..scale.nodes_per_row()).map(displacement).collect(),
            resistances_ohm: vec![1.0; scale.columns()],
        }
    }

    /// Derivatives by central differences of the resistance model itself.
    #[test]
    fn derivatives_are_those_of_the_resistance_model() {
        for (text, row) in [("10x6_3x18", 7), ("10x10_5x30", 0), ("3x2_1x7", 2)] {
            let mut model = SensorModel::new(text.parse().unwrap());
            (model.geometry.column_node_x0_mm, model.geometry.row_pitch_mm) = (12.3, 1.4);
            let pressed = pressed(model.scale, row);
            let ln_ohm = |model: &SensorModel| -> Vec<f64> {
                let ohm = model.row_resistances(row, &pressed.displacements_mm).unwrap();
                ohm.into_iter().map(f64::ln).collect()
            };
            let at = ln_ohm(&model);
            for (index, parameter) in SensorParameter::ALL.into_iter().enumerate() {
                let step = 1e-5 * parameter.of(&model);
                let moved = |by: f64| {
                    let mut moved = model;
                    *parameter.field(&mut moved) += by;
                    ln_ohm(&moved)
                };
                let (above, below) = (moved(step), moved(-step));
                log_resistances(&model, &pressed, |column, ours, slopes| {
                    assert!((ours - at[column]).abs() < 1e-13, "{text}");
                    let expected = (above[column] - below[column]) / (2.0 * step);
                    let error = (slopes[index] - expected).abs();
                    assert!(
                        error < 1e-8 * expected.abs() + 1e-9,
                        "{text}, {parameter}, column {column}: {error}"
                    );
                });
            }
        }
    }
}
