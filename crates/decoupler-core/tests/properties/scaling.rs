//! Scalings of readings and targets, and their inverses.

use decoupler_core::{
    network::{InputChoice, Inputs, MinMax, Quantity, ScalingChoice},
    scene::NoiseSource,
};
use ndarray::{Array2, Axis};
use proptest::prelude::*;

use crate::cases;

/// Samples × channels; each channel has its own magnitude and offset, and one may be constant.
fn tables() -> impl Strategy<Value = Array2<f64>> {
    (2..30_usize, 1..6_usize).prop_flat_map(|(samples, channels)| {
        let channel = (-6.0..6.0_f64, -10.0..10.0_f64, prop::bool::weighted(0.2));
        let channels_of = prop::collection::vec(channel, channels);
        let values = prop::collection::vec(-1.0..1.0_f64, samples * channels);
        (channels_of, values).prop_map(move |(channels_of, values)| {
            Array2::from_shape_fn((samples, channels), |(sample, channel)| {
                let (exponent, offset, is_constant) = channels_of[channel];
                let value = if is_constant {
                    0.5
                } else {
                    values[sample * channels + channel]
                };
                10_f64.powf(exponent) * (offset + value)
            })
        })
    })
}

/// Largest difference in any channel, relative to the channel's largest value.
fn largest_difference(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    let channels = a.axis_iter(Axis(1)).zip(b.axis_iter(Axis(1)));
    let of_channel = channels.map(|(a, b)| {
        let size = b.iter().fold(f64::MIN_POSITIVE, |size, value| size.max(value.abs()));
        a.iter().zip(b).map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max)
    });
    of_channel.fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn ranges_are_scaled_to_minus_one_to_one_and_back(values in tables()) {
        let scaling = MinMax::fit(values.view()).unwrap();
        let scaled = scaling.scale(values.view());
        prop_assert_eq!(scaled.dim(), (values.nrows(), scaling.varying().len()));
        for channel in scaled.axis_iter(Axis(1)) {
            let (low, high) = channel.iter().fold((1.0_f64, -1.0_f64), |(low, high), &value| (low.min(value), high.max(value)));
            prop_assert!((low + 1.0).abs() < 1e-9 && (high - 1.0).abs() < 1e-9, "{low} to {high}");
        }
        let off = largest_difference(&scaling.restore(scaled.view()), &values);
        prop_assert!(off < 1e-14, "{off:e}");
    }

    /// A power of two changes no digit.
    #[test]
    fn scaled_values_do_not_depend_on_the_unit(values in tables(), exponent in -40..40_i32) {
        let other = values.mapv(|value| value * 2_f64.powi(exponent));
        let scaled = |values: &Array2<f64>| MinMax::fit(values.view()).unwrap().scale(values.view());
        prop_assert_eq!(scaled(&values), scaled(&other));
    }

    #[test]
    fn the_order_of_the_samples_does_not_change_a_scaling(
        (values, order) in tables().prop_flat_map(|values| {
            let order = Just(Vec::from_iter(0..values.nrows())).prop_shuffle();
            (Just(values), order)
        })
    ) {
        let shuffled = values.select(Axis(0), &order);
        prop_assert_eq!(MinMax::fit(values.view()), MinMax::fit(shuffled.view()));
    }

    /// For channels of one magnitude: whitening treats the weakest patterns of very different ones as rounding.
    #[test]
    fn whitened_samples_are_uncorrelated(
        values in (12..30_usize, 1..6_usize).prop_flat_map(|(samples, channels)| {
            let values = prop::collection::vec(-1.0..1.0_f64, samples * channels);
            values.prop_map(move |values| Array2::from_shape_vec((samples, channels), values).unwrap())
        })
    ) {
        let channels = values.ncols();
        let choice = InputChoice { quantity: Quantity::Raw, scaling: ScalingChoice::Whitening };
        let whitened = Inputs::fit(choice, values.view(), NoiseSource::default()).unwrap().of(values.view());
        prop_assert_eq!(whitened.ncols(), channels);
        let covariance = whitened.t().dot(&whitened) / values.nrows() as f64;
        for ((row, column), &value) in covariance.indexed_iter() {
            let expected = if row == column { 1.0 } else { 0.0 };
            prop_assert!((value - expected).abs() < 1e-10, "({row}, {column}): {value}");
        }
    }
}
