use eframe::egui::{CollapsingHeader, Ui};

use super::{DecoderResult, DecodersState};
use crate::{
    app::{
        glossary,
        shared::Phase,
        theme::Theme,
        theme::space,
        widgets::{TableColumn, TableRow, TableView, dim_ui, focus_ring_ui, note_ui},
    },
    decoupling::DecoderKind,
    evaluation::{DecoderReport, Errors},
    export::format_number,
};

const TIMES_LIMIT: &str = "× limit";

const COLUMNS: [TableColumn<'_>; 5] = [
    TableColumn::text(""),
    TableColumn::figure("Z %").meaning(glossary::Z_PERCENT.hint),
    TableColumn::figure(TIMES_LIMIT).meaning(
        "Mean |error| of z divided by that of the Bayesian reference, the limit for decoders of a row's own readings in \
         this scene.",
    ),
    TableColumn::figure("residual").meaning(glossary::RESIDUAL.hint),
    TableColumn::figure("µs")
        .meaning("Time to decode a frame (all rows, read at one moment) on one thread, in µs: the median of many."),
];

/// The other decoders on the same test set, folded away until the user asks for them.
pub fn decoders_ui(ui: &mut Ui, decoders: &mut DecodersState, phase: Phase, reference: Option<&Errors>) {
    ui.add_space(space(1));
    let header = CollapsingHeader::new("More decoders")
        .open(Some(decoders.is_open))
        .show(ui, |ui| {
            if let Some(measured) = &decoders.measured {
                measured_ui(ui, measured, reference);
            } else {
                let text = match phase {
                    Phase::Died => "The network was lost with the training thread: train again.",
                    _ => "They are measured when the training is paused or has ended.",
                };
                dim_ui(ui, text);
            }
        });
    focus_ring_ui(ui, &header.header_response);
    let hint = "Ridge regression, radial-basis network, Newton on Eq. (2) and others on the same test set: errors, \
                times, and distance from the limit.";
    if header.header_response.on_hover_text(hint).clicked() {
        decoders.is_open = !decoders.is_open;
    }
}

fn measured_ui(ui: &mut Ui, measured: &[DecoderResult], reference: Option<&Errors>) {
    let palette = Theme::of(ui).palette;
    // Without noise there is no limit but rounding, and nothing to be compared with it.
    let limit = reference.filter(|limit| !limit.is_rounding());
    let columns: Vec<TableColumn<'_>> = COLUMNS
        .into_iter()
        .filter(|column| limit.is_some() || column.heading() != TIMES_LIMIT)
        .collect();
    let figures_count = columns.len() - 1;
    let rows = measured.iter().map(|result| {
        let cells = match &result.report {
            None => vec!["…".to_owned(); figures_count],
            Some(Err(_)) => vec![format_number(None); figures_count],
            Some(Ok(report)) => figures(report, limit),
        };
        let colour = if result.kind == DecoderKind::Network {
            palette.accent
        } else {
            palette.text
        };
        TableRow::figures(result.kind.name(result.precision), cells)
            .meaning(result.kind.meaning())
            .colour(colour)
    });
    let of_limit = limit.map(|limit| {
        let cells = [limit.z_percent, Some(1.0), None, None].map(format_number);
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
}

/// In the order of [`COLUMNS`] without the names, and without the ratio where there is no limit.
fn figures(report: &DecoderReport, limit: Option<&Errors>) -> Vec<String> {
    let nodes = report.errors.nodes();
    let ratio = limit.map(|limit| nodes.and_then(|errors| errors.times(limit)));
    let figures = [Some(report.errors.percent())].into_iter().chain([
        ratio,
        nodes.map(|_| report.residual),
        Some(Some(report.cost.frame_us)),
    ]);
    figures.flatten().map(format_number).collect()
}

#[cfg(test)]
mod tests {
    use egui_kittest::{Harness, kittest::Queryable as _};

    use super::*;
    use crate::{
        decoupling::Precision,
        evaluation::{DecoderSet, Preset},
        scene::{Noise, NoisySets},
    };

    fn unfolded() -> DecodersState {
        DecodersState {
            is_open: true,
            measured: Some(DecoderResult::pending()),
        }
    }

    #[test]
    fn a_decoder_worse_than_the_mean_says_so_with_cause_and_cure() {
        let mut settings = crate::evaluation::SimulatedSettings::default();
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
        let place = DecoderResult::pending()
            .iter()
            .position(|result| result.kind == DecoderKind::Ridge);
        decoders.take(place.unwrap(), Ok(report));
        let harness = Harness::new_ui(move |ui| decoders_ui(ui, &mut decoders, Phase::Idle, None));
        harness.get_by_label(&format!("Ridge: {remark}"));
    }

    #[test]
    fn a_decoder_that_fails_says_why_and_the_others_stand() {
        let mut decoders = unfolded();
        decoders.take(0, Err("no resistance at rest".to_owned()));
        let harness = Harness::new_ui(move |ui| decoders_ui(ui, &mut decoders, Phase::Idle, None));
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
        let place = DecoderResult::pending()
            .iter()
            .position(|result| result.kind == DecoderKind::Newton)
            .unwrap();
        decoders.take(place, Ok(report));
        let harness = Harness::new_ui(move |ui| decoders_ui(ui, &mut decoders, Phase::Idle, None));
        harness.get_by_label_contains("Newton: 10 of 10 rows are not determined by their readings");
    }
}
