//! Limits of what charts over epochs draw, so that a diverged training leaves the rest of its curves readable.

use crate::training::EpochRecord;

/// Factor above the error or gradient of the start from which a curve is drawn at the edge.
const MOST_GROWTH: f64 = 1e3;
/// Learning rates, dampings and scales beyond these are drawn at the edge.
const PARAMETERS: std::ops::RangeInclusive<f64> = 1e-20..=1e12;

/// Largest error drawn.
pub fn highest_mse(history: &[EpochRecord]) -> f64 {
    highest(history.first().map(|start| start.training_mse))
}

/// Largest gradient drawn.
pub fn highest_gradient(history: &[EpochRecord]) -> f64 {
    highest(history.first().map(|start| start.gradient_norm))
}

/// The parameter of a method as it is drawn.
pub fn drawn_parameter(value: f64) -> f64 {
    if value > 0.0 {
        value.clamp(*PARAMETERS.start(), *PARAMETERS.end())
    } else {
        value
    }
}

fn highest(at_start: Option<f64>) -> f64 {
    let highest = MOST_GROWTH * at_start.unwrap_or(0.0);
    if highest > 0.0 { highest } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_a_diverged_training_spans_what_can_be_read() {
        let epoch = |epoch, training_mse: f64| EpochRecord {
            epoch,
            training_mse,
            validation_mse: None,
            test_mse: None,
            gradient_norm: training_mse,
            parameter: 1e300,
            effective_parameters: None,
            validation_failures: 0,
        };
        let history = [epoch(0, 1.5), epoch(1, 0.5), epoch(2, 1e300)];
        assert_eq!((highest_mse(&history), highest_gradient(&history)), (1500.0, 1500.0));
        assert_eq!(
            highest_mse(&[epoch(0, 0.0)]),
            f64::INFINITY,
            "a start without error sets no scale"
        );
        assert_eq!(highest_mse(&[]), f64::INFINITY);
        assert_eq!([1e300, 1e-300, 0.1, 0.0].map(drawn_parameter), [1e12, 1e-20, 0.1, 0.0]);
    }
}
