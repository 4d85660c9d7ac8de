use eframe::egui::{Color32, Ui};
use egui_plot::{Line, PlotPoints};

use crate::{
    app::{
        plotting::{
            Key, Mark,
            plot_style::{log_marks, log_text, plot, thinned},
        },
        shared::{PLACES, RunList},
        theme::{Palette, Theme},
    },
    training::EpochRecord,
};

/// The colours of the two runs.
pub fn colours(palette: &Palette) -> [Color32; 2] {
    [palette.accent, palette.warning]
}

/// What is in the chart.
pub fn curves_keys(palette: &Palette, runs: &RunList) -> Vec<Key> {
    let places = (0..2).filter(|&place| runs.pinned(place).is_some());
    let keys = places.flat_map(|place| {
        let colour = colours(palette)[place];
        let [training, test] = [["A training", "A test"], ["B training", "B test"]][place];
        [(training, Mark::Dashes), (test, Mark::Line)].map(|(name, mark)| Key { name, mark, colour })
    });
    keys.collect()
}

/// Training and test error against epoch of both runs, in one chart with one scale.
pub fn curves_ui(ui: &mut Ui, runs: &RunList) {
    let palette = Theme::of(ui).palette;
    let chart = plot(ui, "compared losses", "epoch", "mse (scaled)")
        .y_grid_spacer(log_marks)
        .y_axis_formatter(|mark, _| log_text(mark.value));
    chart.show(ui, |plot_ui| {
        for (place, colour) in colours(&palette).into_iter().enumerate() {
            let Some(run) = runs.pinned(place) else { continue };
            let history = &run.file.training.history;
            let curve = |error: fn(&EpochRecord) -> Option<f64>| {
                let points = thinned(history).filter_map(|epoch| Some([epoch.epoch as f64, error(&epoch)?.log10()]));
                PlotPoints::from(points.filter(|point| point[1].is_finite()).collect::<Vec<[f64; 2]>>())
            };
            let letter = PLACES[place];
            let training = Line::new(format!("{letter} training"), curve(|epoch| Some(epoch.training_mse)));
            let training = training.style(egui_plot::LineStyle::dashed_dense());
            plot_ui.line(training.color(colour).width(1.4));
            let test = Line::new(format!("{letter} test"), curve(|epoch| epoch.test_mse));
            plot_ui.line(test.color(colour).width(1.8));
        }
    });
}
