use ndarray::{ArrayView1, ArrayView2};

/// Errors of the last digits of a reading, in units of its last place: those of a computed resistance, and of the
/// arithmetic that follows.
const LAST_PLACES: f64 = 4.0;

/// Returns the smallest standard deviation of each channel of `readings` (samples × channels), in their unit, that is more
/// than rounding: that of the last digits; or, where all readings of a channel are whole steps of a converter or of
/// printed decimals, that of a single sample one step off, and of few samples that of rounding itself, step/√12.
pub(super) fn rounding(readings: ArrayView2<'_, f64>) -> Vec<f64> {
    let of_channel = |channel: ArrayView1<'_, f64>| {
        let digits = LAST_PLACES * f64::EPSILON * root_mean_square(channel.iter().map(|value| value.abs()));
        digits.max(step(channel).unwrap_or(0.0) / (channel.len() as f64).max(12.0).sqrt())
    };
    readings.columns().into_iter().map(of_channel).collect()
}

/// Returns the step of which the values of a channel are whole multiples, up to a common offset.
fn step(channel: ArrayView1<'_, f64>) -> Option<f64> {
    /// Distance from whole steps, in steps, of values that count as whole: by chance, one value in 500 is so close.
    const TOLERANCE: f64 = 1e-3;
    /// Fewest distinct values that are not whole steps by chance.
    const FEWEST: usize = 4;
    let mut values = channel.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let repeats = channel.len() - values.len();
    let (&lowest, &highest) = (values.first()?, values.last()?);
    let gaps = values.windows(2).map(|pair| pair[1] - pair[0]);
    let step = gaps.min_by(f64::total_cmp)?;
    // Readings that never repeat have too many values for their steps to matter, or too few to be sure of.
    if values.len() < FEWEST && repeats == 0 {
        return None;
    }
    let rounding = LAST_PLACES * f64::EPSILON * lowest.abs().max(highest.abs());
    let is_whole = |value: &f64| {
        let steps = (value - lowest) / step;
        (steps - steps.round()).abs() < TOLERANCE
    };
    (rounding < TOLERANCE * step && values.iter().all(is_whole)).then_some(step)
}

/// Root mean square of finite values of at least 0, without overflow.
pub(super) fn root_mean_square(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let count = values.len().max(1) as f64;
    let largest = values.clone().fold(0.0, f64::max);
    if largest > 0.0 {
        largest * (values.map(|value| (value / largest).powi(2)).sum::<f64>() / count).sqrt()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    #[test]
    fn steps_of_a_converter_and_decimals_are_found_and_others_are_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let draw: Vec<f64> = (0..200).map(|_| rng.random_range(20.0..45.0)).collect();
        let step_ohm = 91.8 / 64.0;
        let readings = Array2::from_shape_fn((200, 4), |(sample, channel)| match channel {
            0 => draw[sample],
            1 => (draw[sample] / step_ohm).round() * step_ohm,
            2 => format!("{:.1}", draw[sample]).parse().unwrap(),
            _ => 31.7,
        });
        let found = rounding(readings.view());
        let expected = [0.0, step_ohm / 200.0_f64.sqrt(), 0.1 / 200.0_f64.sqrt(), 0.0];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            assert!(found > 0.0);
        }
    }

    #[test]
    fn one_sample_one_step_off_is_the_most_that_counts_as_rounding() {
        for off in [1, 2] {
            let readings = Array2::from_shape_fn((100, 1), |(sample, _)| 31.0 + if sample < off { 0.25 } else { 0.0 });
            let deviation = readings.std(0.0);
            assert_eq!(rounding(readings.view())[0] > deviation, off == 1, "{off}");
        }
    }

    #[test]
    fn few_or_no_samples_have_no_steps() {
        for samples in 0..4 {
            let readings = Array2::from_shape_fn((samples, 1), |(sample, _)| 3.0 + (sample as f64).sqrt());
            assert!(rounding(readings.view())[0] < 1e-14);
        }
    }
}
