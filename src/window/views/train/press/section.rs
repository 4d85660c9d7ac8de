use std::{sync::Arc, time::Duration};

use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    text::counted,
};
use decoupler_files::{
    export::format_number,
    figure::{SequentialMap, readings_figure},
};
use eframe::egui::{Align, Layout, RichText, Slider, Ui, WidgetInfo, vec2};
use ndarray::Array2;

use super::{
    Finger, PressState,
    decoders::{Comparison, KINDS},
    solving::{Answer, Question, Shown},
};
use crate::window::{
    glossary,
    plotting::cells_ui,
    shared::Shared,
    test_view::Skin,
    theme::{Theme, semibold, space, type_size},
    widgets::{
        TableColumn, TableRow, TableView, dim_ui, note_ui, number_ui, placeholder_ui, refusal_ui, section_heading_ui,
        slider_ui, usually,
    },
};

const COLUMNS: [TableColumn<'_>; 4] = [
    TableColumn::text(""),
    TableColumn::figure("mean mm").meaning("Mean |error| of z over the nodes of the pressed surface, in millimetres"),
    TableColumn::figure("worst mm").meaning("Largest |error| of z, in millimetres"),
    TableColumn::figure("µs")
        .meaning("Time to decode this frame (all rows) on one thread, in µs: the shortest of several."),
];

/// The finger, and the answers of all decoders to it.
pub fn press_section_ui(ui: &mut Ui, press: &mut PressState, shared: &Shared) {
    let Some(skin) = shared.skin() else { return };
    section_heading_ui(ui, "Press");
    finger_ui(ui, press, skin.stroke_mm);
    ui.add_space(space(1));
    match &press.answered {
        Some((question, Ok(shown))) => {
            answers_ui(ui, press, question, shown);
            remarks_ui(ui, press, question, shown, shared);
        }
        Some((_, Err(reason))) => {
            note_ui(ui, &format!("This cannot be pressed: {reason}."));
        }
        None if press.is_pressing() => {
            dim_ui(ui, "Computing the readings…");
        }
        None => {
            // The surface shows it too: in a low window the error table comes first.
            if ui.clip_rect().height() > space(70) {
                dim_ui(
                    ui,
                    "Press on the actual surface; the wheel sets the depth. Drag with the right button or Shift to turn it.",
                );
            }
            return;
        }
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

/// Radius and depth of the finger; the depth as a number, and on a slider that ends at the scene's largest compression.
fn finger_ui(ui: &mut Ui, press: &mut PressState, stroke_mm: f64) {
    let (before, usual) = (press.finger, Finger::default());
    let finger = &mut press.finger;
    let limit = format_number(stroke_mm);
    let hint = format!("Depth of the press in mm, up to the scene's largest compression of {limit} mm.");
    let (depth_mm, usual_mm) = (finger.depth_share * stroke_mm, usual.depth_share * stroke_mm);
    // A thousandth of a millimetre is finer than any finger.
    let shown_mm = (1e3 * depth_mm).round() / 1e3;
    let (mut typed_mm, mut slid_mm) = (shown_mm, depth_mm);
    let line = ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        let meaning = "Radius of the ball that presses, in mm.";
        let label = ui.label("Radius").on_hover_text(meaning);
        let limits = usually(usual.radius_mm, 0.5..=20.0);
        let radius = number_ui(ui, &mut finger.radius_mm, &limits, "mm", vec2(space(14), space(6)));
        ui.add_space(space(1));
        let name = ui.label("Depth").on_hover_text(&hint);
        let depth = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let limits = usually(usual_mm, 0.0..=stroke_mm);
            let number = number_ui(ui, &mut typed_mm, &limits, "mm", vec2(space(16), space(6)));
            let width = (ui.available_width() - space(2)).max(space(8));
            let slider = slider_ui(ui, Slider::new(&mut slid_mm, 0.0..=stroke_mm), width);
            if slider.double_clicked() {
                slid_mm = usual_mm;
            }
            slider.widget_info(|| WidgetInfo::slider(true, slid_mm, "Depth of the press"));
            slider.on_hover_text(&hint);
            number.labelled_by(name.id).on_hover_text(&hint)
        });
        [radius.labelled_by(label.id).on_hover_text(meaning), depth.inner]
    });
    line.inner.iter().for_each(|field| refusal_ui(ui, field));
    let changed_mm = if typed_mm == shown_mm { slid_mm } else { typed_mm };
    if changed_mm != depth_mm {
        finger.depth_share = (changed_mm / stroke_mm).clamp(0.0, 1.0);
    }
    if *finger != before {
        ui.request_repaint();
    }
}

/// The table of decoders, the network first and the best in bold, and why some have no answer.
fn answers_ui(ui: &mut Ui, press: &PressState, question: &Question, shown: &Shown) {
    let palette = Theme::of(ui).palette;
    let Comparison { answers, failure, .. } = &press.comparison;
    let network = shown
        .answer
        .as_ref()
        .map(|answer| (DecoderKind::Network, Some(answer), palette.accent));
    let is_compared = question.subject.as_ref().is_some_and(|subject| subject.is_idle);
    let others = KINDS.iter().filter(|_| is_compared).map(|&kind| {
        let compared = answers.iter().find(|compared| compared.kind == kind);
        // Answers to an earlier touch are pale.
        let is_present = compared.is_some_and(|compared| Arc::ptr_eq(&compared.of, &shown.pressed));
        let colour = if is_present { palette.text } else { palette.dim };
        (kind, compared.map(|compared| &compared.answer), colour)
    });
    let decoders = Vec::from_iter(network.into_iter().chain(others));
    let mean_mm = |answer: &Option<&Result<Answer, String>>| Some(answer.as_ref()?.as_ref().ok()?.errors.z_mm);
    let means_mm = decoders.iter().filter_map(|(_, answer, _)| mean_mm(answer));
    let best_mm = means_mm.fold(f64::INFINITY, f64::min);
    let rows = decoders.iter().map(|(kind, answer, colour)| {
        TableRow::figures(kind.name(Precision::Double), cells(*answer))
            .meaning(kind.meaning())
            .colour(*colour)
            .strong(mean_mm(answer) == Some(best_mm))
    });
    if !decoders.is_empty() {
        TableView::new("answers", &COLUMNS).show_all(ui, rows.collect());
    }
    for (kind, answer, _) in &decoders {
        if let Some(Err(reason)) = answer {
            note_ui(ui, &format!("{}: {reason}", kind.name(Precision::Double)));
        }
    }
    if let Some(reason) = failure {
        note_ui(ui, &format!("The other decoders did not answer: {reason}."));
    }
}

fn cells(answer: Option<&Result<Answer, String>>) -> Vec<String> {
    match answer {
        None => vec!["…".to_owned(); COLUMNS.len() - 1],
        Some(Err(_)) => vec![format_number(None); COLUMNS.len() - 1],
        Some(Ok(Answer { errors, time })) => {
            let [mean_mm, worst_mm] = [errors.z_mm, errors.worst_mm].map(format_number);
            vec![mean_mm, worst_mm, microseconds(*time)]
        }
    }
}

/// Formats a time with two digits: further ones vary from frame to frame.
fn microseconds(time: Duration) -> String {
    match 1e6 * time.as_secs_f64() {
        us if us < 10.0 => format!("{us:.1}"),
        us => format!("{us:.0}"),
    }
}

/// Shows remarks on the basis of the figures.
fn remarks_ui(ui: &mut Ui, press: &PressState, question: &Question, shown: &Shown, shared: &Shared) {
    if shown.outside > 0 {
        let (outside, verb) = (shown.outside, if shown.outside == 1 { "is" } else { "are" });
        let readings = counted(shown.pressed.readings().len(), "reading");
        let text = format!(
            "{outside} of {readings} {verb} outside the range of the network's training set: there it extrapolates."
        );
        note_ui(ui, &text);
    }
    let subject = question.subject.as_ref();
    let text = match subject {
        None => press.waiting_text(shared),
        Some(subject) if subject.is_demo => "Decoded by a built-in demo network. Train to use your own.",
        Some(subject) if !subject.is_idle => "The other decoders answer when the training is paused or finished.",
        Some(_) => "",
    };
    if !text.is_empty() {
        dim_ui(ui, text);
    }
    let own = subject.filter(|subject| !subject.is_demo);
    let simulation = own.and_then(|subject| subject.settings.simulation());
    if simulation.is_some_and(|simulation| !simulation.scene.noise.is_none()) {
        dim_ui(ui, "The readings of a press are without the scene's noise.");
    }
}

impl Shown {
    /// Time that the network took to decode.
    pub fn network_time(&self) -> Option<String> {
        let answer = self.answer.as_ref()?.as_ref().ok()?;
        Some(format!("{} µs", microseconds(answer.time)))
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
        if let Some((rows, columns)) = drops_percent.map(Array2::dim) {
            let [rows, columns] = [counted(rows, "row-wire"), counted(columns, "column-wire")];
            dim_ui(ui, &format!("{rows} × {columns}"));
        }
    });
}

/// Readings of the displayed surface as a map of row-wires and column-wires, in `colours` and with one row marked;
/// `drops_percent` are their drops below those at rest. Returns the one under the pointer.
pub fn readings_ui(
    ui: &mut Ui,
    drops_percent: Option<&Array2<f64>>,
    skin: Option<&Skin>,
    lit_row: Option<usize>,
    colours: SequentialMap,
) -> Option<ReadingPointed> {
    let Some((drops_percent, skin)) = drops_percent.zip(skin) else {
        placeholder_ui(ui, "The readings of the surface appear here.");
        return None;
    };
    let end = end_of_scale(drops_percent);
    let map = readings_figure(drops_percent.clone(), &skin.rows, end).coloured(colours);
    let marked = (lit_row.as_slice(), &[][..], Theme::of(ui).palette.text);
    let ([row, column], cell) = cells_ui(ui, "Readings of the actual surface", &map, marked)?;
    let is_clicked = cell.clicked();
    let value = format_number(map.values[[row, column]]);
    let wire = skin.rows.get(row).map_or(0, |row| row + 1);
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

/// Returns the largest drop, rounded up so that the scale is stable under small movements.
fn end_of_scale(drops_percent: &Array2<f64>) -> f64 {
    /// Upper end for a sensor at rest.
    const MIN_PERCENT: f64 = 0.01;
    let largest = drops_percent.iter().copied().filter(|drop| drop.is_finite());
    let largest = largest.fold(MIN_PERCENT, f64::max);
    let decade = 10_f64.powf(largest.log10().floor());
    let ends = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0].map(|end| end * decade);
    ends.into_iter().find(|end| *end >= largest).unwrap_or(10.0 * decade)
}
