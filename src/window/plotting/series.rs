//! Values over time, one plot below the other: the wheel zooms, dragging moves, a double click shows everything.

use std::ops::RangeInclusive;

use decoupler_files::{
    export::format_number,
    figure::{Ink, LineAt, LineStyle, Look, Marker, PlotFigure, Series, TimeSeries},
};
use eframe::egui::{Response, Ui};

use super::plot::plots_ui;
use crate::window::theme::space;

/// Targets shown one below the other: more would be too flat.
pub const MAX_TRACKS: usize = 6;

/// Part of a time series in view, and the samples that respond to the pointer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SeriesView {
    /// Range of places in view; `None` for all of them.
    pub seen: Option<RangeInclusive<f64>>,
    /// First target that is shown, where there are too many for the height.
    pub first: usize,
}

impl SeriesView {
    /// Returns the figure of what is in view, with at most `tracks` targets and the sample `marked`.
    pub fn figure(&self, series: &TimeSeries<'_>, tracks: usize, marked: Option<usize>) -> PlotFigure {
        let all = series.targets.len();
        let first = self.first.min(all.saturating_sub(tracks));
        let targets = first..all.min(first + tracks);
        let mut figure = series.figure(targets.clone(), &self.range(series));
        let marked = marked.filter(|sample| *sample < series.places.len());
        for (target, plot) in targets.zip(&mut figure.plots) {
            let Some(sample) = marked else { break };
            let at = series.places[sample];
            let line = Series::across("displayed sample", LineAt::X(at), Ink::Grey, LineStyle::Dashed);
            let mark = |name: &str, ink: Ink, value: f64| {
                Series::new(name, Look::marker(ink, Marker::Disc), [[at, value]]).listed(None)
            };
            plot.series.push(line.listed(None));
            let actual = series
                .actual
                .map(|actual| mark("actual sample", Ink::Text, actual[[sample, target]]));
            plot.series.extend(actual);
            plot.series
                .push(mark("decoded sample", Ink::Blue, series.decoded[[sample, target]]));
        }
        figure
    }

    /// Returns the number of targets for which there is room.
    pub fn tracks(ui: &Ui) -> usize {
        ((ui.available_height() / space(14)) as usize).clamp(1, MAX_TRACKS)
    }

    fn range(&self, series: &TimeSeries<'_>) -> RangeInclusive<f64> {
        let [first, last] = [series.places.first(), series.places.last()].map(|end| end.copied().unwrap_or_default());
        self.seen.clone().unwrap_or(first..=last)
    }

    /// Draws what is in view in the remaining space. Below the pointer the values of the nearest sample appear after its `name`.
    /// Returns the sample that was clicked.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        id: &str,
        series: &TimeSeries<'_>,
        marked: Option<usize>,
        name: impl Fn(usize) -> String,
    ) -> Option<usize> {
        let figure = self.figure(series, Self::tracks(ui), marked);
        let plots = plots_ui(ui, id, &figure);
        let all = SeriesView::default().range(series);
        let mut clicked = None;
        for (track, plot) in plots.iter().enumerate() {
            self.move_by(ui, &plot.response, &all, |at| plot.place_at(at));
            let Some(place) = plot.response.hover_pos().map(|at| plot.place_at(at)) else {
                continue;
            };
            let after = series.places.partition_point(|other| *other < place);
            let near = [after.saturating_sub(1), after]
                .into_iter()
                .filter(|sample| *sample < series.places.len());
            let distance = |sample: &usize| (series.places[*sample] - place).abs();
            let near = near.min_by(|one, other| distance(one).total_cmp(&distance(other)));
            let Some(sample) = near else { continue };
            let target = self.first.min(series.targets.len().saturating_sub(plots.len())) + track;
            let decoded = series.decoded[[sample, target]];
            let half_width = series
                .intervals
                .and_then(|intervals| intervals.half_width(target, decoded));
            let half_width =
                half_width.map_or_else(String::new, |half_width| format!(" ± {}", format_number(half_width)));
            let actual = series
                .actual
                .map(|actual| format!("actual {}, ", format_number(actual[[sample, target]])));
            let (title, actual) = (series.targets[target].title(), actual.unwrap_or_default());
            let text = format!(
                "{}\n{title}: {actual}decoded {}{half_width}",
                name(sample),
                format_number(decoded)
            );
            plot.response.clone().on_hover_text_at_pointer(text);
            clicked = clicked.or(Some(sample).filter(|_| plot.response.clicked()));
        }
        clicked
    }

    /// Follows the wheel and the drag of the pointer over a plot whose places are those of `place_at`.
    fn move_by(
        &mut self,
        ui: &Ui,
        response: &Response,
        all: &RangeInclusive<f64>,
        place_at: impl Fn(eframe::egui::Pos2) -> f64,
    ) {
        if response.double_clicked() {
            self.seen = None;
        }
        let (Some(at), true) = (response.hover_pos(), all.start() < all.end()) else {
            return;
        };
        let wheel = ui.input(|input| input.smooth_scroll_delta.y);
        let zoom = ui.input(|input| input.zoom_delta()) * (0.004 * wheel).exp();
        let (here, before) = (place_at(at), place_at(at - response.drag_delta()));
        if zoom == 1.0 && here == before {
            return;
        }
        let (seen, zoom) = (self.seen.as_ref().unwrap_or(all), f64::from(zoom));
        let width = ((seen.end() - seen.start()) / zoom).min(all.end() - all.start());
        let first = here - (here - seen.start()) / zoom - (here - before);
        let first = first.clamp(*all.start(), all.end() - width);
        let seen = first..=first + width;
        self.seen = Some(seen).filter(|seen| seen.start() > all.start() || seen.end() < all.end());
    }
}
