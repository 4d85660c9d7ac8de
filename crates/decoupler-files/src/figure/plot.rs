use std::ops::RangeInclusive;

use decoupler_core::text::counted;
use glam::Vec2;

use super::{
    Ink, LineStyle, Look, Marker,
    axis::{PlotAxis, Scale},
    drawing::{Bounds, Labels, Measure, Shape},
    extremes, unique_by,
};

/// A plot of series of points: curves, scatter, bars.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Horizontal.
    pub x: PlotAxis,
    /// Vertical.
    pub y: PlotAxis,
    /// Drawn in this order.
    pub series: Vec<Series>,
    /// Gives both axes the same scale.
    pub has_equal_scales: bool,
}

/// Points that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name, shown with the values of a point.
    pub name: String,
    /// Name in the legend, common to all series that are listed as one; `None` if it is not listed.
    pub key: Option<String>,
    /// Appearance.
    pub look: Look,
    /// What is drawn.
    pub form: Form,
    /// Label at the upper end of a vertical line.
    pub label: Option<String>,
    /// In the order in which the line runs.
    pub points: Vec<PlotPoint>,
}

/// A point of a series.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotPoint {
    /// Horizontal.
    pub x: f64,
    /// Vertical.
    pub y: f64,
    /// Ends of its error bar.
    pub bar: Option<[f64; 2]>,
    /// Note shown instead of its coordinates.
    pub note: Option<String>,
    /// Label next to it, if there is room.
    pub label: Option<String>,
    /// Index of its item, such as a node or a bar, which other figures share.
    pub item: Option<usize>,
}

/// What a series draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Symbols at the points, a line through them, or both: as its look says.
    Points,
    /// Bars of this width from 0 to each point.
    Bars(f64),
    /// The area between the ends of the bars of the points.
    Band,
    /// No points, but a line across the whole plot or a band, behind everything else.
    Across(LineAt),
}

/// Position of a line across a plot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineAt {
    /// Vertical, at this value of x.
    X(f64),
    /// Horizontal, at this value of y.
    Y(f64),
    /// A band between these values of x.
    Between([f64; 2]),
}

impl From<[f64; 2]> for PlotPoint {
    fn from([x, y]: [f64; 2]) -> Self {
        Self {
            x,
            y,
            ..Self::default()
        }
    }
}

impl PlotPoint {
    /// The point of an item that other figures share.
    #[must_use]
    pub fn of_item(mut self, item: usize) -> Self {
        self.item = Some(item);
        self
    }

    /// The point with a note instead of its coordinates.
    #[must_use]
    pub fn noted(mut self, note: String) -> Self {
        self.note = Some(note);
        self
    }
}

impl Series {
    /// A series of points, listed in the legend by its name.
    pub fn new<P: Into<PlotPoint>>(name: impl Into<String>, look: Look, points: impl IntoIterator<Item = P>) -> Self {
        let name = name.into();
        Self {
            key: Some(name.clone()),
            name,
            look,
            form: Form::Points,
            label: None,
            points: points.into_iter().map(Into::into).collect(),
        }
    }

    /// A line across the whole plot, or a band if it has no style; listed in the legend by its name.
    pub fn across(name: impl Into<String>, at: LineAt, ink: Ink, style: impl Into<Option<LineStyle>>) -> Self {
        Self {
            form: Form::Across(at),
            ..Self::new(name, Look::line(ink, style), [[0.0; 2]; 0])
        }
    }

    /// The series with a value that is constant up to the next point.
    #[must_use]
    pub fn stepped(mut self) -> Self {
        let (mut steps, mut height) = (Vec::<PlotPoint>::new(), None);
        for point in self.points {
            let corner = height.filter(|height| *height != point.y);
            steps.extend(corner.map(|height| PlotPoint::from([point.x, height])));
            height = Some(point.y);
            steps.push(point);
        }
        self.points = steps;
        self
    }

    /// A vertical line with a label instead of an entry in the legend.
    #[must_use]
    pub fn labelled(mut self, label: &str) -> Self {
        self.label = Some(label.to_owned());
        self.listed(None)
    }

    /// The series with this name in the legend, or none.
    #[must_use]
    pub fn listed(mut self, key: Option<&str>) -> Self {
        self.key = key.map(str::to_owned);
        self
    }
}

impl Plot {
    /// A plot of the series that have something to draw.
    pub fn new(x: PlotAxis, y: PlotAxis, series: impl IntoIterator<Item = Series>) -> Self {
        let is_drawn = |series: &Series| !series.points.is_empty() || matches!(series.form, Form::Across(_));
        Self {
            x,
            y,
            series: series.into_iter().filter(is_drawn).collect(),
            has_equal_scales: false,
        }
    }

    /// Returns the lines across the plot.
    pub fn lines_across(&self) -> impl Iterator<Item = (&Series, LineAt)> {
        self.series.iter().filter_map(|series| match series.form {
            Form::Across(at) => Some((series, at)),
            _ => None,
        })
    }

    /// Returns two opposite corners of a line or band across these ranges, as places; `None` if an axis has none for it.
    pub(crate) fn corners(&self, line: LineAt, [x, y]: &[RangeInclusive<f64>; 2]) -> Option<[[f64; 2]; 2]> {
        let ([left, right], [low, high]) = match line {
            LineAt::X(at) => ([self.x.place(at)?; 2], [*y.start(), *y.end()]),
            LineAt::Y(at) => ([*x.start(), *x.end()], [self.y.place(at)?; 2]),
            LineAt::Between([from, to]) => ([self.x.place(from)?, self.x.place(to)?], [*y.start(), *y.end()]),
        };
        Some([[left, low], [right, high]])
    }

    /// Returns the place of a point on both axes; `None` if one of the axes has no place for it.
    pub fn place(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        Some([self.x.place(x)?, self.y.place(y)?])
    }

    /// Returns the points of a series that have a place, with their places.
    pub fn placed<'a>(&self, series: &'a Series) -> impl Iterator<Item = (&'a PlotPoint, [f64; 2])> {
        let points = series.points.iter();
        points.filter_map(|point| Some((point, self.place(point.x, point.y)?)))
    }

    /// Returns the stretches of the line of a series: a missing point leaves a gap.
    pub fn stretches(&self, series: &Series) -> Vec<Vec<[f64; 2]>> {
        let places = series.points.iter().map(|point| self.place(point.x, point.y));
        unbroken(places)
    }

    /// Returns the stretches of a band: the place of each point on the horizontal axis, and those of both ends of its bar.
    pub fn bands(&self, series: &Series) -> Vec<Vec<[f64; 3]>> {
        unbroken(series.points.iter().map(|point| {
            let [x, low] = self.place(point.x, point.bar?[0])?;
            Some([x, low, self.y.place(point.bar?[1])?])
        }))
    }

    /// Returns the places of the ends of an error bar. Values without a place on a logarithmic axis are below its lower
    /// end.
    pub fn bar_ends(&self, ends: [f64; 2], y_range: &RangeInclusive<f64>) -> [f64; 2] {
        ends.map(|end| self.y.place(end).unwrap_or(*y_range.start()))
    }

    /// Returns the ranges of places in view on both axes.
    pub fn ranges(&self) -> [RangeInclusive<f64>; 2] {
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        for series in &self.series {
            let mut half = 0.0;
            match series.form {
                Form::Points | Form::Band => {}
                Form::Bars(width) => {
                    half = 0.5 * width;
                    ys.push(0.0);
                }
                Form::Across(LineAt::X(x)) => xs.push(x),
                Form::Across(LineAt::Y(y)) => ys.push(y),
                Form::Across(LineAt::Between(ends)) => xs.extend(ends),
            }
            for (point, _) in self.placed(series) {
                xs.extend([point.x - half, point.x + half]);
                ys.push(point.y);
                ys.extend(point.bar.into_iter().flatten());
            }
        }
        let x = self.x.range(xs.into_iter().filter_map(|value| self.x.place(value)));
        let y = self.y.range(ys.into_iter().filter_map(|value| self.y.place(value)));
        if self.has_equal_scales {
            let both = x.start().min(*y.start())..=x.end().max(*y.end());
            return [both.clone(), both];
        }
        [x, y]
    }

    /// Returns the text on a point of a series.
    pub fn words(&self, series: &Series, point: &PlotPoint) -> String {
        if let Some(note) = &point.note {
            return note.clone();
        }
        let (x, y) = (self.x.value_text(point.x), self.y.value_text(point.y));
        let mut words = format!("{}\n{}: {x}\n{}: {y}", series.name, self.x.name, self.y.name);
        if let Some([low, high]) = point.bar {
            words += &format!(", {} to {}", self.y.value_text(low), self.y.value_text(high));
        }
        words
    }

    /// Describes the plot in a sentence: its axes, the course of each curve, the extent of each cloud of points,
    /// the highest bar.
    pub fn summary(&self) -> String {
        let scale = match self.y.scale {
            Scale::Logarithmic => " on a logarithmic scale",
            _ => "",
        };
        let series = self.series.iter().filter_map(|series| self.words_about(series));
        let parts = Vec::from_iter(series).join("; ");
        let parts = if parts.is_empty() { "nothing to show" } else { &parts };
        format!("{}{scale} against {}: {parts}.", self.y.name, self.x.name)
    }

    /// Describes a series; `None` if no point of it is drawn.
    fn words_about(&self, series: &Series) -> Option<String> {
        let (name, x, y) = (&series.name, |x| self.x.value_text(x), |y| self.y.value_text(y));
        if let Form::Across(line) = series.form {
            return match line {
                LineAt::X(at) if name.contains(&x(at)) => Some(name.clone()),
                LineAt::X(at) => Some(format!("{name} at {}", x(at))),
                LineAt::Y(at) => Some(format!("{name} at {}", y(at))),
                LineAt::Between(_) => None,
            };
        }
        let points = Vec::from_iter(self.placed(series).map(|(point, _)| point));
        let (first, last) = (points.first()?, points.last()?);
        let (lowest, highest) = extremes(points.iter(), |point| point.y)?;
        let (leftmost, rightmost) = extremes(points.iter(), |point| point.x)?;
        // An axis without values only keeps the points apart.
        let at = |point: &PlotPoint| match self.y.scale {
            Scale::Hidden => x(point.x),
            _ => format!("{} at {}", y(point.y), x(point.x)),
        };
        let is_curve = series.look.line.is_some_and(|style| style != LineStyle::Fine);
        Some(match (points.len(), series.form) {
            (bars, Form::Bars(_)) => format!("{}, the highest {}", counted(bars, "bar"), at(highest)),
            (1, _) => format!("{name}: {}", at(first)),
            _ if is_curve => {
                let extremes = [("lowest", lowest), ("highest", highest)].into_iter();
                let inner = extremes.filter(|(_, point)| point.y != first.y && point.y != last.y);
                let inner: String = inner.map(|(what, point)| format!(", {what} {}", at(point))).collect();
                format!("{name} from {} to {}{inner}", at(first), at(last))
            }
            (count, _) => {
                let extents = [(&self.y, lowest.y, highest.y), (&self.x, leftmost.x, rightmost.x)].into_iter();
                let extents = extents.filter(|(axis, ..)| axis.scale != Scale::Hidden);
                let extents = extents.map(|(axis, low, high)| {
                    format!(", {} {} to {}", axis.name, axis.value_text(low), axis.value_text(high))
                });
                format!("{} of {name}{}", counted(count, "point"), extents.collect::<String>())
            }
        })
    }

    /// Lays out the labels of points and of vertical lines in `frame`, where `at` gives the point of a place: next to their
    /// point, clear of each other and, if possible, of everything else. Those without room are left out; earlier ones are
    /// shown where points are crowded.
    pub fn lay_out_labels(&self, frame: Bounds, at: impl Fn([f64; 2]) -> Vec2, measure: Measure<'_>) -> Vec<Shape> {
        /// Room between a point and its label.
        const GAP: f32 = 5.0;
        let mut wanted: Vec<(Vec2, &str)> = Vec::new();
        for series in &self.series {
            if let (Form::Across(LineAt::X(x)), Some(label)) = (series.form, &series.label)
                && let Some(x) = self.x.place(x)
            {
                wanted.push((Vec2::new(at([x, 0.0]).x, frame.min.y), label));
            }
            let placed = self.placed(series);
            wanted.extend(placed.filter_map(|(point, place)| Some((at(place), point.label.as_deref()?))));
        }
        // Most plots have none.
        if wanted.is_empty() {
            return Vec::new();
        }
        let mut marks = Vec::new();
        for series in &self.series {
            let points: Vec<Vec2> = self.placed(series).map(|(_, place)| at(place)).collect();
            match series.look.line {
                Some(_) => marks.extend(along(&points)),
                None => marks.extend(points),
            }
        }
        // To the right of the point if possible, else to the left, above or below.
        let sides = [1.0, -1.0, 0.0].map(|x| [-1.0, 0.0, 1.0].map(|y| Vec2::new(x, y)));
        let mut labels = Labels::new(measure);
        for (at, text) in wanted {
            let sides = sides.iter().flatten().filter(|side| **side != Vec2::ZERO);
            let middles = sides.map(|side| at + side * (GAP + 0.5 * measure(text)));
            labels.place(text, -1e-3, middles, |place| {
                let is_within = frame.contains(place.min) && frame.contains(place.max);
                let covered = || marks.iter().filter(|mark| place.grown(2.0).contains(**mark)).count();
                is_within.then(covered)
            });
        }
        labels.shapes().collect()
    }
}

/// Returns the stretches of at least two neighbours without a gap.
pub(super) fn unbroken<T: Clone>(items: impl Iterator<Item = Option<T>>) -> Vec<Vec<T>> {
    let items: Vec<Option<T>> = items.collect();
    let stretches = items.split(Option::is_none).filter(|stretch| stretch.len() > 1);
    let whole = |stretch: &[Option<T>]| stretch.iter().flatten().cloned().collect();
    stretches.map(whole).collect()
}

/// Returns places along a line, which labels should avoid.
fn along(line: &[Vec2]) -> impl Iterator<Item = Vec2> {
    const STEP: f32 = 4.0;
    line.windows(2).flat_map(|ends| {
        let (from, to) = (ends[0], ends[1]);
        let steps = (from.distance(to) / STEP).ceil().clamp(1.0, 1000.0);
        (0..=steps as usize).map(move |step| from.lerp(to, step as f32 / steps))
    })
}

/// Plots side by side, or one below the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotFigure {
    /// From left to right, or from above.
    pub plots: Vec<Plot>,
    /// Puts the plots one below the other, with one horizontal axis.
    pub is_stacked: bool,
    /// Sentences about the figure.
    pub notes: Vec<String>,
}

impl From<Plot> for PlotFigure {
    fn from(plot: Plot) -> Self {
        Self::new([plot], [])
    }
}

impl PlotFigure {
    /// Plots with notes.
    pub fn new(plots: impl IntoIterator<Item = Plot>, notes: impl IntoIterator<Item = String>) -> Self {
        Self {
            plots: plots.into_iter().collect(),
            is_stacked: false,
            notes: notes.into_iter().collect(),
        }
    }

    /// Returns the entries of the legends of all plots, each once.
    pub fn keys(&self) -> Vec<(&str, Look)> {
        let series = self.plots.iter().flat_map(|plot| &plot.series);
        let keys = series.filter_map(|series| Some((series.key.as_deref()?, series.look)));
        unique_by(keys.filter(|(key, _)| !key.is_empty()), |(key, _)| *key)
    }

    /// Describes the figure in one sentence per plot, followed by its notes.
    pub fn summary(&self) -> String {
        let plots = self.plots.iter().map(Plot::summary);
        plots.chain(self.notes.iter().cloned()).collect::<Vec<_>>().join(" ")
    }

    /// Returns the figure with a halo around the points of one of these items, and around `others`.
    #[must_use]
    pub fn lighting(mut self, is_lit: impl Fn(usize) -> bool, others: &[[f64; 2]]) -> Self {
        for plot in &mut self.plots {
            let points = plot.series.iter().filter(|series| series.form == Form::Points);
            let lit = points.flat_map(|series| &series.points);
            let lit = lit.filter(|point| point.item.is_some_and(&is_lit)).cloned();
            let points: Vec<PlotPoint> = lit.chain(others.iter().copied().map(PlotPoint::from)).collect();
            if !points.is_empty() {
                let look = Look::marker(Ink::Text, Marker::Halo);
                plot.series.push(Series::new("lit", look, points).listed(None));
            }
        }
        self
    }
}

/// Returns evenly spaced indices, at most 2000 and the last one: more dots of one cloud would not be visible.
pub(super) fn thinned_places(count: usize) -> impl Iterator<Item = usize> {
    let stride = count.div_ceil(2000).max(1);
    let last = count.checked_sub(1);
    let last = last.filter(|last| !last.is_multiple_of(stride));
    (0..count).step_by(stride).chain(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_on_a_point_has_its_series_position_and_value() {
        let look = Look::line(Ink::Blue, LineStyle::Solid);
        let mut series = Series::new("test", look, [[12.0, 0.001_234]]);
        let plot = Plot::new(
            PlotAxis::linear("epoch"),
            PlotAxis::logarithmic("error (%)"),
            Vec::new(),
        );
        assert_eq!(
            plot.words(&series, &series.points[0]),
            "test\nepoch: 12\nerror (%): 0.00123"
        );
        series.points[0].bar = Some([0.001, 0.002]);
        assert!(
            plot.words(&series, &series.points[0])
                .ends_with("0.00123, 0.00100 to 0.00200")
        );
        series.points[0].note = Some("the best".to_owned());
        assert_eq!(plot.words(&series, &series.points[0]), "the best");
    }

    #[test]
    fn everything_that_is_drawn_is_in_view() {
        let look = Look::line(Ink::Blue, None);
        let series = Series {
            form: Form::Bars(2.0),
            ..Series::new("bars", look, [[1.0, 5.0]])
        };
        let mut plot = Plot::new(PlotAxis::linear(""), PlotAxis::linear(""), vec![series]);
        plot.series.extend([
            Series::across("x", LineAt::X(9.0), Ink::Grey, LineStyle::Dashed),
            Series::across("y", LineAt::Y(-3.0), Ink::Grey, LineStyle::Dashed),
            Series::across("band", LineAt::Between([-4.0, 3.0]), Ink::Grey, None),
        ]);
        let [x, y] = plot.ranges();
        assert!([0.0, 2.0, 9.0, -4.0].iter().all(|value| x.contains(value)), "{x:?}");
        assert!([0.0, 5.0, -3.0].iter().all(|value| y.contains(value)), "{y:?}");
        plot.has_equal_scales = true;
        let [x, y] = plot.ranges();
        assert_eq!(x, y);
    }

    const FRAME: Bounds = Bounds {
        min: Vec2::ZERO,
        max: Vec2::new(200.0, 100.0),
    };
    const SIZE: Vec2 = Vec2::new(60.0, 12.0);

    /// A plot in which each point has a label.
    fn labelled(look: Look, points: &[[f64; 2]]) -> Plot {
        let points = points.iter().map(|&point| PlotPoint {
            label: Some("label".to_owned()),
            ..point.into()
        });
        let series = Series::new("", look, points);
        Plot::new(PlotAxis::linear(""), PlotAxis::linear(""), [series])
    }

    fn labels(plot: &Plot) -> Vec<Bounds> {
        let at = |[x, y]: [f64; 2]| Vec2::new(x as f32, y as f32);
        let bounds = |shape| match shape {
            Shape::Text(at, ..) => Bounds::centred(at, SIZE),
            _ => panic!("not a label: {shape:?}"),
        };
        let shapes = plot.lay_out_labels(FRAME, at, &|_| SIZE).into_iter();
        shapes.map(bounds).collect()
    }

    const DISC: Look = Look {
        ink: Ink::Blue,
        line: None,
        marker: Some(Marker::Disc),
    };

    #[test]
    fn labels_are_in_the_plot_and_clear_of_each_other_and_of_marks() {
        let points = [[10.0, 50.0], [12.0, 54.0], [190.0, 95.0], [198.0, 4.0], [100.0, 50.0]];
        let labels = labels(&labelled(DISC, &points));
        assert_eq!(labels.len(), points.len());
        for (index, label) in labels.iter().enumerate() {
            assert!(FRAME.contains(label.min) && FRAME.contains(label.max), "{label:?}");
            for other in &labels[..index] {
                assert!(!other.grown(-1e-3).intersects(label), "{label:?} {other:?}");
            }
            for [x, y] in points {
                let point = Vec2::new(x as f32, y as f32);
                assert!(!label.grown(1.0).contains(point), "{label:?} {point:?}");
            }
        }
    }

    #[test]
    fn a_label_keeps_clear_of_a_line_through_its_point() {
        let mut plot = labelled(DISC, &[[100.0, 6.0]]);
        let line = Look::line(Ink::Blue, LineStyle::Solid);
        plot.series.push(Series::new("", line, [[20.0, 6.0], [180.0, 6.0]]));
        let label = labels(&plot)[0];
        assert!(label.min.y > 6.0, "below, because there is no room above: {label:?}");
    }

    #[test]
    fn a_label_without_room_is_left_out() {
        let labels = labels(&labelled(DISC, &[[100.0, 50.0]; 30]));
        assert!((1..29).contains(&labels.len()), "{}", labels.len());
    }

    #[test]
    fn a_legend_lists_series_that_look_alike_once() {
        let series = |name: &str, key| Series::new(name, Look::line(Ink::Blue, None), [[0.0, 1.0]]).listed(key);
        let line = Series::across("limit", LineAt::Y(1.0), Ink::Grey, LineStyle::Dashed);
        let all = [
            series("row 1", Some("rows")),
            series("row 2", Some("rows")),
            series("lit", None),
            line.clone(),
            line.labelled("here"),
        ];
        let plot = Plot::new(PlotAxis::linear(""), PlotAxis::linear(""), all);
        let figure = PlotFigure {
            plots: vec![plot.clone(), plot],
            ..PlotFigure::default()
        };
        assert_eq!(
            figure.keys(),
            [
                ("rows", Look::line(Ink::Blue, None)),
                ("limit", Look::line(Ink::Grey, LineStyle::Dashed))
            ]
        );
    }

    #[test]
    fn thinning_keeps_both_ends() {
        let thin: Vec<usize> = thinned_places(12_345).collect();
        assert!(thin.len() <= 2001);
        assert_eq!((thin[0], thin[thin.len() - 1]), (0, 12_344));
        assert_eq!(thinned_places(1).collect::<Vec<_>>(), [0]);
        assert_eq!(thinned_places(0).count(), 0);
    }
}
