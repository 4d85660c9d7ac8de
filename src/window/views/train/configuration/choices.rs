use eframe::egui::{RichText, Slider, Stroke, Ui};

use crate::window::{
    glossary,
    theme::{Theme, space, type_size},
    widgets::{
        dim_ui,
        fields::{capitalised, count_ui, usually},
        note_ui, segmented_ui, slider_ui, text_ui,
    },
};
use decoupler_core::{
    evaluation::{SimulatedSettings, Workload},
    network::{HiddenSuggestions, LARGEST_HIDDEN},
    sensor::ArrayScale,
    text::counted,
};
use decoupler_files::export::describe_workload;

/// The scale of the array: one of the paper's, or any other typed; changes `scale`.
pub fn array_choice_ui(ui: &mut Ui, scale: &mut ArrayScale) {
    text_ui(
        ui,
        "Array scale",
        glossary::ARRAY_SCALE.hint,
        scale,
        ArrayScale::default(),
    );
    let names = ArrayScale::PRESETS.map(|scale| (scale, format!("{}×{}", scale.rows(), scale.nodes_per_row())));
    let options: Vec<_> = names.iter().map(|(scale, name)| (*scale, name.as_str())).collect();
    if let Some(picked) = segmented_ui(ui, "Array scale of the paper", &options, *scale, true) {
        *scale = picked;
    }
    let dim = Theme::of(ui).palette.dim;
    let text = format!(
        "{} of {} over {} of {}",
        counted(scale.rows(), "row-wire"),
        counted(scale.nodes_per_row(), "node"),
        counted(scale.columns(), "column-wire"),
        counted(scale.nodes_per_column(), "node")
    );
    let wires = [glossary::ROW_WIRE, glossary::COLUMN_WIRE, glossary::NODE];
    let wires = wires.map(|term| format!("{}: {}", term.name, term.hint)).join("\n\n");
    ui.label(RichText::new(text).size(type_size().note).color(dim))
        .on_hover_text(wires);
    if let Some(note) = scale.note() {
        note_ui(ui, &note);
    }
    ui.add_space(space(1));
}

/// The number of hidden nodes, with the rules of thumb for these numbers of inputs and outputs; changes `hidden`.
pub fn hidden_choice_ui(ui: &mut Ui, hidden: &mut usize, channels: Option<(usize, usize)>) {
    let usual = SimulatedSettings::default().hidden;
    let limits = usually(usual, 1..=LARGEST_HIDDEN);
    count_ui(ui, "Hidden nodes", glossary::HIDDEN_NODES.hint, hidden, limits);
    let Some((n, m)) = channels else {
        hidden_slider_ui(ui, hidden, &[]);
        return;
    };
    let suggestions = HiddenSuggestions::new(n, m);
    let (low, high) = (*suggestions.square_root.start(), *suggestions.square_root.end());
    hidden_slider_ui(ui, hidden, &[suggestions.logarithm, low, high]);
    let text = format!("Rules of thumb: {}, or {low} to {high}", suggestions.logarithm);
    dim_ui(ui, &text).on_hover_text(format!(
        "Rules of the paper for n = {n} inputs and m = {m} outputs: log₂ n (Eq. 13), or √(n + m) + a with a from 1 to 10 \
         (Eq. 12). A starting point, not a limit."
    ));
}

/// Memory and time of a training that takes much of either.
pub fn workload_ui(ui: &mut Ui, draft: &SimulatedSettings) {
    if let Ok(workload) = Workload::of(draft)
        && workload.is_large()
    {
        let warning = Theme::of(ui).palette.warning;
        let text = capitalised(&describe_workload(&workload));
        ui.label(RichText::new(text).size(type_size().note).color(warning));
    }
}

/// A slider for small networks, with small marks at the suggestions.
fn hidden_slider_ui(ui: &mut Ui, hidden: &mut usize, suggestions: &[usize]) {
    const MAX: usize = 64;
    let slider = Slider::new(hidden, 1..=MAX).clamping(eframe::egui::SliderClamping::Never);
    let width = ui.available_width();
    let response = slider_ui(ui, slider, width);
    if response.double_clicked() {
        *hidden = SimulatedSettings::default().hidden;
    }
    let rail = response.rect.x_range().shrink(0.4 * response.rect.height());
    let stroke = Stroke::new(1.5, Theme::of(ui).palette.warning);
    for &suggestion in suggestions.iter().filter(|suggestion| **suggestion <= MAX) {
        let share = (suggestion - 1) as f32 / (MAX - 1) as f32;
        let (x, bottom) = (rail.min + share * rail.span(), response.rect.bottom() + space(1));
        ui.painter().vline(x, bottom - space(1)..=bottom, stroke);
    }
    let value = *hidden as f64;
    response.widget_info(|| eframe::egui::WidgetInfo::slider(true, value, "Hidden nodes slider"));
    ui.add_space(space(1));
}

#[cfg(test)]
mod tests {
    use egui_kittest::{Harness, kittest::Queryable as _};

    use super::*;

    #[test]
    fn a_large_training_tells_its_memory_and_time_before_it_begins() {
        for (hidden, is_told) in [(12, false), (512, true)] {
            let mut draft = SimulatedSettings {
                hidden,
                ..SimulatedSettings::default()
            };
            draft.source.sensor.scale = "10x10_5x512".parse().unwrap();
            let harness = Harness::new_ui(move |ui| workload_ui(ui, &draft));
            let found = harness.query_by_label_contains("of memory");
            assert_eq!(found.is_some(), is_told, "{hidden} hidden nodes");
        }
    }
}
