//! The scene of a simulated array: rows, axes, loading and noise; and its samples.

use decoupler_core::{
    dataset::Simulation,
    evaluation::RunSettings,
    scene::{Indenter, IndenterShape, Loading, Movement, Noise, Rows, Scene},
};
use eframe::egui::Ui;

use super::{Fields, Look, Row, network::ROWS};
use crate::window::{
    glossary,
    widgets::{
        fields::{capitalised, count_ui, in_percent, input_text, list_ui, percent_ui, quantity_ui},
        fold_ui, section_heading_ui,
    },
};

/// Numbers of samples, and the seed.
pub const SAMPLES: [Row; 4] = [
    Row("samples", "Training samples", Look::Number("")),
    Row("validation samples", "Validation samples", Look::Number("")),
    Row("test samples", "Test samples", Look::Number("")),
    Row("seed", "Seed", Look::Number("")),
];

const AXES: Row = Row("axes", "Axes", Look::List(&[("z", "z"), ("xyz", "x, y, z")]));

const LOADING: Row = Row(
    "loading",
    "Loading",
    // A correlation length of twice the assumed node pitch.
    Look::List(&[
        ("random", "Random nodes"),
        ("smooth:4", "Smooth field"),
        ("indenter", "Indenter"),
    ]),
);

const NOISE: Row = Row("noise", "Relative noise", Look::Number("%"));

const OTHER_NOISE: [Row; 3] = [
    Row("noise ohm", "Additive noise", Look::Number("Ω")),
    Row("adc bits", "Converter bits", Look::Number("")),
    Row("drift", "Drift", Look::Number("%")),
];

const NOISY_SETS: Row = Row(
    "noise in",
    "Noise in",
    Look::List(&[("both", "Both"), ("training", "Training"), ("test", "Test")]),
);

/// Rows, axes, loading, compression and noise of the settings, which are of a simulated array.
pub fn scene_ui(ui: &mut Ui, fields: &mut Fields<'_>) {
    fields.show(ui, &[ROWS]);
    if let Some(Simulation { sensor, scene, .. }) = fields.settings.simulation_mut()
        && let Rows::One(row) = &mut scene.rows
    {
        let (mut number, hint) = (*row + 1, "Number of the row-wire that is read, from 1.");
        count_ui(ui, "Row", hint, &mut number, 1..=sensor.scale.rows());
        *row = number - 1;
    }
    fields.show(ui, &[AXES]);
    if let Some(Simulation { scene, .. }) = fields.settings.simulation_mut()
        && let Movement::Xyz { largest_shift_mm } = &mut scene.movement
    {
        let hint = "Largest displacement of a node along x and along y, in either direction, in mm.";
        quantity_ui(ui, "Largest shift", hint, largest_shift_mm, 1e-6..=1e3, "mm");
    }
    fields.show(ui, &[LOADING]);
    if let Some(Simulation { scene, .. }) = fields.settings.simulation_mut() {
        match &mut scene.loading {
            Loading::RandomNodes => {}
            Loading::SmoothField { correlation_length_mm } => {
                let (name, hint) = ("Correlation length", glossary::CORRELATION_LENGTH.hint);
                quantity_ui(ui, name, hint, correlation_length_mm, 1e-3..=1e6, "mm");
            }
            Loading::Indenter(indenter) => indenter_ui(ui, indenter),
        }
        let (name, hint) = ("Largest compression", glossary::LARGEST_COMPRESSION.hint);
        let usual = Scene::default().largest_compression;
        percent_ui(ui, name, hint, &mut scene.largest_compression, usual, 0.001..=99.0);
    }
    section_heading_ui(ui, "Noise on resistance");
    fields.show(ui, &[NOISE]);
    let noise = |fields: &Fields<'_>| fields.settings.simulation().map(|simulation| simulation.scene.noise);
    let others = noise(fields).is_some_and(|noise| !Noise { relative: 0.0, ..noise }.is_none());
    fold_ui(ui, "Other noise", if others { "set" } else { "none" }, |ui| {
        fields.show(ui, &OTHER_NOISE);
        if noise(fields).is_some_and(|noise| !noise.is_none()) {
            fields.show(ui, &[NOISY_SETS]);
        }
    });
}

/// Shape and sizes of an indenter. A shape that the window does not offer, from a file, is shown and kept.
fn indenter_ui(ui: &mut Ui, indenter: &mut Indenter) {
    let hint =
        "Shape of the indenter. Its position, depth, size, direction and tilt are drawn at random for each snapshot.";
    let name = capitalised(indenter.name());
    let mut shapes = vec![
        ("sphere", "Sphere", "A ball."),
        ("flat punch", "Flat punch", "The flat end of a round bar."),
    ];
    if !shapes.iter().any(|(shape, ..)| *shape == indenter.name()) {
        shapes.push((indenter.name(), &name, "A shape from a file."));
    }
    if let Some(picked) = list_ui(ui, "Shape", hint, &shapes, indenter.name()) {
        let found = Indenter::all().into_iter().find(|offered| offered.name() == picked);
        indenter.shape = found.map_or(indenter.shape, |found| found.shape);
    }
    let (radius, tilt) = match &mut indenter.shape {
        IndenterShape::Sphere { radius_mm } => (Some(radius_mm), None),
        IndenterShape::FlatPunch(body) | IndenterShape::Cylinder(body) => {
            (Some(&mut body.radius_mm), Some(&mut body.largest_tilt_degrees))
        }
        IndenterShape::Edge { largest_tilt_degrees } => (None, Some(largest_tilt_degrees)),
    };
    if let Some(radius) = radius {
        let hint = "Smallest radius of the indenter, in mm.";
        if quantity_ui(ui, "Radius from", hint, &mut radius.smallest, 1e-3..=1e6, "mm").changed() {
            radius.largest = radius.largest.max(radius.smallest);
        }
        let hint = "Largest radius of the indenter, in mm.";
        if quantity_ui(ui, "Radius to", hint, &mut radius.largest, 1e-3..=1e6, "mm").changed() {
            radius.smallest = radius.smallest.min(radius.largest);
        }
    }
    if let Some(tilt) = tilt {
        let hint =
            "Largest angle between the indenter and the surface, in degrees; each tilt is drawn between 0 and this.";
        quantity_ui(ui, "Largest tilt", hint, tilt, 0.0..=45.0, "°");
    }
    let hint = glossary::SPREAD.hint;
    quantity_ui(ui, "Spread", hint, &mut indenter.spread_mm, 1e-3..=1e6, "mm");
}

/// Loading, rows, axes and noise.
pub fn of_scene(scene: &Scene) -> String {
    let loading = match scene.loading {
        Loading::RandomNodes => "random nodes",
        Loading::SmoothField { .. } => "smooth field",
        Loading::Indenter(indenter) => indenter.name(),
    };
    let rows = match scene.rows {
        Rows::One(row) => format!("row {}", row + 1),
        rows => format!("{rows} rows"),
    };
    let axes = if scene.movement == Movement::Z { "" } else { ", x y z" };
    let noise = match scene.noise {
        noise if noise.is_none() => String::new(),
        Noise { relative, .. } if relative > 0.0 => format!(", {} % noise", input_text(in_percent(relative))),
        _ => ", noise".to_owned(),
    };
    format!("{loading}, {rows}{axes}{noise}")
}

/// Numbers of training, validation and test samples, and the seed.
pub fn of_samples(settings: &RunSettings) -> String {
    let [training, validation, test, seed] = SAMPLES.map(|row| row.text(settings).unwrap_or_default());
    format!("{training} + {validation} + {test}, seed {seed}")
}
