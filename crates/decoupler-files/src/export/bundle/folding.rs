use ndarray::Array2;

use super::twofold::Twofold;
use decoupler_core::{
    decoupling::{AffineLayer, Layer, LayeredMap},
    network::Quantity,
};

/// A map whose scalings are folded into its layers, and which takes the changes of the readings from a value in the middle
/// of each channel.
#[derive(Clone, Debug)]
pub(super) struct FoldedMap {
    /// R₀ of each channel, exact in single precision.
    pub(super) centre: Vec<f64>,
    pub(super) layers: Vec<Layer<Twofold>>,
}

/// Difference of the logarithms of memberships between a rule and its copy that never fires.
const NEVER: f64 = -1000.0;

impl FoldedMap {
    /// Folds neighbouring affine layers into one, and the quantity into the first.
    pub(super) fn of(map: &LayeredMap) -> Self {
        // Rounded to single precision, so that r − R₀ is the same number in both; the biases take up the rest.
        let centre: Vec<f64> = map
            .centre
            .iter()
            .map(|&value| f64::from(map.quantity.resistance_ohm(value) as f32))
            .collect();
        let mut pending = Some(of_changes(map, &centre));
        let mut layers = Vec::new();
        for layer in &map.layers {
            let mut values = layer.values().copied().map(Twofold::from);
            let layer = layer.with_values(&mut values).expect("as many values as the layer has");
            match (layer, &pending) {
                (Layer::Affine(next), Some(before)) => pending = Some(joined(before, &next)),
                (Layer::Affine(next), None) => pending = Some(next),
                (
                    Layer::Rules {
                        memberships,
                        consequents,
                    },
                    Some(before),
                ) => {
                    layers.push(Layer::Rules {
                        memberships: joined(before, &memberships),
                        consequents: joined(before, &consequents),
                    });
                    pending = None;
                }
                (layer, _) => {
                    layers.extend(pending.take().map(Layer::Affine));
                    layers.push(layer);
                }
            }
        }
        layers.extend(pending.map(Layer::Affine));
        Self { centre, layers }
    }

    /// Widens the layers so that each has as many values as that of another map with the most; the added ones have no effect.
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

/// The centred values of the quantity as an affine map of the changes from `centre`.
fn of_changes(map: &LayeredMap, centre: &[f64]) -> AffineLayer<Twofold> {
    let channels = centre.len();
    let mut weights = Array2::from_elem((channels, channels), Twofold::ZERO);
    let mut biases = Vec::new();
    for (channel, (&ohm, &value)) in centre.iter().zip(&map.centre).enumerate() {
        weights[[channel, channel]] = match map.quantity {
            Quantity::Conductance => Twofold::from(1.0) / Twofold::from(ohm),
            Quantity::Resistance | Quantity::LogResistance | Quantity::Raw => Twofold::from(1.0),
        };
        let at_centre = match map.quantity {
            Quantity::Resistance | Quantity::Raw => Twofold::from(ohm),
            Quantity::Conductance => Twofold::from(1.0) / Twofold::from(ohm),
            Quantity::LogResistance => Twofold::from(ohm).ln(),
        };
        biases.push(at_centre - Twofold::from(value));
    }
    AffineLayer { weights, biases }
}

/// One affine layer in the place of two.
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

/// Number of values that are peculiar to a layer: its outputs, Gaussians or rules; 0 of one that has no tables.
fn own_width(layer: &Layer<Twofold>) -> usize {
    match layer {
        Layer::Affine(affine) => affine.outputs(),
        Layer::Tanh => 0,
        Layer::Gaussians { centres } => centres.ncols(),
        Layer::Rules { memberships, .. } => memberships.outputs(),
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
        Layer::Rules {
            memberships,
            consequents,
        } => {
            let (rules, outputs) = (memberships.outputs(), consequents.outputs() / memberships.outputs());
            // Copies of the first rule, whose memberships are 0 compared with its own.
            let source = |rule: usize| if rule < rules { rule } else { 0 };
            let of_rule = |column: usize| source(column / outputs) * outputs + column % outputs;
            let pick = |table: &Array2<Twofold>, columns: usize, of: &dyn Fn(usize) -> usize| {
                let value = |(input, column)| table.get((input, of(column))).copied().unwrap_or(Twofold::ZERO);
                Array2::from_shape_fn((inputs, columns), value)
            };
            let offset = |rule: usize| {
                let never = if rule < rules { 0.0 } else { NEVER };
                memberships.biases[source(rule)] + Twofold::from(never)
            };
            Layer::Rules {
                memberships: AffineLayer {
                    weights: pick(&memberships.weights, width, &source),
                    biases: (0..width).map(offset).collect(),
                },
                consequents: AffineLayer {
                    weights: pick(&consequents.weights, width * outputs, &of_rule),
                    biases: (0..width * outputs)
                        .map(|column| consequents.biases[of_rule(column)])
                        .collect(),
                },
            }
        }
    }
}
