use eframe::egui::{DragValue, Ui};

use super::noise_section::noise_ui;
use crate::{
    app::{
        theme::space,
        widgets::{
            dim_ui,
            fields::{capitalised, count_ui, field_ui, list_ui, options_ui, percent_ui, quantity_ui},
            note_ui, section_heading_ui,
        },
    },
    dataset::LARGEST_SAMPLES,
    evaluation::{Outlook, SimulatedSettings},
    export::format_number,
    scene::{Indenter, IndenterShape, Loading, Movement, Rows},
};

/// What is read, what moves, how it is loaded and what disturbs it; changes `draft`. `outlook` is that of the scene, once
/// it is known.
pub fn scene_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings, outlook: Option<&Outlook>) {
    section_heading_ui(ui, "Scene");
    rows_ui(ui, draft);
    movement_ui(ui, &mut draft.source.scene.movement);
    loading_ui(ui, &mut draft.source.scene.loading);
    let hint = "The most a node is pressed down, in percent of the height.";
    percent_ui(
        ui,
        "Largest compression",
        hint,
        &mut draft.source.scene.largest_compression,
        0.001..=99.0,
    );
    noise_ui(ui, &mut draft.source.scene.noise);
    size_ui(ui, draft);
    outlook_ui(ui, draft, outlook);
}

/// How many of what the scene describes; changes `draft`.
pub fn samples_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    section_heading_ui(ui, "Samples");
    let rows = draft.source.model_size().map_or(1, |size| size.rows);
    let hint = match rows {
        1 => "What the method fits.".to_owned(),
        _ => format!("What the method fits, of all rows together; whole snapshots of {rows} rows are drawn."),
    };
    count_ui(
        ui,
        "Training samples",
        &hint,
        &mut draft.source.samples,
        1..=LARGEST_SAMPLES,
    );
    let hint = "Drawn beside the training samples; they choose the best weights and stop the training. 0 for none.";
    count_ui(
        ui,
        "Validation samples",
        hint,
        &mut draft.source.validation_samples,
        0..=LARGEST_SAMPLES,
    );
    let hint = "Never trained on: all errors are measured here, and the snapshots shown are these.";
    count_ui(
        ui,
        "Test samples",
        hint,
        &mut draft.source.test_samples,
        1..=LARGEST_SAMPLES,
    );
    let hint = "Everything random follows from it: the same seed gives the same network.";
    field_ui(ui, "Seed", hint, |ui| {
        ui.add_sized([space(16), space(6)], DragValue::new(&mut draft.seed.0).speed(0.1))
    });
}

fn rows_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    let rows = &mut draft.source.scene.rows;
    let last = draft.source.sensor.scale.rows() - 1;
    let one = match *rows {
        // The array may have become smaller.
        Rows::One(row) => Rows::One(row.min(last)),
        _ => Rows::One(0),
    };
    if let Rows::One(_) = rows {
        *rows = one;
    }
    let options = [
        (
            Rows::All,
            "All",
            "One network for all rows, which is not told which row it reads: the paper.",
        ),
        (
            Rows::Known,
            "Known",
            "A small network for each row, trained side by side: the electronics know which row they address.",
        ),
        (one, "One", "One row-wire only; nothing else is modelled."),
    ];
    let hint = "Which row-wires are read, and whether a network knows which.";
    if let Some(picked) = options_ui(ui, "Rows", hint, &options, *rows) {
        *rows = picked;
    }
    if let Rows::One(row) = rows {
        let mut number = *row + 1;
        let hint = "Which row-wire is read, counted from 1.";
        count_ui(ui, "Row", hint, &mut number, 1..=last + 1);
        *row = number - 1;
    }
}

fn movement_ui(ui: &mut Ui, movement: &mut Movement) {
    let sideways = match *movement {
        Movement::Xyz { .. } => *movement,
        Movement::Z => Movement::SIDEWAYS,
    };
    let options = [
        (Movement::Z, "z", "Nodes move up and down only: the paper."),
        (
            sideways,
            "x, y, z",
            "Nodes also shift sideways: three times as many unknowns from the same readings.",
        ),
    ];
    let hint = "Along which axes nodes move. What does not move is not modelled.";
    if let Some(picked) = options_ui(ui, "Axes", hint, &options, *movement) {
        *movement = picked;
    }
    if let Movement::Xyz { largest_shift_mm } = movement {
        let hint = "The most a node shifts along x, and along y, either way.";
        quantity_ui(ui, "Largest shift", hint, largest_shift_mm, 1e-6..=1e3, "mm");
    }
}

fn loading_ui(ui: &mut Ui, loading: &mut Loading) {
    /// Twice the assumed node pitch.
    const CORRELATION_LENGTH_MM: f64 = 4.0;
    let (mut smooth, mut indenter) = (
        Loading::SmoothField {
            correlation_length_mm: CORRELATION_LENGTH_MM,
        },
        Loading::Indenter(Indenter::default()),
    );
    match loading {
        Loading::RandomNodes => {}
        Loading::SmoothField { .. } => smooth = *loading,
        Loading::Indenter(_) => indenter = *loading,
    }
    let options = [
        (
            Loading::RandomNodes,
            "Random nodes",
            "Every node is pressed by a random amount of its own: the paper.",
        ),
        (
            smooth,
            "Smooth field",
            "A smooth random surface: neighbours move alike within the correlation length.",
        ),
        (indenter, "Indenter", "A body pressed somewhere onto the surface."),
    ];
    let hint = "How the surface is loaded in the samples.";
    if let Some(picked) = list_ui(ui, "Loading", hint, &options, *loading) {
        *loading = picked;
    }
    match loading {
        Loading::RandomNodes => {}
        Loading::SmoothField {
            correlation_length_mm: length,
        } => {
            let hint = "Distance over which displacements resemble each other.";
            quantity_ui(ui, "Correlation length", hint, length, 1e-3..=1e6, "mm");
        }
        Loading::Indenter(indenter) => indenter_ui(ui, indenter),
    }
}

fn indenter_ui(ui: &mut Ui, indenter: &mut Indenter) {
    let offered = Indenter::all().map(|offered| offered.shape);
    let present = std::mem::discriminant(&indenter.shape);
    let shapes = offered.map(|shape| {
        if std::mem::discriminant(&shape) == present {
            indenter.shape
        } else {
            shape
        }
    });
    let texts = [
        ("Sphere", "A ball."),
        ("Flat punch", "The flat end of a round bar."),
        ("Cylinder", "A bar lying across the whole surface, in any direction."),
        (
            "Edge",
            "The straight edge of a large block, in any direction; one side of it is pressed.",
        ),
    ];
    let options: Vec<_> = shapes
        .into_iter()
        .zip(texts)
        .map(|(shape, (text, meaning))| (shape, text, meaning))
        .collect();
    let hint = "Its place, depth, size, direction and tilt are drawn anew for each snapshot.";
    if let Some(picked) = list_ui(ui, "Shape", hint, &options, indenter.shape) {
        indenter.shape = picked;
    }
    let (radius, tilt) = match &mut indenter.shape {
        IndenterShape::Sphere { radius_mm } => (Some(radius_mm), None),
        IndenterShape::FlatPunch {
            radius_mm,
            largest_tilt_degrees,
        }
        | IndenterShape::Cylinder {
            radius_mm,
            largest_tilt_degrees,
        } => (Some(radius_mm), Some(largest_tilt_degrees)),
        IndenterShape::Edge { largest_tilt_degrees } => (None, Some(largest_tilt_degrees)),
    };
    if let Some(radius) = radius {
        let hint = "The smallest radius drawn.";
        let changed = quantity_ui(ui, "Radius from", hint, &mut radius.smallest, 1e-3..=1e6, "mm").changed();
        if changed {
            radius.largest = radius.largest.max(radius.smallest);
        }
        let hint = "The largest radius drawn.";
        let changed = quantity_ui(ui, "Radius to", hint, &mut radius.largest, 1e-3..=1e6, "mm").changed();
        if changed {
            radius.smallest = radius.smallest.min(radius.largest);
        }
    }
    if let Some(tilt) = tilt {
        let hint = "The steepest slope of the body against the surface; each is drawn from 0 to it.";
        quantity_ui(ui, "Largest tilt", hint, tilt, 0.0..=45.0, "°");
    }
    let hint = "Decay length of the surface around the indenter, in mm.";
    quantity_ui(ui, "Spread", hint, &mut indenter.spread_mm, 1e-3..=1e6, "mm");
}

/// What the scene came to.
fn size_ui(ui: &mut Ui, draft: &SimulatedSettings) {
    let Ok(size) = draft.source.model_size() else { return };
    let text = format!("{} unknowns, {} equations a frame", size.unknowns, size.equations);
    dim_ui(ui, &text).on_hover_text(
        "A frame is one reading of every row. Unknowns are the coordinates that vary in the scene; each resistance gives \
         an equation, Eq. (2). What does not vary is not modelled.",
    );
}

/// How badly conditioned the scene is, and what stands in the way.
fn outlook_ui(ui: &mut Ui, draft: &SimulatedSettings, outlook: Option<&Outlook>) {
    let condition = outlook.map(|outlook| outlook.worst_row.condition());
    let text = match condition {
        Some(condition) if condition.is_infinite() => "Condition number infinite".to_owned(),
        condition => format!("Condition number {}", format_number(condition)),
    };
    dim_ui(ui, &text).on_hover_text(
        "Worst-case amplification of a relative error in the readings: the largest singular value of the Jacobian of ln R \
         over the smallest, of the worst row, its nodes half way down.",
    );
    let Some(outlook) = outlook else { return };
    let sideways = draft.source.scene.movement != Movement::Z;
    if outlook.warnings.is_empty() && sideways {
        note_ui(ui, &sideways_in_words(outlook));
    }
    for warning in &outlook.warnings {
        note_ui(ui, &capitalised(&format!("{warning}.")));
    }
}

/// What scenes of nodes that shift sideways ask of the readings.
fn sideways_in_words(outlook: &Outlook) -> String {
    let (worst, noise) = (&outlook.worst_row, outlook.noise);
    if noise > 0.0 {
        let spread = format_number(worst.worst_spread_mm(noise));
        format!("With this noise the movement that is seen worst is known to ±{spread} mm only.")
    } else {
        // One millimetre of the movement seen worst against the reading it changes.
        let change = format_number(100.0 * worst.worst_spread_mm(1.0).recip());
        format!(
            "Sideways shifts are hard to see: a millimetre of the movement seen worst changes the readings by {change} \
             %. Any noise above that hides it."
        )
    }
}
