//! Figures for print: the drawing matches the data, on every machine.

use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    evaluation::{Preset, TradeOffPoint, measure_trade_off},
    job::Job,
};
use decoupler_files::{
    export::figures::Picture,
    figure::{
        Figure, HeatMap, Ink, Look, Marker, Plot, PlotAxis, PlotFigure, SequentialMap, Series, TradeOffLevel,
        TradeOffLimits, node_figure, trade_off_figure,
    },
    import::Setup,
};
use glam::DVec3;
use image::GenericImageView as _;
use ndarray::Array2;
use resvg::usvg::roxmltree::{Document, Node};

fn scatter(marker: Marker, values: &[(f64, f64)]) -> Series {
    let points = values.iter().map(|&(x, y)| [x, y]);
    Series::new("series", Look::marker(Ink::Blue, marker), points)
}

fn plot(y: PlotAxis, series: Vec<Series>) -> Picture {
    let plot = Plot::new(PlotAxis::linear("across"), y, series);
    Figure::from(PlotFigure::from(plot)).draw()
}

fn count(picture: &Picture, what: &str) -> usize {
    picture.svg().matches(what).count()
}

/// Calls `read` with the elements of a kind.
fn elements<T>(picture: &Picture, kind: &str, read: impl Fn(Node<'_, '_>) -> T) -> Vec<T> {
    let document = Document::parse(picture.svg()).unwrap();
    let elements = document.descendants().filter(|node| node.has_tag_name(kind));
    elements.map(read).collect()
}

fn number(element: Node<'_, '_>, name: &str) -> f64 {
    element.attribute(name).unwrap().parse().unwrap()
}

/// Centres of the circles, in points.
fn discs(picture: &Picture) -> Vec<[f64; 2]> {
    elements(picture, "circle", |circle| {
        ["cx", "cy"].map(|name| number(circle, name))
    })
}

/// The lines of this width, each with its points as they are written.
fn lines(picture: &Picture, width: &str) -> Vec<Vec<String>> {
    let of_path = |path: Node<'_, '_>| {
        let is_wanted = path.attribute("stroke-width") == Some(width);
        let lines = path.attribute("d").unwrap_or_default().split('M').skip(1);
        let lines = lines.filter(|_| is_wanted);
        Vec::from_iter(lines.map(|line| line.split(' ').map(str::to_owned).collect()))
    };
    elements(picture, "path", of_path).concat()
}

fn texts(picture: &Picture) -> Vec<String> {
    elements(picture, "text", |text| text.text().unwrap_or_default().to_owned())
}

#[test]
fn points_are_drawn_at_their_values() {
    let picture = plot(
        PlotAxis::linear("up"),
        vec![scatter(Marker::Disc, &[(0.0, 1.0), (1.0, 2.0), (2.0, 4.0)])],
    );
    // The first disc is in the legend.
    let [_, a, b, c] = discs(&picture).try_into().unwrap();
    assert!((b[0] - 0.5 * (a[0] + c[0])).abs() < 0.02, "evenly spaced across");
    assert!(a[1] > b[1] && b[1] > c[1], "larger values are higher");
    assert!(((b[1] - c[1]) / (a[1] - b[1]) - 2.0).abs() < 0.01);

    let decades = [(0.0, 1e-4), (1.0, 1e-2), (2.0, 1.0)];
    let picture = plot(PlotAxis::logarithmic("up"), vec![scatter(Marker::Disc, &decades)]);
    let [_, a, b, c] = discs(&picture).try_into().unwrap();
    assert!(((b[1] - c[1]) - (a[1] - b[1])).abs() < 0.02, "decades are equally high");
}

#[test]
fn points_without_a_place_are_left_out() {
    let values = [
        (0.0, 1.0),
        (1.0, f64::NAN),
        (2.0, f64::INFINITY),
        (3.0, -1.0),
        (4.0, 0.0),
    ];
    let series = || vec![scatter(Marker::Disc, &values)];
    assert_eq!(discs(&plot(PlotAxis::linear("up"), series())).len(), 3 + 1);
    let picture = plot(PlotAxis::logarithmic("up"), series());
    assert_eq!(discs(&picture).len(), 1 + 1);
    assert_eq!(count(&picture, "NaN") + count(&picture, "inf"), 0);
    // No values, one value, and values that differ only by rounding.
    for values in [
        &[][..],
        &[(3.0, 0.2)],
        &[(1.0, 0.1), (2.0, 0.1 + 1e-17)],
        &[(0.0, 1e300), (1.0, -1e300)],
    ] {
        for y in [PlotAxis::linear("up"), PlotAxis::logarithmic("up")] {
            let picture = plot(y, vec![scatter(Marker::Ring, values)]);
            assert_eq!(count(&picture, "NaN") + count(&picture, "inf"), 0, "{values:?}");
            picture.png().unwrap();
        }
    }
}

#[test]
fn node_plots_have_a_square_and_a_disc_for_each_node_and_optional_bars() {
    let nodes = |z_mm: [f64; 3]| z_mm.map(|z| DVec3::new(0.0, 0.0, z));
    let (actual, decoupled) = (nodes([4.1, 4.5, 4.9]), nodes([4.2, 4.4, 4.9]));
    let draw = |spread_mm| Figure::from(node_figure(&actual, Some(&decoupled), spread_mm, 3)).draw();
    let plain = draw(None);
    assert_eq!(discs(&plain).len(), 3 + 1);
    for name in ["actual", "decoded", "node, row by row", "z (mm)"] {
        assert!(texts(&plain).iter().any(|text| text == name), "{name}");
    }
    // Below the bars the axis reaches further down, so its ticks may be others.
    let bars = |picture: &Picture| lines(picture, "1.1").len();
    let with_bars = draw(Some(&[0.1, 0.2, 0.3]));
    assert_eq!((bars(&plain), bars(&with_bars)), (0, 3 * 3), "a line and two ends each");
}

#[test]
fn png_has_300_dots_per_inch_and_text_in_the_programs_fonts() {
    let picture = plot(PlotAxis::linear("up"), vec![scatter(Marker::Square, &[(0.0, 1.0)])]);
    let png = image::load_from_memory(&picture.png().unwrap()).unwrap();
    assert_eq!(f64::from(png.width()), 510.0 / 72.0 * 300.0);
    assert_eq!(png.get_pixel(0, 0).0, [255; 4], "the background is white");
    // The name of the x axis: ink in the lowest strip of the picture, which contains only text.
    let strip = (png.height() - 80..png.height()).flat_map(|y| (0..png.width()).map(move |x| (x, y)));
    let ink = strip.filter(|&(x, y)| png.get_pixel(x, y).0[0] < 100).count();
    assert!(ink > 200, "{ink} dark pixels");
}

fn heat_map(rows: &[&str], columns: &[&str], values: &[f64], value_axis: PlotAxis) -> HeatMap {
    let shape = (rows.len(), columns.len());
    let texts = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect();
    HeatMap {
        x_name: "hidden nodes".to_owned(),
        y_name: "array".to_owned(),
        columns: texts(columns),
        rows: texts(rows),
        values: Array2::from_shape_vec(shape, values.to_vec()).unwrap(),
        notes: Array2::default(shape),
        value_axis,
        colours: SequentialMap::default(),
    }
}

#[test]
fn heat_maps_have_each_value_in_its_cell_and_logarithmic_colours_on_request() {
    let axis = PlotAxis::linear("Z error (%)");
    let map = heat_map(
        &["a < b & c", "d"],
        &["6", "8"],
        &[1.0, 2.5, f64::NAN, 4.0],
        axis.clone(),
    );
    let picture = Figure::from(map).draw();
    for word in ["1.00", "2.50", "–", "4.00", "a < b & c", "hidden nodes", "Z error (%)"] {
        assert!(texts(&picture).iter().any(|text| text == word), "{word}");
    }
    picture.png().unwrap();
    Figure::from(heat_map(&[], &[], &[], axis)).draw().png().unwrap();

    let colours = |values: [f64; 3], axis| -> Vec<String> {
        let fill = |path: Node<'_, '_>| path.attribute("fill").unwrap_or_default().to_owned();
        let map = heat_map(&[""], &["", "", ""], &values, axis);
        elements(&Figure::from(map).draw(), "path", fill)[..3].to_vec()
    };
    let even = colours([1.0, 2.0, 3.0], PlotAxis::linear(""));
    let decades = colours([0.001, 0.1, 10.0], PlotAxis::logarithmic(""));
    assert_eq!(even, decades);
    assert_ne!(even, colours([0.001, 0.1, 10.0], PlotAxis::linear("")));
    // A zero has no logarithm; it is drawn as the minimum.
    assert_eq!(colours([0.0, 1.0, 10.0], PlotAxis::logarithmic(""))[0], decades[0]);
}

#[test]
fn the_file_extension_determines_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let picture = plot(PlotAxis::linear("up"), Vec::new());
    for (name, start) in [("a.svg", &b"<svg"[..]), ("b.PNG", b"\x89PNG")] {
        let path = folder.path().join(name);
        picture.save(&path).unwrap();
        assert!(std::fs::read(path).unwrap().starts_with(start), "{name}");
    }
    let error = picture.save("c.bmp".as_ref()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "cannot write 'c.bmp': give a name that ends in .png or .svg"
    );
}

#[test]
fn hollow_marks_of_the_trade_off_mean_32_bits_and_nothing_else() {
    let mut points = Vec::new();
    for preset in Preset::ALL {
        let mut settings = preset.settings();
        let simulation = settings.simulation_mut().unwrap();
        simulation.sensor.scale = "4x4_2x12".parse().unwrap();
        (
            simulation.samples,
            simulation.validation_samples,
            simulation.test_samples,
        ) = (100, 20, 20);
        settings.training.stopping.epochs = 2;
        let on_point = |_, point: Result<_, _>, _: Option<&_>| {
            points.push(TradeOffPoint {
                preset: Some(preset),
                ..point.unwrap()
            });
        };
        let kinds = [DecoderKind::Ridge, DecoderKind::Network];
        let sets = Setup::from(settings).sets("".as_ref(), &Job::UNINTERRUPTED, &mut |_| ());
        let sets = sets.unwrap().sets;
        measure_trade_off(&settings, &sets, &[3], &kinds, &Job::UNINTERRUPTED, on_point).unwrap();
    }
    let is_single = |single: bool| {
        let of_bits = points
            .iter()
            .filter(|point| (point.report.precision == Precision::Single) == single);
        of_bits.count()
    };
    let (hollow, filled) = (is_single(true), is_single(false));
    assert_eq!((hollow, filled), (2, 4));
    // Unreachable limits: no answers, whose rings would be hollow too.
    let limits = TradeOffLimits {
        percent: 0.0,
        microseconds: 0.0,
    };
    let level = TradeOffLevel {
        noise: Some(0.0),
        points,
    };
    let figure = trade_off_figure(&level, &limits);
    for plot in &figure.plots {
        let marked = plot.series.iter().filter(|series| series.look.marker.is_some());
        let points: Vec<_> = marked.flat_map(|series| &series.points).collect();
        for point in &points {
            let is_beaten = points.iter().any(|other| {
                let is_as_good = other.x <= point.x && other.y <= point.y;
                is_as_good && (other.x < point.x || other.y < point.y)
            });
            assert_eq!(
                point.label.is_some(),
                !is_beaten,
                "points of the front are named: {point:?}"
            );
        }
    }
    let picture = Figure::from(figure).draw();
    let rings = elements(&picture, "circle", |circle| circle.attribute("fill") == Some("none"));
    let hollow_discs = rings.iter().filter(|is_hollow| **is_hollow).count();
    let closed = lines(&picture, "1.4")
        .into_iter()
        .filter(|line| line.first() == line.last());
    // Each in both plots.
    assert_eq!((hollow_discs, closed.count()), (2, 2), "discs and diamonds");
    let areas = elements(&picture, "path", |path| path.attribute("fill") != Some("none"));
    let diamonds = areas.into_iter().filter(|is_area| *is_area).count();
    let filled_marks = (rings.len() - hollow_discs) + diamonds;
    // In the legend each decoder has one.
    assert_eq!(filled_marks, 2 * filled + 2);
    let note = "Discs: paper preset, diamonds: best preset, hollow: 32 bits.";
    for name in ["Ridge", "Network", note] {
        assert!(
            texts(&picture).iter().any(|text| text == name),
            "{name}: {:?}",
            texts(&picture)
        );
    }
}
