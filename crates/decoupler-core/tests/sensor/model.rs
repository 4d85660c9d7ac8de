//! The resistance model against golden vectors of an independent implementation, and its Jacobian against central
//! differences.

use decoupler_core::sensor::{ArrayScale, Geometry, SensorModel};
use glam::DVec3;
use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    scale: ArrayScale,
    geometry_mm: GoldenGeometry,
    row: usize,
    resistivity_ohm_per_mm: f64,
    displacement_mm: Vec<[f64; 3]>,
    resistance_ohm: Vec<f64>,
}

#[derive(Deserialize)]
struct GoldenGeometry {
    height: f64,
    row_x0: f64,
    row_pitch: f64,
    node_pitch: f64,
    column_pitch: f64,
    column_node_x0: f64,
    column_node_pitch: f64,
}

fn golden() -> Vec<(SensorModel, Case)> {
    let golden: Golden = serde_json::from_str(include_str!("../fixtures/forward_model.json")).unwrap();
    let with_model = |case: Case| {
        let given = &case.geometry_mm;
        let geometry = Geometry {
            height_mm: given.height,
            row_x0_mm: given.row_x0,
            row_pitch_mm: given.row_pitch,
            node_pitch_mm: given.node_pitch,
            column_pitch_mm: given.column_pitch,
            column_node_x0_mm: given.column_node_x0,
            column_node_pitch_mm: given.column_node_pitch,
            ..Geometry::default()
        };
        let resistivity_ohm_per_mm = case.resistivity_ohm_per_mm;
        (
            SensorModel {
                scale: case.scale,
                geometry,
                resistivity_ohm_per_mm,
            },
            case,
        )
    };
    golden.cases.into_iter().map(with_model).collect()
}

fn displacements(case: &Case) -> Vec<DVec3> {
    case.displacement_mm.iter().map(|&u| DVec3::from_array(u)).collect()
}

#[test]
fn golden_vectors_agree_to_1e_12() {
    let cases = golden();
    assert_eq!(cases.len(), 18);
    for (model, case) in cases {
        let resistances = model.row_resistances(case.row, &displacements(&case)).unwrap();
        assert_eq!(resistances.len(), case.resistance_ohm.len());
        for (ours, golden) in resistances.iter().zip(&case.resistance_ohm) {
            assert!(
                (ours / golden - 1.0).abs() < 1e-12,
                "{} row {}: {ours} {golden}",
                case.scale,
                case.row
            );
        }
    }
}

#[test]
fn the_jacobian_agrees_with_central_differences() {
    let step_mm = 1e-4;
    for (model, case) in golden() {
        // Sideways too, to avoid derivatives that vanish by symmetry.
        let at: Vec<DVec3> = displacements(&case)
            .iter()
            .map(|u| *u + DVec3::new(0.1, -0.05, 0.0))
            .collect();
        let jacobian = model.row_jacobian(case.row, &at).unwrap();
        let largest = jacobian.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for node in 0..at.len() {
            for (axis, unit) in DVec3::AXES.into_iter().enumerate() {
                let moved = |by: f64| {
                    let mut at = at.clone();
                    at[node] += by * unit;
                    model.row_resistances(case.row, &at).unwrap()
                };
                for (column, (plus, minus)) in moved(step_mm).iter().zip(moved(-step_mm)).enumerate() {
                    let difference = (plus - minus) / (2.0 * step_mm);
                    let error = (jacobian[[column, node, axis]] - difference).abs();
                    assert!(error < 1e-7 * largest, "{error} of {largest}");
                }
            }
        }
    }
}
