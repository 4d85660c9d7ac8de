//! The configuration form, with a short summary of each folded part.

use decoupler_core::{
    dataset::Simulation,
    evaluation::{Outlook, Preset, RunSettings, Source, TrainingSize},
    network::{InputChoice, Quantity, ScalingChoice, Shape},
    scene::{Loading, Movement, RowModel, Rows, Scene},
    sensor::{Geometry, SensorModel},
    text::counted,
    training::{StoppingRules, TrainingSettings},
};
use decoupler_files::import::Setup;
use eframe::egui::{RichText, Ui};

use super::automatic::{automatic_choice_ui, chosen_inputs_ui, chosen_network_ui, chosen_training_ui};
use super::scene_section::{
    array_choice_ui, hidden_choice_ui, outlook_notes_ui, recorded_workload_ui, samples_section_ui, scene_choice_ui,
    scene_section_ui, workload_ui,
};
use crate::window::{
    glossary,
    shared::{Effect, Phase, Shared, SourceKind, method_choice_ui, method_settings_ui, stopping_ui},
    theme::{Theme, space, type_size},
    views::train::{exports::PaperFigure, recording::RecordingEditor},
    widgets::{
        Landmark, dim_ui, explained_options_ui,
        fields::{capitalised, input_text, list_ui, options_ui, quantity_ui, usually},
        fold_ui, ghost_button, scrolled_ui,
    },
};

/// The source and the settings of the next training. Returns the figure of the paper that the user picked, if any.
pub fn configuration_ui(
    ui: &mut Ui,
    recording: &mut RecordingEditor,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) -> Option<PaperFigure> {
    let mut picked = None;
    scrolled_ui(ui, "configuration", |ui| {
        ui.add_space(space(2));
        ui.add_enabled_ui(!shared.phase.is_busy(), |ui| {
            source_choice_ui(ui, shared.source, effects);
        });
        ui.add_space(space(2));
        match shared.source {
            SourceKind::Array => picked = array_ui(ui, shared, effects),
            SourceKind::Recording => recording_ui(ui, recording, shared, effects),
        }
        ui.add_space(space(4));
    });
    picked
}

/// The choice between the simulated array and a recording.
fn source_choice_ui(ui: &mut Ui, source: SourceKind, effects: &mut Vec<Effect>) {
    let options = [
        (
            SourceKind::Array,
            "Simulated array",
            "Samples are drawn from the resistance model of a row-column array.",
        ),
        (
            SourceKind::Recording,
            "Recording",
            "Samples are read from files with readings and measured targets.",
        ),
    ];
    if let Some(source) = explained_options_ui(ui, "Source", &options, source, true) {
        effects.push(Effect::ChooseSource(source));
    }
}

/// Settings of a training on a simulated array. Returns the paper's figure that the user picked.
fn array_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<PaperFigure> {
    let mut draft = shared.draft;
    let mut picked = None;
    let is_busy = shared.phase.is_busy();
    let noise_of = |draft: &RunSettings| draft.simulation().map(|simulation| simulation.scene.noise);
    let followed = present(&draft);
    let top = ui.cursor().top();
    ui.add_enabled_ui(!is_busy, |ui| {
        let Some(simulation) = draft.simulation_mut() else {
            return;
        };
        array_choice_ui(ui, &mut simulation.sensor.scale);
        let scale = simulation.sensor.scale;
        hidden_choice_ui(
            ui,
            &mut draft.hidden,
            Some((scale.columns(), scale.coordinates_per_row())),
        );
        workload_ui(ui, &draft);
    });
    method_ui(ui, &mut draft, shared.phase);
    Landmark::Choices.stands_at(ui, ui.min_rect().with_min_y(top));
    ui.add_enabled_ui(!is_busy, |ui| {
        preset_section_ui(ui, &mut draft);
        if let Some(simulation) = draft.simulation_mut() {
            scene_choice_ui(ui, &mut simulation.scene);
            ui.add_space(space(2));
            ui.separator();
            outlook_notes_ui(ui, &simulation.scene, outlook(shared));
            fold_ui(ui, "Scene", &of_scene(&simulation.scene), |ui| {
                scene_section_ui(ui, simulation, outlook(shared));
            });
        }
        // The best number of samples depends on the noise.
        if let Some(preset) = followed.filter(|_| noise_of(&draft) != noise_of(&shared.draft)) {
            draft = applied(preset, &draft);
        }
        fold_ui(ui, "Samples", &of_samples(&draft), |ui| {
            samples_section_ui(ui, &mut draft);
        });
        if let Some(Simulation { sensor, .. }) = draft.simulation_mut() {
            fold_ui(ui, "Geometry", &of_geometry(&sensor.geometry), |ui| {
                geometry_ui(ui, sensor);
            });
        }
        fold_ui(ui, "Network inputs", &of_inputs(&draft.inputs), |ui| {
            array_inputs_ui(ui, &mut draft);
        });
    });
    training_ui(ui, &mut draft, StoppingRules::default(), shared.phase);
    ui.add_enabled_ui(!is_busy && shared.phase != Phase::Died, |ui| {
        fold_ui(ui, "Figures of the paper", "", |ui| picked = paper_section_ui(ui));
    });
    let (text, hint) = (
        "Reset to the paper's settings",
        "10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples",
    );
    reset_ui(ui, text, hint, &mut draft, RunSettings::default(), is_busy);
    if draft != shared.draft {
        effects.push(Effect::Configure(Box::new(draft)));
    }
    picked
}

/// Files and settings of a training on a recording.
fn recording_ui(ui: &mut Ui, recording: &mut RecordingEditor, shared: &Shared, effects: &mut Vec<Effect>) {
    let mut settings = shared.recording.settings;
    let is_busy = shared.phase.is_busy();
    let top = ui.cursor().top();
    ui.add_enabled_ui(!is_busy, |ui| recording.files_ui(ui, shared, effects));
    recording.columns_button_ui(ui, shared);
    ui.add_space(space(2));
    ui.separator();
    let has_one_network = settings.source.row_model() == RowModel::Shared;
    automatic_choice_ui(ui, shared, has_one_network, effects);
    let is_automatic = shared.recording.is_automatic();
    let chosen = shared.chosen_run().map(|run| &run.setup);
    if is_automatic {
        chosen_network_ui(ui, chosen);
    } else {
        ui.add_enabled_ui(!is_busy, |ui| {
            hidden_choice_ui(ui, &mut settings.hidden, recording.channels());
        });
        recorded_method_ui(ui, &mut settings, shared.phase);
        if let Some(size) = recording.training_size(&settings) {
            recorded_workload_ui(ui, &settings, size);
        }
    }
    Landmark::Choices.stands_at(ui, ui.min_rect().with_min_y(top));
    ui.add_space(space(2));
    ui.separator();
    ui.add_enabled_ui(!is_busy, |ui| {
        recording.folds_ui(ui, &mut settings, shared, effects);
        let summary = match (is_automatic, chosen) {
            (false, _) => of_inputs(&settings.inputs),
            (true, Some(chosen)) => of_inputs(&chosen.settings().inputs),
            (true, None) => "automatic".to_owned(),
        };
        fold_ui(ui, "Network inputs", &summary, |ui| {
            if is_automatic {
                chosen_inputs_ui(ui, chosen.map(Setup::settings));
            } else {
                scaling_ui(ui, &mut settings.inputs.scaling);
            }
            recording_rows_ui(ui, &mut settings, recording.has_row_wires());
            let is_one = settings.source.row_model() == RowModel::Shared;
            if let (false, true, Some(channels)) = (is_automatic, is_one, recording.channels()) {
                weights_ui(ui, &settings, channels, 1);
            }
        });
    });
    if is_automatic {
        chosen_training_ui(ui, chosen.map(Setup::settings));
    } else {
        let rules = StoppingRules::recorded(&settings.training.method);
        training_ui(ui, &mut settings, rules, shared.phase);
    }
    let usual = RunSettings::measured(RowModel::Shared);
    let hint = "Bayesian regularisation for recordings, 12 hidden nodes, 300 epochs";
    reset_ui(ui, "Reset to the default settings", hint, &mut settings, usual, is_busy);
    if settings != shared.recording.settings {
        effects.push(Effect::ConfigureRecording(Box::new(settings)));
    }
}

/// The method of a recording; another one comes with the settings that suit recordings.
fn recorded_method_ui(ui: &mut Ui, settings: &mut RunSettings, phase: Phase) {
    let before = *settings;
    method_ui(ui, settings, phase);
    if settings.training.method.short_name() != before.training.method.short_name() {
        let chosen = std::mem::replace(settings, before).training.method;
        settings.choose_method(chosen);
    }
}

/// The method. A paused training can be continued with another one.
fn method_ui(ui: &mut Ui, settings: &mut RunSettings, phase: Phase) {
    ui.add_space(space(1));
    ui.add_enabled_ui(!phase.is_busy() || phase == Phase::Paused, |ui| {
        method_choice_ui(ui, &mut settings.training.method);
    });
}

/// The folded settings of the training; `usual` are the default stopping rules.
fn training_ui(ui: &mut Ui, settings: &mut RunSettings, usual: StoppingRules, phase: Phase) {
    ui.add_enabled_ui(!phase.is_busy() || phase == Phase::Paused, |ui| {
        fold_ui(ui, "When to stop", &of_stopping(&settings.training), |ui| {
            stopping_ui(ui, &mut settings.training.stopping, usual);
        });
        fold_ui(ui, "Method settings", &of_method(settings), |ui| {
            method_settings_ui(ui, settings, !phase.is_busy());
        });
    });
}

/// The button that sets `settings` to `usual`.
fn reset_ui(ui: &mut Ui, text: &str, hint: &str, settings: &mut RunSettings, usual: RunSettings, is_busy: bool) {
    ui.add_space(space(4));
    let can_reset = !is_busy && *settings != usual;
    let reset = ui.add_enabled(can_reset, eframe::egui::Button::new(text));
    if reset.on_hover_text(hint).clicked() {
        *settings = usual;
    }
}

/// Returns the outlook of the scene of the draft, if it is known.
fn outlook(shared: &Shared) -> Option<&Outlook> {
    let (settings, test) = match (&shared.preview, &shared.run) {
        (Some(preview), _) => (&preview.settings, &preview.test),
        (None, Some(run)) => (run.settings(), run.test.array()?),
        (None, None) => return None,
    };
    let sensor_and_scene = |settings: &RunSettings| {
        let simulation = settings.simulation()?;
        Some((simulation.sensor, simulation.scene))
    };
    let is_same = sensor_and_scene(settings) == sensor_and_scene(&shared.draft);
    test.outlook.as_ref().filter(|_| is_same)
}

/// The paper's figures of single networks, one click each.
fn paper_section_ui(ui: &mut Ui) -> Option<PaperFigure> {
    const GAP: f32 = space(1);
    let mut picked = None;
    let width = 0.5 * (ui.available_width() - GAP);
    ui.spacing_mut().item_spacing = [GAP, GAP].into();
    for pair in PaperFigure::ALL.chunks(2) {
        ui.horizontal(|ui| {
            for figure in pair {
                let button = ghost_button(figure.name).min_size([width, space(7)].into());
                if ui.add(button).on_hover_text(figure.description).clicked() {
                    picked = Some(*figure);
                }
            }
        });
    }
    picked
}

/// Shows the presets of the settings; changes `draft`.
pub fn preset_section_ui(ui: &mut Ui, draft: &mut RunSettings) {
    ui.add_space(space(2));
    let options = [
        (
            Some(Preset::Paper),
            "Paper",
            "One network for all rows, resistances between −1 and 1, 1000 training samples.\n\nArray, axes, loading, \
             noise, hidden nodes and seed stay as they are.",
        ),
        (
            Some(Preset::Best),
            "Best",
            "A small network for each known row, whitened conductances, 5000 training samples, or 50 000 if the \
             readings are noisy.\n\nChosen by measurement: of all and known rows, resistance, conductance and its \
             logarithm, min-max and whitening, this has the lowest test error for the same hidden nodes.\n\nArray, \
             axes, loading, noise, hidden nodes and seed stay as they are.",
        ),
    ];
    if let Some(Some(picked)) = explained_options_ui(ui, "Preset", &options, present(draft), true) {
        *draft = applied(picked, draft);
    }
}

/// Returns the preset that `draft` follows, if any.
pub fn present(draft: &RunSettings) -> Option<Preset> {
    Preset::ALL.into_iter().find(|&preset| applied(preset, draft) == *draft)
}

/// Returns `draft` with the settings of `preset`: how readings are decoded and trained on, not the scene.
pub fn applied(preset: Preset, draft: &RunSettings) -> RunSettings {
    let Some(simulation) = draft.simulation() else {
        return *draft;
    };
    let of_preset = preset.simulation_in(simulation.scene.noise);
    let source = Simulation {
        sensor: simulation.sensor,
        scene: Scene {
            rows: of_preset.scene.rows,
            ..simulation.scene
        },
        test_samples: simulation.test_samples,
        ..of_preset
    };
    RunSettings {
        source: source.into(),
        hidden: draft.hidden,
        starts: draft.starts,
        combine: draft.combine,
        initialization: draft.initialization,
        seed: draft.seed,
        ..preset.settings_in(simulation.scene.noise)
    }
}

/// Loading, rows, axes and noise.
pub(super) fn of_scene(scene: &Scene) -> String {
    let loading = match scene.loading {
        Loading::RandomNodes => "random nodes".to_owned(),
        Loading::SmoothField { .. } => "smooth field".to_owned(),
        Loading::Indenter(indenter) => indenter.name().to_owned(),
    };
    let rows = match scene.rows {
        Rows::All => "all rows".to_owned(),
        Rows::Known => "known rows".to_owned(),
        Rows::One(row) => format!("row {}", row + 1),
    };
    let axes = match scene.movement {
        Movement::Z => "",
        Movement::Xyz { .. } => ", x y z",
    };
    let noise = if scene.noise.is_none() { "" } else { ", noise" };
    format!("{loading}, {rows}{axes}{noise}")
}

/// Numbers of training, validation and test samples, and the seed.
pub(super) fn of_samples(draft: &RunSettings) -> String {
    let samples = draft.simulation().map_or(String::new(), |simulation| {
        let Simulation {
            samples,
            validation_samples,
            test_samples,
            ..
        } = simulation;
        format!("{samples} + {validation_samples} + {test_samples}, ")
    });
    format!("{samples}seed {}", draft.seed.0)
}

/// Height, and whether the geometry differs from the assumed one.
pub(super) fn of_geometry(geometry: &Geometry) -> String {
    let height = input_text(geometry.height_mm);
    if *geometry == Geometry::default() {
        format!("assumed, {height} mm high")
    } else {
        format!("custom, {height} mm high")
    }
}

/// Quantity and scaling of the inputs.
pub(super) fn of_inputs(inputs: &InputChoice) -> String {
    let quantity = match inputs.quantity {
        Quantity::Raw => "readings",
        Quantity::Resistance => "resistance",
        Quantity::Conductance => "conductance",
        Quantity::LogResistance => "log-resistance",
    };
    let scaling = match inputs.scaling {
        ScalingChoice::MinMax => "min-max",
        ScalingChoice::Whitening => "whitening",
    };
    format!("{quantity}, {scaling}")
}

/// The rule that ends every training.
pub(super) fn of_stopping(training: &TrainingSettings) -> String {
    counted(training.stopping.epochs, "epoch")
}

/// The first of the method's own settings, and the number of starts.
pub(super) fn of_method(settings: &RunSettings) -> String {
    let method = settings.training.method;
    let first = method.settings().next();
    let first = first.and_then(|setting| Some(format!("{} {}, ", setting.name, input_text(setting.number(&method)?))));
    let starts = counted(settings.starts, "start");
    format!("{}{starts}", first.unwrap_or_default())
}

/// Lengths and resistivity; changes `sensor`.
pub fn geometry_ui(ui: &mut Ui, sensor: &mut SensorModel) {
    let Geometry {
        height_mm,
        row_x0_mm,
        row_pitch_mm,
        node_pitch_mm,
        column_y0_mm,
        column_pitch_mm,
        column_node_x0_mm,
        column_node_pitch_mm,
    } = &mut sensor.geometry;
    let usual = Geometry::default();
    let lengths = [
        ("Height", glossary::HEIGHT.hint, height_mm, usual.height_mm),
        (
            "Row pitch",
            "Distance between row-wires, in mm (the paper's wire gap).",
            row_pitch_mm,
            usual.row_pitch_mm,
        ),
        (
            "Node pitch",
            "Distance between nodes on a row-wire, in mm.",
            node_pitch_mm,
            usual.node_pitch_mm,
        ),
        (
            "Column pitch",
            "Distance between column-wires, in mm (the paper's wire gap).",
            column_pitch_mm,
            usual.column_pitch_mm,
        ),
        (
            "Column node pitch",
            "Distance between nodes on a column-wire, in mm.",
            column_node_pitch_mm,
            usual.column_node_pitch_mm,
        ),
    ];
    for (name, hint, value, usual) in lengths {
        quantity_ui(ui, name, hint, value, usually(usual, 1e-6..=1e6), "mm");
    }
    let offsets = [
        (
            "First row at x",
            "x coordinate of the first row-wire, in mm.",
            row_x0_mm,
            usual.row_x0_mm,
        ),
        (
            "First column at y",
            "y coordinate of the first column-wire, in mm.",
            column_y0_mm,
            usual.column_y0_mm,
        ),
        (
            "First column node at x",
            "x coordinate of the first node on each column-wire, in mm.",
            column_node_x0_mm,
            usual.column_node_x0_mm,
        ),
    ];
    for (name, hint, value, usual) in offsets {
        quantity_ui(ui, name, hint, value, usually(usual, -1e6..=1e6), "mm");
    }
    let hint = glossary::RESISTIVITY.hint;
    quantity_ui(
        ui,
        "Resistivity",
        hint,
        &mut sensor.resistivity_ohm_per_mm,
        usually(SensorModel::new(sensor.scale).resistivity_ohm_per_mm, 1e-12..=1e12),
        "Ω/mm",
    );
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(Geometry::ASSUMPTION).size(type_size().note).color(dim));
    if sensor.geometry != Geometry::default() && ui.button("Reset to the assumed geometry").clicked() {
        sensor.geometry = Geometry::default();
    }
}

/// The inputs of the network of an array, and its size; changes `draft`.
pub fn array_inputs_ui(ui: &mut Ui, draft: &mut RunSettings) {
    let options = [
        (Quantity::Resistance, "Resistance", "R, as in the paper."),
        (Quantity::Conductance, "Conductance", glossary::CONDUCTANCE.hint),
        (Quantity::LogResistance, "Log-resistance", glossary::LOG_RESISTANCE.hint),
    ];
    if let Some(picked) = list_ui(ui, "Inputs", glossary::INPUTS.hint, &options, draft.inputs.quantity) {
        draft.inputs.quantity = picked;
    }
    scaling_ui(ui, &mut draft.inputs.scaling);
    if let Ok(size) = TrainingSize::drawn(draft) {
        weights_ui(ui, draft, (size.inputs, size.targets), size.networks);
    }
}

/// The row model of a recording: one network per row-wire is offered if a column contains the row numbers. Changes
/// `settings`.
fn recording_rows_ui(ui: &mut Ui, settings: &mut RunSettings, has_row_wires: bool) {
    if !has_row_wires {
        return;
    }
    let options = [
        (RowModel::Shared, "All", "One network for all row-wires."),
        (
            RowModel::Each,
            "Known",
            "One network per row-wire, for electronics that know which row they address.",
        ),
    ];
    let rows = settings.source.row_model();
    if let Some(rows) = options_ui(ui, "Rows", glossary::ROWS.hint, &options, rows) {
        settings.source = Source::Measured { rows };
    }
}

fn scaling_ui(ui: &mut Ui, scaling: &mut ScalingChoice) {
    let options = [
        (ScalingChoice::MinMax, "Min-max", glossary::MIN_MAX.hint),
        (ScalingChoice::Whitening, "Whitening", glossary::WHITENING.hint),
    ];
    if let Some(picked) = options_ui(ui, "Scaling", glossary::SCALING.hint, &options, *scaling) {
        *scaling = picked;
    }
}

/// Shows the size of the networks with these numbers of inputs and outputs.
fn weights_ui(ui: &mut Ui, settings: &RunSettings, (inputs, outputs): (usize, usize), networks: usize) {
    let shape = Shape {
        inputs,
        hidden: settings.hidden,
        outputs,
    };
    // Components that do not vary are left out, which is known only from the samples.
    let at_most = match settings.inputs.scaling {
        ScalingChoice::MinMax => "",
        ScalingChoice::Whitening => "at most ",
    };
    let weights = shape.weights();
    let [inputs, outputs, of_each] =
        [(inputs, "input"), (outputs, "output"), (weights, "weight")].map(|(count, noun)| counted(count, noun));
    let text = match networks {
        1 => format!("{at_most}{inputs}, {outputs}, {of_each}"),
        networks => format!(
            "{networks} networks of {at_most}{inputs}, {outputs} and {of_each}: {} in total",
            networks * weights
        ),
    };
    dim_ui(ui, &capitalised(&text)).on_hover_text("Inputs are readings; outputs are the targets that vary.");
}
