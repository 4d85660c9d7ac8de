use serde_json::{Map, Value, json};

use super::{
    choice::BundlePrecision,
    portable::{ChannelRanges, Portable},
};
use crate::export::NetworkFile;

/// Facts about a network, for people and programs that have only the bundle: names of fields and JSON values.
pub(super) type Metadata = Map<String, Value>;

/// Names of the readings: r_1, r_2, …
pub(super) fn reading_names(portable: &Portable) -> Vec<String> {
    (1..=portable.channels).map(|channel| format!("r_{channel}")).collect()
}

/// Names of the coordinates: x_1, y_1, z_1, x_2, …
pub(super) fn coordinate_names(portable: &Portable) -> Vec<String> {
    let name = |output: usize| format!("{}_{}", ["x", "y", "z"][output % 3], output / 3 + 1);
    (0..portable.outputs).map(name).collect()
}

/// Collects the metadata of a bundle.
pub(super) fn metadata(file: &NetworkFile, portable: &Portable, precision: BundlePrecision) -> Metadata {
    let settings = &file.settings;
    let sensor = &settings.source.sensor;
    let range = |range: &ChannelRanges| {
        let (minimum, maximum): (Vec<f64>, Vec<f64>) = range.extremes.iter().copied().unzip();
        json!({ "minimum": minimum, "maximum": maximum })
    };
    let ranges = portable
        .networks
        .iter()
        .map(|network| network.range.as_ref().map(range));
    let fields = json!({
        "program": crate::export::document::PROGRAM,
        "trained_by": file.program,
        "array": sensor.scale.to_string(),
        "geometry": sensor.geometry,
        "scene": settings.source.scene,
        "rows": settings.source.scene.rows.to_string(),
        "takes_row": portable.takes_row(),
        "row_numbers": portable.takes_row().then_some([1, portable.networks.len()]),
        "inputs": { "names": reading_names(portable), "unit": "ohm" },
        "outputs": { "names": coordinate_names(portable), "unit": "mm" },
        "quantity": portable.quantity,
        "hidden_nodes": portable.hidden,
        "precision": precision.to_string(),
        "training_samples": settings.source.samples,
        "seed": settings.seed,
        "errors": file.errors,
        "readings_in_training_ohm": ranges.collect::<Vec<_>>(),
        "output_range_mm": portable.full_scale_mm,
    });
    match fields {
        Value::Object(fields) => fields,
        _ => Map::new(),
    }
}
