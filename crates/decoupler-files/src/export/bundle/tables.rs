use super::{
    portable::Portable,
    weights::{Arithmetic, Digits, RoundedMap, Weights},
};
use decoupler_core::decoupling::{AffineLayer, Layer};

/// Numbers of a bundle under the name that they have in its files.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub(super) name: String,
    /// Sizes of the table of one map, one or two of them.
    pub(super) shape: Vec<usize>,
    pub(super) digits: Digits,
    /// Map by map, each row by row.
    pub(super) values: Vec<f64>,
}

/// Names of the tables of a layer.
#[derive(Clone, Debug)]
pub(super) struct LayerNames {
    /// What the layer gives, in code.
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
            (Layer::Rules { .. }, _) => ("blended", [affine("membership"), affine("consequent")].concat()),
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
        Layer::Rules {
            memberships,
            consequents,
        } => [affine(memberships), affine(consequents)].concat(),
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

    /// Reads the numbers of `portable` in this arithmetic back; `read` returns the values of a table.
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
                return Err(format!("'{}' has not as many numbers as it should", table.name));
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
