use decoupler_core::{
    dataset::{LARGEST_SAMPLES, Seed, Simulation},
    evaluation::{Outlook, RunSettings, TrainingSize, Workload},
    network::{LARGEST_HIDDEN, suggested_hidden},
    scene::{Indenter, IndenterShape, Loading, Movement, Noise, NoisySets, Rows, Scene},
    sensor::ArrayScale,
    text::counted,
};
use decoupler_files::export::{describe_recorded_workload, describe_workload, format_number};
use eframe::egui::{CollapsingHeader, RichText, Slider, Stroke, Ui};

use crate::window::{
    glossary,
    shared::opening_scene,
    theme::{Theme, space, type_size},
    widgets::{
        dim_ui, explained_options_ui,
        fields::{
            capitalised, count_ui, in_percent, input_text, list_ui, options_ui, percent_ui, quantity_ui, seed_ui,
            usually,
        },
        focus_ring_ui, note_ui, segmented_ui, slider_ui, text_ui,
    },
};

/// Shows rows, axes, loading and noise of the scene; changes `simulation`. `outlook` is that of the scene, once
/// it is known.
pub fn scene_section_ui(ui: &mut Ui, simulation: &mut Simulation, outlook: Option<&Outlook>) {
    let scene = &mut simulation.scene;
    rows_ui(ui, &mut scene.rows, simulation.sensor.scale);
    movement_ui(ui, &mut scene.movement);
    loading_ui(ui, &mut scene.loading);
    let hint = glossary::LARGEST_COMPRESSION.hint;
    percent_ui(
        ui,
        "Largest compression",
        hint,
        &mut scene.largest_compression,
        Scene::default().largest_compression,
        0.001..=99.0,
    );
    noise_ui(ui, &mut scene.noise);
    size_ui(ui, simulation);
    condition_ui(ui, outlook);
}

/// Shows the numbers of samples and the seed; changes `draft`.
pub fn samples_section_ui(ui: &mut Ui, draft: &mut RunSettings) {
    let usual = Simulation::default();
    let Some(simulation) = draft.simulation_mut() else {
        return;
    };
    let rows = simulation.rows().unwrap_or(1);
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
        &mut simulation.samples,
        usually(usual.samples, 1..=LARGEST_SAMPLES),
    );
    let hint = glossary::VALIDATION_SET.hint;
    count_ui(
        ui,
        "Validation samples",
        hint,
        &mut simulation.validation_samples,
        usually(usual.validation_samples, 0..=LARGEST_SAMPLES),
    );
    let hint = glossary::TEST_SET.hint;
    count_ui(
        ui,
        "Test samples",
        hint,
        &mut simulation.test_samples,
        usually(usual.test_samples, 1..=LARGEST_SAMPLES),
    );
    seed_ui(ui, "Seed", glossary::SEED.hint, &mut draft.seed.0, Seed::default().0);
}

fn rows_ui(ui: &mut Ui, rows: &mut Rows, scale: ArrayScale) {
    let last = scale.rows() - 1;
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
        IndenterShape::FlatPunch(body) | IndenterShape::Cylinder(body) => {
            (Some(&mut body.radius_mm), Some(&mut body.largest_tilt_degrees))
        }
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
fn condition_ui(ui: &mut Ui, outlook: Option<&Outlook>) {
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
    let sideways = scene.movement != Movement::Z;
    if outlook.warnings.is_empty() && sideways {
        note_ui(ui, &sideways_in_words(outlook));
    }
    for warning in &outlook.warnings {
        note_ui(ui, &capitalised(&format!("{warning}.")));
    }
}

/// Returns the effect of sideways shifts on the readings as a sentence.
fn sideways_in_words(outlook: &Outlook) -> String {
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

/// The ready-made scenes, one click each; changes `scene`. All other settings of a scene are folded below them.
pub fn scene_choice_ui(ui: &mut Ui, scene: &mut Scene) {
    ui.add_space(space(1));
    // The preset decides which rows share a network.
    let [print, paper] = [opening_scene(), Scene::default()].map(|ready| Scene {
        rows: scene.rows,
        ..ready
    });
    let options = [
        (
            print,
            "Indenter's print",
            "Each sample is the print of a ball of 2 to 6 mm radius, pressed somewhere onto the surface: as a touch \
             would leave it.",
        ),
        (paper, "Paper's scene", glossary::RANDOM_NODES.hint),
    ];
    if let Some(picked) = explained_options_ui(ui, "Ready-made scenes", &options, *scene, true) {
        *scene = picked;
    }
}

/// Shows the noise of the readings; changes `noise`. A line summarises it while the settings are folded away.
pub fn noise_ui(ui: &mut Ui, noise: &mut Noise) {
    let shown = CollapsingHeader::new("Noise on resistance").show(ui, |ui| settings_ui(ui, noise));
    focus_ring_ui(ui, &shown.header_response);
    if shown.body_response.is_none() && !noise.is_none() {
        let dim = Theme::of(ui).palette.dim;
        ui.label(RichText::new(in_words(noise)).size(type_size().note).color(dim));
    }
}

fn settings_ui(ui: &mut Ui, noise: &mut Noise) {
    let hint = glossary::RELATIVE_NOISE.hint;
    percent_ui(ui, "Relative noise", hint, &mut noise.relative, 0.0, 0.0..=100.0);
    let hint = "Noise of each reading (standard deviation), in Ω.";
    quantity_ui(
        ui,
        "Additive noise",
        hint,
        &mut noise.additive_ohm,
        usually(0.0, 0.0..=1e12),
        "Ω",
    );
    let mut bits = noise.converter_bits.map_or(0, usize::from);
    let most = usize::from(Noise::MAX_BITS);
    let hint = "Resolution of the analogue-to-digital converter, in bits; its range is 0 to twice the largest \
                resistance at rest. 0 for no quantisation.";
    count_ui(ui, "Converter bits", hint, &mut bits, usually(0, 0..=most));
    noise.converter_bits = u8::try_from(bits).ok().filter(|&bits| bits > 0);
    percent_ui(ui, "Drift", glossary::DRIFT.hint, &mut noise.drift, 0.0, 0.0..=100.0);
    if !noise.is_none() {
        let options = [
            (
                NoisySets::Both,
                "Both",
                "Training and test samples: the network learns to handle the noise.",
            ),
            (NoisySets::Training, "Training", "Training samples only."),
            (
                NoisySets::Test,
                "Test",
                "Test samples only: the network is trained on clean readings.",
            ),
        ];
        let hint = "Samples to which noise is added. Validation samples are treated like training samples.";
        if let Some(picked) = options_ui(ui, "Noise in", hint, &options, noise.sets) {
            noise.sets = picked;
        }
    }
}

/// The noise in a line: `0.1 % relative, 12 bits, in test only`.
fn in_words(noise: &Noise) -> String {
    let percent = |share: f64| input_text(in_percent(share));
    let sources = [
        (noise.relative > 0.0).then(|| format!("{} % relative", percent(noise.relative))),
        (noise.additive_ohm > 0.0).then(|| format!("{} Ω", input_text(noise.additive_ohm))),
        noise.converter_bits.map(|bits| format!("{bits} bits")),
        (noise.drift > 0.0).then(|| format!("{} % drift", percent(noise.drift))),
        match noise.sets {
            NoisySets::Both => None,
            NoisySets::Training => Some("in training only".to_owned()),
            NoisySets::Test => Some("in test only".to_owned()),
        },
    ];
    sources.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The scale of the array: one of the paper's, or any other typed; changes `scale`.
pub fn array_choice_ui(ui: &mut Ui, scale: &mut ArrayScale) {
    text_ui(
        ui,
        "Array scale",
        glossary::ARRAY_SCALE.hint,
        scale,
        ArrayScale::default(),
    );
    let names = ArrayScale::PRESETS.map(|scale| (scale, format!("{}×{}", scale.rows(), scale.nodes_per_row())));
    let options: Vec<_> = names.iter().map(|(scale, name)| (*scale, name.as_str())).collect();
    if let Some(picked) = segmented_ui(ui, "Array scale of the paper", &options, *scale, true) {
        *scale = picked;
    }
    let dim = Theme::of(ui).palette.dim;
    let text = format!(
        "{} of {} over {} of {}",
        counted(scale.rows(), "row-wire"),
        counted(scale.nodes_per_row(), "node"),
        counted(scale.columns(), "column-wire"),
        counted(scale.nodes_per_column(), "node")
    );
    let wires = [glossary::ROW_WIRE, glossary::COLUMN_WIRE, glossary::NODE];
    let wires = wires.map(|term| format!("{}: {}", term.name, term.hint)).join("\n\n");
    ui.label(RichText::new(text).size(type_size().note).color(dim))
        .on_hover_text(wires);
    if let Some(note) = scale.note() {
        note_ui(ui, &note);
    }
    ui.add_space(space(1));
}

/// The number of hidden nodes, with the rules of thumb for these numbers of inputs and outputs; changes `hidden`.
pub fn hidden_choice_ui(ui: &mut Ui, hidden: &mut usize, channels: Option<(usize, usize)>) {
    let usual = RunSettings::default().hidden;
    let limits = usually(usual, 1..=LARGEST_HIDDEN);
    count_ui(ui, "Hidden nodes", glossary::HIDDEN_NODES.hint, hidden, limits);
    let Some((n, m)) = channels else {
        hidden_slider_ui(ui, hidden, &[]);
        return;
    };
    let (square_root, logarithm) = suggested_hidden(n, m);
    let (low, high) = (*square_root.start(), *square_root.end());
    hidden_slider_ui(ui, hidden, &[logarithm, low, high]);
    let text = format!("Rules of thumb: {logarithm}, or {low} to {high}");
    dim_ui(ui, &text).on_hover_text(format!(
        "Rules of the paper for n = {n} inputs and m = {m} outputs: log₂ n (Eq. 13), or √(n + m) + a with a from 1 to 10 \
         (Eq. 12). A starting point, not a limit."
    ));
}

/// Notes the memory and time of a training that needs much of either.
pub fn workload_ui(ui: &mut Ui, draft: &RunSettings) {
    let Ok(size) = TrainingSize::drawn(draft) else { return };
    let workload = Workload::of(draft, size);
    if workload.is_large() {
        let warning = Theme::of(ui).palette.warning;
        let text = capitalised(&describe_workload(&workload));
        ui.label(RichText::new(text).size(type_size().note).color(warning));
    }
}

/// Notes the time of a training on a recording that takes long.
pub fn recorded_workload_ui(ui: &mut Ui, settings: &RunSettings, size: TrainingSize) {
    if let Some(text) = describe_recorded_workload(settings, size) {
        let warning = Theme::of(ui).palette.warning;
        ui.label(RichText::new(capitalised(&text)).size(type_size().note).color(warning));
    }
}

/// A slider for small networks, with small marks at the suggestions.
fn hidden_slider_ui(ui: &mut Ui, hidden: &mut usize, suggestions: &[usize]) {
    const MAX: usize = 64;
    let slider = Slider::new(hidden, 1..=MAX).clamping(eframe::egui::SliderClamping::Never);
    let width = ui.available_width();
    let response = slider_ui(ui, slider, width);
    if response.double_clicked() {
        *hidden = RunSettings::default().hidden;
    }
    let rail = response.rect.x_range().shrink(0.4 * response.rect.height());
    let stroke = Stroke::new(1.5, Theme::of(ui).palette.warning);
    for &suggestion in suggestions.iter().filter(|suggestion| **suggestion <= MAX) {
        let share = (suggestion - 1) as f32 / (MAX - 1) as f32;
        let (x, bottom) = (rail.min + share * rail.span(), response.rect.bottom() + space(1));
        ui.painter().vline(x, bottom - space(1)..=bottom, stroke);
    }
    let value = *hidden as f64;
    response.widget_info(|| eframe::egui::WidgetInfo::slider(true, value, "Hidden nodes slider"));
    ui.add_space(space(1));
}

#[cfg(test)]
mod tests {
    use egui_kittest::{Harness, kittest::Queryable as _};

    use super::*;

    #[test]
    fn noise_is_summarised_in_a_line() {
        let noise = Noise {
            relative: 0.07,
            converter_bits: Some(12),
            sets: NoisySets::Test,
            ..Noise::default()
        };
        assert_eq!(in_words(&noise), "7 % relative, 12 bits, in test only");
    }

    #[test]
    fn a_large_training_states_its_memory_and_time_before_it_begins() {
        for (hidden, is_shown) in [(12, false), (512, true)] {
            let mut draft = RunSettings {
                hidden,
                ..RunSettings::default()
            };
            draft.simulation_mut().unwrap().sensor.scale = "10x10_5x512".parse().unwrap();
            let harness = Harness::new_ui(move |ui| workload_ui(ui, &draft));
            let found = harness.query_by_label_contains("of memory");
            assert_eq!(found.is_some(), is_shown, "{hidden} hidden nodes");
        }
    }
}
