//! Bundles as one JSON file with the numbers of a decoder, layer by layer.

use serde_json::{Map, Value, json};

use super::{
    draft::Draft,
    error::BundleError,
    exported_decoder::Metadata,
    portable::Portable,
    report::BundleCheck,
    vectors::Vector,
    weights::{Arithmetic, Weights},
};

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
