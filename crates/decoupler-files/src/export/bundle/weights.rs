//! Bundles as one JSON file with the numbers of a decoder, layer by layer.

use decoupler_core::network::Quantity;
use ndarray::ArrayView1;
use serde_json::{Map, Value, json};

use super::{
    exported_decoder::Metadata,
    folder::Draft,
    layers::{AffineLayer, Layer},
    portable::{FoldedMap, Portable},
    report::{BundleCheck, BundleError},
    vectors::Vector,
};

/// Digits of a floating-point number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Digits {
    Single,
    Double,
}

/// Digits in which a bundle of floating-point numbers decodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Arithmetic {
    /// Number of first layers that are computed in double precision, with the changes of the readings.
    pub(super) wide_layers: usize,
    /// Of the readings, and of everything after these layers.
    pub(super) rest: Digits,
}

/// Rounded weights of a bundle.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Weights {
    pub(super) quantity: Quantity,
    pub(super) arithmetic: Arithmetic,
    pub(super) maps: Vec<RoundedMap>,
}

/// The numbers of one map.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RoundedMap {
    pub(super) centre: Vec<f64>,
    pub(super) layers: Vec<Layer<f64>>,
}

impl Digits {
    /// Rounds to these digits. A sum, product, quotient or root of singles that is computed in double and then rounded
    /// equals the result of single precision (S. A. Figueroa, SIGNUM Newsletter 30 (1995), 21-26).
    pub(super) fn round(self, value: f64) -> f64 {
        match self {
            Self::Single => f64::from(value as f32),
            Self::Double => value,
        }
    }

    /// Half the spacing of numbers at 1.
    pub(super) fn unit_roundoff(self) -> f64 {
        0.5 * match self {
            Self::Single => f64::from(f32::EPSILON),
            Self::Double => f64::EPSILON,
        }
    }
}

impl Arithmetic {
    pub(super) const DOUBLE: Self = Self {
        wide_layers: 0,
        rest: Digits::Double,
    };

    /// Single precision, with this number of first layers in double.
    pub(super) fn single(wide_layers: usize) -> Self {
        Self {
            wide_layers,
            rest: Digits::Single,
        }
    }

    /// Returns the digits of a layer by its index; the changes have the digits of the first layer.
    pub(super) fn of_layer(self, index: usize) -> Digits {
        if index < self.wide_layers {
            Digits::Double
        } else {
            self.rest
        }
    }
}

impl Weights {
    /// Rounds the weights of `portable`.
    pub(super) fn of(portable: &Portable, arithmetic: Arithmetic) -> Self {
        let map = |map: &FoldedMap| {
            let layers = map.layers.iter().enumerate().map(|(index, layer)| {
                let digits = arithmetic.of_layer(index);
                let mut values = layer.values().map(|value| digits.round(value.to_f64()));
                layer.with_values(&mut values).expect("as many values as the layer has")
            });
            RoundedMap {
                centre: map.centre.clone(),
                layers: layers.collect(),
            }
        };
        Self {
            quantity: portable.quantity,
            arithmetic,
            maps: portable.maps.iter().map(map).collect(),
        }
    }

    /// Decodes a row in the arithmetic of the bundle.
    pub(super) fn decode(&self, map: usize, readings: &[f64]) -> Vec<f64> {
        let (arithmetic, map) = (self.arithmetic, &self.maps[map]);
        let readings = readings.iter().zip(&map.centre);
        let changes = readings.map(|(&ohm, &centre)| {
            let ohm = arithmetic.rest.round(ohm);
            change(self.quantity, arithmetic.of_layer(0), ohm, centre)
        });
        let mut values: Vec<f64> = changes.collect();
        for (index, layer) in map.layers.iter().enumerate() {
            let digits = arithmetic.of_layer(index);
            values.iter_mut().for_each(|value| *value = digits.round(*value));
            values = apply(layer, digits, values);
        }
        values.into_iter().map(|value| arithmetic.rest.round(value)).collect()
    }
}

fn change(quantity: Quantity, digits: Digits, ohm: f64, centre: f64) -> f64 {
    let difference = digits.round(ohm - centre);
    match quantity {
        Quantity::Resistance | Quantity::Raw => difference,
        Quantity::Conductance => digits.round(-difference / ohm),
        Quantity::LogResistance => digits.round(libm::log1p(digits.round(difference / centre))),
    }
}

fn apply(layer: &Layer<f64>, digits: Digits, values: Vec<f64>) -> Vec<f64> {
    match layer {
        Layer::Affine(affine) => sums(digits, &values, affine),
        Layer::Tanh => values
            .into_iter()
            .map(|value| digits.round(libm::tanh(value)))
            .collect(),
        Layer::Gaussians { centres } => {
            let gaussian = |centre: ArrayView1<'_, f64>| {
                let square = values.iter().zip(centre).fold(0.0, |sum, (value, centre)| {
                    let apart = digits.round(value - centre);
                    digits.round(sum + digits.round(apart * apart))
                });
                digits.round(libm::exp(-square))
            };
            centres.columns().into_iter().map(gaussian).collect()
        }
    }
}

/// values · weights + biases.
fn sums(digits: Digits, values: &[f64], affine: &AffineLayer<f64>) -> Vec<f64> {
    let mut sums = affine.biases.clone();
    for (value, row) in values.iter().zip(affine.weights.rows()) {
        for (sum, weight) in sums.iter_mut().zip(row) {
            *sum = digits.round(*sum + digits.round(value * weight));
        }
    }
    sums
}

/// Name of the only file.
pub(super) const FILE: &str = "decoder.json";

/// Writes the file and reads it back.
///
/// # Errors
/// It cannot be written or read back.
pub(super) fn export(draft: &mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError> {
    let (portable, golden) = (draft.portable, draft.vectors.golden());
    let damaged = |reason| BundleError::read_back(FILE, reason);
    let bytes = draft.write(FILE, write(portable, draft.weights, draft.metadata, golden))?;
    let text = String::from_utf8(bytes).map_err(|error| damaged(error.to_string()))?;
    let deviation = draft.deviation_of(&read_weights(&text, portable).map_err(damaged)?);
    Ok(vec![BundleCheck::of(
        "JSON numbers, read back and evaluated",
        deviation,
    )])
}

/// Writes the numbers, the metadata and the golden vectors.
fn write(portable: &Portable, weights: &Weights, metadata: &Metadata, golden: &[Vector]) -> String {
    let tables = weights.tables(portable).into_iter().map(|table| {
        let shape = [&[weights.maps.len()], &table.shape[..]].concat();
        (table.name, json!({ "shape": shape, "values": table.values }))
    });
    let vectors = golden
        .iter()
        .map(|vector| json!({ "row": vector.row + 1, "readings": vector.readings, "answers": vector.answers }));
    let document = json!({
        "format": "decoupler decoder",
        "metadata": metadata,
        "tables": tables.collect::<Map<String, Value>>(),
        "golden_vectors": vectors.collect::<Vec<_>>(),
    });
    format!("{document:#}\n")
}

/// Reads the numbers back.
///
/// # Errors
/// A description of the damage.
fn read_weights(text: &str, portable: &Portable) -> Result<Weights, String> {
    let document: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    Weights::of_tables(portable, Arithmetic::DOUBLE, |table| {
        let values = document["tables"][table.name.as_str()]["values"].as_array();
        let numbers = values.and_then(|values| values.iter().map(Value::as_f64).collect());
        numbers.ok_or_else(|| format!("the table '{}' is missing or damaged", table.name))
    })
}

/// Numbers of a bundle, with their name in its files.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub(super) name: String,
    /// Shape of the table of one map, with one or two dimensions.
    pub(super) shape: Vec<usize>,
    pub(super) digits: Digits,
    /// Map by map, each row by row.
    pub(super) values: Vec<f64>,
}

/// Names of the tables of a layer.
#[derive(Clone, Debug)]
pub(super) struct LayerNames {
    /// Name of the layer's result in code.
    pub(super) result: String,
    /// Tables in the order of [`Layer::values`].
    pub(super) tables: Vec<String>,
}

impl Table {
    /// Number of values of each map.
    pub(super) fn size(&self) -> usize {
        self.shape.iter().product()
    }
}

/// Names of the tables of all layers.
pub(super) fn names<T>(layers: &[Layer<T>]) -> Vec<LayerNames> {
    let name = |(index, layer): (usize, &Layer<T>)| {
        let affine = |prefix: &str| ["weights", "biases"].map(|table| format!("{prefix}_{table}"));
        let (result, tables) = match (layer, layers.get(index + 1)) {
            (Layer::Affine(_), None) => ("outputs", affine("output").to_vec()),
            (Layer::Affine(_), Some(Layer::Tanh)) => ("hidden_sums", affine("hidden").to_vec()),
            (Layer::Affine(_), Some(_)) => ("inputs", affine("input").to_vec()),
            (Layer::Tanh, _) => ("activations", Vec::new()),
            (Layer::Gaussians { .. }, _) => ("gaussians", vec!["gaussian_centres".to_owned()]),
        };
        LayerNames {
            result: result.to_owned(),
            tables,
        }
    };
    layers.iter().enumerate().map(name).collect()
}

/// Shapes of the tables of a layer, in the order of its values.
fn shapes(layer: &Layer<f64>) -> Vec<Vec<usize>> {
    let affine = |affine: &AffineLayer<f64>| {
        let (inputs, outputs) = affine.weights.dim();
        [vec![inputs, outputs], vec![outputs]]
    };
    match layer {
        Layer::Affine(layer) => affine(layer).to_vec(),
        Layer::Tanh => Vec::new(),
        Layer::Gaussians { centres } => vec![vec![centres.nrows(), centres.ncols()]],
    }
}

impl Weights {
    /// All numbers with their names, the centres first.
    pub(super) fn tables(&self, portable: &Portable) -> Vec<Table> {
        let layers = &self.maps[0].layers;
        let mut tables = vec![Table {
            name: portable.meaning.centre().to_owned(),
            shape: vec![portable.channels],
            digits: self.arithmetic.of_layer(0),
            values: self.maps.iter().flat_map(|map| map.centre.iter().copied()).collect(),
        }];
        for (index, (layer, names)) in layers.iter().zip(names(layers)).enumerate() {
            let mut first = 0;
            for (name, shape) in names.tables.into_iter().zip(shapes(layer)) {
                let size: usize = shape.iter().product();
                let of_map = |map: &RoundedMap| map.layers[index].values().skip(first).take(size).copied().collect();
                let values = self.maps.iter().map(of_map).collect::<Vec<Vec<f64>>>().concat();
                tables.push(Table {
                    name,
                    shape,
                    digits: self.arithmetic.of_layer(index),
                    values,
                });
                first += size;
            }
        }
        tables
    }

    /// Reads back the numbers of `portable` in this arithmetic; `read` returns the values of a table.
    ///
    /// # Errors
    /// Those of `read`, or a table of another size.
    pub(super) fn of_tables(
        portable: &Portable,
        arithmetic: Arithmetic,
        mut read: impl FnMut(&Table) -> Result<Vec<f64>, String>,
    ) -> Result<Self, String> {
        let mut weights = Self::of(portable, arithmetic);
        let count = weights.maps.len();
        let mut of_maps = vec![Vec::new(); count];
        for table in weights.tables(portable) {
            let values = read(&table)?;
            if values.len() != table.values.len() {
                return Err(format!("'{}' has the wrong number of values", table.name));
            }
            for (map, values) in of_maps.iter_mut().zip(values.chunks(table.size().max(1))) {
                map.extend_from_slice(values);
            }
        }
        for (map, values) in weights.maps.iter_mut().zip(of_maps) {
            let mut values = values.into_iter();
            map.centre = values.by_ref().take(portable.channels).collect();
            let layers = map.layers.iter().map(|layer| layer.with_values(&mut values));
            let layers: Option<Vec<_>> = layers.collect();
            map.layers = layers.ok_or("numbers are missing")?;
        }
        Ok(weights)
    }
}
