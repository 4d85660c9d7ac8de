use prost::Message;

use super::{
    evaluator::{Tensor, element_type},
    schema::{
        Dimension, Graph, GraphBuilder, INT64, Model, OperatorSet, Property, TensorShape, TensorType, TypeOfValue,
        ValueInfo,
    },
};
use crate::export::bundle::{
    exported_decoder::Metadata,
    layers::Layer,
    meaning::{Meaning, comment},
    portable::Portable,
    weights::{Arithmetic, Digits, Table, Weights, names},
};
use decoupler_core::{network::Quantity, problem::Channel};

const OPSET: i64 = 13;
/// The first version of the format with opset 13.
const IR_VERSION: i64 = 7;

/// Writes the graph of `weights`.
pub(in crate::export::bundle) fn write(
    portable: &Portable,
    weights: &Weights,
    metadata: &Metadata,
    notes: &[String],
) -> Vec<u8> {
    model(portable, weights, metadata, notes).encode_to_vec()
}

/// The graph of `weights` with its description.
pub(super) fn model(portable: &Portable, weights: &Weights, metadata: &Metadata, notes: &[String]) -> Model {
    let properties = metadata.iter().map(|(key, value)| Property {
        key: key.clone(),
        value: value.as_str().map_or_else(|| value.to_string(), str::to_owned),
    });
    let row = if portable.takes_row() {
        format!("the {} of the row 'row' (from 1)", portable.decoder)
    } else {
        format!("the {}", portable.decoder)
    };
    let about = match portable.meaning {
        Meaning::Array(_) => format!(
            "Decodes the readings of one row-wire in ohm into the coordinates of its nodes in mm with {row}. Answers are \
             NaN where a reading or the row is invalid."
        ),
        Meaning::Own { .. } => {
            format!("Decodes readings into targets with {row}. Answers are NaN where a reading or the row is invalid.")
        }
    };
    let notes = notes.iter().map(|note| format!(" Note: {note}."));
    Model {
        ir_version: IR_VERSION,
        producer_name: "decoupler".to_owned(),
        producer_version: env!("CARGO_PKG_VERSION").to_owned(),
        doc_string: std::iter::once(about).chain(notes).collect(),
        graph: Some(graph(portable, weights)),
        opset_import: vec![OperatorSet {
            domain: String::new(),
            version: OPSET,
        }],
        metadata_props: properties.collect(),
    }
}

fn graph(portable: &Portable, weights: &Weights) -> Graph {
    let mut builder = GraphBuilder::default();
    let digits = weights.arithmetic.rest;
    let is_valid = add_validity(&mut builder, portable, digits);
    let answers = add_layers(&mut builder, portable, weights);
    let answers = if weights.arithmetic.wide_layers == portable.layers().len() {
        builder.cast(&answers, digits, "rounded_outputs")
    } else {
        answers
    };
    let meaning = &portable.meaning;
    builder.node("Where", &[&is_valid, &answers, "not_a_number"], meaning.outputs());
    let names = |array: &str, own: &str, channels: Vec<Channel>| {
        let is_array = matches!(meaning, Meaning::Array(_));
        let name = |channel: &Channel| {
            if is_array {
                channel.name.clone()
            } else {
                comment(&channel.title())
            }
        };
        let names: Vec<String> = channels.iter().map(name).collect();
        format!("{}: {}", if is_array { array } else { own }, names.join(", "))
    };
    let mut outputs = vec![value(
        meaning.outputs(),
        element_type(digits),
        Some(portable.outputs),
        names("Coordinates in mm", "Targets", meaning.targets()),
    )];
    if add_readings_outside(&mut builder, portable, digits) {
        let text = "Number of readings beyond the range seen in training by more than a tenth of it";
        outputs.push(value("readings_outside", INT64, None, text.to_owned()));
    }
    let mut inputs = vec![value(
        meaning.readings(),
        element_type(digits),
        Some(portable.channels),
        names("Readings in ohm", "Readings", meaning.inputs()),
    )];
    if portable.takes_row() {
        let text = format!("Row of each reading, from 1 to {}", portable.rows());
        inputs.push(value("row", INT64, None, text));
    }
    Graph {
        name: "decoupler".to_owned(),
        input: inputs,
        output: outputs,
        ..builder.build()
    }
}

/// Adds the condition (batch × 1) under which there is an answer, and the index of the row's network.
fn add_validity(builder: &mut GraphBuilder, portable: &Portable, digits: Digits) -> String {
    let scalar = |value: f64| Tensor::real(digits, [], vec![value]);
    let readings = portable.meaning.readings();
    let not_outside = builder.constant("infinity", &scalar(f64::INFINITY));
    builder.constant("not_a_number", &scalar(f64::NAN));
    builder.constant("second_axis", &Tensor::int([1], vec![1]));
    let is_reading = if portable.quantity == Quantity::Raw {
        let size = builder.node("Abs", &[readings], "reading_sizes");
        builder.node("Less", &[&size, &not_outside], "is_reading")
    } else {
        let zero = builder.constant("zero", &scalar(0.0));
        let is_positive = builder.node("Greater", &[readings, &zero], "is_positive");
        let is_finite = builder.node("Less", &[readings, &not_outside], "is_finite");
        builder.node("And", &[&is_positive, &is_finite], "is_reading")
    };
    let is_invalid = builder.node("Not", &[&is_reading], "is_invalid_reading");
    let counted = builder.cast_to(&is_invalid, INT64, "counted_invalid_readings");
    let invalid = builder.sum(&counted, "second_axis", true, "invalid_readings");
    let none = builder.constant("none", &Tensor::int([], vec![0]));
    let are_valid = builder.node("Equal", &[&invalid, &none], "are_readings_valid");
    if !portable.takes_row() {
        return are_valid;
    }
    let first = builder.constant("first_row", &Tensor::int([], vec![1]));
    let last = builder.constant("last_row", &Tensor::int([], vec![portable.rows() as i64]));
    let not_below = builder.node("GreaterOrEqual", &["row", &first], "is_row_from_first");
    let not_above = builder.node("LessOrEqual", &["row", &last], "is_row_to_last");
    let is_row = builder.node("And", &[&not_below, &not_above], "is_row");
    let row = builder.node("Where", &[&is_row, "row", &first], "valid_row");
    builder.node("Sub", &[&row, &first], "row_index");
    let is_row = builder.node("Unsqueeze", &[&is_row, "second_axis"], "is_row_of_answer");
    builder.node("And", &[&are_valid, &is_row], "is_valid")
}

/// Adds the changes of the readings and all layers; returns the name of the last values.
fn add_layers(builder: &mut GraphBuilder, portable: &Portable, weights: &Weights) -> String {
    let tables = weights.tables(portable);
    let mut tables = tables.iter();
    let mut table = |builder: &mut GraphBuilder| {
        let table = tables.next().expect("a table for each name");
        add_table(builder, portable, table)
    };
    let centre = table(builder);
    let mut values = add_changes(builder, portable, weights.arithmetic, &centre);
    for (index, (layer, names)) in portable.layers().iter().zip(names(portable.layers())).enumerate() {
        let digits = weights.arithmetic.of_layer(index);
        if index > 0 && index == weights.arithmetic.wide_layers {
            values = builder.cast(&values, digits, &format!("rounded_{values}"));
        }
        let all: Vec<String> = names.tables.iter().map(|_| table(builder)).collect();
        let result = names.result;
        values = match layer {
            Layer::Affine(_) => add_affine(builder, portable, &values, [&all[0], &all[1]], &result),
            Layer::Tanh => builder.node("Tanh", &[&values], &result),
            Layer::Gaussians { .. } => {
                let third = builder.constant("third_axis", &Tensor::int([1], vec![2]));
                let apart = builder.node("Unsqueeze", &[&values, &third], "inputs_of_gaussians");
                let apart = builder.node("Sub", &[&apart, &all[0]], "apart");
                let squares = builder.node("Mul", &[&apart, &apart], "squares");
                let sums = builder.sum(&squares, "second_axis", false, "squared_distances");
                let negative = builder.node("Neg", &[&sums], "logarithms_of_gaussians");
                builder.node("Exp", &[&negative], &result)
            }
        };
    }
    values
}

/// Adds the sums of weighted values and biases.
fn add_affine(
    builder: &mut GraphBuilder,
    portable: &Portable,
    values: &str,
    [weights, biases]: [&str; 2],
    result: &str,
) -> String {
    let products = add_product(builder, portable, values, weights, &format!("products_for_{result}"));
    builder.node("Add", &[&products, biases], result)
}

fn add_changes(builder: &mut GraphBuilder, portable: &Portable, arithmetic: Arithmetic, centre: &str) -> String {
    let digits = arithmetic.of_layer(0);
    let readings = if digits == arithmetic.rest {
        portable.meaning.readings().to_owned()
    } else {
        builder.cast(portable.meaning.readings(), digits, "readings_in_double")
    };
    match portable.quantity {
        Quantity::Resistance | Quantity::Raw => builder.node("Sub", &[&readings, centre], "changes"),
        Quantity::Conductance => {
            let difference = builder.node("Sub", &[centre, &readings], "differences_ohm");
            builder.node("Div", &[&difference, &readings], "changes")
        }
        Quantity::LogResistance => {
            let difference = builder.node("Sub", &[&readings, centre], "differences_ohm");
            let relative = builder.node("Div", &[&difference, centre], "relative_changes");
            add_log_of_one_more(builder, &relative, digits)
        }
    }
}

/// Adds ln(1 + x) = x · ln w / (w − 1), where w is the rounded 1 + x: the errors of w in both cancel (W. Kahan, in the
/// Hewlett-Packard HP-15C Advanced Functions Handbook, 1982).
fn add_log_of_one_more(builder: &mut GraphBuilder, x: &str, digits: Digits) -> String {
    let one = builder.constant("one", &Tensor::real(digits, [], vec![1.0]));
    let sum = builder.node("Add", &[x, &one], "ratios");
    let log = builder.node("Log", &[&sum], "logs_of_ratios");
    let rounded = builder.node("Sub", &[&sum, &one], "rounded_changes");
    let product = builder.node("Mul", &[x, &log], "log_products");
    let quotient = builder.node("Div", &[&product, &rounded], "log_quotients");
    let is_tiny = builder.node("Equal", &[&sum, &one], "is_change_tiny");
    builder.node("Where", &[&is_tiny, x, &quotient], "changes")
}

/// Adds a constant for one map, or the part of a table of all rows.
fn add_table(builder: &mut GraphBuilder, portable: &Portable, table: &Table) -> String {
    let tensor = |shape: &[usize]| Tensor::real(table.digits, shape, table.values.clone());
    if !portable.takes_row() {
        return builder.constant(&table.name, &tensor(&table.shape));
    }
    let shape = [&[portable.maps.len()], &table.shape[..]].concat();
    let all = builder.constant(&format!("{}_of_rows", table.name), &tensor(&shape));
    builder.node("Gather", &[&all, "row_index"], &table.name)
}

/// Adds the product of values (batch × n) with a matrix (n × m), or with the matrix of each one's row.
fn add_product(builder: &mut GraphBuilder, portable: &Portable, values: &str, matrix: &str, name: &str) -> String {
    if !portable.takes_row() {
        return builder.node("MatMul", &[values, matrix], name);
    }
    let rows = builder.node("Unsqueeze", &[values, "second_axis"], &format!("{name}_left"));
    let products = builder.node("MatMul", &[&rows, matrix], &format!("{name}_of_rows"));
    builder.node("Squeeze", &[&products, "second_axis"], name)
}

/// Adds the number of readings outside the limits, if these are known.
fn add_readings_outside(builder: &mut GraphBuilder, portable: &Portable, digits: Digits) -> bool {
    let Some(ranges) = portable.known_ranges() else {
        return false;
    };
    let mut limit = |name: &str, pick: fn(&(f64, f64)) -> f64| {
        let values = ranges.iter().flat_map(|range| range.limits.iter().map(pick));
        let values = values.map(|value| digits.round(value)).collect();
        let mut shape = vec![portable.channels];
        if !portable.takes_row() {
            return builder.constant(name, &Tensor::real(digits, shape, values));
        }
        shape.insert(0, ranges.len());
        let table = builder.constant(&format!("{name}_of_rows"), &Tensor::real(digits, shape, values));
        builder.node("Gather", &[&table, "row_index"], name)
    };
    let [lowest, highest] = portable.meaning.limits();
    let (low, high) = (limit(lowest, |limits| limits.0), limit(highest, |limits| limits.1));
    let readings = portable.meaning.readings();
    let not_below = builder.node("GreaterOrEqual", &[readings, &low], "is_not_below");
    let not_above = builder.node("LessOrEqual", &[readings, &high], "is_not_above");
    let is_inside = builder.node("And", &[&not_below, &not_above], "is_inside");
    let is_outside = builder.node("Not", &[&is_inside], "is_outside");
    let counted = builder.cast_to(&is_outside, INT64, "counted_outside");
    builder.sum(&counted, "second_axis", false, "readings_outside");
    true
}

/// Describes an input or output: batch, or batch × `width`.
fn value(name: &str, elem_type: i32, width: Option<usize>, doc_string: String) -> ValueInfo {
    let batch = Dimension {
        dim_param: Some("batch".to_owned()),
        ..Dimension::default()
    };
    let width = width.map(|width| Dimension {
        dim_value: Some(width as i64),
        ..Dimension::default()
    });
    let shape = TensorShape {
        dim: std::iter::once(batch).chain(width).collect(),
    };
    ValueInfo {
        name: name.to_owned(),
        kind: Some(TypeOfValue {
            tensor_type: Some(TensorType {
                elem_type,
                shape: Some(shape),
            }),
        }),
        doc_string,
    }
}
