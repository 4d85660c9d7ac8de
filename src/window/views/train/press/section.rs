use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    text::counted,
};
use decoupler_files::{
    export::format_number,
    figure::{SequentialMap, frame_time, readings_figure},
};
use eframe::egui::{RichText, Ui};
use ndarray::Array2;

use super::{
    super::decoders::{self, DecoderResult, Decoders, OF_TOUCH, decoders_fold_ui, notes_ui},
    Finger, PressState,
    solving::{Answer, Question, Shown},
};
use crate::window::{
    glossary,
    plotting::cells_ui,
    shared::Shared,
    test_view::Skin,
    theme::{Theme, semibold, space, type_size},
    widgets::{
        TableRow, TableView, dim_ui,
        fields::{quantity_ui, usually},
        note_ui, placeholder_ui, section_heading_ui,
    },
};

/// The finger while it presses, and the answers of all decoders to it.
pub fn press_section_ui(ui: &mut Ui, press: &mut PressState, shared: &Shared) {
    let Some(skin) = shared.skin() else { return };
    // The surface says how to press, too: in a low window the error table comes first.
    if press.answered.is_none() && !press.is_pressing() && ui.clip_rect().height() <= space(70) {
        return;
    }
    section_heading_ui(ui, "Press");
    if press.is_pressing() {
        finger_ui(ui, press, skin.stroke_mm);
        ui.add_space(space(1));
    }
    match &press.answered {
        Some((question, Ok(shown))) => {
            let is_compared = question.subject.is_some() && question.is_idle;
            answers_ui(ui, &mut press.decoders, is_compared, shown);
            remarks_ui(ui, press, question, shown, shared);
        }
        Some((_, Err(reason))) => {
            note_ui(ui, &format!("This cannot be pressed: {reason}."));
        }
        None if press.is_pressing() => {
            dim_ui(ui, "Computing the readings…");
        }
        None => {
            dim_ui(
                ui,
                "Press on the actual surface; the wheel sets the depth. Drag with the right button or Shift to turn it.",
            );
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

/// Radius and depth of the finger.
fn finger_ui(ui: &mut Ui, press: &mut PressState, stroke_mm: f64) {
    let (before, usual) = (press.finger, Finger::default());
    let finger = &mut press.finger;
    let limit = format_number(stroke_mm);
    let radius_hint = "Radius of the ball that presses, in mm.";
    let depth_hint = format!(
        "Depth of the press in mm, up to the scene's largest compression of {limit} mm; the wheel sets it, too."
    );
    // A thousandth of a millimetre is finer than any finger.
    let shown_mm = (1e3 * finger.depth_share * stroke_mm).round() / 1e3;
    let mut depth_mm = shown_mm;
    ui.columns_const(|[left, right]| {
        let radius = &mut finger.radius_mm;
        quantity_ui(
            left,
            "Radius",
            radius_hint,
            radius,
            usually(usual.radius_mm, 0.5..=20.0),
            "mm",
        );
        let limits = usually(usual.depth_share * stroke_mm, 0.0..=stroke_mm);
        quantity_ui(right, "Depth", &depth_hint, &mut depth_mm, limits, "mm");
    });
    if depth_mm != shown_mm {
        finger.depth_share = (depth_mm / stroke_mm).clamp(0.0, 1.0);
    }
    if *finger != before {
        ui.request_repaint();
    }
}

/// The answers of the network and of the training mean, those of the other decoders folded below, and why some have none.
fn answers_ui(ui: &mut Ui, decoders: &mut Decoders, is_compared: bool, shown: &Shown) {
    let palette = &Theme::of(ui).palette;
    let rows_of = |measured: &[DecoderResult], kinds: &dyn Fn(DecoderKind) -> bool| {
        let wanted = measured.iter().filter(|result| kinds(result.kind));
        Vec::from_iter(wanted.map(|result| decoders::row(result, &OF_TOUCH, (None, 0), palette)))
    };
    let network = shown.answer.as_ref().map(|answer| {
        let figures = match answer {
            Ok(Answer { errors, frame_us }) => [errors.z_mm, errors.worst_mm, *frame_us].map(format_number),
            Err(_) => [(); 3].map(|()| format_number(None)),
        };
        let kind = DecoderKind::Network;
        TableRow::figures(kind.name(Precision::Double), figures)
            .meaning(kind.meaning())
            .colour(palette.accent)
            .strong(true)
    });
    let columns = decoders::columns(&OF_TOUCH);
    let mut rows = Vec::from_iter(network);
    if let Some(measured) = decoders.measured.as_ref().filter(|_| is_compared) {
        rows.extend(rows_of(measured, &|kind| kind == DecoderKind::Mean));
    }
    if !rows.is_empty() {
        TableView::new("answers", &columns).show_all(ui, rows);
    }
    if let Some(Err(reason)) = &shown.answer {
        note_ui(ui, &format!("Network: {reason}"));
    }
    let folded = decoders
        .measured
        .iter()
        .flatten()
        .find(|result| result.kind == DecoderKind::Mean);
    if let Some(mean) = folded.filter(|_| is_compared && !decoders.is_open) {
        notes_ui(ui, std::slice::from_ref(mean), false);
    }
    if is_compared {
        let hint = "Ridge regression, radial-basis network, Newton on Eq. (2) and others on this press.";
        decoders_fold_ui(ui, ("Other decoders", hint), decoders, |ui, measured| {
            TableView::new("other answers", &columns)
                .show_all(ui, rows_of(measured, &|kind| kind != DecoderKind::Mean));
            notes_ui(ui, measured, false);
        });
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
    let text = match &question.subject {
        None => press.waiting_text(shared),
        Some(_) if question.is_demo => "Decoded by a built-in demo network. Train to use your own.",
        Some(_) if !question.is_idle => "The other decoders answer when the training is paused or finished.",
        Some(subject)
            if subject
                .setup
                .settings()
                .simulation()
                .is_some_and(|of| !of.scene.noise.is_none()) =>
        {
            "The readings of a press are without the scene's noise."
        }
        Some(_) => return,
    };
    dim_ui(ui, text);
}

impl Shown {
    /// Time that the network took to decode.
    pub fn network_time(&self) -> Option<String> {
        Some(frame_time(self.answer.as_ref()?.as_ref().ok()?.frame_us))
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
