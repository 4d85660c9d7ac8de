//! Facts derived from the singular values, in words.

use eframe::egui::{RichText, Ui};

use super::Analysis;
use crate::window::{
    glossary,
    theme::{Theme, space, type_size},
    widgets::{fact_ui, fields::capitalised, note_ui, section_heading_ui},
};
use decoupler_files::export::format_number;

/// Warnings with what to change, then the figures.
pub fn facts_ui(ui: &mut Ui, analysis: &Analysis) {
    section_heading_ui(ui, "Findings");
    if analysis.warnings.is_empty() {
        let text = RichText::new(summary(analysis)).size(type_size().note);
        ui.label(text.color(Theme::of(ui).palette.good));
    }
    for warning in &analysis.warnings {
        note_ui(ui, &format!("{}.", capitalised(&warning.to_string())));
    }
    ui.add_space(space(2));
    for (name, meaning, value) in facts(analysis) {
        fact_ui(ui, name, meaning, &value);
    }
}

/// Returns the summary shown where there are no warnings.
fn summary(analysis: &Analysis) -> String {
    let (seen, patterns) = (analysis.patterns_seen(), analysis.worst_row().unknowns());
    if analysis.noise.total() == 0.0 {
        "Without noise, the readings determine every deformation.".to_owned()
    } else if seen == patterns {
        "Every deformation pattern is above the noise.".to_owned()
    } else {
        format!(
            "The noise hides {} of {patterns} deformation patterns: for those, a decoder can only give the most \
             likely value. To see more, lower the noise, reduce the height, widen the node pitch, or add column-wires.",
            patterns - seen
        )
    }
}

fn facts(analysis: &Analysis) -> Vec<(&'static str, &'static str, String)> {
    let worst = analysis.worst_row();
    let condition = worst.condition();
    let condition = if condition.is_finite() {
        format_number(condition)
    } else {
        "infinite".to_owned()
    };
    let alike = analysis.alike.map_or_else(
        || "the row is known".to_owned(),
        |pair| {
            format!(
                "{} and {}, by {}",
                pair.first + 1,
                pair.second + 1,
                format_number(pair.difference)
            )
        },
    );
    let mut facts = vec![
        (
            "Unknowns of a row",
            "Number of coordinates to decode from the readings of one row-wire.",
            worst.unknowns().to_string(),
        ),
        (
            "Readings of a row",
            "Number of resistances measured for one row-wire, one for each column-wire.",
            worst.equations.to_string(),
        ),
        ("Condition number", glossary::CONDITION_NUMBER.hint, condition),
        (
            "Worst row",
            "The row-wire with the smallest singular value.",
            (worst.row + 1).to_string(),
        ),
        (
            "Most similar rows",
            "The two row-wires with the most similar readings at rest, and their relative difference.",
            alike,
        ),
    ];
    if analysis.noise.total() > 0.0 {
        facts.extend(noise_facts(analysis));
    }
    facts
}

fn noise_facts(analysis: &Analysis) -> [(&'static str, &'static str, String); 4] {
    let worst = analysis.worst_row();
    let spread_mm = worst.worst_spread_mm(analysis.noise.own);
    let spread = if spread_mm.is_finite() {
        format!("{} mm", format_number(spread_mm))
    } else {
        "infinite".to_owned()
    };
    let share = 100.0 * worst.remaining_share(analysis.noise.own, analysis.prior_mm);
    let prior = format_number(analysis.prior_mm);
    [
        (
            "Noise of a reading",
            "Relative standard deviation of one reading, from all noise sources of the scene.",
            format_number(analysis.noise.total()),
        ),
        (
            "Deformation patterns above the noise",
            "Number of deformation patterns of the worst row that the readings determine better than the scene alone \
             does.",
            format!("{} of {}", analysis.patterns_seen(), worst.unknowns()),
        ),
        (
            "Uncertainty of the worst pattern",
            "Standard deviation of the deformation pattern that is seen worst, in mm, from the readings alone.",
            spread,
        ),
        (
            "Remaining spread",
            "Spread of the deformation after a reading, in percent of its spread before (root mean square over \
             patterns).",
            format!("{} % of {prior} mm", format_number(share)),
        ),
    ]
}
