use std::{sync::Arc, time::Duration};

use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    job::Job,
    network::Networks,
    text::counted,
};
use decoupler_files::{
    export::format_number,
    figure::{HeatMap, SequentialMap, readings_figure},
};
use eframe::egui::{Align, Layout, Response, RichText, Slider, Ui, Vec2, WidgetInfo};
use ndarray::Array2;

use super::{
    comparing::Compared,
    pressed::{Pressed, PressedAnswer},
    state::{Finger, PressState, Subject, Tool},
    touch::Touch,
};
use crate::window::{
    glossary,
    plotting::cells_ui,
    shared::{Phase, Shared},
    test_view::TestView,
    theme::{Theme, semibold, space, type_size},
    views::train::drawn::Frames,
    widgets::{
        TableColumn, TableRow, TableView, dim_ui, explained_options_ui, note_ui, number_ui, placeholder_ui, refusal_ui,
        section_heading_ui, slider_ui, usually,
    },
};

const TOOLS: [(Tool, &str, &str); 5] = [
    (Tool::Sphere, "Sphere", "Presses a ball onto the surface."),
    (
        Tool::FlatPunch,
        "Punch",
        "Presses the flat end of a round bar onto the surface.",
    ),
    (
        Tool::Cylinder,
        "Cylinder",
        "Presses a bar onto the surface, along a row of nodes.",
    ),
    (Tool::Edge, "Edge", "Presses the edge of a block onto the surface."),
    (Tool::OneNode, "Node", "Moves a single node: drag it up or down."),
];

const COLUMNS: [TableColumn<'_>; 4] = [
    TableColumn::text(""),
    TableColumn::figure("mean mm").meaning("Mean |error| of z over the nodes of the pressed surface, in millimetres"),
    TableColumn::figure("worst mm").meaning("Largest |error| of z, in millimetres"),
    TableColumn::figure("µs")
        .meaning("Time to decode this frame (all rows) on one thread, in µs: the shortest of several."),
];

/// The finger, and the answers of all decoders to it.
pub fn press_section_ui(ui: &mut Ui, press: &mut PressState, shared: &Shared) {
    let Some(test) = shared.test() else { return };
    section_heading_ui(ui, "Under your finger");
    finger_ui(ui, press, test);
    ui.add_space(space(1));
    if let Some(reason) = press.failure() {
        note_ui(ui, &format!("This cannot be pressed: {reason}."));
    } else if let Some(shown) = press.shown() {
        answers_ui(ui, shown, press.compared());
        remarks_ui(ui, press, shown, shared);
    } else if press.is_pressing() {
        dim_ui(ui, "Computing the readings…");
    } else {
        // The surface shows it too: in a low window the error table comes first.
        if ui.clip_rect().height() > space(70) {
            dim_ui(ui, "Press on the actual surface; the wheel sets the depth.");
        }
        return;
    }
    let back = ui.small_button("Back to the test set");
    if back
        .on_hover_text("Shows the snapshots of the test set again (Esc).")
        .clicked()
    {
        press.let_go();
        ui.request_repaint();
    }
}

fn finger_ui(ui: &mut Ui, press: &mut PressState, test: &TestView) {
    let before = press.finger;
    if let Some(tool) = explained_options_ui(ui, "Press with", &TOOLS, press.finger.tool, true) {
        press.finger.tool = tool;
    }
    let finger = &mut press.finger;
    let mut refused = Vec::new();
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        if finger.has_radius() {
            let hint = "Radius of the body that presses, in mm.";
            let label = ui.label("Radius").on_hover_text(hint);
            let limits = usually(Finger::default().radius_mm, Finger::RADIUS_MM);
            let size = Vec2::new(space(14), space(6));
            let radius = number_ui(ui, &mut finger.radius_mm, &limits, "mm", size);
            refused.push(radius.labelled_by(label.id).on_hover_text(hint));
            ui.add_space(space(1));
        }
        if finger.tool == Tool::OneNode {
            dim_ui(ui, "Take a node and drag it up or down.");
            return;
        }
        refused.push(depth_ui(ui, finger, test.stroke_mm));
    });
    refused.iter().for_each(|field| refusal_ui(ui, field));
    if press.finger != before {
        press.follow_finger(test.stroke_mm);
        ui.request_repaint();
    }
}

/// The depth as a number and on a slider that ends at the scene's largest compression.
fn depth_ui(ui: &mut Ui, finger: &mut Finger, stroke_mm: f64) -> Response {
    let limit = format_number(stroke_mm);
    let hint = format!("Depth of the press in mm, up to the scene's largest compression of {limit} mm.");
    let mut depth_mm = finger.depth_share * stroke_mm;
    let before_mm = depth_mm;
    let usual_mm = Finger::default().depth_share * stroke_mm;
    let label = ui.label("Depth").on_hover_text(&hint);
    let field = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let limits = usually(usual_mm, 0.0..=stroke_mm);
        // A thousandth of a millimetre is finer than any finger.
        let shown_mm = (1e3 * depth_mm).round() / 1e3;
        let mut typed_mm = shown_mm;
        let number = number_ui(ui, &mut typed_mm, &limits, "mm", Vec2::new(space(16), space(6)));
        if typed_mm != shown_mm {
            depth_mm = typed_mm;
        }
        let number = number.labelled_by(label.id).on_hover_text(&hint);
        let width = (ui.available_width() - space(2)).max(space(8));
        let slider = slider_ui(ui, Slider::new(&mut depth_mm, 0.0..=stroke_mm), width);
        if slider.double_clicked() {
            depth_mm = usual_mm;
        }
        slider.widget_info(|| WidgetInfo::slider(true, depth_mm, "Depth of the press"));
        slider.on_hover_text(&hint);
        number
    });
    if depth_mm != before_mm {
        finger.depth_share = (depth_mm / stroke_mm).clamp(0.0, 1.0);
    }
    field.inner
}

fn answers_ui(ui: &mut Ui, shown: &Shown, compared: &[Compared]) {
    let palette = Theme::of(ui).palette;
    let network = match &shown.answer {
        Some(Ok(answer)) => Some(answer),
        _ => None,
    };
    let answered = |row: &Compared| match &row.answer {
        Some(Ok(answer)) => Some(answer.mean_mm),
        _ => None,
    };
    let means = compared
        .iter()
        .filter_map(answered)
        .chain(network.map(|answer| answer.mean_mm));
    let best_mm = means.fold(f64::INFINITY, f64::min);
    let row = |kind: DecoderKind, cells: Vec<String>, mean_mm: Option<f64>, colour| {
        TableRow::figures(kind.name(Precision::Double), cells)
            .meaning(kind.meaning())
            .colour(colour)
            .strong(mean_mm == Some(best_mm))
    };
    let of_network = shown.answer.as_ref().map(|answer| {
        let (cells, mean_mm) = cells_of(Some(answer));
        row(DecoderKind::Network, cells, mean_mm, palette.accent)
    });
    let mut rows: Vec<TableRow<'_>> = of_network.into_iter().collect();
    rows.extend(compared.iter().map(|compared| {
        let (cells, mean_mm) = cells_of(compared.answer.as_ref());
        // Answers to an earlier touch are pale.
        let colour = if compared.is_present { palette.text } else { palette.dim };
        row(compared.kind, cells, mean_mm, colour)
    }));
    if !rows.is_empty() {
        TableView::new("answers", &COLUMNS).show_all(ui, rows);
    }
    let failed = compared.iter().filter_map(|compared| match &compared.answer {
        Some(Err(reason)) => Some((compared.kind, reason)),
        _ => None,
    });
    for (kind, reason) in failed {
        note_ui(ui, &format!("{}: {reason}", kind.name(Precision::Double)));
    }
    if let Some(Err(reason)) = &shown.answer {
        note_ui(ui, &format!("The network has no answer: {reason}."));
    }
}

/// The cells of a row, and its mean error.
fn cells_of(answer: Option<&Result<PressedAnswer, String>>) -> (Vec<String>, Option<f64>) {
    match answer {
        None => (vec!["…".to_owned(); COLUMNS.len()], None),
        Some(Err(_)) => (vec![format_number(None); COLUMNS.len()], None),
        Some(Ok(answer)) => {
            let figures = [answer.mean_mm, answer.worst_mm].map(format_number);
            (
                figures.into_iter().chain([microseconds(answer.time)]).collect(),
                Some(answer.mean_mm),
            )
        }
    }
}

/// Formats a time with two digits: further ones vary from frame to frame.
fn microseconds(time: Option<Duration>) -> String {
    match time.map(|time| 1e6 * time.as_secs_f64()) {
        None => format_number(None),
        Some(us) if us < 10.0 => format!("{us:.1}"),
        Some(us) => format!("{us:.0}"),
    }
}

/// Shows remarks on the basis of the figures.
fn remarks_ui(ui: &mut Ui, press: &PressState, shown: &Shown, shared: &Shared) {
    let readings = shown.pressed.readings_ohm().len();
    if shown.outside > 0 {
        let outside = shown.outside;
        note_ui(
            ui,
            &format!(
                "{outside} of {} {} outside the range of the network's training set: there it extrapolates.",
                counted(readings, "reading"),
                if outside == 1 { "is" } else { "are" }
            ),
        );
    }
    let subject = shown.question.subject.as_ref();
    let text = match subject {
        Some(subject) if subject.is_ready_made => {
            "A small network answers, trained on a few ball prints a moment ago. Train gives you your own."
        }
        Some(subject) if !subject.is_idle => "The other decoders answer when the training is paused or finished.",
        Some(_) => "",
        None if press.ready.is_awaited(shared) => "A small network is being trained to answer…",
        None if shared.phase == Phase::Preparing => "The network answers once its training has begun.",
        None => "Train a network to see how it decodes this touch.",
    };
    if !text.is_empty() {
        dim_ui(ui, text);
    }
    let own = subject.filter(|subject| !subject.is_ready_made);
    let simulation = own.and_then(|subject| subject.settings.simulation());
    if simulation.is_some_and(|simulation| !simulation.scene.noise.is_none()) {
        dim_ui(ui, "Readings under the finger are without the scene's noise.");
    }
    if let (None, Some(reason)) = (subject, &press.ready.failure) {
        note_ui(ui, &format!("No small network could be trained: {reason}"));
    }
}

impl Shown {
    /// Time that the network took to decode.
    pub fn network_time(&self) -> Option<String> {
        let answer = self.answer.as_ref()?.as_ref().ok()?;
        answer.time.map(|time| format!("{} µs", microseconds(Some(time))))
    }
}

impl PressState {
    /// Text of the network's card while something is pressed and no network has answered.
    pub fn waiting_text(&self, shared: &Shared) -> &'static str {
        if self.ready.is_awaited(shared) {
            "A small network is being trained to answer…"
        } else if shared.phase.is_busy() {
            "The network answers here once its training has begun."
        } else {
            "This array is too large for a quick network: press Train, and your network answers here."
        }
    }
}

/// A reading under the pointer.
#[derive(Clone, Copy, Debug)]
pub struct ReadingPointed {
    /// Places of its row-wire among those read, and of its column-wire.
    pub cell: [usize; 2],
    /// True if it was clicked.
    pub is_clicked: bool,
}

/// The header of the card of the readings.
pub fn readings_head_ui(ui: &mut Ui, drops_percent: Option<&Array2<f64>>) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(6));
        ui.label(RichText::new("Readings").font(semibold(type_size().title)))
            .on_hover_text(glossary::READING.hint);
        if let Some(drops_percent) = drops_percent {
            let (rows, columns) = drops_percent.dim();
            let [rows, columns] =
                [(rows, "row-wire"), (columns, "column-wire")].map(|(count, noun)| counted(count, noun));
            dim_ui(ui, &format!("{rows} × {columns}"));
        }
    });
}

/// Readings of the displayed surface as a map of row-wires and column-wires, in `colours` and with one row marked;
/// `drops_percent` are their drops below those at rest. Returns the one under the pointer.
pub fn readings_ui(
    ui: &mut Ui,
    drops_percent: Option<&Array2<f64>>,
    test: Option<&TestView>,
    lit_row: Option<usize>,
    colours: SequentialMap,
) -> Option<ReadingPointed> {
    let Some((drops_percent, test)) = drops_percent.zip(test) else {
        placeholder_ui(ui, "The readings of the surface appear here.");
        return None;
    };
    let map = readings_map(drops_percent, &test.rows).coloured(colours);
    let marked = (lit_row.as_slice(), &[][..], Theme::of(ui).palette.text);
    let ([row, column], cell) = cells_ui(ui, "Readings of the actual surface", &map, marked)?;
    let is_clicked = cell.clicked();
    let value = format_number(map.values[[row, column]]);
    let wire = test.rows.get(row).map_or(0, |row| row + 1);
    cell.on_hover_text_at_pointer(format!(
        "Row-wire {wire}, column-wire {}\ndrop from unloaded: {value} %\n{}\nClick for the section along it.",
        column + 1,
        glossary::DROP.equation
    ));
    Some(ReadingPointed {
        cell: [row, column],
        is_clicked,
    })
}

/// Returns the map with colours from 0 to the largest drop, rounded up so that the scale is stable under small movements.
fn readings_map(drops_percent: &Array2<f64>, rows: &[usize]) -> HeatMap {
    /// Upper end of the colour scale for a sensor at rest.
    const MIN_PERCENT: f64 = 0.01;
    let largest = drops_percent.iter().copied().filter(|drop| drop.is_finite());
    let largest = largest.fold(MIN_PERCENT, f64::max);
    let decade = 10_f64.powf(largest.log10().floor());
    let ends = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0].map(|end| end * decade);
    let end = ends.into_iter().find(|end| *end >= largest).unwrap_or(10.0 * decade);
    readings_figure(drops_percent.clone(), rows, end)
}

/// Everything that a touch and the network's answer depend on.
#[derive(Clone, Debug)]
pub(super) struct Question {
    pub(super) touch: Touch,
    pub(super) test: TestView,
    pub(super) subject: Option<Subject>,
}

/// A touch with everything that is shown about it.
#[derive(Clone, Debug)]
pub struct Shown {
    pub(super) question: Question,
    /// The touched sensor.
    pub(super) pressed: Arc<Pressed>,
    /// Its surface, the network's, and their difference.
    pub(super) frames: Frames,
    /// Drops of its readings below those at rest, in percent: rows read × M4.
    pub drops_percent: Option<Array2<f64>>,
    /// The network's answer, if there is a network, or why it has none.
    pub(super) answer: Option<Result<PressedAnswer, String>>,
    /// Number of readings outside the range of the network's training.
    pub(super) outside: usize,
}

impl Question {
    /// Returns true if both questions are the same.
    pub(super) fn is(&self, other: &Self) -> bool {
        let is_same_subject = match (&self.subject, &other.subject) {
            (Some(one), Some(other)) => one.is(other),
            (one, other) => one.is_none() && other.is_none(),
        };
        is_same_subject && self.is_of(&other.test) && self.touch == other.touch
    }

    /// Returns true if it is about this sensor, with the same rows and stroke: a new training has another test set of the
    /// same sensor.
    pub(super) fn is_of(&self, test: &TestView) -> bool {
        let of = |test: &TestView| (test.sensor, test.stroke_mm);
        of(&self.test) == of(test) && self.test.rows == test.rows
    }

    /// Returns true if the answer takes a few milliseconds at most.
    pub(super) fn is_light(&self) -> bool {
        /// Takes about three milliseconds.
        const MAX_PAIRS: f64 = 2e6;
        /// Weights of the networks: take as long.
        const MAX_WEIGHTS: usize = 2_000_000;
        let weights = self.subject.as_ref().map_or(0, |subject| subject.networks.weights());
        Pressed::node_pairs(&self.test.sensor, &self.test.rows) <= MAX_PAIRS && weights <= MAX_WEIGHTS
    }

    /// Presses, reads and decodes.
    pub(super) fn answer(self) -> Result<Shown, String> {
        let test = &self.test;
        let pressed = Pressed::new(&test.sensor, &test.rows, &self.touch, test.stroke_mm);
        let pressed = pressed.map_err(|error| error.to_string())?;
        let networks = self.subject.as_ref().map(|subject| &*subject.networks);
        let answer = networks.map(|networks| {
            let mut decoder = networks.decoder();
            let answer = pressed.answer(&mut decoder, &Job::UNINTERRUPTED);
            answer.map_err(|error| error.to_string())
        });
        let actual = test.frame_of(pressed.nodes_mm());
        let decoupled = answer.as_ref().and_then(|answer| answer.as_ref().ok()).map(|answer| {
            let decoupled = test.frame_of(answer.nodes_mm());
            let error = actual.error_of(&decoupled);
            (decoupled, error)
        });
        Ok(Shown {
            frames: Frames { actual, decoupled },
            drops_percent: test.drops_percent(pressed.readings_ohm()),
            outside: networks.map_or(0, |networks| outside(networks, pressed.readings_ohm())),
            answer,
            pressed: Arc::new(pressed),
            question: self,
        })
    }
}

/// Number of readings outside the range that the networks were trained in.
fn outside(networks: &Networks, readings_ohm: &Array2<f64>) -> usize {
    let rows = readings_ohm.rows().into_iter().enumerate();
    let of_row = rows.map(|(row_index, readings)| {
        let inputs = networks.at(row_index).inputs();
        let readings = readings.to_slice().expect("a row of a standard array is contiguous");
        let range = inputs.range();
        range.map_or(0, |range| range.outside(inputs.quantity(), readings).count())
    });
    of_row.sum()
}
