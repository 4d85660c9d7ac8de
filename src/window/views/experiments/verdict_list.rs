use eframe::egui::{Color32, Frame, Margin, RichText, Ui};

use super::Outcome;
use crate::window::theme::{Palette, Theme, radius, semibold, space, type_size};
use decoupler_core::evaluation::experiments::{Verdict, VerdictStatus};

/// The claims that hold in this run, with the numbers; below, those that could not be tried.
pub fn verdicts_ui(ui: &mut Ui, outcome: &Outcome) {
    for verdict in &outcome.verdicts {
        verdict_ui(ui, verdict);
    }
    let palette = Theme::of(ui).palette;
    for failure in decoupler_files::export::describe_failures(&outcome.results) {
        ui.label(RichText::new(failure).size(type_size().note).color(palette.bad));
    }
    for remark in decoupler_files::export::describe_worse_than_mean(&outcome.results) {
        ui.label(RichText::new(remark).size(type_size().note).color(palette.warning));
    }
}

fn verdict_ui(ui: &mut Ui, verdict: &Verdict) {
    let palette = Theme::of(ui).palette;
    let colour = colour_of(verdict.standing, &palette);
    ui.horizontal_wrapped(|ui| {
        Frame::new()
            .fill(colour.gamma_multiply(0.16))
            .corner_radius(radius())
            .inner_margin(Margin::symmetric(6, 1))
            .show(ui, |ui| {
                ui.label(
                    RichText::new(verdict.standing.to_string())
                        .font(semibold(type_size().small))
                        .color(colour),
                );
            });
        ui.label(RichText::new(verdict.claim).font(semibold(type_size().note)));
    });
    ui.label(
        RichText::new(&verdict.finding)
            .size(type_size().note)
            .color(palette.dim),
    );
    ui.add_space(space(2));
}

fn colour_of(standing: VerdictStatus, palette: &Palette) -> Color32 {
    match standing {
        VerdictStatus::Holds => palette.good,
        VerdictStatus::HoldsInPart => palette.warning,
        VerdictStatus::Fails => palette.bad,
        VerdictStatus::Undecided => palette.dim,
    }
}
