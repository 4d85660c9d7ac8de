//! The scene of a simulated array: rows, axes, loading and noise; and its samples.

use decoupler_core::{
    dataset::Simulation,
    evaluation::{Outlook, RunSettings},
    scene::{Indenter, IndenterShape, Loading, Movement, Noise, NoisySets, Radii, Rows, Scene},
    settings::{Field, Kind, Setting},
    text::counted,
};
use decoupler_files::export::format_number;
use eframe::egui::{CollapsingHeader, Ui};

use super::{Fields, Look, Row, Source};
use crate::window::{
    glossary,
    widgets::{
        dim_ui,
        fields::{capitalised, count_ui, in_percent, input_text},
        focus_ring_ui, note_ui,
    },
};

/// Numbers of samples, and the seed.
pub const SAMPLES: [Row; 4] = [
    Row::new(
        "samples",
        "Training samples",
        "Number of samples to which the network is fitted, or the networks of all rows; drawn as whole snapshots of the rows \
         that are read.",
        Look::Number(""),
    ),
    Row::new(
        "validation samples",
        "Validation samples",
        glossary::VALIDATION_SET.hint,
        Look::Number(""),
    ),
    Row::new(
        "test samples",
        "Test samples",
        glossary::TEST_SET.hint,
        Look::Number(""),
    ),
    Row::new("seed", "Seed", glossary::SEED.hint, Look::Number("")),
];

const ROWS: Row = Row {
    label: "Rows",
    hint: glossary::ROWS.hint,
    look: Look::Options(&[
        (
            "all",
            "All",
            "One network for every row, without the row number as an input, as in the paper.",
        ),
        (
            "known",
            "Known",
            "One small network per row, for electronics that know which row they address.",
        ),
        ("1", "One", "One row-wire only; nothing else is modelled."),
    ]),
    setting: Source::Own(Setting::new("rows", Kind::Text, "", |run| {
        let rows = &mut scene(run)?.rows;
        let text = match rows {
            Rows::One(_) => "1".to_owned(),
            _ => rows.to_string(),
        };
        Some(Field::text(text, rows, str::parse))
    })),
};

const MOVEMENT_AND_LOADING: [Row; 9] = [
    Row::new(
        "axes",
        "Axes",
        glossary::AXES.hint,
        Look::Options(&[
            ("z", "z", "Nodes move up and down only, as in the paper."),
            (
                "xyz",
                "x, y, z",
                "Nodes also shift sideways: three times as many unknowns from the same readings.",
            ),
        ]),
    ),
    Row::number(
        "Largest shift",
        "Largest displacement of a node along x and along y, in either direction, in mm.",
        (Kind::Number(1e-6, 1e3), "mm"),
        |run| match &mut scene(run)?.movement {
            Movement::Xyz { largest_shift_mm } => Some(Field::Number(largest_shift_mm)),
            Movement::Z => None,
        },
    ),
    Row::new(
        "loading",
        "Loading",
        glossary::LOADING.hint,
        // A correlation length of twice the assumed node pitch.
        Look::List(&[
            ("random", "Random nodes", glossary::RANDOM_NODES.hint),
            ("smooth:4", "Smooth field", glossary::SMOOTH_FIELD.hint),
            ("indenter", "Indenter", glossary::INDENTER.hint),
        ]),
    ),
    Row::number(
        "Correlation length",
        glossary::CORRELATION_LENGTH.hint,
        LENGTH,
        |run| match &mut scene(run)?.loading {
            Loading::SmoothField { correlation_length_mm } => Some(Field::Number(correlation_length_mm)),
            _ => None,
        },
    ),
    Row {
        label: "Shape",
        hint: "Shape of the indenter. Its position, depth, size, direction and tilt are drawn at random for each snapshot.",
        look: Look::List(&[
            ("sphere", "Sphere", "A ball."),
            ("flat punch", "Flat punch", "The flat end of a round bar."),
        ]),
        setting: Source::Own(Setting::new("shape", Kind::Choice, "", |run| {
            let indenter = indenter(run)?;
            let read = |name: &str| Indenter::all().into_iter().find(|offered| offered.name() == name);
            let name = indenter.name().to_owned();
            Some(Field::Text(
                name,
                Box::new(move |name| {
                    indenter.shape = read(name).ok_or_else(|| format!("no shape is named {name}"))?.shape;
                    Ok(())
                }),
            ))
        })),
    },
    Row::number(
        "Radius from",
        "Smallest radius of the indenter, in mm.",
        LENGTH,
        |run| Some(Field::Number(&mut radii(run)?.smallest)),
    ),
    Row::number("Radius to", "Largest radius of the indenter, in mm.", LENGTH, |run| {
        Some(Field::Number(&mut radii(run)?.largest))
    }),
    Row::number(
        "Largest tilt",
        "Largest angle between the indenter and the surface, in degrees; each tilt is drawn between 0 and this.",
        (Kind::Number(0.0, 45.0), "°"),
        |run| match &mut indenter(run)?.shape {
            IndenterShape::Sphere { .. } => None,
            IndenterShape::FlatPunch(body) | IndenterShape::Cylinder(body) => {
                Some(Field::Number(&mut body.largest_tilt_degrees))
            }
            IndenterShape::Edge { largest_tilt_degrees } => Some(Field::Number(largest_tilt_degrees)),
        },
    ),
    Row::number("Spread", glossary::SPREAD.hint, LENGTH, |run| {
        Some(Field::Number(&mut indenter(run)?.spread_mm))
    }),
];

const COMPRESSION: Row = Row::number(
    "Largest compression",
    glossary::LARGEST_COMPRESSION.hint,
    (Kind::Number(1e-5, 0.99), "%"),
    |run| Some(Field::Number(&mut scene(run)?.largest_compression)),
);

const NOISE: [Row; 4] = [
    Row::new(
        "noise",
        "Relative noise",
        glossary::RELATIVE_NOISE.hint,
        Look::Number("%"),
    ),
    Row::new(
        "noise ohm",
        "Additive noise",
        "Noise of each reading (standard deviation), in Ω.",
        Look::Number("Ω"),
    ),
    Row::new(
        "adc bits",
        "Converter bits",
        "Resolution of the analogue-to-digital converter, in bits; its range is 0 to twice the largest resistance at rest. 0 \
         for no quantisation.",
        Look::Number(""),
    ),
    Row::new("drift", "Drift", glossary::DRIFT.hint, Look::Number("%")),
];

const NOISY_SETS: Row = Row::new(
    "noise in",
    "Noise in",
    "Samples to which noise is added. Validation samples are treated like training samples.",
    Look::Options(&[
        (
            "both",
            "Both",
            "Training and test samples: the network learns to handle the noise.",
        ),
        ("training", "Training", "Training samples only."),
        (
            "test",
            "Test",
            "Test samples only: the network is trained on clean readings.",
        ),
    ]),
);

const LENGTH: (Kind, &str) = (Kind::Number(1e-3, 1e6), "mm");

fn scene(run: &mut RunSettings) -> Option<&mut Scene> {
    Some(&mut run.simulation_mut()?.scene)
}

fn indenter(run: &mut RunSettings) -> Option<&mut Indenter> {
    match &mut scene(run)?.loading {
        Loading::Indenter(indenter) => Some(indenter),
        _ => None,
    }
}

fn radii(run: &mut RunSettings) -> Option<&mut Radii> {
    match &mut indenter(run)?.shape {
        IndenterShape::Sphere { radius_mm } => Some(radius_mm),
        IndenterShape::FlatPunch(body) | IndenterShape::Cylinder(body) => Some(&mut body.radius_mm),
        IndenterShape::Edge { .. } => None,
    }
}

/// Rows, axes, loading, compression and noise, and the numbers of unknowns and equations.
pub fn scene_ui(ui: &mut Ui, fields: &mut Fields<'_>) {
    fields.show(ui, &[ROWS]);
    let rows = fields
        .settings
        .simulation()
        .map_or(1, |simulation| simulation.sensor.scale.rows());
    if let Some(Scene {
        rows: Rows::One(row), ..
    }) = scene(fields.settings)
    {
        let mut number = *row + 1;
        let hint = "Number of the row-wire that is read, from 1.";
        count_ui(ui, "Row", hint, &mut number, 1..=rows);
        *row = number - 1;
    }
    let before = radii(fields.settings).copied();
    fields.show(ui, &MOVEMENT_AND_LOADING);
    if let (Some(before), Some(radii)) = (before, radii(fields.settings))
        && radii.smallest > radii.largest
    {
        // The other end follows the one that was changed.
        let end = if radii.smallest == before.smallest {
            radii.largest
        } else {
            radii.smallest
        };
        (radii.smallest, radii.largest) = (end, end);
    }
    fields.show(ui, &[COMPRESSION]);
    noise_ui(ui, fields);
    if let Some(simulation) = fields.settings.simulation() {
        size_ui(ui, simulation);
    }
}

/// The noise of the readings; a line summarises it while its fields are folded away.
fn noise_ui(ui: &mut Ui, fields: &mut Fields<'_>) {
    let shown = CollapsingHeader::new("Noise on resistance").show(ui, |ui| {
        fields.show(ui, &NOISE);
        if scene(fields.settings).is_some_and(|scene| !scene.noise.is_none()) {
            fields.show(ui, &[NOISY_SETS]);
        }
    });
    focus_ring_ui(ui, &shown.header_response);
    if let Some(scene) = scene(fields.settings).filter(|scene| !scene.noise.is_none())
        && shown.body_response.is_none()
    {
        dim_ui(ui, &of_noise(&scene.noise));
    }
}

/// The noise in a line: `0.1 % relative, 12 bits, in test only`.
fn of_noise(noise: &Noise) -> String {
    let percent = |share: f64| input_text(in_percent(share));
    let sources = [
        (noise.relative > 0.0).then(|| format!("{} % relative", percent(noise.relative))),
        (noise.additive_ohm > 0.0).then(|| format!("{} Ω", input_text(noise.additive_ohm))),
        noise.converter_bits.map(|bits| format!("{bits} bits")),
        (noise.drift > 0.0).then(|| format!("{} % drift", percent(noise.drift))),
        (noise.sets != NoisySets::Both).then(|| format!("in {} only", <&str>::from(noise.sets))),
    ];
    sources.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Shows the numbers of unknowns and equations of the scene.
fn size_ui(ui: &mut Ui, simulation: &Simulation) {
    let Ok(rows) = simulation.rows() else { return };
    let scale = simulation.sensor.scale;
    let text = format!(
        "{}, {} per frame",
        counted(rows * simulation.scene.unknowns_per_row(scale), "unknown"),
        counted(rows * scale.columns(), "equation")
    );
    dim_ui(ui, &text).on_hover_text(
        "A frame is one reading of every row. Unknowns are the coordinates that vary in the scene; each resistance \
         gives an equation, Eq. (2). What does not vary is not modelled.",
    );
}

/// Shows the condition number of the scene.
pub fn condition_ui(ui: &mut Ui, outlook: Option<&Outlook>) {
    let condition = outlook.map(|outlook| outlook.worst_row.condition());
    let text = match condition {
        Some(condition) if condition.is_infinite() => "Condition number infinite".to_owned(),
        condition => format!("Condition number {}", format_number(condition)),
    };
    dim_ui(ui, &text).on_hover_text(glossary::CONDITION_NUMBER.hint);
}

/// Shows the warnings of the scene, which stay visible while its settings are folded away.
pub fn outlook_notes_ui(ui: &mut Ui, scene: &Scene, outlook: Option<&Outlook>) {
    let Some(outlook) = outlook else { return };
    if outlook.warnings.is_empty() && scene.movement != Movement::Z {
        note_ui(ui, &of_sideways_shifts(outlook));
    }
    for warning in &outlook.warnings {
        note_ui(ui, &capitalised(&format!("{warning}.")));
    }
}

/// Returns the effect of sideways shifts on the readings as a sentence.
fn of_sideways_shifts(outlook: &Outlook) -> String {
    if outlook.noise.total() > 0.0 {
        let spread = format_number(outlook.worst_spread_mm);
        format!("With this noise, the worst-seen movement is known only to ±{spread} mm.")
    } else {
        // Relative change of the readings for 1 mm of the worst-seen movement.
        let change = format_number(100.0 * outlook.worst_row.worst_spread_mm(1.0).recip());
        format!(
            "Sideways shifts are hard to see: 1 mm of the worst-seen movement changes the readings by {change} %. \
             Noise above that hides it."
        )
    }
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
    let noise = if scene.noise.is_none() { "" } else { ", noise" };
    format!("{loading}, {rows}{axes}{noise}")
}

/// Numbers of training, validation and test samples, and the seed.
pub fn of_samples(settings: &RunSettings) -> String {
    let [training, validation, test, seed] = SAMPLES.map(|row| row.text(settings).unwrap_or_default());
    format!("{training} + {validation} + {test}, seed {seed}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_summarised_in_a_line() {
        let noise = Noise {
            relative: 0.07,
            converter_bits: Some(12),
            sets: NoisySets::Test,
            ..Noise::default()
        };
        assert_eq!(of_noise(&noise), "7 % relative, 12 bits, in test only");
    }
}
