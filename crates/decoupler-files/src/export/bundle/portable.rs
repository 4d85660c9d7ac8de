use decoupler_core::network::Quantity;
use ndarray::Array2;
use thiserror::Error;

use super::{
    exact::Twofold,
    exported_decoder::ExportedDecoder,
    layers::{AffineLayer, Layer, LayeredMap},
    meaning::Meaning,
};
use crate::export::format_number;

/// Everything that a decoder computes, from readings (in ohm, or as the user has them) to outputs (in mm, or in the units of
/// the targets), with all scaling folded into its layers. Every writer starts from it, and handles layers rather than
/// decoders.
///
/// The first layer takes the change x of each reading r from a value R₀ in the middle of its channel. The change is
/// computed from the difference r − R₀, which loses no digits in low precision where readings differ little:
///
/// | quantity | change x |
/// |---|---|
/// | resistance, raw | r − R₀ |
/// | conductance | (R₀ − r)/r, the relative change of 1/r |
/// | logarithm | ln(1 + (r − R₀)/R₀) |
#[derive(Clone, Debug)]
pub(super) struct Portable {
    /// Name of the decoder.
    pub(super) name: &'static str,
    /// Word for it in sentences, and the name of its file of weights: network or decoder.
    pub(super) decoder: &'static str,
    pub(super) quantity: Quantity,
    /// Meaning of readings and outputs.
    pub(super) meaning: Meaning,
    /// Number of readings of a row, M4 of an array.
    pub(super) channels: usize,
    /// Number of outputs, 3·M2 of an array.
    pub(super) outputs: usize,
    /// One map for all row-wires, or one for each in ascending order, all of the same shape.
    pub(super) maps: Vec<FoldedMap>,
    /// Ranges of the readings in training: one for all row-wires, or one for each if the row is an argument.
    pub(super) ranges: Vec<Option<ChannelRanges>>,
    /// Range to which deviations of each output are relative: the widest of any in training for the coordinates of an array,
    /// and its own for a target of own data, as units differ.
    pub(super) scales: Vec<f64>,
}

/// Readings of each channel in training.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChannelRanges {
    /// Smallest and largest reading.
    pub(super) extremes: Vec<(f64, f64)>,
    /// Limits beyond which a reading counts as outside.
    pub(super) limits: Vec<(f64, f64)>,
}

/// Errors that occur when the scaling of decoders is folded into their layers.
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
}

impl Portable {
    /// Folds the scaling of the decoder of `exported` into its layers.
    ///
    /// # Errors
    /// A folded weight is not a finite number.
    pub(super) fn of(exported: &ExportedDecoder<'_>) -> Result<Self, FoldError> {
        let layered = LayeredMap::of(exported.program()).expect("decoders that are described are chains of layers");
        let quantity = layered[0].quantity;
        let mut maps: Vec<_> = layered.iter().map(FoldedMap::of).collect();
        if let Some(index) = maps.iter().position(|map| !is_finite(map, quantity)) {
            return Err(FoldError::NotFinite { network: index + 1 });
        }
        FoldedMap::widen(&mut maps);
        let channels = maps[0].centre.len();
        let outputs = maps[0]
            .layers
            .iter()
            .fold(channels, |width, layer| layer.outputs(width));
        let meaning = exported.meaning();
        let targets = exported.target_extremes();
        let scales = match &meaning {
            Meaning::Array(_) => vec![scale(targets, 0..outputs); outputs],
            Meaning::Own { .. } => (0..outputs).map(|output| scale(targets, output..output + 1)).collect(),
        };
        let ranges = exported.reading_ranges().iter().map(|range| {
            range.as_ref().map(|range| ChannelRanges {
                extremes: (0..range.channels()).map(|channel| range.extremes(channel)).collect(),
                limits: (0..range.channels())
                    .map(|channel| range.limits(quantity, channel))
                    .collect(),
            })
        });
        Ok(Self {
            name: exported.kind().name(),
            decoder: exported.kind().noun(),
            ranges: ranges.collect(),
            meaning,
            quantity,
            channels,
            outputs,
            maps,
            scales,
        })
    }

    /// Returns `true` if there is a decoder for each known row, which makes the row an argument.
    pub(super) fn takes_row(&self) -> bool {
        self.rows() > 1
    }

    /// Number of row-wires that are distinguished; 1 if the row is not an argument.
    pub(super) fn rows(&self) -> usize {
        self.ranges.len()
    }

    /// Returns the layers of the first map, whose shapes are those of all maps.
    pub(super) fn layers(&self) -> &[Layer<super::exact::Twofold>] {
        &self.maps[0].layers
    }

    /// Number of values that the widest layer gives.
    pub(super) fn widest(&self) -> usize {
        let mut inputs = self.channels;
        let widths = self.layers().iter().map(|layer| {
            inputs = layer.outputs(inputs);
            inputs
        });
        // Outputs are not summed further.
        let mut widths: Vec<usize> = widths.collect();
        widths.pop();
        widths.into_iter().max().unwrap_or(0)
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

    /// Advice for a decoder that amplifies less.
    pub(super) fn smaller_weights(&self) -> &'static str {
        match (&self.meaning, self.decoder) {
            (Meaning::Own { .. }, decoder) if decoder != "network" => "take another decoder",
            (meaning, _) => meaning.smaller_weights(),
        }
    }

    /// The ranges of the readings of all rows in training, if all are known.
    pub(super) fn known_ranges(&self) -> Option<Vec<&ChannelRanges>> {
        self.ranges.iter().map(Option::as_ref).collect()
    }
}

/// Widest range in training among these outputs of all rows.
fn scale(targets: &[Vec<(f64, f64)>], outputs: std::ops::Range<usize>) -> f64 {
    let extremes = targets.iter().flat_map(|row| row[outputs.clone()].iter());
    let (width, largest) = extremes.fold((0.0_f64, 0.0_f64), |(width, largest), &(low, high)| {
        (width.max(high - low), largest.max(low.abs()).max(high.abs()))
    });
    // Outputs that did not vary are constants, and deviations are relative to these.
    [width, largest].into_iter().find(|&scale| scale > 0.0).unwrap_or(1.0)
}

fn is_finite(map: &FoldedMap, quantity: Quantity) -> bool {
    // Single precision has a smaller range.
    let mut all = map.layers.iter().flat_map(Layer::values);
    all.all(|weight| (weight.to_f64() as f32).is_finite()) && map.centre.iter().all(|&ohm| quantity.accepts(ohm))
}

/// A map whose scalings are folded into its layers, and whose inputs are the changes of the readings from a value in
/// the middle of each channel.
#[derive(Clone, Debug)]
pub(super) struct FoldedMap {
    /// R₀ of each channel, exact in single precision.
    pub(super) centre: Vec<f64>,
    pub(super) layers: Vec<Layer<Twofold>>,
}

impl FoldedMap {
    /// Folds neighbouring affine layers into one, and the quantity into the first.
    pub(super) fn of(map: &LayeredMap) -> Self {
        // Rounded to single precision: r − R₀ is the same number in both precisions; the biases absorb the difference.
        let centre: Vec<f64> = map.centre.iter().map(|&ohm| f64::from(ohm as f32)).collect();
        let mut pending = Some(of_changes(map, &centre));
        let mut layers = Vec::new();
        for layer in &map.layers {
            let mut values = layer.values().copied().map(Twofold::from);
            let layer = layer.with_values(&mut values).expect("as many values as the layer has");
            match (layer, &pending) {
                (Layer::Affine(next), Some(before)) => pending = Some(joined(before, &next)),
                (Layer::Affine(next), None) => pending = Some(next),
                (layer, _) => {
                    layers.extend(pending.take().map(Layer::Affine));
                    layers.push(layer);
                }
            }
        }
        layers.extend(pending.map(Layer::Affine));
        Self { centre, layers }
    }

    /// Pads each layer to the largest number of values of that layer in any map; the padding has no effect.
    pub(super) fn widen(maps: &mut [Self]) {
        let depth = maps.iter().map(|map| map.layers.len()).max().unwrap_or(0);
        let mut inputs = maps.iter().map(|map| map.centre.len()).max().unwrap_or(0);
        for index in 0..depth {
            let width = |map: &Self| map.layers.get(index).map(own_width);
            let most = maps.iter().filter_map(width).max().unwrap_or(0);
            for map in &mut *maps {
                if let Some(layer) = map.layers.get_mut(index) {
                    *layer = widened(layer, inputs, most);
                }
            }
            inputs = maps[0].layers.get(index).map_or(inputs, |layer| layer.outputs(inputs));
        }
    }
}

/// The changes from the centre of `map`, which its first layer takes, as an affine map of those from `centre`.
fn of_changes(map: &LayeredMap, centre: &[f64]) -> AffineLayer<Twofold> {
    let channels = centre.len();
    let one = Twofold::from(1.0);
    let mut weights = Array2::from_elem((channels, channels), Twofold::ZERO);
    let mut biases = Vec::new();
    for (channel, (&to_ohm, &from_ohm)) in centre.iter().zip(&map.centre).enumerate() {
        let (to, from) = (Twofold::from(to_ohm), Twofold::from(from_ohm));
        let (weight, bias) = match map.quantity {
            Quantity::Resistance | Quantity::Raw => (one, to - from),
            // The program takes (r − R₀)/r.
            Quantity::Conductance => (-(from / to), one - from / to),
            Quantity::LogResistance => (one, to.ln() - from.ln()),
        };
        weights[[channel, channel]] = weight;
        biases.push(bias);
    }
    AffineLayer { weights, biases }
}

/// Combines two affine layers into one.
fn joined(first: &AffineLayer<Twofold>, second: &AffineLayer<Twofold>) -> AffineLayer<Twofold> {
    let (inputs, inner) = first.weights.dim();
    let outputs = second.outputs();
    let mut weights = Array2::from_elem((inputs, outputs), Twofold::ZERO);
    let mut biases = second.biases.clone();
    for between in 0..inner {
        let of_inner = second.weights.row(between);
        for input in 0..inputs {
            let weight = first.weights[[input, between]];
            // Layers of changes, and those that restore targets, are diagonal.
            if weight.to_f64() != 0.0 {
                for (sum, &next) in weights.row_mut(input).iter_mut().zip(of_inner) {
                    *sum = *sum + weight * next;
                }
            }
        }
        for (bias, &next) in biases.iter_mut().zip(of_inner) {
            *bias = *bias + first.biases[between] * next;
        }
    }
    AffineLayer { weights, biases }
}

/// Number of a layer's outputs or Gaussians; 0 for a layer without tables.
fn own_width(layer: &Layer<Twofold>) -> usize {
    match layer {
        Layer::Affine(affine) => affine.outputs(),
        Layer::Tanh => 0,
        Layer::Gaussians { centres } => centres.ncols(),
    }
}

fn widened(layer: &Layer<Twofold>, inputs: usize, width: usize) -> Layer<Twofold> {
    let wide = |table: &Array2<Twofold>, columns: usize| {
        let value = |place| table.get(place).copied().unwrap_or(Twofold::ZERO);
        Array2::from_shape_fn((inputs, columns), value)
    };
    match layer {
        Layer::Affine(affine) => {
            let mut biases = affine.biases.clone();
            biases.resize(width, Twofold::ZERO);
            Layer::Affine(AffineLayer {
                weights: wide(&affine.weights, width),
                biases,
            })
        }
        Layer::Tanh => Layer::Tanh,
        Layer::Gaussians { centres } => Layer::Gaussians {
            centres: wide(centres, width),
        },
    }
}
