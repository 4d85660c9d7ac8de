use eframe::egui::Ui;
use egui_plot::{Bar, BarChart, VLine};

use crate::{
    app::{plotting::plot_style::plot, theme::Theme},
    export::format_number,
};

const BINS: usize = 41;

/// How the errors of z (decoupled − actual) are distributed over the nodes of the test set.
pub fn error_histogram_ui(ui: &mut Ui, pairs_mm: &[(f64, f64)]) {
    let palette = Theme::of(ui).palette;
    let errors: Vec<f64> = pairs_mm.iter().map(|(actual, decoupled)| decoupled - actual).collect();
    let (counts, width) = histogram(&errors);
    let bars = counts.iter().enumerate().map(|(bin, &count)| {
        let centre = width * (bin as f64 - (BINS / 2) as f64);
        Bar::new(centre, count as f64).width(0.92 * width)
    });
    let text = |bar: &Bar, _: &BarChart| format!("{} nodes at {} mm", bar.value, format_number(bar.argument));
    let chart = BarChart::new("nodes", bars.collect())
        .color(palette.accent)
        .element_formatter(Box::new(text));
    let highest = counts.iter().copied().max().unwrap_or(0);
    plot(
        ui,
        "error histogram",
        "error of z (mm), decoupled − actual",
        "nodes of the test set",
    )
    .include_y(0.0)
    // Room for the words above the highest bar.
    .include_y(1.1 * highest as f64)
    .show(ui, |plot_ui| {
        plot_ui.bar_chart(chart);
        plot_ui.vline(VLine::new("no error", 0.0).color(palette.dim).width(1.0));
    });
}

/// Counts in [`BINS`] bins symmetric about 0, and the width of a bin.
pub fn histogram(errors: &[f64]) -> ([usize; BINS], f64) {
    let finite = || errors.iter().copied().filter(|error| error.is_finite());
    let largest = finite()
        .fold(0.0_f64, |largest, error| largest.max(error.abs()))
        .max(1e-12);
    let half = (BINS / 2) as f64;
    let width = largest / half;
    let mut counts = [0; BINS];
    for error in finite() {
        counts[((error / width).round() + half) as usize] += 1;
    }
    (counts, width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_error_is_counted_once_and_zero_stands_in_the_middle() {
        let (counts, width) = histogram(&[0.0, 0.0, 1.0, -1.0, 0.5, f64::NAN]);
        assert_eq!(counts.iter().sum::<usize>(), 5);
        assert_eq!((counts[0], counts[BINS / 2], counts[BINS - 1]), (1, 2, 1));
        assert!((width - 0.05).abs() < 1e-15);
        assert_eq!(histogram(&[]).0, [0; BINS]);
        assert_eq!(histogram(&[0.0; 3]).0[BINS / 2], 3);
    }
}
