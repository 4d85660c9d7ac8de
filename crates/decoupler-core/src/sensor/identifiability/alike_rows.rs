use glam::DVec3;

use super::Identifiability;
use crate::sensor::{RelativeNoise, SensorError, SensorModel};

/// Two row-wires whose undeformed readings are most alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowPair {
    /// One row-wire, from 0.
    pub first: usize,
    /// The other.
    pub second: usize,
    /// rms over readings of the difference of ln R, as far as an error common to all readings leaves it.
    pub difference: f64,
}

impl Identifiability {
    /// Rows whose undeformed readings differ less than this count as the same even without noise.
    pub const SAME_ROWS: f64 = 1e-9;

    /// The two row-wires whose undeformed readings are most alike; `None` for a single row-wire.
    ///
    /// A layout that is symmetric about a line between row-wires gives mirror rows the same readings: no decoder can
    /// tell which one it reads unless the electronics say so. Of readings with a common error in their `noise`, such as the
    /// gain of a snapshot, a difference that is common to all of them counts only as far as that error leaves it.
    ///
    /// # Errors
    /// The undeformed sensor has no resistance.
    pub fn most_alike_rows(model: &SensorModel, noise: RelativeNoise) -> Result<Option<RowPair>, SensorError> {
        let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        let readings: Vec<Vec<f64>> = (0..model.scale.rows())
            .map(|row| model.row_resistances(row, &rest))
            .collect::<Result<_, _>>()?;
        let weight = noise.weight_of_mean(model.scale.columns());
        let mut closest: Option<RowPair> = None;
        for (second, of_second) in readings.iter().enumerate() {
            for (first, of_first) in readings[..second].iter().enumerate() {
                let differences = of_first.iter().zip(of_second).map(|(a, b)| (a / b).ln());
                let hidden = (1.0 - weight) * differences.clone().sum::<f64>() / of_first.len() as f64;
                let squares = differences.map(|difference| (difference - hidden).powi(2));
                let difference = (squares.sum::<f64>() / of_first.len() as f64).sqrt();
                if closest.is_none_or(|pair| difference < pair.difference) {
                    closest = Some(RowPair {
                        first,
                        second,
                        difference,
                    });
                }
            }
        }
        Ok(closest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::Axes;

    #[test]
    fn mirror_rows_are_found_and_named() {
        let mut model = SensorModel::new("10x6_3x18".parse().unwrap());
        let default = Identifiability::most_alike_rows(&model, RelativeNoise::default())
            .unwrap()
            .unwrap();
        assert!(default.difference > 1e-3, "{default:?}");
        // Column nodes at 7.5, 12.5, 17.5 are symmetric about x = 12.5, the middle of rows 8 to 17.
        model.geometry.column_node_x0_mm = 7.5;
        let pair = Identifiability::most_alike_rows(&model, RelativeNoise::default())
            .unwrap()
            .unwrap();
        assert!(pair.difference < 1e-14, "{pair:?}");
        assert_eq!(pair.first + pair.second, 9);
        let warnings = Identifiability::of_row(&model, 0, &[DVec3::ZERO; 6], Axes::Z)
            .unwrap()
            .warnings(0.0, 0.3, Some(pair));
        let words = warnings[0].to_string();
        assert!(
            words.contains("cannot be told apart") && words.contains("shift"),
            "{words}"
        );
        assert_eq!(
            Identifiability::most_alike_rows(&SensorModel::new("1x6_3x18".parse().unwrap()), RelativeNoise::default()),
            Ok(None)
        );
    }
}
