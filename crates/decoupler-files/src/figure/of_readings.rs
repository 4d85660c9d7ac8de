//! The figure of the readings of a frame.

use ndarray::Array2;

use super::{axis::PlotAxis, colour_map::SequentialMap, heat_map::HeatMap};

/// Readings of a frame, rows × columns, as what they say about it: their drop below the unloaded state.
///
/// `drops_percent` is 100 (1 − R/R₀), in percent of the unloaded resistance; `rows` are the row-wires read, from 0. Colours
/// span 0 to `largest_percent`, so that they mean the same from frame to frame; what is beyond has the end's colour.
pub fn readings_figure(drops_percent: Array2<f64>, rows: &[usize], largest_percent: f64) -> HeatMap {
    let axis = PlotAxis::linear("drop from unloaded (%)").including([0.0, largest_percent]);
    of_wires(drops_percent, rows, axis.limited(0.0..=largest_percent))
}

/// Gains of the unloaded state, rows × columns, as their difference from 1 in percent; `rows` as for [`readings_figure`].
pub fn zero_gains_figure(gains: &Array2<f64>, rows: &[usize]) -> HeatMap {
    let percent = gains.mapv(|gain| 100.0 * (gain - 1.0));
    of_wires(percent, rows, PlotAxis::linear("gain − 1, unloaded (%)"))
}

fn of_wires(values: Array2<f64>, rows: &[usize], value_axis: PlotAxis) -> HeatMap {
    HeatMap {
        colours: SequentialMap::default(),
        x_name: "column-wire".to_owned(),
        y_name: "row-wire".to_owned(),
        columns: (1..=values.ncols()).map(|column| column.to_string()).collect(),
        rows: rows.iter().map(|row| (row + 1).to_string()).collect(),
        notes: Array2::default(values.dim()),
        values,
        value_axis,
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn colours_of_readings_mean_the_same_from_frame_to_frame() {
        let [slight, strong] = [0.4, 30.0].map(|drop| readings_figure(array![[0.0, drop], [-1.0, 2.0]], &[0, 4], 5.0));
        assert_eq!((slight.range(), strong.range()), (0.0..=5.0, 0.0..=5.0));
        assert_eq!(strong.colour_share(30.0, &strong.range()), Some(1.0));
        assert_eq!(strong.colour_share(-1.0, &strong.range()), Some(0.0));
        assert_eq!(
            (slight.rows, slight.columns),
            (vec!["1".into(), "5".into()], vec!["1".into(), "2".into()])
        );
    }

    #[test]
    fn gains_are_told_by_their_difference_from_one() {
        let figure = zero_gains_figure(&array![[1.02, 0.99]], &[0]);
        assert!((figure.values[[0, 0]] - 2.0).abs() < 1e-12 && (figure.values[[0, 1]] + 1.0).abs() < 1e-12);
        assert_eq!(figure.range(), figure.values[[0, 1]]..=figure.values[[0, 0]]);
    }
}
