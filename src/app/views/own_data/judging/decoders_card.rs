use std::sync::Arc;

use eframe::egui::{Ui, vec2};

use super::{Measuring, findings_card::target_ui, measuring::UnderWay, thread::Decoders};
use crate::{
    app::{
        plotting::{Pointer, hue_colour, plots_ui},
        theme::{Theme, space},
        views::own_data::{remarks::sentence, state::OwnDataView},
        widgets::{
            ColumnWidth, TableCell, TableColumn, TableRow, TableView, dim_ui, ghost_button, invitation_ui, note_ui,
            scrolled_ui,
        },
    },
    evaluation::TargetReport,
    export::{format_duration, format_number, format_r2},
    figure::{PlotFigure, decoders_figure, trade_words::frame_time},
};

/// Share of the card for the chart.
const CHART: f32 = 0.55;

/// Error against decoding time of the network on show and other decoders, or how to measure them.
pub fn decoders_ui(ui: &mut Ui, view: &mut OwnDataView) {
    let is_possible = !view.phase.is_busy() && !view.measuring.is_under_way();
    let Some(shown) = view.shown.as_ref().map(|shown| Arc::clone(&shown.file)) else {
        invitation_ui(
            ui,
            "Train a network first. Then its error stands here against its decoding time, beside ridge regression, a \
             radial-basis network and fuzzy rules.",
            "Measure the decoders",
            false,
        );
        return;
    };
    let Measuring {
        decoders,
        target,
        under_way,
        ..
    } = &mut view.measuring;
    let Some(decoders) = decoders else {
        if *under_way == Some(UnderWay::Decoders) {
            dim_ui(ui, "Reading the files…");
            if ui.add(ghost_button("Stop measuring")).clicked() {
                view.measuring.cancel();
            }
        } else if invitation_ui(
            ui,
            "Error against decoding time: the network in 64 and 32 bits beside the mean, ridge regression, a radial-basis \
             network and fuzzy rules, on the same samples. It takes some seconds.",
            "Measure the decoders",
            is_possible,
        ) {
            view.measuring.measure_decoders(shown);
            ui.request_repaint();
        }
        return;
    };
    let (mut is_wanted, mut is_stopped) = (false, false);
    ui.horizontal(|ui| {
        target_ui(ui, &decoders.of.targets, target);
        if *under_way == Some(UnderWay::Decoders) {
            dim_ui(ui, "Measuring…");
            is_stopped = ui.add(ghost_button("Stop measuring")).clicked();
        } else {
            is_wanted = ui.add_enabled(is_possible, ghost_button("Measure again")).clicked();
        }
    });
    if !Arc::ptr_eq(&decoders.of, &shown) {
        dim_ui(
            ui,
            "These were measured beside another network: measure again for the one on show.",
        );
    }
    let height = ui.available_height();
    let chart = CHART * height - space(2);
    ui.allocate_ui(vec2(ui.available_width(), chart), |ui| {
        ui.set_min_height(chart);
        plots_ui(ui, "decoders", &figure(decoders, *target), Pointer::Moves);
    });
    ui.add_space(space(2));
    let notes = notes(decoders);
    let rows = if notes.is_empty() { 1.0 } else { 0.6 };
    ui.allocate_ui(vec2(ui.available_width(), rows * ui.available_height()), |ui| {
        table_ui(ui, decoders, *target);
    });
    if !notes.is_empty() {
        scrolled_ui(ui, "notes on decoders", |ui| {
            for note in &notes {
                note_ui(ui, note);
            }
        });
    }
    if is_stopped {
        view.measuring.cancel();
    }
    if is_wanted {
        view.measuring.measure_decoders(shown);
        ui.request_repaint();
    }
}

/// Decoders that cannot be used, and what their errors do not tell.
fn notes(decoders: &Decoders) -> Vec<String> {
    let remarks = decoders.reports.iter().flat_map(|report| {
        let name = report.kind.name(report.precision);
        report.remarks.iter().map(move |remark| format!("{name}: {remark}"))
    });
    let notes = decoders.refused.iter().cloned().chain(remarks);
    notes.map(|note| sentence(&note)).collect()
}

fn table_ui(ui: &mut Ui, decoders: &Decoders, target: usize) {
    let palette = &Theme::of(ui).palette;
    let error = format!("RMSE, {}", decoders.of.targets[target].title());
    let columns = [
        TableColumn::text("decoder").width(ColumnWidth::Rest),
        TableColumn::figure(&error),
        TableColumn::figure("R²"),
        TableColumn::figure("to decode"),
        TableColumn::figure("to fit"),
    ];
    let row = |place: usize| {
        let report: &TargetReport = &decoders.reports[place];
        let name = report.kind.name(report.precision);
        let errors = &report.targets[target];
        let texts = [
            format_number(errors.rmse),
            format_r2(errors.r2),
            frame_time(report.cost.frame_us),
            fit_time(report),
        ];
        let label = format!("{name}: {}", texts.join(", "));
        TableRow::new(std::iter::once(name.to_owned()).chain(texts).map(TableCell::new))
            .labelled(label)
            .meaning(report.kind.meaning())
            .dot(hue_colour(report.kind.colour().into(), palette))
    };
    TableView::new("decoders", &columns).show(ui, decoders.reports.len(), row);
}

/// Time to fit a decoder; a network was trained before.
fn fit_time(report: &TargetReport) -> String {
    if report.kind.needs_network() {
        return "trained".to_owned();
    }
    let time = std::time::Duration::try_from_secs_f64(report.cost.fit_seconds);
    time.map_or_else(|_| format_number(None), format_duration)
}

fn figure(decoders: &Decoders, target: usize) -> PlotFigure {
    decoders_figure(
        &decoders.reports,
        target,
        &decoders.of.targets[target],
        &decoders.decoded,
    )
}

/// The chart on show.
pub fn shown_decoders_figure(measuring: &Measuring) -> Option<PlotFigure> {
    let decoders = measuring.decoders.as_ref()?;
    let last = decoders.of.targets.len().checked_sub(1)?;
    Some(figure(decoders, measuring.target.min(last)))
}
