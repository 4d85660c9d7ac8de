//! The resistance model: sizes, heights, resistance per millimetre, compression, origins.

use decoupler_core::{
    glam::DVec3,
    sensor::{ArrayScale, Geometry, SensorModel},
};

use crate::judge::{Job, Verdict, refused, wrong};

const ROOM: &str = "sensor";
/// Maximum relative error of a resistance: about a hundred roundings.
const TOLERANCE: f64 = 1e-13;

/// Eq. (2), computed from differences of coordinates that do not involve the origin.
fn resistances_ohm(model: &SensorModel, row: usize, pressed_mm: &[f64]) -> Vec<f64> {
    let (scale, geometry) = (model.scale, model.geometry);
    let apart_x = geometry.row_x0_mm - geometry.column_node_x0_mm;
    let of_column = |column: usize| {
        let mut sum = 0.0;
        for (node, pressed_mm) in pressed_mm.iter().enumerate() {
            let across = 0.5 * (scale.columns() as f64 - 1.0) - column as f64;
            let along = node as f64 - 0.5 * (scale.nodes_per_row() as f64 - 1.0);
            let y = geometry.column_pitch_mm * across + geometry.node_pitch_mm * along;
            let z = geometry.height_mm - pressed_mm;
            for other in 0..scale.nodes_per_column() {
                let x = apart_x + geometry.row_pitch_mm * row as f64 - geometry.column_node_pitch_mm * other as f64;
                sum += 1.0 / x.hypot(y).hypot(z);
            }
        }
        model.resistivity_ohm_per_mm / sum
    };
    (0..scale.columns()).map(of_column).collect()
}

fn judge(model: &SensorModel, compression: f64) -> Verdict {
    if let Err(error) = model.check() {
        return refused(&error);
    }
    let nodes = model.scale.nodes_per_row();
    let pressed_mm = |node: usize| compression * model.geometry.height_mm * (1.0 - 0.3 * (node % 3) as f64);
    let pressed_mm: Vec<f64> = (0..nodes).map(pressed_mm).collect();
    let displacements_mm: Vec<DVec3> = pressed_mm.iter().map(|&z| DVec3::new(0.0, 0.0, z)).collect();
    let mut worst = 0.0_f64;
    for row in [0, model.scale.rows() / 2, model.scale.rows() - 1] {
        let modelled = match model.row_resistances(row, &displacements_mm) {
            Ok(modelled) => modelled,
            Err(error) => return refused(&error),
        };
        for (modelled, expected) in modelled.iter().zip(resistances_ohm(model, row, &pressed_mm)) {
            worst = worst.max((modelled / expected - 1.0).abs());
        }
    }
    if worst <= TOLERANCE {
        Verdict::Right
    } else {
        wrong(format!("a resistance has a relative error of {worst:.1e}"))
    }
}

/// Returns the geometry with every length multiplied by `factor`.
pub(crate) fn in_other_units(geometry: Geometry, factor: f64) -> Geometry {
    Geometry {
        height_mm: factor * geometry.height_mm,
        row_x0_mm: factor * geometry.row_x0_mm,
        row_pitch_mm: factor * geometry.row_pitch_mm,
        node_pitch_mm: factor * geometry.node_pitch_mm,
        column_y0_mm: factor * geometry.column_y0_mm,
        column_pitch_mm: factor * geometry.column_pitch_mm,
        column_node_x0_mm: factor * geometry.column_node_x0_mm,
        column_node_pitch_mm: factor * geometry.column_node_pitch_mm,
    }
}

pub(crate) fn jobs() -> Vec<Job> {
    let mut jobs = Vec::new();
    let mut push = |extreme, sentence: String, model: SensorModel, compression: f64| {
        jobs.push(Job::one(ROOM, extreme, sentence, move || judge(&model, compression)));
    };
    let model = SensorModel::new(ArrayScale::default());
    for scale in [
        "1x1_1x1",
        "1x1_1x3",
        "1x10_5x30",
        "10x1_5x3",
        "2x2_2x6",
        "10x64_5x192",
        "512x1_1x1",
        "3x512_2x8",
        "32x32_16x96",
    ] {
        let model = SensorModel::new(scale.parse().unwrap());
        for compression in [0.0, 0.2, 0.9, 0.99999] {
            push(
                "sizes",
                format!("{scale} pressed by {compression:e} of its height"),
                model,
                compression,
            );
        }
    }
    for compression in [
        1e-300,
        1e-12,
        1e-6,
        0.01,
        0.5,
        0.99,
        0.999,
        0.99999,
        0.999_999_999,
        1.0,
        1.5,
        f64::NAN,
    ] {
        push(
            "compression",
            format!("pressed by {compression:e} of the height"),
            model,
            compression,
        );
    }
    for exponent in [-300, -150, -12, -6, -3, 3, 6, 12, 150, 300] {
        let factor = 10_f64.powi(exponent);
        let mut scaled = model;
        scaled.geometry = in_other_units(model.geometry, factor);
        push(
            "heights and units of length",
            format!("all lengths times {factor:e}"),
            scaled,
            0.2,
        );
        scaled.geometry = Geometry {
            height_mm: factor * 5.0,
            ..model.geometry
        };
        push(
            "heights and units of length",
            format!("height {:e} mm", factor * 5.0),
            scaled,
            0.2,
        );
        scaled.geometry = model.geometry;
        scaled.resistivity_ohm_per_mm = factor;
        push("resistance per mm", format!("{factor:e} ohm a millimetre"), scaled, 0.2);
    }
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut other = model;
        other.resistivity_ohm_per_mm = value;
        push("resistance per mm", format!("{value} ohm a millimetre"), other, 0.2);
        other = model;
        other.geometry.height_mm = value;
        push("heights and units of length", format!("height {value} mm"), other, 0.2);
        other = model;
        other.geometry.node_pitch_mm = value;
        push(
            "heights and units of length",
            format!("node pitch {value} mm"),
            other,
            0.2,
        );
    }
    for origin_mm in [-1e12, -1e9, -1e3, 1e3, 1e6, 1e9, 1e12, 1e15] {
        let mut moved = model;
        // Pitches that round at large coordinates, though their differences need not.
        moved.geometry.row_pitch_mm = 0.7;
        moved.geometry.node_pitch_mm = 1.3;
        moved.geometry.column_pitch_mm = 1.1;
        moved.geometry.column_node_pitch_mm = 4.9;
        moved.geometry.column_y0_mm = origin_mm;
        push("origins", format!("y from {origin_mm:e} mm"), moved, 0.2);
        moved.geometry.row_x0_mm += origin_mm;
        moved.geometry.column_node_x0_mm += origin_mm;
        push("origins", format!("x and y from {origin_mm:e} mm"), moved, 0.2);
    }
    jobs
}
