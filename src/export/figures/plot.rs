use super::{
    canvas::{Anchor, Area, At, CHARACTER, Canvas, Stroke, TEXT},
    colours::{BAND, DIM, Hue, INK},
    frame::Frame,
    picture::Picture,
    plot_axis::PlotAxis,
};

/// A plot of series of points: curves, scatter, or both.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Across.
    pub x: PlotAxis,
    /// Up.
    pub y: PlotAxis,
    /// Drawn in this order.
    pub series: Vec<Series>,
    /// Marked values of x, behind the series.
    pub spans: Vec<Span>,
    /// Across, in points (1/72 inch).
    pub width_pt: f64,
}

/// Points that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Stands beside the plot.
    pub name: String,
    /// Its colour.
    pub hue: Hue,
    /// A line from point to point.
    pub has_line: bool,
    /// True for a dashed line.
    pub is_dashed: bool,
    /// At each point.
    pub marker: Option<Marker>,
    /// In the order in which the line runs.
    pub points: Vec<PlotPoint>,
}

/// A point of a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotPoint {
    /// Across.
    pub x: f64,
    /// Up.
    pub y: f64,
    /// Ends of its error bar.
    pub bar: Option<[f64; 2]>,
}

/// Symbol at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// A hollow square.
    Square,
    /// A filled disc.
    Disc,
    /// A hollow circle.
    Ring,
}

/// A marked stretch of the x axis, or a single value.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// Stands beside the plot.
    pub name: String,
    /// Its beginning.
    pub from: f64,
    /// Its end; the same for a single value.
    pub to: f64,
}

impl Plot {
    /// Two thirds of a page.
    pub const WIDTH_PT: f64 = 360.0;
    /// A whole page.
    pub const WIDE_PT: f64 = 510.0;

    const HEIGHT: f64 = 230.0;
    const LEFT: f64 = 50.0;
    const TOP: f64 = 12.0;
    const BOTTOM: f64 = 36.0;
    const RIGHT: f64 = 12.0;

    /// Draws the figure.
    pub fn draw(&self) -> Picture {
        let mut canvas = Canvas::new(self.width_pt, Self::HEIGHT);
        let area = Area {
            left: Self::LEFT,
            top: Self::TOP,
            width: self.width_pt - Self::LEFT - Self::RIGHT - self.legend_width(),
            height: Self::HEIGHT - Self::TOP - Self::BOTTOM,
        };
        let points = || self.series.iter().flat_map(|series| &series.points);
        let ends = self.spans.iter().flat_map(|span| [span.from, span.to]);
        let x = points().map(|point| point.x).chain(ends);
        let y = points().flat_map(|point| std::iter::once(point.y).chain(point.bar.into_iter().flatten()));
        let frame = Frame {
            area,
            x: (&self.x, self.x.range(x.filter_map(|value| self.x.place(value)))),
            y: (&self.y, self.y.range(y.filter_map(|value| self.y.place(value)))),
        };
        self.draw_spans(&frame, &mut canvas);
        frame.draw(&mut canvas);
        canvas.clipped(area, |canvas| {
            for series in &self.series {
                series.draw(&frame, canvas);
            }
        });
        self.draw_legend(area, &mut canvas);
        canvas.finish()
    }

    fn draw_spans(&self, frame: &Frame<'_>, canvas: &mut Canvas) {
        let area = frame.area;
        for span in &self.spans {
            let (Some(from), Some(to)) = (self.x.place(span.from), self.x.place(span.to)) else {
                continue;
            };
            let [left, right] = [from, to].map(|place| frame.x_at(place));
            if right > left {
                let band = Area {
                    left,
                    width: right - left,
                    ..area
                };
                canvas.block(band, BAND);
            } else {
                canvas.line([left, area.top], [left, area.bottom()], Stroke::new(DIM, 0.8).dashed());
            }
        }
    }

    fn names(&self) -> impl Iterator<Item = &String> {
        let series = self.series.iter().map(|series| &series.name);
        series.chain(self.spans.iter().map(|span| &span.name))
    }

    fn legend_width(&self) -> f64 {
        let longest = self.names().map(|name| name.chars().count()).max();
        longest.map_or(0.0, |characters| 34.0 + CHARACTER * characters as f64)
    }

    /// Beside the plot, so that it covers nothing.
    fn draw_legend(&self, area: Area, canvas: &mut Canvas) {
        let (left, right) = (area.right() + 10.0, area.right() + 28.0);
        for (line, name) in self.names().enumerate() {
            let y = area.top + 0.5 * TEXT + 1.6 * TEXT * line as f64;
            match self.series.get(line) {
                Some(series) => series.draw_sample([left, y], [right, y], canvas),
                None => {
                    let span = &self.spans[line - self.series.len()];
                    if span.to > span.from {
                        let sample = Area {
                            left,
                            top: y - 0.5 * TEXT,
                            width: right - left,
                            height: TEXT,
                        };
                        canvas.block(sample, BAND);
                    } else {
                        canvas.line([left, y], [right, y], Stroke::new(DIM, 0.8).dashed());
                    }
                }
            }
            canvas.text([right + 5.0, y], Anchor::Start, INK, name);
        }
    }
}

impl Series {
    fn stroke(&self) -> Stroke {
        let stroke = Stroke::new(self.hue.rgb(), 1.1);
        if self.is_dashed { stroke.dashed() } else { stroke }
    }

    fn draw(&self, frame: &Frame<'_>, canvas: &mut Canvas) {
        let placed = self.points.iter().map(|point| (point, frame.at(point.x, point.y)));
        let placed: Vec<(&PlotPoint, Option<At>)> = placed.collect();
        if self.has_line {
            // A missing point leaves a gap.
            for stretch in placed.split(|(_, at)| at.is_none()).filter(|stretch| stretch.len() > 1) {
                let line: Vec<At> = stretch.iter().filter_map(|(_, at)| *at).collect();
                canvas.polyline(&line, self.stroke());
            }
        }
        for (point, at) in &placed {
            if let (Some(at), Some(ends)) = (at, point.bar) {
                self.draw_bar(frame, at[0], ends, canvas);
            }
        }
        for at in placed.iter().filter_map(|(_, at)| *at) {
            self.draw_marker(at, canvas);
        }
    }

    fn draw_bar(&self, frame: &Frame<'_>, x: f64, ends: [f64; 2], canvas: &mut Canvas) {
        let axis = &frame.y;
        // What a logarithmic axis has no place for lies below its lower end.
        let [low, high] = ends.map(|end| frame.y_at(axis.0.place(end).unwrap_or(*axis.1.start())));
        let stroke = Stroke::new(self.hue.rgb(), 0.8);
        canvas.line([x, low], [x, high], stroke);
        for y in [low, high] {
            canvas.line([x - 2.0, y], [x + 2.0, y], stroke);
        }
    }

    fn draw_marker(&self, at: At, canvas: &mut Canvas) {
        const HALF: f64 = 2.6;
        let colour = self.hue.rgb();
        match self.marker {
            Some(Marker::Square) => {
                let square = Area {
                    left: at[0] - HALF,
                    top: at[1] - HALF,
                    width: 2.0 * HALF,
                    height: 2.0 * HALF,
                };
                canvas.outline(square, Stroke::new(colour, 1.0));
            }
            Some(Marker::Disc) => canvas.disc(at, 2.1, colour, None),
            Some(Marker::Ring) => canvas.ring(at, HALF, Stroke::new(colour, 1.0)),
            None => {}
        }
    }

    fn draw_sample(&self, from: At, to: At, canvas: &mut Canvas) {
        if self.has_line {
            canvas.line(from, to, self.stroke());
        }
        self.draw_marker([0.5 * (from[0] + to[0]), from[1]], canvas);
    }
}
