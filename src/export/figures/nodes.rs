use super::{
    colours::Hue,
    plot::{Marker, Plot, PlotPoint, Series},
    plot_axis::PlotAxis,
};

/// The paper's Fig. 6: z of every node, row by row, in millimetres; true as squares, decoupled as discs, each with a
/// bar of ± `spread_mm` if it is given.
pub fn node_plot(actual_mm: &[f64], decoupled_mm: &[f64], spread_mm: Option<&[f64]>) -> Plot {
    let points = |z_mm: &[f64], spread_mm: Option<&[f64]>| {
        let numbered = z_mm.iter().enumerate();
        let point = |(node, &y): (usize, &f64)| PlotPoint {
            x: (node + 1) as f64,
            y,
            bar: spread_mm
                .and_then(|spread| spread.get(node))
                .map(|spread| [y - spread, y + spread]),
        };
        numbered.map(point).collect()
    };
    let series = |name: &str, hue, marker, points| Series {
        name: name.to_owned(),
        hue,
        has_line: false,
        is_dashed: false,
        marker: Some(marker),
        points,
    };
    Plot {
        x: PlotAxis::linear("node, row by row"),
        y: PlotAxis::linear("z (mm)"),
        series: vec![
            series("true", Hue::Blue, Marker::Square, points(actual_mm, None)),
            series("decoupled", Hue::Red, Marker::Disc, points(decoupled_mm, spread_mm)),
        ],
        spans: Vec::new(),
        width_pt: Plot::WIDE_PT,
    }
}
