//! The figure of what the readings of each row determine.

use super::{
    axis::{PlotAxis, TickRule},
    look::{Hue, Key, LineStyle, Look, Marker},
    plot::{LineAt, Plot, ReferenceLine, Series},
    plot_figure::PlotFigure,
};
use decoupler_core::sensor::Identifiability;

/// Values below the largest by this factor are rounding.
const ROUNDING: f64 = 1e-16;

/// Singular values of every row, from the best-seen deformation pattern to the worst. `worst` is the index of the row
/// drawn strongest; noise hides the patterns whose value is below `hidden_below_per_mm`, 0 without noise.
pub fn singular_values_figure(rows: &[Identifiability], worst: usize, hidden_below_per_mm: f64) -> PlotFigure {
    let strong = Look::marker(Hue::Blue, Marker::Disc).joined();
    let pale = Look::line(Hue::Grey, LineStyle::Fine);
    let others = rows.iter().enumerate().filter(|(index, _)| *index != worst);
    let others = others.map(|(_, row)| Series::new(format!("row {}", row.row + 1), pale, numbered(row)));
    let strongest = rows.get(worst).map(|row| {
        let name = format!("row {}, worst", row.row + 1);
        Series::new(name, strong, numbered(row))
    });
    let series: Vec<Series> = others.chain(strongest).collect();
    let mut keys = vec![Key::new("worst row", strong)];
    if rows.len() > 1 {
        keys.push(Key::new("other rows", pale));
    }
    let mut lines = Vec::new();
    if hidden_below_per_mm > 0.0 {
        let (name, hue, style) = ("noise hides values below", Hue::Orange, LineStyle::Dashed);
        lines.push(ReferenceLine::new(name, LineAt::Y(hidden_below_per_mm), hue, style));
        keys.push(Key::new(name, Look::line(hue, style)));
    }
    let unknowns = rows.get(worst).map_or(1, Identifiability::unknowns);
    let x = PlotAxis::linear("deformation pattern, best seen first").including([0.5, unknowns as f64 + 0.5]);
    let y = PlotAxis::logarithmic("singular value of ∂ ln R/∂u (1/mm)");
    PlotFigure {
        plots: vec![Plot {
            lines,
            ..Plot::new(x.ticked(TickRule::Whole), y, series)
        }],
        keys,
        notes: Vec::new(),
    }
}

/// Number of the pattern from 1, and its value; without those that are rounding.
fn numbered(row: &Identifiability) -> Vec<[f64; 2]> {
    let values = &row.singular_values_per_mm;
    let least = ROUNDING * values.first().copied().unwrap_or(0.0);
    let numbered = values.iter().enumerate().filter(|&(_, &value)| value > least);
    numbered.map(|(number, value)| [number as f64 + 1.0, *value]).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use decoupler_core::sensor::{Axes, SensorModel};

    #[test]
    fn patterns_that_are_not_seen_have_no_place_on_a_logarithmic_axis() {
        let model = SensorModel::new("2x6_3x4".parse().unwrap());
        let row = Identifiability::of_row(&model, 0, &[DVec3::ZERO; 6], Axes::Z).unwrap();
        let points = numbered(&row);
        assert_eq!((row.unknowns(), points.len()), (6, 4));
        assert_eq!(points[0], [1.0, row.singular_values_per_mm[0]]);
        let quiet = singular_values_figure(std::slice::from_ref(&row), 0, 0.0);
        assert_eq!((quiet.keys.len(), quiet.plots[0].lines.len()), (1, 0));
        assert_eq!(singular_values_figure(&[row.clone(), row], 1, 0.1).keys.len(), 3);
        assert!(singular_values_figure(&[], 0, 0.0).plots[0].series.is_empty());
    }
}
