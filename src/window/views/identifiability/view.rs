use std::ops::RangeInclusive;

use decoupler_core::{
    scene::{Movement, RowModel, Rows, Scene},
    sensor::{ArrayScale, Geometry, LARGEST_COUNT},
    text::counted,
};
use eframe::egui::{Button, Slider, SliderClamping, Ui, WidgetInfo, emath::Numeric};

use super::{
    IdentifiabilityView, Question,
    array_view::{identifiability_ui, shown, status},
    recording,
};
use crate::window::{
    glossary,
    shared::{Effect, Holdings, Offers, Shared, Shown, SourceKind, Status, View, ViewKind},
    theme::space,
    widgets::{
        dim_ui,
        fields::{count_ui, quantity_ui, usually},
        primary_button, scrolled_ui, section_heading_ui, segmented_ui, slider_ui,
    },
};

impl View for IdentifiabilityView {
    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        self.follow_shown(shared);
        self.study.take_events(effects);
        while let Some(answer) = self.worker.next_answer() {
            if answer.is_newest {
                self.is_pending = false;
            }
            match answer.analysis {
                Ok(analysis) => {
                    self.problem = None;
                    self.analysis = Some(analysis);
                }
                Err(reason) => self.problem = Some(reason),
            }
        }
    }

    fn holdings(&self, _shared: &Shared) -> Holdings {
        Holdings {
            is_computing: self.study.is_under_way(),
            unfinished: self.study.unfinished().into_iter().collect(),
            files: Vec::new(),
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, shared: &Shared, _effects: &mut Vec<Effect>) {
        if shared.source == SourceKind::Recording {
            recording::offer_actions(&mut self.study, offers, shared);
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        match shared.source {
            SourceKind::Array => shown(self, shared),
            SourceKind::Recording => recording::shown(&self.study),
        }
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        match shared.source {
            SourceKind::Array => array_form_ui(ui, self, shared, effects),
            SourceKind::Recording => recording::form_ui(ui, &mut self.study, shared),
        }
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        Some(match shared.source {
            SourceKind::Array => {
                identifiability_ui(ui, self, shared, effects);
                status(self)
            }
            SourceKind::Recording => {
                recording::body_ui(ui, &mut self.study, shared);
                recording::status(&self.study, shared)
            }
        })
    }
}

impl IdentifiabilityView {
    /// When the view is shown, takes the sensor and scene of the Train view, with what was last tried on them.
    fn follow_shown(&mut self, shared: &Shared) {
        let was_shown = std::mem::replace(&mut self.is_shown, shared.shown == ViewKind::Sensor);
        if self.is_shown && !was_shown {
            let is_other = shared
                .draft
                .simulation()
                .is_some_and(|simulation| self.follow(simulation));
            if is_other || self.problem.is_some() {
                self.ask();
            }
        }
    }
}

/// Shows geometry, array and scene, and the buttons that copy them to and from the Train view.
pub fn array_form_ui(ui: &mut Ui, view: &mut IdentifiabilityView, shared: &Shared, effects: &mut Vec<Effect>) {
    let mut question = view.question;
    let mut is_taken = false;
    scrolled_ui(ui, "identifiability form", |ui| {
        section_heading_ui(ui, "Geometry");
        geometry_ui(ui, &mut question);
        section_heading_ui(ui, "Array");
        array_ui(ui, &mut question.sensor.scale);
        section_heading_ui(ui, "Scene");
        scene_ui(ui, &mut question);
        ui.add_space(space(3));
        is_taken = buttons_ui(ui, view, shared, effects);
        ui.add_space(space(4));
    });
    if question != view.question {
        view.question = question;
        view.ask();
    } else if let Some(simulation) = shared.draft.simulation().filter(|_| is_taken) {
        view.take(simulation);
        view.ask();
    }
}

fn geometry_ui(ui: &mut Ui, question: &mut Question) {
    let (geometry, usual) = (&mut question.sensor.geometry, Geometry::default());
    let lengths = [
        (
            "Height",
            "Height of the row-wires above the column-wires, undeformed, in mm.",
            &mut geometry.height_mm,
            usual.height_mm,
            0.5..=15.0,
        ),
        (
            "Node pitch",
            "Distance between nodes on a row-wire, in mm.",
            &mut geometry.node_pitch_mm,
            usual.node_pitch_mm,
            0.2..=8.0,
        ),
        (
            "Row pitch",
            "Distance between row-wires, in mm.",
            &mut geometry.row_pitch_mm,
            usual.row_pitch_mm,
            0.2..=8.0,
        ),
        (
            "Column pitch",
            "Distance between column-wires, in mm.",
            &mut geometry.column_pitch_mm,
            usual.column_pitch_mm,
            0.2..=8.0,
        ),
        (
            "Column node pitch",
            "Distance between nodes on a column-wire, in mm.",
            &mut geometry.column_node_pitch_mm,
            usual.column_node_pitch_mm,
            0.5..=15.0,
        ),
    ];
    for (name, hint, value, usual, range) in lengths {
        quantity_ui(ui, name, hint, value, usually(usual, 1e-6..=1e6), "mm");
        stepped_slider_ui(ui, name, value, usual, range, 0.05);
    }
    let hint = "x coordinate of the first node on each column-wire, in mm. Shifting it breaks the symmetry that makes \
                rows read alike.";
    let name = "First column node at x";
    let (value, usual) = (&mut geometry.column_node_x0_mm, usual.column_node_x0_mm);
    quantity_ui(ui, name, hint, value, usually(usual, -1e6..=1e6), "mm");
    stepped_slider_ui(ui, name, value, usual, -10.0..=40.0, 0.05);
}

fn array_ui(ui: &mut Ui, scale: &mut ArrayScale) {
    let usual = ArrayScale::default();
    let (mut columns, mut nodes) = (scale.columns(), scale.nodes_per_column());
    let hint = "Number of column-wires. Each adds one reading to every row.";
    let limits = |usual: usize| usually(usual, 1..=LARGEST_COUNT);
    count_ui(ui, "Column-wires", hint, &mut columns, limits(usual.columns()));
    stepped_slider_ui(ui, "Column-wires", &mut columns, usual.columns(), 1..=100, 1.0);
    let hint = "Number of nodes on each column-wire, which are read together.";
    let (name, usual) = ("Nodes on each column", usual.nodes_per_column());
    count_ui(ui, name, hint, &mut nodes, limits(usual));
    stepped_slider_ui(ui, name, &mut nodes, usual, 1..=20, 1.0);
    if let Ok(changed) = ArrayScale::new([scale.rows(), scale.nodes_per_row(), nodes, columns]) {
        *scale = changed;
    }
    let rows = counted(scale.rows(), "row-wire");
    let text = format!("{scale}: {rows} of {}", counted(scale.nodes_per_row(), "node"));
    dim_ui(ui, &text);
}

fn scene_ui(ui: &mut Ui, question: &mut Question) {
    let scene = &mut question.scene;
    let known = [(RowModel::Shared, "Row unknown"), (RowModel::Each, "Row known")];
    if let Some(model) = segmented_ui(ui, "Row model", &known, scene.rows.model(), true) {
        scene.rows = match model {
            RowModel::Shared => Rows::All,
            RowModel::Each => Rows::Known,
        };
    }
    let is_sideways = scene.movement != Movement::Z;
    let movements = [(false, "Nodes move in z"), (true, "In x, y and z")];
    if let Some(is_sideways) = segmented_ui(ui, "Node movement", &movements, is_sideways, true) {
        scene.movement = if is_sideways { Movement::SIDEWAYS } else { Movement::Z };
    }
    let hint = glossary::RELATIVE_NOISE.hint;
    let (noise, usual) = (&mut scene.noise.relative, Scene::default().noise.relative);
    quantity_ui(ui, "Relative noise", hint, noise, usually(usual, 0.0..=1.0), "");
    form_slider_ui(ui, "Relative noise", noise, usual, |noise| {
        Slider::new(noise, 0.0..=1.0).logarithmic(true).smallest_positive(1e-6)
    });
    let hint = "Compression of all nodes at which the sensor is analysed, in percent of the height, up to the largest \
                of the scene.";
    let mut percent = 100.0 * question.compression;
    let max = 100.0 * scene.largest_compression;
    let usual = 0.5 * max;
    quantity_ui(ui, "Compression", hint, &mut percent, usually(usual, 0.0..=max), "%");
    stepped_slider_ui(ui, "Compression", &mut percent, usual, 0.0..=max, 0.5);
    // Only if it was changed: converting to percent and back may round it.
    if percent != 100.0 * question.compression {
        question.compression = percent / 100.0;
    }
}

fn stepped_slider_ui<N: Numeric>(
    ui: &mut Ui,
    name: &str,
    value: &mut N,
    usual: N,
    range: RangeInclusive<N>,
    step: f64,
) {
    form_slider_ui(ui, name, value, usual, |value| Slider::new(value, range).step_by(step));
}

/// Shows a slider as wide as the form, which a double click resets to `usual`. A value out of its range is kept until
/// the slider is moved.
fn form_slider_ui<N: Numeric>(
    ui: &mut Ui,
    name: &str,
    value: &mut N,
    usual: N,
    slider: impl FnOnce(&mut N) -> Slider<'_>,
) {
    let (present, width) = (value.to_f64(), ui.available_width());
    let response = slider_ui(ui, slider(value).clamping(SliderClamping::Never), width);
    if response.double_clicked() {
        *value = usual;
    }
    response.widget_info(|| WidgetInfo::slider(true, present, format!("{name} slider")));
}

/// Returns true if the question is to be reset to the Train view's.
fn buttons_ui(ui: &mut Ui, view: &mut IdentifiabilityView, shared: &Shared, effects: &mut Vec<Effect>) -> bool {
    let question = view.question;
    let mut is_taken = false;
    let of_draft = shared.draft.simulation();
    let is_other = of_draft.is_some_and(|simulation| question.sensor != simulation.sensor);
    let can_use = !shared.phase.is_busy() && is_other;
    let why_not = if shared.phase.is_busy() {
        "A training is running in the Train view: its settings cannot be changed now"
    } else {
        "This is already the sensor of the Train view"
    };
    let can_reset = of_draft.is_some_and(|simulation| question != Question::of(simulation));
    ui.vertical_centered_justified(|ui| {
        let button = primary_button("Use this sensor in the Train view");
        let button = ui.add_enabled(can_use, button);
        if button
            .on_hover_text("Copies the array and its geometry to the Train view; the scene there stays as it is.")
            .on_disabled_hover_text(why_not)
            .clicked()
        {
            let settings = view.hand_over(&shared.draft);
            effects.extend([Effect::Configure(Box::new(settings)), Effect::ShowTraining]);
        }
        let reset = ui.add_enabled(can_reset, Button::new("Reset to the Train view's sensor"));
        is_taken = reset
            .on_hover_text("Restores the sensor and the scene of the Train view.")
            .clicked();
    });
    is_taken
}
