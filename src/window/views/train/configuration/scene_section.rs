use eframe::egui::Ui;

use super::noise_section::noise_ui;
use crate::window::{
    glossary,
    widgets::{
        dim_ui,
        fields::{capitalised, count_ui, list_ui, options_ui, percent_ui, quantity_ui, seed_ui, usually},
        note_ui,
    },
};
use decoupler_core::{
    dataset::LARGEST_SAMPLES,
    evaluation::{Outlook, SimulatedSettings},
    scene::{Indenter, IndenterShape, Loading, Movement, Rows, Scene},
    text::counted,
};
use decoupler_files::export::format_number;

/// Shows rows, axes, loading and noise of the scene; changes `draft`. `outlook` is that of the scene, once
/// it is known.
pub fn scene_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings, outlook: Option<&Outlook>) {
    rows_ui(ui, draft);
    movement_ui(ui, &mut draft.source.scene.movement);
    loading_ui(ui, &mut draft.source.scene.loading);
    let hint = glossary::LARGEST_COMPRESSION.hint;
    percent_ui(
        ui,
        "Largest compression",
        hint,
        &mut draft.source.scene.largest_compression,
        Scene::default().largest_compression,
        0.001..=99.0,
    );
    noise_ui(ui, &mut draft.source.scene.noise);
    size_ui(ui, draft);
    condition_ui(ui, outlook);
}

/// Shows the numbers of samples and the seed; changes `draft`.
pub fn samples_section_ui(ui: &mut Ui, draft: &mut SimulatedSettings) {
    let usual = SimulatedSettings::default();
    let rows = draft.source.model_size().map_or(1, |size| size.rows);
    let hint = match rows {
        1 => "Number of samples to which the network is fitted.".to_owned(),
        _ => format!(
            "Number of samples to which the networks are fitted, over all rows; drawn as whole snapshots of \
                      {rows} rows."
        ),
    };
    count_ui(
        ui,
        "Training samples",
        &hint,
        &mut draft.source.samples,
        usually(usual.source.samples, 1..=LARGEST_SAMPLES),
    );
    let hint = glossary::VALIDATION_SET.hint;
    count_ui(
        ui,
        "Validation samples",
        hint,
        &mut draft.source.validation_samples,
        usually(usual.source.validation_samples, 0..=LARGEST_SAMPLES),
    );
    let hint = glossary::TEST_SET.hint;
    count_ui(
        ui,
        "Test samples",
        hint,
        &mut draft.source.test_samples,
        usually(usual.source.test_samples, 1..=LARGEST_SAMPLES),
    );
    seed_ui(ui, "Seed", glossary::SEED.hint, &mut draft.seed.0, usual.seed.0);
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
            "One network for every row, without the row number as an input, as in the paper.",
        ),
        (
            Rows::Known,
            "Known",
            "One small network per row, for electronics that know which row they address.",
        ),
        (one, "One", "One row-wire only; nothing else is modelled."),
    ];
    if let Some(picked) = options_ui(ui, "Rows", glossary::ROWS.hint, &options, *rows) {
        *rows = picked;
    }
    if let Rows::One(row) = rows {
        let mut number = *row + 1;
        let hint = "Number of the row-wire that is read, from 1.";
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
        (Movement::Z, "z", "Nodes move up and down only, as in the paper."),
        (
            sideways,
            "x, y, z",
            "Nodes also shift sideways: three times as many unknowns from the same readings.",
        ),
    ];
    if let Some(picked) = options_ui(ui, "Axes", glossary::AXES.hint, &options, *movement) {
        *movement = picked;
    }
    if let Movement::Xyz { largest_shift_mm } = movement {
        let hint = "Largest displacement of a node along x and along y, in either direction, in mm.";
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
        (Loading::RandomNodes, "Random nodes", glossary::RANDOM_NODES.hint),
        (smooth, "Smooth field", glossary::SMOOTH_FIELD.hint),
        (indenter, "Indenter", glossary::INDENTER.hint),
    ];
    if let Some(picked) = list_ui(ui, "Loading", glossary::LOADING.hint, &options, *loading) {
        *loading = picked;
    }
    match loading {
        Loading::RandomNodes => {}
        Loading::SmoothField {
            correlation_length_mm: length,
        } => {
            let hint = glossary::CORRELATION_LENGTH.hint;
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
    let hint = "Shape of the indenter. Its position, depth, size, direction and tilt are drawn at random for each \
                snapshot.";
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
        let hint = "Smallest radius of the indenter, in mm.";
        let changed = quantity_ui(ui, "Radius from", hint, &mut radius.smallest, 1e-3..=1e6, "mm").changed();
        if changed {
            radius.largest = radius.largest.max(radius.smallest);
        }
        let hint = "Largest radius of the indenter, in mm.";
        let changed = quantity_ui(ui, "Radius to", hint, &mut radius.largest, 1e-3..=1e6, "mm").changed();
        if changed {
            radius.smallest = radius.smallest.min(radius.largest);
        }
    }
    if let Some(tilt) = tilt {
        let hint = "Largest angle between the indenter and the surface, in degrees; each tilt is drawn between 0 and \
                    this.";
        quantity_ui(ui, "Largest tilt", hint, tilt, 0.0..=45.0, "°");
    }
    let hint = glossary::SPREAD.hint;
    quantity_ui(ui, "Spread", hint, &mut indenter.spread_mm, 1e-3..=1e6, "mm");
}

/// Shows the numbers of unknowns and equations of the scene.
fn size_ui(ui: &mut Ui, draft: &SimulatedSettings) {
    let Ok(size) = draft.source.model_size() else { return };
    let text = format!(
        "{}, {} per frame",
        counted(size.unknowns, "unknown"),
        counted(size.equations, "equation")
    );
    dim_ui(ui, &text).on_hover_text(
        "A frame is one reading of every row. Unknowns are the coordinates that vary in the scene; each resistance \
         gives an equation, Eq. (2). What does not vary is not modelled.",
    );
}

/// Shows the condition number of the scene.
fn condition_ui(ui: &mut Ui, outlook: Option<&Outlook>) {
    let condition = outlook.map(|outlook| outlook.worst_row.condition());
    let text = match condition {
        Some(condition) if condition.is_infinite() => "Condition number infinite".to_owned(),
        condition => format!("Condition number {}", format_number(condition)),
    };
    dim_ui(ui, &text).on_hover_text(glossary::CONDITION_NUMBER.hint);
}

/// Shows the warnings of the scene, which stand there also while its settings are folded away.
pub fn outlook_notes_ui(ui: &mut Ui, draft: &SimulatedSettings, outlook: Option<&Outlook>) {
    let Some(outlook) = outlook else { return };
    let sideways = draft.source.scene.movement != Movement::Z;
    if outlook.warnings.is_empty() && sideways {
        note_ui(ui, &sideways_in_words(outlook));
    }
    for warning in &outlook.warnings {
        note_ui(ui, &capitalised(&format!("{warning}.")));
    }
}

/// Returns the effect of sideways shifts on the readings, in words.
fn sideways_in_words(outlook: &Outlook) -> String {
    if outlook.noise.total() > 0.0 {
        let spread = format_number(outlook.worst_spread_mm);
        format!("With this noise, the worst-seen movement is known only to ±{spread} mm.")
    } else {
        // One millimetre of the movement seen worst against the reading it changes.
        let change = format_number(100.0 * outlook.worst_row.worst_spread_mm(1.0).recip());
        format!(
            "Sideways shifts are hard to see: 1 mm of the worst-seen movement changes the readings by {change} %. \
             Noise above that hides it."
        )
    }
}
