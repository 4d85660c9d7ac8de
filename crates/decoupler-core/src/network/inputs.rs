use ndarray::{Array2, ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

use super::{ChannelNoise, MinMax, NetworkError, Quantity, Whitening, quantity::rounding};
use crate::{numerics::root_mean_square, scene::NoiseSource, sensor::RelativeNoise, text::Named};

/// Choice of the input quantity and its scaling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputChoice {
    /// Quantity computed from each resistance.
    pub quantity: Quantity,
    /// Scaling of the quantity.
    pub scaling: ScalingChoice,
}

impl InputChoice {
    /// Resistances scaled to [−1, 1], as in the paper.
    pub const PAPER: Self = Self {
        quantity: Quantity::Resistance,
        scaling: ScalingChoice::MinMax,
    };
    /// Raw readings scaled to [−1, 1], for measured data in any unit.
    pub const MEASURED: Self = Self {
        quantity: Quantity::Raw,
        scaling: ScalingChoice::MinMax,
    };
    /// Whitened conductances.
    pub const BEST: Self = Self {
        quantity: Quantity::Conductance,
        scaling: ScalingChoice::Whitening,
    };
}

/// Choice of the scaling of the inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case")]
pub enum ScalingChoice {
    /// Each channel scaled to [−1, 1], as in the paper.
    #[default]
    MinMax,
    /// Principal components scaled to unit variance, or to less where they are below the noise.
    #[strum(serialize = "whiten")]
    Whitening,
}

/// Preprocessing of resistances into network inputs, fitted to a training set.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs {
    quantity: Quantity,
    scaling: InputScaling,
    /// `None` if the training set is not known.
    range: Option<MinMax>,
}

/// Scaling fitted to a training set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum InputScaling {
    /// Each channel scaled to [−1, 1].
    MinMax(MinMax),
    /// Principal components scaled to unit variance.
    Whitening(Whitening),
}

impl Named for ScalingChoice {
    const WHAT: &'static str = "a scaling";
    const ALL: &'static [Self] = &[Self::MinMax, Self::Whitening];
}

impl Inputs {
    /// Creates inputs from a quantity, its fitted scaling, and the range of the readings in the training set, if it is known.
    pub(super) fn new(quantity: Quantity, scaling: InputScaling, range: Option<MinMax>) -> Self {
        Self {
            quantity,
            scaling,
            range,
        }
    }

    /// Fits the scaling to training resistances in ohm (samples × M4).
    ///
    /// `unseen` is the noise of later readings that the training set lacks; none if the training set already contains
    /// it. Whitening keeps at most half as many components as there are samples. With more, new samples are scaled to
    /// larger values than the training set, without bound when there are as many components as samples.
    ///
    /// # Errors
    /// If there are no samples, a value is not finite or not in the domain of the quantity, or a range overflows.
    pub fn fit(
        choice: InputChoice,
        resistances_ohm: ArrayView2<'_, f64>,
        unseen: NoiseSource,
    ) -> Result<Self, NetworkError> {
        let quantity = choice.quantity;
        quantity.check(resistances_ohm)?;
        let values = quantity.of_all(resistances_ohm);
        let scaling = match choice.scaling {
            ScalingChoice::MinMax => InputScaling::MinMax(MinMax::fit(values.view())?),
            ScalingChoice::Whitening => {
                let rounding = channel_rounding(quantity, resistances_ohm);
                let unseen = channel_noise(quantity, resistances_ohm, unseen);
                let max_components = resistances_ohm.nrows() / 2;
                InputScaling::Whitening(Whitening::fit(values.view(), &rounding, &unseen, max_components)?)
            }
        };
        Ok(Self::new(quantity, scaling, MinMax::of(resistances_ohm)))
    }

    /// Returns the range of the readings in the training set, if it is known.
    pub fn range(&self) -> Option<&MinMax> {
        self.range.as_ref()
    }

    /// Returns the quantity computed from each resistance.
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Returns the fitted scaling.
    pub(crate) fn scaling(&self) -> &InputScaling {
        &self.scaling
    }

    /// Number of resistances per sample, M4.
    pub fn channels(&self) -> usize {
        match &self.scaling {
            InputScaling::MinMax(scaling) => scaling.channels(),
            InputScaling::Whitening(scaling) => scaling.channels(),
        }
    }

    /// Number of network inputs.
    pub fn count(&self) -> usize {
        match &self.scaling {
            InputScaling::MinMax(scaling) => scaling.varying().len(),
            InputScaling::Whitening(scaling) => scaling.components(),
        }
    }

    /// Returns the inputs (samples × inputs) for resistances in ohm (samples × M4).
    pub fn of(&self, resistances_ohm: ArrayView2<'_, f64>) -> Array2<f64> {
        let values = self.quantity.of_all(resistances_ohm);
        match &self.scaling {
            InputScaling::MinMax(scaling) => scaling.scale(values.view()),
            InputScaling::Whitening(scaling) => scaling.scale(values.view()),
        }
    }

    /// Returns the centre and matrix (inputs × M4) of the scaling: inputs = matrix · (values − centre).
    pub fn affine(&self) -> (Vec<f64>, Array2<f64>) {
        match &self.scaling {
            InputScaling::MinMax(scaling) => scaling.affine(),
            InputScaling::Whitening(scaling) => scaling.affine(),
        }
    }

    /// Returns `true` if the limits, which may come from a file, are valid.
    pub(super) fn is_valid(&self) -> bool {
        let is_scaling_valid = match &self.scaling {
            InputScaling::MinMax(scaling) => scaling.is_valid(),
            InputScaling::Whitening(scaling) => scaling.is_valid(),
        };
        let is_accepted = |range: &MinMax| {
            let mut extremes = (0..range.channels()).map(|channel| range.extremes(channel));
            extremes.all(|(low, high)| self.quantity.accepts(low) && self.quantity.accepts(high))
        };
        let is_range_valid =
            |range: &MinMax| range.is_valid() && range.channels() == self.channels() && is_accepted(range);
        is_scaling_valid && self.range.as_ref().is_none_or(is_range_valid)
    }
}

/// Returns the deviations of `quantity` caused by `noise` in `resistances_ohm` (samples × channels): root mean squares
/// over the samples.
pub(crate) fn channel_noise(
    quantity: Quantity,
    resistances_ohm: ArrayView2<'_, f64>,
    noise: NoiseSource,
) -> ChannelNoise {
    if noise.is_none() {
        return ChannelNoise::none(resistances_ohm.ncols());
    }
    let deviations = |part: fn(RelativeNoise) -> f64| {
        let of_channel = |channel: ArrayView1<'_, f64>| {
            let deviation = |&ohm: &f64| quantity.deviation(ohm, ohm * part(noise.relative_to(ohm)));
            root_mean_square(channel.iter().map(deviation))
        };
        resistances_ohm.columns().into_iter().map(of_channel).collect()
    };
    ChannelNoise {
        own: deviations(|noise| noise.own),
        common: deviations(|noise| noise.common),
    }
}

/// Returns the deviations of `quantity` caused by the rounding of `resistances_ohm` (samples × channels).
fn channel_rounding(quantity: Quantity, resistances_ohm: ArrayView2<'_, f64>) -> Vec<f64> {
    let channels = resistances_ohm.columns().into_iter().zip(rounding(resistances_ohm));
    let deviation = |(channel, rounding_ohm): (ArrayView1<'_, f64>, f64)| {
        root_mean_square(channel.iter().map(|&ohm| quantity.deviation(ohm, rounding_ohm)))
    };
    channels.map(deviation).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn the_affine_map_agrees_with_the_scaling() {
        let resistances = array![
            [10.0, 20.0, 5.0],
            [11.0, 26.0, 5.0],
            [13.0, 21.0, 5.0],
            [12.0, 29.0, 5.0]
        ];
        for quantity in Quantity::ALL {
            for scaling in [ScalingChoice::MinMax, ScalingChoice::Whitening] {
                let choice = InputChoice { quantity, scaling };
                let inputs = Inputs::fit(choice, resistances.view(), NoiseSource::default()).unwrap();
                assert_eq!((inputs.channels(), inputs.count()), (3, 2));
                let (centre, matrix) = inputs.affine();
                let ours = inputs.of(resistances.view());
                for (sample, ohms) in resistances.rows().into_iter().enumerate() {
                    for k in 0..2 {
                        let expected: f64 = (0..3)
                            .map(|c| matrix[[k, c]] * (quantity.of(ohms[c]) - centre[c]))
                            .sum();
                        assert!((ours[[sample, k]] - expected).abs() < 1e-10);
                    }
                }
            }
        }
    }
}
