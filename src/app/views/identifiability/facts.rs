//! What the singular values come to, in words.

use eframe::egui::{Align, Label, Layout, RichText, Ui, WidgetInfo, accesskit::Role};

use super::Analysis;
use crate::{
    app::{
        theme::{Theme, space, type_size},
        widgets::{fields::capitalised, note_ui, section_heading_ui},
    },
    export::format_number,
};

/// Warnings with what to change, then the figures.
pub fn facts_ui(ui: &mut Ui, analysis: &Analysis) {
    section_heading_ui(ui, "What the readings tell");
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

/// What holds where nothing is in the way.
fn summary(analysis: &Analysis) -> String {
    let (seen, patterns) = (analysis.patterns_seen(), analysis.worst_row().unknowns());
    if analysis.noise == 0.0 {
        "Without noise every deformation can be told from the readings.".to_owned()
    } else if seen == patterns {
        "Every deformation pattern stands out of this noise.".to_owned()
    } else {
        format!(
            "This noise hides {} of {patterns} patterns: of those a decoder can only answer what is likely. To see more, \
             lower the noise, reduce the height, widen the node pitch, or add column-wires.",
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
            "Coordinates to be found from the readings of one row-wire.",
            worst.unknowns().to_string(),
        ),
        (
            "Readings of a row",
            "One resistance for each column-wire.",
            worst.equations.to_string(),
        ),
        (
            "Condition number",
            "Largest singular value over the smallest, in the row that sees its worst pattern least: how much worse that \
             pattern is seen than the best.",
            condition,
        ),
        (
            "Worst row",
            "The row-wire with the smallest singular value.",
            (worst.row + 1).to_string(),
        ),
        (
            "Rows most alike",
            "The two row-wires with the most similar readings at rest, and by how much they differ (relative).",
            alike,
        ),
    ];
    if analysis.noise > 0.0 {
        facts.extend(noise_facts(analysis));
    }
    facts
}

fn noise_facts(analysis: &Analysis) -> [(&'static str, &'static str, String); 4] {
    let worst = analysis.worst_row();
    let spread_mm = worst.worst_spread_mm(analysis.noise);
    let spread = if spread_mm.is_finite() {
        format!("{} mm", format_number(spread_mm))
    } else {
        "not at all".to_owned()
    };
    let share = 100.0 * worst.remaining_share(analysis.noise, analysis.prior_mm);
    let prior = format_number(analysis.prior_mm);
    [
        (
            "Noise of a reading",
            "Relative, one standard deviation, from all sources of the scene.",
            format_number(analysis.noise),
        ),
        (
            "Patterns out of the noise",
            "Patterns of the worst row that readings narrow more than the scene alone does.",
            format!("{} of {}", analysis.patterns_seen(), worst.unknowns()),
        ),
        (
            "Worst pattern known to",
            "From readings alone, one standard deviation.",
            spread,
        ),
        (
            "Spread that remains",
            "Of the deformation's spread before reading, what a reading leaves (root mean square over patterns).",
            format!("{} % of {prior} mm", format_number(share)),
        ),
    ]
}

fn fact_ui(ui: &mut Ui, name: &'static str, meaning: &str, value: &str) {
    let dim = Theme::of(ui).palette.dim;
    ui.horizontal(|ui| {
        let text = |text: &str| RichText::new(text).size(type_size().note);
        ui.label(text(name).color(dim)).on_hover_text(meaning);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let response = ui.add(Label::new(text(value)).truncate());
            let label = format!("{name}: {value}");
            response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &label));
            response.on_hover_text(meaning);
        });
    });
}
