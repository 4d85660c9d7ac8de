//! The two questions and their answers, and the point that is marked.

use eframe::egui::{Label, RichText, Ui};

use super::{PointWish, TradeOffLook};
use crate::window::{
    shared::{DecoderSource, decoder_export_ui},
    theme::{Theme, semibold, space, type_size},
    widgets::{dim_ui, fields::quantity_ui, ghost_button, section_heading_ui},
};
use decoupler_core::{
    evaluation::{TradeOffLevel, TradeOffPoint},
    text::counted,
};
use decoupler_files::{
    export::format_percent,
    figure::{frame_time, point_facts, point_name},
};

/// "Fastest under", "most accurate under", and the marked point. Returns what the user wants to do with it; `source` gives
/// what the decoder of a point is exported from.
pub fn choices_ui(
    ui: &mut Ui,
    level: &TradeOffLevel,
    look: &mut TradeOffLook,
    can_load: bool,
    source: impl Fn(usize) -> Option<DecoderSource>,
) -> Option<PointWish> {
    let [fastest, most_accurate] = level.answers(&look.limits);
    section_heading_ui(ui, "Recommended decoders");
    let hint = if level.noise.is_some() {
        "Finds the decoder with the shortest time for a frame among those whose Z error is at most this, in percent."
    } else {
        "Finds the decoder with the shortest time among those whose mean absolute error is at most this, in percent of the \
         range of the targets."
    };
    quantity_ui(ui, "Fastest under", hint, &mut look.limits.percent, 1e-15..=1e6, "%");
    let none = "No measured decoder is this accurate.";
    answer_ui(ui, &mut look.marked, level, "Fastest", fastest, none);
    ui.add_space(space(1));
    let hint = "Finds the decoder with the smallest error among those that decode a frame, or a sample of a recording, \
                within this time, in µs.";
    quantity_ui(
        ui,
        "Most accurate under",
        hint,
        &mut look.limits.microseconds,
        1e-6..=1e12,
        "µs",
    );
    let none = "No measured decoder is this fast.";
    answer_ui(ui, &mut look.marked, level, "Most accurate", most_accurate, none);
    section_heading_ui(ui, "Marked point");
    match look.marked.and_then(|marked| Some((marked, level.points.get(marked)?))) {
        Some((marked, point)) => marked_ui(ui, (marked, point), can_load, source(marked).as_ref()),
        None => {
            dim_ui(
                ui,
                "Click a row of the table to mark its point, or a point of a chart to load it; right-click a point to export it.",
            );
            None
        }
    }
}

/// The configuration that answers a question; a click marks it.
fn answer_ui(
    ui: &mut Ui,
    marked: &mut Option<usize>,
    level: &TradeOffLevel,
    question: &str,
    chosen: Option<usize>,
    none: &str,
) {
    let Some((number, point)) = chosen.and_then(|number| Some((number, level.points.get(number)?))) else {
        dim_ui(ui, none);
        return;
    };
    let text = format!(
        "{}: {}, {}",
        point_name(point),
        format_percent(point.report.errors.percent()),
        frame_time(point.report.cost.frame_us)
    );
    let accent = Theme::of(ui).palette.accent;
    let response = ui.selectable_label(
        *marked == Some(number),
        RichText::new(&text).size(type_size().note).color(accent),
    );
    let response = response.on_hover_text("Click to mark it in the charts and the table.");
    response.widget_info(|| {
        let label = format!("{question}: {text}");
        eframe::egui::WidgetInfo::labeled(eframe::egui::accesskit::Role::Button, true, label)
    });
    if response.clicked() {
        *marked = Some(number);
    }
}

fn marked_ui(
    ui: &mut Ui,
    (number, point): (usize, &TradeOffPoint),
    can_load: bool,
    source: Option<&DecoderSource>,
) -> Option<PointWish> {
    let mut wish = None;
    let name = RichText::new(point_name(point)).font(semibold(type_size().note));
    ui.add(Label::new(name).truncate());
    ui.horizontal(|ui| {
        let load = ui.add_enabled(can_load, ghost_button("Load into Train view"));
        let is_loaded = load
            .on_hover_text("Uses its source and network settings for the next training.")
            .on_disabled_hover_text("A training is running in the Train view: its settings cannot be changed now")
            .clicked();
        wish = is_loaded.then_some(PointWish::Load(number));
        if let Some(source) = source {
            let button = ghost_button("Export this decoder…");
            let task = decoder_export_ui(ui, button, point.report.kind, source);
            wish = wish.take().or(task.map(|task| PointWish::Export(Box::new(task))));
        }
    });
    dim_ui(ui, &format!("{}.", point_facts(point).join("; ")));
    let epochs = counted(point.settings.training.stopping.epochs, "epoch");
    match point.settings.source.simulation() {
        Some(array) => dim_ui(
            ui,
            &format!("{}, at most {epochs}.", counted(array.samples, "training sample")),
        ),
        None => dim_ui(ui, &format!("At most {epochs}.")),
    };
    wish
}
