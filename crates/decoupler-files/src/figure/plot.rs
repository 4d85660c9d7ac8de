use std::ops::RangeInclusive;

use glam::DVec2;

use super::{Hue, Key, LineStyle, Look, Marker, axis::PlotAxis};

/// A plot of series of points: curves, scatter, bars.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Horizontal.
    pub x: PlotAxis,
    /// Vertical.
    pub y: PlotAxis,
    /// Marked stretches of the x axis, behind everything.
    pub spans: Vec<Span>,
    /// Reference lines, behind the series.
    pub lines: Vec<ReferenceLine>,
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
    /// Appearance.
    pub look: Look,
    /// Width of a bar from 0 to each point, for histograms.
    pub bar_width: Option<f64>,
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

/// A marked stretch of the x axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// Meaning.
    pub name: String,
    /// Colour that is tinted.
    pub hue: Hue,
    /// Its ends.
    pub range: RangeInclusive<f64>,
}

/// Position of a reference line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineAt {
    /// Vertical, at this value of x.
    X(f64),
    /// Horizontal, at this value of y.
    Y(f64),
}

/// A line across the whole plot.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceLine {
    /// Meaning, shown under the pointer.
    pub name: String,
    /// Position.
    pub at: LineAt,
    /// Colour.
    pub hue: Hue,
    /// Style.
    pub style: LineStyle,
    /// Label at the upper end of a vertical line.
    pub label: Option<String>,
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

impl Series {
    /// A series of plain points.
    pub fn new(name: impl Into<String>, look: Look, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self {
            name: name.into(),
            look,
            bar_width: None,
            points: points.into_iter().map(PlotPoint::from).collect(),
        }
    }
}

impl ReferenceLine {
    /// A line without a label.
    pub fn new(name: impl Into<String>, at: LineAt, hue: Hue, style: LineStyle) -> Self {
        Self {
            name: name.into(),
            at,
            hue,
            style,
            label: None,
        }
    }
}

impl Plot {
    /// A plot of these series.
    pub fn new(x: PlotAxis, y: PlotAxis, series: Vec<Series>) -> Self {
        Self {
            x,
            y,
            spans: Vec::new(),
            lines: Vec::new(),
            series,
            has_equal_scales: false,
        }
    }

    /// Returns the place of a point on both axes; `None` if one of the axes has no place for it.
    pub fn place(&self, x: f64, y: f64) -> Option<[f64; 2]> {
        Some([self.x.place(x)?, self.y.place(y)?])
    }

    /// Returns true if any point has a label.
    pub fn has_point_labels(&self) -> bool {
        let mut points = self.series.iter().flat_map(|series| &series.points);
        points.any(|point| point.label.is_some())
    }

    /// Returns the points of a series that have a place, with their places.
    pub fn placed<'a>(&self, series: &'a Series) -> impl Iterator<Item = (&'a PlotPoint, [f64; 2])> {
        let points = series.points.iter();
        points.filter_map(|point| Some((point, self.place(point.x, point.y)?)))
    }

    /// Returns the places of the ends of an error bar. Values without a place on a logarithmic axis are below its lower
    /// end.
    pub fn bar_ends(&self, ends: [f64; 2], y_range: &RangeInclusive<f64>) -> [f64; 2] {
        ends.map(|end| self.y.place(end).unwrap_or(*y_range.start()))
    }

    /// Returns the ranges of places in view on both axes.
    pub fn ranges(&self) -> [RangeInclusive<f64>; 2] {
        let placed = || {
            self.series
                .iter()
                .flat_map(|series| self.placed(series).map(move |point| (series, point)))
        };
        let lines = |is_x: bool| {
            self.lines.iter().filter_map(move |line| match line.at {
                LineAt::X(x) if is_x => Some(x),
                LineAt::Y(y) if !is_x => Some(y),
                _ => None,
            })
        };
        let x_values = placed().flat_map(|(series, (point, _))| {
            let half = 0.5 * series.bar_width.unwrap_or(0.0);
            [point.x - half, point.x + half]
        });
        let spans = self
            .spans
            .iter()
            .flat_map(|span| [*span.range.start(), *span.range.end()]);
        let x_values = x_values.chain(spans).chain(lines(true));
        let y_values = placed().flat_map(|(series, (point, _))| {
            let foot = series.bar_width.map(|_| 0.0);
            std::iter::once(point.y)
                .chain(point.bar.into_iter().flatten())
                .chain(foot)
        });
        let y_values = y_values.chain(lines(false));
        let x = self.x.range(x_values.filter_map(|value| self.x.place(value)));
        let y = self.y.range(y_values.filter_map(|value| self.y.place(value)));
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
}

/// Room between a mark and its label.
const GAP: f64 = 5.0;

/// A label to be placed at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLabel {
    /// Position of the point.
    pub at: DVec2,
    /// Width and height of the label.
    pub size: DVec2,
}

/// Returns places along a line, which labels should avoid.
pub fn along(line: &[DVec2]) -> impl Iterator<Item = DVec2> {
    const STEP: f64 = 4.0;
    line.windows(2).flat_map(|ends| {
        let (from, to) = (ends[0], ends[1]);
        let steps = (from.distance(to) / STEP).ceil().clamp(1.0, 1000.0);
        (0..=steps as usize).map(move |step| from.lerp(to, step as f64 / steps))
    })
}

/// Returns the upper left corner of each label next to its point, clear of the other labels and, if possible, of
/// `marks`, the places of everything else that is drawn; `None` if there is no room between `low` and `high`, the
/// corners of the plot.
///
/// Labels are placed in order, each at its best free place, so earlier ones are shown where points are crowded.
pub fn place_labels(labels: &[PointLabel], marks: &[DVec2], (low, high): (DVec2, DVec2)) -> Vec<Option<DVec2>> {
    let mut placed: Vec<(DVec2, DVec2)> = Vec::new();
    let mut place = |label: &PointLabel| {
        let PointLabel { at, size } = *label;
        let [right, left] = [at.x + GAP, at.x - GAP - size.x];
        let [above, below] = [at.y - GAP - size.y, at.y + GAP];
        let middle = at - 0.5 * size;
        let corners = [
            DVec2::new(right, above),
            DVec2::new(right, middle.y),
            DVec2::new(right, below),
            DVec2::new(left, above),
            DVec2::new(left, middle.y),
            DVec2::new(left, below),
            DVec2::new(middle.x, above),
            DVec2::new(middle.x, below),
        ];
        let is_free = |corner: &DVec2| {
            let end = *corner + size;
            let is_within = corner.cmpge(low).all() && end.cmple(high).all();
            is_within && placed.iter().all(|&(from, to)| !overlap((*corner, end), (from, to)))
        };
        let covered = |corner: &DVec2| {
            let (from, to) = (*corner - 2.0, *corner + size + 2.0);
            marks
                .iter()
                .filter(|mark| mark.cmpge(from).all() && mark.cmple(to).all())
                .count()
        };
        let best = corners.into_iter().filter(is_free).min_by_key(covered)?;
        placed.push((best, best + size));
        Some(best)
    };
    labels.iter().map(&mut place).collect()
}

fn overlap(one: (DVec2, DVec2), other: (DVec2, DVec2)) -> bool {
    one.0.cmplt(other.1).all() && other.0.cmplt(one.1).all()
}

/// Plots side by side with one legend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotFigure {
    /// From left to right.
    pub plots: Vec<Plot>,
    /// The legend, above the plots.
    pub keys: Vec<Key>,
    /// Sentences about the figure, below the legend.
    pub notes: Vec<String>,
}

impl PlotFigure {
    /// Returns the figure with a halo around the points of one of these items, and around `others`.
    #[must_use]
    pub fn lighting(mut self, is_lit: impl Fn(usize) -> bool, others: &[[f64; 2]]) -> Self {
        for plot in &mut self.plots {
            let points = plot.series.iter().filter(|series| series.bar_width.is_none());
            let lit = points.flat_map(|series| &series.points);
            let lit = lit.filter(|point| point.item.is_some_and(&is_lit)).cloned();
            let points: Vec<PlotPoint> = lit.chain(others.iter().copied().map(PlotPoint::from)).collect();
            if !points.is_empty() {
                let look = Look::marker(Hue::Ink, Marker::Halo);
                plot.series.push(Series {
                    points,
                    ..Series::new("lit", look, [])
                });
            }
        }
        self
    }
}

/// Maximum number of dots drawn for one cloud; more would not be visible.
const MAX_POINTS: usize = 2000;

/// Returns evenly spaced indices, at most [`MAX_POINTS`] and the last one.
pub(super) fn thinned_places(count: usize) -> impl Iterator<Item = usize> {
    let stride = count.div_ceil(MAX_POINTS).max(1);
    let last = count.checked_sub(1);
    (0..count)
        .step_by(stride)
        .chain(last.filter(|last| !last.is_multiple_of(stride)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_on_a_point_has_its_series_position_and_value() {
        let look = Look::line(Hue::Blue, LineStyle::Solid);
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
        let look = Look::area(Hue::Blue);
        let series = Series {
            bar_width: Some(2.0),
            ..Series::new("bars", look, [[1.0, 5.0]])
        };
        let mut plot = Plot::new(PlotAxis::linear(""), PlotAxis::linear(""), vec![series]);
        plot.lines = vec![
            ReferenceLine::new("x", LineAt::X(9.0), Hue::Grey, LineStyle::Dashed),
            ReferenceLine::new("y", LineAt::Y(-3.0), Hue::Grey, LineStyle::Dashed),
        ];
        let [x, y] = plot.ranges();
        assert!([0.0, 2.0, 9.0].iter().all(|value| x.contains(value)), "{x:?}");
        assert!([0.0, 5.0, -3.0].iter().all(|value| y.contains(value)), "{y:?}");
        plot.has_equal_scales = true;
        let [x, y] = plot.ranges();
        assert_eq!(x, y);
    }

    const FRAME: (DVec2, DVec2) = (DVec2::ZERO, DVec2::new(200.0, 100.0));
    const SIZE: DVec2 = DVec2::new(60.0, 12.0);

    fn placed(points: &[[f64; 2]]) -> Vec<Option<DVec2>> {
        let marks: Vec<DVec2> = points.iter().map(|&point| point.into()).collect();
        let labels: Vec<PointLabel> = marks.iter().map(|&at| PointLabel { at, size: SIZE }).collect();
        place_labels(&labels, &marks, FRAME)
    }

    #[test]
    fn labels_are_in_the_plot_and_clear_of_each_other_and_of_marks() {
        let points = [[10.0, 50.0], [12.0, 54.0], [190.0, 95.0], [198.0, 4.0], [100.0, 50.0]];
        let corners: Vec<DVec2> = placed(&points).into_iter().map(Option::unwrap).collect();
        for (index, &corner) in corners.iter().enumerate() {
            assert!(
                corner.cmpge(FRAME.0).all() && (corner + SIZE).cmple(FRAME.1).all(),
                "{corner}"
            );
            for &other in &corners[..index] {
                assert!(
                    !overlap((corner, corner + SIZE), (other, other + SIZE)),
                    "{corner} {other}"
                );
            }
            for &point in &points {
                let mark = DVec2::from(point);
                assert!(
                    !overlap((corner, corner + SIZE), (mark - 1.0, mark + 1.0)),
                    "{corner} {mark}"
                );
            }
        }
    }

    #[test]
    fn a_label_keeps_clear_of_a_line_through_its_point() {
        let (at, line) = (DVec2::new(100.0, 6.0), [DVec2::new(20.0, 6.0), DVec2::new(180.0, 6.0)]);
        let marks: Vec<DVec2> = along(&line).collect();
        assert_eq!((marks[0], *marks.last().unwrap()), (line[0], line[1]));
        let corner = place_labels(&[PointLabel { at, size: SIZE }], &marks, FRAME)[0].unwrap();
        assert!(corner.y > 6.0, "below, because there is no room above: {corner}");
    }

    #[test]
    fn a_label_without_room_is_left_out() {
        let crowd = vec![[100.0, 50.0]; 30];
        let corners = placed(&crowd);
        assert!(corners[0].is_some() && corners[29].is_none());
    }

    #[test]
    fn thinning_keeps_both_ends() {
        let thin: Vec<usize> = thinned_places(12_345).collect();
        assert!(thin.len() <= MAX_POINTS + 1);
        assert_eq!((thin[0], thin[thin.len() - 1]), (0, 12_344));
        assert_eq!(thinned_places(1).collect::<Vec<_>>(), [0]);
        assert_eq!(thinned_places(0).count(), 0);
    }
}
