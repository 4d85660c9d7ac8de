use eframe::egui::{RichText, Ui};
use egui_plot::{Line, PlotPoints, Points};

use crate::{
    app::{
        plotting::{
            Key, Mark,
            plot_style::{plot, thinned},
        },
        theme::{Palette, Theme, space, type_size},
    },
    export::format_number,
};

/// What is in the chart.
pub fn regression_keys(palette: &Palette) -> Vec<Key> {
    [
        ("nodes of the test set", Mark::Discs, palette.accent),
        ("fitted line", Mark::Line, palette.test_series),
        ("equal", Mark::Dashes, palette.text),
    ]
    .map(|(name, mark, colour)| Key { name, mark, colour })
    .to_vec()
}

/// Decoupled against actual z over the nodes of the test set, with the line on which they would be equal and the line
/// fitted to them. Both axes have one scale.
pub fn regression_ui(ui: &mut Ui, pairs_mm: &[(f64, f64)]) {
    let palette = Theme::of(ui).palette;
    let fit = Fit::new(pairs_mm);
    let low = pairs_mm.iter().map(|pair| pair.0).fold(f64::INFINITY, f64::min);
    let high = pairs_mm.iter().map(|pair| pair.0).fold(f64::NEG_INFINITY, f64::max);
    let dots: PlotPoints<'_> = thinned(pairs_mm)
        .map(|(actual, decoupled)| [actual, decoupled])
        .collect();
    let height = ui.available_height();
    ui.horizontal_top(|ui| {
        plot(ui, "regression", "actual z (mm)", "decoupled z (mm)")
            // Square but for the numbers beside the axes.
            .width((height + space(3)).min(ui.available_width()))
            .height(height)
            .data_aspect(1.0)
            .set_margin_fraction(eframe::egui::Vec2::splat(0.04))
            .show(ui, |plot_ui| {
                let dots = Points::new("nodes", dots).radius(1.6);
                plot_ui.points(dots.color(palette.accent.gamma_multiply(0.7)));
                let line = |name: &str, [a, b]: [f64; 2]| Line::new(name, PlotPoints::from(vec![[low, a], [high, b]]));
                let equal = line("equal", [low, high]).color(palette.text).width(1.4);
                plot_ui.line(equal.style(egui_plot::LineStyle::dashed_dense()));
                if let Some(fit) = fit {
                    let ends = [low, high].map(|actual| fit.slope * actual + fit.offset_mm);
                    plot_ui.line(line("fitted line", ends).color(palette.test_series).width(1.4));
                }
            });
        ui.add_space(space(3));
        ui.vertical(|ui| {
            ui.add_space(space(4));
            let Some(Fit {
                correlation,
                slope,
                offset_mm,
            }) = fit
            else {
                return;
            };
            let sign = if offset_mm < 0.0 { '−' } else { '+' };
            let [slope, offset] = [slope, offset_mm.abs()].map(format_number);
            ui.label(format!("Correlation R = {}", format_number(correlation)));
            let text = format!("Fitted line: decoupled = {slope} · actual {sign} {offset} mm");
            ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
        });
    });
}

/// The least-squares line through pairs of actual and decoupled values.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fit {
    /// Pearson's.
    correlation: f64,
    slope: f64,
    offset_mm: f64,
}

impl Fit {
    /// `None` where one side does not vary.
    fn new(pairs_mm: &[(f64, f64)]) -> Option<Self> {
        let count = pairs_mm.len() as f64;
        let mean = |pick: fn(&(f64, f64)) -> f64| pairs_mm.iter().map(pick).sum::<f64>() / count;
        let (mean_a, mean_d) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let (mut aa, mut dd, mut ad) = (0.0, 0.0, 0.0);
        for (a, d) in pairs_mm {
            aa += (a - mean_a).powi(2);
            dd += (d - mean_d).powi(2);
            ad += (a - mean_a) * (d - mean_d);
        }
        let slope = ad / aa;
        let fit = Self {
            correlation: ad / (aa * dd).sqrt(),
            slope,
            offset_mm: mean_d - slope * mean_a,
        };
        let is_finite = fit.correlation.is_finite() && fit.offset_mm.is_finite();
        is_finite.then_some(fit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_finds_a_line_and_none_without_variation() {
        let line: Vec<_> = (0..9).map(|i| (f64::from(i), 3.0 * f64::from(i) - 1.0)).collect();
        let fit = Fit::new(&line).unwrap();
        assert!((fit.correlation - 1.0).abs() < 1e-15);
        assert!((fit.slope - 3.0).abs() < 1e-14 && (fit.offset_mm + 1.0).abs() < 1e-13);
        assert_eq!(Fit::new(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(Fit::new(&[]), None);
    }
}
