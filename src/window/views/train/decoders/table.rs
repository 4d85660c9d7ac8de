use std::cell::RefCell;

use eframe::egui::{Button, CollapsingHeader, Ui, Vec2};

use super::{DecoderResult, DecodersState};
use crate::window::{
    glossary,
    shared::{DecoderSource, FileTask, Phase, decoder_export_ui, target_choice_ui},
    theme::{Theme, space},
    widgets::{ColumnWidth, TableColumn, TableRow, TableView, dim_ui, focus_ring_ui, note_ui},
};
use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderReport, ErrorMeasure, Errors, Problem},
};
use decoupler_files::export::format_number;

/// What is measured of a decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Figure {
    ZPercent,
    TimesLimit,
    Residual,
    RangePercent,
    Rmse,
    R2,
    FrameTime,
}

impl Figure {
    /// The figures of this problem, from left to right.
    fn of(problem: &Problem, has_limit: bool) -> Vec<Self> {
        if !problem.has_nodes {
            return vec![Self::RangePercent, Self::Rmse, Self::R2, Self::FrameTime];
        }
        let figures = [Self::ZPercent, Self::TimesLimit, Self::Residual, Self::FrameTime].into_iter();
        figures
            .filter(|figure| has_limit || *figure != Self::TimesLimit)
            .collect()
    }

    fn column(self) -> TableColumn<'static> {
        let (heading, meaning) = match self {
            Self::ZPercent => ("Z %", glossary::Z_PERCENT.hint),
            Self::TimesLimit => (
                "× limit",
                "Mean |error| of z divided by that of the Bayesian reference, the limit for decoders of a row's own \
                 readings in this scene.",
            ),
            Self::Residual => ("residual", glossary::RESIDUAL.hint),
            Self::RangePercent => (
                "% of range",
                "Mean absolute error in percent of the range, averaged over all targets that vary.",
            ),
            Self::Rmse => ("RMSE", ErrorMeasure::Rmse.definition()),
            Self::R2 => ("R²", ErrorMeasure::R2.definition()),
            Self::FrameTime => (
                "µs",
                "Time to decode a frame (all rows, or one sample of a recording) on one thread, in µs: the median of many.",
            ),
        };
        TableColumn::figure(heading).meaning(meaning)
    }

    fn value(self, report: &DecoderReport, limit: Option<&Errors>, target: usize) -> Option<f64> {
        let of_target = report.errors.targets().get(target);
        match self {
            Self::ZPercent | Self::RangePercent => report.errors.percent(),
            Self::TimesLimit => report.errors.nodes()?.times(limit?),
            Self::Residual => report.residual,
            Self::Rmse => Some(of_target?.rmse),
            Self::R2 => of_target?.r2,
            Self::FrameTime => Some(report.cost.frame_us),
        }
    }

    /// The same of the limit.
    fn of_limit(self, limit: &Errors) -> Option<f64> {
        match self {
            Self::ZPercent => limit.z_percent,
            Self::TimesLimit => Some(1.0),
            _ => None,
        }
    }
}

/// The other decoders on the same test set, folded away until the user asks for them, next to the errors `limit` of the
/// Bayesian reference. `target` is the one whose errors are shown of a recording. Each decoder can be exported as one of
/// `source`; returns the file asked for.
pub fn decoders_ui(
    ui: &mut Ui,
    decoders: &mut DecodersState,
    phase: Phase,
    (problem, limit): (&Problem, Option<&Errors>),
    target: &mut usize,
    source: Option<&DecoderSource>,
) -> Option<FileTask> {
    let mut asked = None;
    ui.add_space(space(1));
    let header = CollapsingHeader::new("More decoders")
        .open(Some(decoders.is_open))
        .show(ui, |ui| {
            if let Some(measured) = &decoders.measured {
                asked = measured_ui(ui, measured, (problem, limit), target, source);
            } else {
                let text = match phase {
                    Phase::Died => "The network was lost with the training thread: train again.",
                    _ => "They are measured when the training is paused or has ended.",
                };
                dim_ui(ui, text);
            }
        });
    focus_ring_ui(ui, &header.header_response);
    let hint = if problem.has_nodes {
        "Ridge regression, radial-basis network, Newton on Eq. (2) and others on the same test set: errors, times, and \
         distance from the limit."
    } else {
        "Ridge regression, radial-basis network and others on the same test set: errors and times."
    };
    if header.header_response.on_hover_text(hint).clicked() {
        decoders.is_open = !decoders.is_open;
    }
    asked
}

fn measured_ui(
    ui: &mut Ui,
    measured: &[DecoderResult],
    (problem, limit): (&Problem, Option<&Errors>),
    target: &mut usize,
    source: Option<&DecoderSource>,
) -> Option<FileTask> {
    let palette = Theme::of(ui).palette;
    // Without noise there is no limit but rounding, and nothing to be compared with it.
    let limit = limit.filter(|limit| !limit.is_rounding());
    if !problem.has_nodes {
        target_choice_ui(ui, "RMSE and R² of", "target of the decoders", &problem.targets, target);
    }
    let target = (*target).min(problem.targets.len().saturating_sub(1));
    let mut figures = Figure::of(problem, limit.is_some());
    // In a narrow window the buttons at the end come first.
    if ui.available_width() < space(80) {
        figures.retain(|figure| *figure != Figure::R2);
    }
    let columns: Vec<TableColumn<'_>> = std::iter::once(TableColumn::text(""))
        .chain(figures.iter().map(|figure| figure.column()))
        .chain([TableColumn::text("").width(ColumnWidth::Points(space(7)))])
        .collect();
    let asked = RefCell::new(None);
    let rows = measured.iter().map(|result| {
        let cells = figures.iter().map(|figure| match &result.report {
            None => "…".to_owned(),
            Some(Err(_)) => format_number(None),
            Some(Ok(report)) => format_number(figure.value(report, limit, target)),
        });
        let colour = if result.kind == DecoderKind::Network {
            palette.accent
        } else {
            palette.text
        };
        let row = TableRow::figures(result.kind.name(result.precision), cells)
            .meaning(result.kind.meaning())
            .colour(colour);
        // The menu has both precisions.
        let source = source.filter(|_| result.precision == Precision::Double && matches!(result.report, Some(Ok(_))));
        match source {
            None => row,
            Some(source) => row.controls(|ui| {
                let button = Button::new("…").min_size(Vec2::splat(space(5)));
                let task = decoder_export_ui(ui, button, result.kind, source);
                if task.is_some() {
                    asked.replace(task);
                }
            }),
        }
    });
    let of_limit = limit.map(|limit| {
        let cells = figures.iter().map(|figure| format_number(figure.of_limit(limit)));
        TableRow::figures("limit", cells)
            .meaning(glossary::REFERENCE.hint)
            .colour(palette.dim)
    });
    let rows = rows.chain(of_limit).collect();
    TableView::new("decoders", &columns).show_all(ui, rows);
    for result in measured {
        let name = result.kind.name(result.precision);
        match &result.report {
            Some(Err(reason)) => {
                note_ui(ui, &format!("{name}: {reason}"));
            }
            Some(Ok(report)) => {
                for remark in &report.remarks {
                    note_ui(ui, &format!("{name}: {remark}"));
                }
            }
            None => {}
        }
    }
    asked.into_inner()
}

#[cfg(test)]
mod tests {
    use egui_kittest::{Harness, kittest::Queryable as _};

    use super::*;
    use decoupler_core::{
        evaluation::{DecoderSet, Preset, Simulation, Source},
        scene::{Noise, NoisySets},
    };

    fn unfolded() -> DecodersState {
        DecodersState {
            is_open: true,
            measured: Some(DecoderResult::pending(&Source::Simulated(Simulation::default()))),
        }
    }

    fn shown(mut decoders: DecodersState) -> Harness<'static> {
        let problem = Simulation::default().problem();
        Harness::new_ui(move |ui| {
            decoders_ui(ui, &mut decoders, Phase::Idle, (&problem, None), &mut 0, None);
        })
    }

    #[test]
    fn a_decoder_worse_than_the_mean_says_so_with_cause_and_cure() {
        let mut settings = decoupler_core::evaluation::SimulatedSettings::default();
        settings.source.sensor.scale = "2x3_2x9".parse().unwrap();
        settings.source.samples = 40;
        settings.source.scene.noise = Noise {
            sets: NoisySets::Test,
            ..Noise::relative(0.5)
        };
        let test = settings.draw_test().unwrap();
        let mut without_noise = settings;
        without_noise.source.scene.noise = Noise::default();
        // Fitted without the noise that the readings have.
        let set = DecoderSet::new(&without_noise, None).unwrap();
        let report = set
            .measure(DecoderKind::Ridge, Precision::Double, &test)
            .unwrap()
            .unwrap();
        let remark = report.remarks[0].to_string();
        assert!(remark.contains("times that of always answering the mean"), "{remark}");
        let mut decoders = unfolded();
        let place = DecoderResult::pending(&Source::Simulated(Simulation::default()))
            .iter()
            .position(|result| result.kind == DecoderKind::Ridge);
        decoders.take(place.unwrap(), Ok(report));
        let harness = shown(decoders);
        harness.get_by_label(&format!("Ridge: {remark}"));
    }

    #[test]
    fn a_decoder_that_fails_says_why_and_the_others_stand() {
        let mut decoders = unfolded();
        decoders.take(0, Err("no resistance at rest".to_owned()));
        let harness = shown(decoders);
        harness.get_by_label("Training mean: no resistance at rest");
        harness.get_by_label("Training mean, Z %: –");
        harness.get_by_label("Newton, Z %: …");
    }

    #[test]
    fn rows_that_were_not_solved_are_counted_below_the_table() {
        let mut decoders = unfolded();
        // Four electrodes are too few for six nodes.
        let mut settings = Preset::Best.settings();
        settings.source.sensor.scale = "10x6_3x4".parse().unwrap();
        settings.source.samples = 100;
        settings.source.test_samples = 10;
        let set = DecoderSet::new(&settings, None).unwrap();
        let test = settings.draw_test().unwrap();
        let report = set
            .measure(DecoderKind::Newton, Precision::Double, &test)
            .unwrap()
            .unwrap();
        let place = DecoderResult::pending(&Source::Simulated(Simulation::default()))
            .iter()
            .position(|result| result.kind == DecoderKind::Newton)
            .unwrap();
        decoders.take(place, Ok(report));
        let harness = shown(decoders);
        harness.get_by_label_contains("Newton: 10 of 10 rows are not determined by their readings");
    }
}
