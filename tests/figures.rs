//! Figures for print: what is drawn is what was given, on every machine alike.

#![cfg(feature = "figures")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use decoupler::export::figures::{
    HeatMap, Hue, Marker, Picture, PictureFormat, Plot, PlotAxis, PlotPoint, Series, node_plot,
};
use image::GenericImageView as _;
use ndarray::Array2;

fn scatter(marker: Marker, values: &[(f64, f64)]) -> Series {
    let points = values.iter().map(|&(x, y)| PlotPoint { x, y, bar: None });
    Series {
        name: "series".to_owned(),
        hue: Hue::Blue,
        has_line: false,
        is_dashed: false,
        marker: Some(marker),
        points: points.collect(),
    }
}

fn plot(y: PlotAxis, series: Vec<Series>) -> Picture {
    let plot = Plot {
        x: PlotAxis::linear("across"),
        y,
        series,
        spans: Vec::new(),
        width_pt: Plot::WIDTH_PT,
    };
    plot.draw()
}

fn count(picture: &Picture, what: &str) -> usize {
    picture.svg().matches(what).count()
}

/// Centres of the discs, in points.
fn discs(picture: &Picture) -> Vec<[f64; 2]> {
    let number = |line: &str, name: &str| -> f64 {
        let rest = line.split(&format!("{name}=\"")).nth(1).unwrap();
        rest.split('"').next().unwrap().parse().unwrap()
    };
    let lines = picture.svg().lines().filter(|line| line.starts_with("<circle"));
    lines.map(|line| [number(line, "cx"), number(line, "cy")]).collect()
}

#[test]
fn points_stand_where_their_values_are() {
    let picture = plot(
        PlotAxis::linear("up"),
        vec![scatter(Marker::Disc, &[(0.0, 1.0), (1.0, 2.0), (2.0, 4.0)])],
    );
    // The last disc is the sample beside the plot.
    let [a, b, c, _] = discs(&picture).try_into().unwrap();
    assert!((b[0] - 0.5 * (a[0] + c[0])).abs() < 0.02, "evenly spaced across");
    assert!(a[1] > b[1] && b[1] > c[1], "larger values are higher");
    assert!(((b[1] - c[1]) / (a[1] - b[1]) - 2.0).abs() < 0.01);

    let decades = [(0.0, 1e-4), (1.0, 1e-2), (2.0, 1.0)];
    let picture = plot(PlotAxis::logarithmic("up"), vec![scatter(Marker::Disc, &decades)]);
    let [a, b, c, _] = discs(&picture).try_into().unwrap();
    assert!(((b[1] - c[1]) - (a[1] - b[1])).abs() < 0.02, "decades are equally high");
}

#[test]
fn what_has_no_place_is_left_out() {
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
    // Nothing, one value, and values that differ by rounding only.
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
fn node_plots_have_a_square_and_a_disc_for_each_node_and_bars_on_demand() {
    let (actual, decoupled) = ([4.1, 4.5, 4.9], [4.2, 4.4, 4.9]);
    let plain = node_plot(&actual, &decoupled, None).draw();
    assert_eq!(discs(&plain).len(), 3 + 1);
    let with_bars = node_plot(&actual, &decoupled, Some(&[0.1, 0.2, 0.3])).draw();
    let lines = |picture: &Picture| count(picture, "<polyline");
    assert!(lines(&with_bars) >= lines(&plain) + 3 * 3, "a line and two ends each");
}

#[test]
fn png_has_300_dots_an_inch_and_text_from_the_programs_own_fonts() {
    let picture = plot(PlotAxis::linear("up"), vec![scatter(Marker::Square, &[(0.0, 1.0)])]);
    let png = image::load_from_memory(&picture.png().unwrap()).unwrap();
    assert_eq!(f64::from(png.width()), Plot::WIDTH_PT / 72.0 * 300.0);
    assert_eq!(png.get_pixel(0, 0).0, [255; 4], "the ground is white");
    // The name of the x axis: ink in the lowest strip of the picture, where nothing but text is.
    let strip = (png.height() - 80..png.height()).flat_map(|y| (0..png.width()).map(move |x| (x, y)));
    let ink = strip.filter(|&(x, y)| png.get_pixel(x, y).0[0] < 100).count();
    assert!(ink > 200, "{ink} dark pixels");
}

#[test]
fn heat_maps_say_each_value_in_its_cell() {
    let values = Array2::from_shape_vec((2, 2), vec![1.0, 2.5, f64::NAN, 4.0]).unwrap();
    let map = HeatMap {
        x_name: "hidden nodes".to_owned(),
        y_name: "array".to_owned(),
        columns: vec!["6".to_owned(), "8".to_owned()],
        rows: vec!["a < b & c".to_owned(), "d".to_owned()],
        values,
        value_axis: PlotAxis::linear("Z error (%)"),
    };
    let picture = map.draw();
    for text in [
        "1.00",
        "2.50",
        "–",
        "4.00",
        "a &lt; b &amp; c",
        "hidden nodes",
        "Z error (%)",
    ] {
        assert!(picture.svg().contains(&format!(">{text}</text>")), "{text}");
    }
    picture.png().unwrap();
    let empty = HeatMap {
        columns: Vec::new(),
        rows: Vec::new(),
        values: Array2::zeros((0, 0)),
        ..map
    };
    empty.draw().png().unwrap();
}

#[test]
fn colours_of_a_heat_map_go_by_the_logarithm_if_told() {
    let map = |values: [f64; 3], value_axis| HeatMap {
        x_name: String::new(),
        y_name: String::new(),
        columns: vec![String::new(); 3],
        rows: vec![String::new()],
        values: Array2::from_shape_vec((1, 3), values.to_vec()).unwrap(),
        value_axis,
    };
    let cells = |map: HeatMap| -> Vec<String> {
        let svg = map.draw().svg().to_owned();
        let fills = svg.split("<rect").skip(1).filter(|rect| rect.contains("fill=\"#"));
        let fill = |rect: &str| rect.split("fill=\"").nth(1).unwrap()[..7].to_owned();
        fills
            .map(fill)
            .skip_while(|colour| colour == "#ffffff")
            .take(3)
            .collect()
    };
    let even = cells(map([1.0, 2.0, 3.0], PlotAxis::linear("")));
    let decades = cells(map([0.001, 0.1, 10.0], PlotAxis::logarithmic("")));
    assert_eq!(even, decades);
    assert_ne!(even, cells(map([0.001, 0.1, 10.0], PlotAxis::linear(""))));
    // A zero has no logarithm, but is the least there is.
    assert_eq!(cells(map([0.0, 1.0, 10.0], PlotAxis::logarithmic("")))[0], decades[0]);
}

#[test]
fn the_name_of_the_file_tells_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let picture = plot(PlotAxis::linear("up"), Vec::new());
    for (name, format) in [("a.svg", PictureFormat::Svg), ("b.PNG", PictureFormat::Png)] {
        let path = folder.path().join(name);
        assert_eq!(PictureFormat::of_path(&path).unwrap(), format);
        picture.save(format, &path).unwrap();
        assert!(path.metadata().unwrap().len() > 100);
    }
    let error = PictureFormat::of_path("c.bmp".as_ref()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "cannot write 'c.bmp': give a name that ends in .png or .svg"
    );
}
