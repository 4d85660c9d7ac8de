use ndarray::Array2;
use thiserror::Error;

use super::{exported_network::ExportedNetwork, meaning::Meaning, twofold::Twofold};
use crate::export::format_number;
use crate::network::{DecouplingNetwork, InputScaling, Quantity};

/// Everything that a network computes, from readings (in ohm, or as the user has them) to outputs (in mm, or in the units of
/// the targets), with all scaling folded into its weights. Every writer starts from it.
///
/// A hidden node adds up `weight · x + bias`, where x is the change of a reading r from a value R₀ in the middle of its
/// channel. The change is computed from the difference r − R₀, so that a number of few digits loses nothing where
/// readings differ little:
///
/// | quantity | change x |
/// |---|---|
/// | resistance, raw | r − R₀ |
/// | conductance | (R₀ − r)/r, the relative change of 1/r |
/// | logarithm | ln(1 + (r − R₀)/R₀) |
#[derive(Clone, Debug)]
pub(super) struct Portable {
    pub(super) quantity: Quantity,
    /// Meaning of readings and outputs.
    pub(super) meaning: Meaning,
    /// Number of readings of a row, M4 of an array.
    pub(super) channels: usize,
    pub(super) hidden: usize,
    /// Number of outputs, 3·M2 of an array.
    pub(super) outputs: usize,
    /// One for all row-wires, or one for each, from the first.
    pub(super) networks: Vec<PortableNetwork>,
    /// Range to which deviations of each output are relative: the widest of any in training for the coordinates of an array,
    /// and its own for a target of own data, as units differ.
    pub(super) scales: Vec<f64>,
}

/// One network of a [`Portable`].
#[derive(Clone, Debug)]
pub(super) struct PortableNetwork {
    /// R₀ of each channel, exact in single precision.
    pub(super) centre: Vec<f64>,
    /// Channels × hidden nodes.
    pub(super) hidden_weights: Array2<Twofold>,
    pub(super) hidden_biases: Vec<Twofold>,
    /// Hidden nodes × outputs; zero for outputs that were constant in training.
    pub(super) output_weights: Array2<Twofold>,
    pub(super) output_biases: Vec<Twofold>,
    /// Readings in training.
    pub(super) range: Option<ChannelRanges>,
}

/// Readings of each channel in training.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChannelRanges {
    /// Smallest and largest reading.
    pub(super) extremes: Vec<(f64, f64)>,
    /// Limits beyond which a reading counts as outside.
    pub(super) limits: Vec<(f64, f64)>,
}

/// Errors of folding the scaling of networks into their weights.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FoldError {
    /// A weight overflows.
    #[error(
        "network {network}: a weight is beyond the range of single precision when the scaling is folded into it; train again with other settings"
    )]
    NotFinite {
        /// Number of the network, from 1.
        network: usize,
    },
    /// The networks of a file read different quantities.
    #[error("the networks of the rows read different quantities: train them together")]
    Quantities,
}

impl Portable {
    /// Folds the scaling of the networks of `exported` into their weights.
    ///
    /// # Errors
    /// A folded weight is not a finite number, or the networks read different quantities.
    pub(super) fn of(exported: ExportedNetwork<'_>) -> Result<Self, FoldError> {
        let networks = exported.networks().values();
        let first = &networks[0];
        let quantity = first.inputs().quantity();
        if networks.iter().any(|network| network.inputs().quantity() != quantity) {
            return Err(FoldError::Quantities);
        }
        let folded: Vec<_> = networks.iter().map(PortableNetwork::of).collect();
        if let Some(index) = folded.iter().position(|network| !network.is_finite(quantity)) {
            return Err(FoldError::NotFinite { network: index + 1 });
        }
        let outputs = first.outputs().channels();
        let meaning = exported.meaning();
        let scales = match &meaning {
            Meaning::Array(_) => vec![scale(networks, 0..outputs); outputs],
            Meaning::Own { .. } => (0..outputs).map(|output| scale(networks, output..output + 1)).collect(),
        };
        Ok(Self {
            meaning,
            quantity,
            channels: first.inputs().channels(),
            hidden: first.mlp().shape().hidden,
            outputs,
            networks: folded,
            scales,
        })
    }

    /// Returns `true` if the networks are those of known rows, so that the row is an argument.
    pub(super) fn takes_row(&self) -> bool {
        self.networks.len() > 1
    }

    /// Widest range of a coordinate of an array in training; `None` for own data.
    pub(super) fn output_range_mm(&self) -> Option<f64> {
        match self.meaning {
            Meaning::Array(_) => self.scales.first().copied(),
            Meaning::Own { .. } => None,
        }
    }

    /// A deviation relative to [`Self::scales`], in mm for an array, and in per cent of the range of a target of own data.
    pub(super) fn in_words(&self, relative: f64) -> String {
        match self.output_range_mm() {
            Some(range_mm) => format!("{} mm", format_number(relative * range_mm)),
            None => format!("{} % of its range in training", format_number(100.0 * relative)),
        }
    }

    /// The ranges of all networks in training, if all are known.
    pub(super) fn ranges(&self) -> Option<Vec<&ChannelRanges>> {
        self.networks.iter().map(|network| network.range.as_ref()).collect()
    }
}

/// Widest range in training among these outputs.
fn scale(networks: &[DecouplingNetwork], outputs: std::ops::Range<usize>) -> f64 {
    let extremes = networks
        .iter()
        .flat_map(|network| outputs.clone().map(|output| network.outputs().extremes(output)));
    let (width, largest) = extremes.fold((0.0_f64, 0.0_f64), |(width, largest), (low, high)| {
        (width.max(high - low), largest.max(low.abs()).max(high.abs()))
    });
    // Outputs that did not vary are constants, and deviations are relative to these.
    [width, largest].into_iter().find(|&scale| scale > 0.0).unwrap_or(1.0)
}

impl PortableNetwork {
    fn of(network: &DecouplingNetwork) -> Self {
        let (inputs, mlp) = (network.inputs(), network.mlp());
        let (quantity, shape) = (inputs.quantity(), mlp.shape());
        let (middles, _) = inputs.affine();
        let matrix = scaling_matrix(inputs.scaling());
        // Rounded to single precision, so that r − R₀ is the same number in both; the biases take up the rest.
        let centre: Vec<f64> = middles
            .iter()
            .map(|&value| f64::from(quantity.resistance_ohm(value) as f32))
            .collect();
        let (w, v) = (mlp.hidden_layer(), mlp.output_layer());
        let of_value = Array2::from_shape_fn((inputs.channels(), shape.hidden), |(channel, node)| {
            let products = (0..shape.inputs).map(|k| matrix[[k, channel]] * Twofold::from(w[[k, node]]));
            products.fold(Twofold::ZERO, |sum, product| sum + product)
        });
        let hidden_biases = (0..shape.hidden).map(|node| {
            let rests = centre.iter().zip(&middles).enumerate();
            rests.fold(
                Twofold::from(w[[shape.inputs, node]]),
                |bias, (channel, (&ohm, &value))| {
                    bias + of_value[[channel, node]] * (value_of(quantity, ohm) - Twofold::from(value))
                },
            )
        });
        let hidden_biases = hidden_biases.collect();
        let per_change = |channel: usize| match quantity {
            Quantity::Conductance => Twofold::from(1.0) / Twofold::from(centre[channel]),
            Quantity::Resistance | Quantity::LogResistance | Quantity::Raw => Twofold::from(1.0),
        };
        let hidden_weights = Array2::from_shape_fn(of_value.dim(), |(channel, node)| {
            of_value[[channel, node]] * per_change(channel)
        });
        let ranges = network.outputs().middles_and_half_widths();
        let mut output_weights = Array2::from_elem((shape.hidden, ranges.len()), Twofold::ZERO);
        let mut output_biases: Vec<_> = ranges.iter().map(|range| Twofold::from(range.0)).collect();
        for (output, &coordinate) in network.outputs().varying().iter().enumerate() {
            let half_width = Twofold::from(ranges[coordinate].1);
            for node in 0..shape.hidden {
                output_weights[[node, coordinate]] = Twofold::from(v[[node, output]]) * half_width;
            }
            let bias = Twofold::from(v[[shape.hidden, output]]) * half_width;
            output_biases[coordinate] = output_biases[coordinate] + bias;
        }
        let range = inputs.range().map(|range| ChannelRanges {
            extremes: (0..range.channels()).map(|channel| range.extremes(channel)).collect(),
            limits: (0..range.channels())
                .map(|channel| range.limits(quantity, channel))
                .collect(),
        });
        Self {
            centre,
            hidden_weights,
            hidden_biases,
            output_weights,
            output_biases,
            range,
        }
    }

    /// Largest size of an output, whatever the activations.
    pub(super) fn reach(&self, output: usize) -> f64 {
        let weights = self.output_weights.column(output);
        let of_weights: f64 = weights.iter().map(|weight| weight.to_f64().abs()).sum();
        self.output_biases[output].to_f64().abs() + of_weights
    }

    fn is_finite(&self, quantity: Quantity) -> bool {
        let weights = self.hidden_weights.iter().chain(&self.hidden_biases);
        let mut all = weights.chain(&self.output_weights).chain(&self.output_biases);
        // Single precision has a smaller range.
        all.all(|weight| (weight.to_f64() as f32).is_finite()) && self.centre.iter().all(|&ohm| quantity.accepts(ohm))
    }
}

/// The matrix (inputs × channels) by which centred values are multiplied.
fn scaling_matrix(scaling: &InputScaling) -> Array2<Twofold> {
    match scaling {
        InputScaling::Whitening(whitening) => whitening.matrix().mapv(Twofold::from),
        InputScaling::MinMax(minmax) => {
            let (varying, ranges) = (minmax.varying(), minmax.middles_and_half_widths());
            let mut matrix = Array2::from_elem((varying.len(), minmax.channels()), Twofold::ZERO);
            for (input, &channel) in varying.iter().enumerate() {
                matrix[[input, channel]] = Twofold::from(1.0) / Twofold::from(ranges[channel].1);
            }
            matrix
        }
    }
}

fn value_of(quantity: Quantity, ohm: f64) -> Twofold {
    match quantity {
        Quantity::Resistance | Quantity::Raw => Twofold::from(ohm),
        Quantity::Conductance => Twofold::from(1.0) / Twofold::from(ohm),
        Quantity::LogResistance => Twofold::from(ohm).ln(),
    }
}
