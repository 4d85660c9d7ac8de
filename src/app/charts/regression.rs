use eframe::egui::{RichText, Ui};
use egui_plot::{Line, PlotPoints, Points};
use ndarray::Array2;

use super::{
    plot_style::{legend, plot, thinned},
    test_pairs::z_pairs_mm,
};
use crate::{
    app::theme::{Theme, type_size},
    dataset::Dataset,
    export::format_number,
};

/// Decoupled against actual z over the nodes of the test set, with the line on which they would be equal.
pub fn regression_ui(ui: &mut Ui, test: &Dataset, decoupled_mm: &Array2<f64>) {
    let palette = Theme::of(ui).palette;
    let pairs = z_pairs_mm(test, decoupled_mm);
    if let Some(correlation) = correlation(&pairs) {
        let text = format!("Correlation R = {}", format_number(correlation));
        ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
    }
    let low = pairs.iter().map(|pair| pair.0).fold(f64::INFINITY, f64::min);
    let high = pairs.iter().map(|pair| pair.0).fold(f64::NEG_INFINITY, f64::max);
    let dots: PlotPoints<'_> = thinned(&pairs).map(|(actual, decoupled)| [actual, decoupled]).collect();
    plot(ui, "regression", "actual z (mm)", "decoupled z (mm)")
        .legend(legend())
        .show(ui, |plot_ui| {
            let equal = Line::new("equal", PlotPoints::from(vec![[low, low], [high, high]]));
            plot_ui.line(equal.color(palette.dim).width(1.0));
            plot_ui.points(
                Points::new("nodes", dots)
                    .radius(1.6)
                    .color(palette.accent.gamma_multiply(0.7)),
            );
        });
}

/// Pearson's correlation; `None` where one side does not vary.
fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| pairs.iter().map(pick).sum::<f64>() / count;
    let (mean_a, mean_d) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let (mut aa, mut dd, mut ad) = (0.0, 0.0, 0.0);
    for (a, d) in pairs {
        aa += (a - mean_a).powi(2);
        dd += (d - mean_d).powi(2);
        ad += (a - mean_a) * (d - mean_d);
    }
    Some(ad / (aa * dd).sqrt()).filter(|r| r.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_is_one_on_a_line_and_none_without_variation() {
        let line: Vec<_> = (0..9).map(|i| (f64::from(i), 3.0 * f64::from(i) - 1.0)).collect();
        assert!((correlation(&line).unwrap() - 1.0).abs() < 1e-15);
        assert_eq!(correlation(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(correlation(&[]), None);
    }
}
